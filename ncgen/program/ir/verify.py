"""A check that a program is well formed: cheap, run on every program, and it finds generator bugs early."""

from __future__ import annotations

import math

from ncgen.program.ir.angles import SHARED
from ncgen.program.ir.blocks import Block, Program
from ncgen.program.ir.functions import FUNCTIONS
from ncgen.program.ir.graph import ARITHMETIC, PIECES

ARITY = {code: 1 if code == "neg" else 2 for code in ARITHMETIC} | {n: f.arity for n, f in FUNCTIONS.items()}


class ProgramError(AssertionError):
    """A program broke a rule of its own: a defect of ncgen, never of the user's model."""


def verify(program: Program, sizes: dict[str, int]) -> None:
    """Check order of definitions, arities, index ranges, finite constants, and that every output is written.

    sizes: length of every input array. Raises ProgramError naming the block and the rule.
    """
    shared = dict.fromkeys(SHARED.values(), len(program.angles))
    sizes = {**sizes, **shared, **program.temporaries, program.output: program.size}
    written: set[int] = set()
    _require(all(0 <= i < sizes.get("q", 0) for i in program.angles), f"program {program.name}: an angle beyond q")
    for number, block in enumerate(program.blocks):
        where = f"program {program.name}, block {number}"
        _check_ops(block, sizes, where)
        for store in block.stores:
            _require(store.array in sizes, f"{where}: a store into {store.array}, which does not exist")
            _require(len(store.table) == block.count, f"{where}: a store's table has {len(store.table)} entries for {block.count} runs")
            _require(all(0 <= i < sizes[store.array] for i in store.table), f"{where}: a store leaves {store.array}")
            _require(0 <= store.node < len(block.ops), f"{where}: a store of an unknown operation")
            if store.array == program.output:
                plain = set(store.table)
                _require(store.accumulate <= (plain <= written), f"{where}: adds to an output that was never set")
                _require(store.accumulate or len(plain) == len(store.table), f"{where}: overwrites an output within one store")
                written |= plain
    _require(written == set(range(program.size)), f"program {program.name}: outputs never written")


def _check_ops(block: Block, sizes: dict[str, int], where: str) -> None:
    for number, op in enumerate(block.ops):
        _require(all(0 <= a < number for a in op.args), f"{where}: operation {number} uses one that is not yet defined")
        if op.code == "const":
            _require(math.isfinite(op.value), f"{where}: constant {op.value}")
        elif op.code == "load":
            array, position = op.input
            _require(0 <= position < sizes.get(array, 0), f"{where}: reads {array}[{position}], which does not exist")
        elif op.code == "slot":
            _require(0 <= op.slot < len(block.slots), f"{where}: unknown slot {op.slot}")
        elif op.code == PIECES:
            _require(len(op.args) == 1, f"{where}: a lookup of {len(op.args)} arguments")
            _require(len(op.pieces.rows) == len(op.pieces.knots) + 1, f"{where}: a lookup whose table has another length")
        else:
            _require(op.code in ARITY, f"{where}: unknown operation {op.code}")
            _require(len(op.args) == ARITY[op.code], f"{where}: {op.code} of {len(op.args)} arguments")
    for slot in block.slots:
        _require(len(slot.table) == block.count, f"{where}: a table of {len(slot.table)} entries for {block.count} runs")
        if slot.array == "const":
            _require(all(map(math.isfinite, slot.table)), f"{where}: a constant that is not finite")
        else:
            _require(all(0 <= i < sizes.get(slot.array, 0) for i in slot.table), f"{where}: reads beyond {slot.array}")


def _require(condition: bool, message: str) -> None:
    if not condition:
        raise ProgramError(message)
