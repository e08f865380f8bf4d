"""What a program costs: operations by kind, and the bytes it reads and writes."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

from ncgen.program.ir.angles import SHARED
from ncgen.program.ir.blocks import Loop, Program
from ncgen.program.ir.graph import ARITHMETIC

NUMBER, INDEX = 8, 4
"""Bytes of a double and of an index."""


@dataclass(frozen=True)
class Cost:
    """operations: {code: how many}; functions such as sin count as one operation each.

    read, written: bytes of numbers and index tables, every mention counted once
    statements: operations as written in the source, loops counted once
    """

    operations: dict[str, int]
    read: int
    written: int
    statements: int

    @property
    def total(self) -> int:
        return sum(self.operations.values())

    @property
    def calls(self) -> int:
        """Elementary function calls."""
        return sum(n for code, n in self.operations.items() if code not in ARITHMETIC)


def cost(program: Program) -> Cost:
    """Count a program's operations and bytes."""
    operations: Counter[str] = Counter()
    read = written = statements = 0
    operations.update({name: len(program.angles) for name in SHARED})
    for block in program.blocks:
        inner = [op.code for op in block.ops if op.args]
        statements += len(inner) + len(block.stores)
        operations.update({code: n * block.count for code, n in Counter(inner).items()})
        adds = sum(store.accumulate for store in block.stores)
        operations["add"] += adds * block.count
        read += NUMBER * block.count * (sum(op.code in ("load", "slot") for op in block.ops) + adds)
        written += NUMBER * block.count * len(block.stores)
        if isinstance(block, Loop):
            tables = {slot.table for slot in block.slots if slot.array != "const"} | {s.table for s in block.stores}
            read += INDEX * sum(map(len, tables))
    return Cost({k: n for k, n in sorted(operations.items()) if n}, read, written, statements)
