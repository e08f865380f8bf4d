"""Index and number tables of loops: kept once, and not at all where a formula says the same."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class TablePlace:
    """Where run i reads or writes: `step*i + offset`, or `table[i] + offset`."""

    table: str | None
    step: int
    offset: int

    @property
    def infix(self) -> str:
        """The place as most languages write it; the run's number is `i`."""
        head = f"{self.table}[i]" if self.table else {0: "", 1: "i"}.get(self.step, f"{self.step} * i")
        if not head:
            return str(self.offset)
        return head if not self.offset else f"{head} {'+' if self.offset > 0 else '-'} {abs(self.offset)}"


class Tables:
    """The tables of one source file.

    Two index lists that differ by a constant share a table, so the x, y and z of a point need one.
    """

    def __init__(self, prefix: str) -> None:
        self.prefix = prefix
        self.indices: dict[tuple[int, ...], str] = {}
        self.numbers: dict[tuple[float, ...], str] = {}

    def place(self, table: tuple[int, ...]) -> TablePlace:
        steps = {b - a for a, b in zip(table, table[1:])}
        if len(steps) <= 1:
            return TablePlace(None, steps.pop() if steps else 0, table[0])
        shape = tuple(i - table[0] for i in table)
        lowest = -min(shape)
        key = tuple(i + lowest for i in shape)
        name = self.indices.setdefault(key, f"{self.prefix}index_{len(self.indices) + 1}")
        return TablePlace(name, 0, table[0] - lowest)

    def number(self, table: tuple[float, ...]) -> str:
        return self.numbers.setdefault(table, f"{self.prefix}number_{len(self.numbers) + 1}")
