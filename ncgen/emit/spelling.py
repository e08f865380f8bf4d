"""Kernels as records that templates print, the same for every language with infix notation; a `Spelling` says what differs."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable
from typing import Any, TypeAlias

from ncgen.emit.environment import comment_text, loop_comments
from ncgen.emit.infix import Assignment, write
from ncgen.emit.loop_tables import Tables
from ncgen.emit.naming import Names
from ncgen.model.pieces import Pieces
from ncgen.program.ir.angles import SHARED
from ncgen.program.ir.blocks import Block, Loop, Program, Slot, Store, TableStore
from ncgen.program.ir.cost import cost
from ncgen.program.ir.graph import PIECES, Op

Record: TypeAlias = dict[str, Any]
"""What a template is filled with."""


class Spelling(ABC):
    """How a language spells one file. tables: those of the file; prefix: how the names begin that the file uses itself."""

    reserved: tuple[str, ...] = ()
    """Words that the user's names may not take, besides keywords of C and Python and the kernels' arguments."""

    def __init__(self, tables: Tables, prefix: str = "ncgen") -> None:
        self.tables, self.prefix = tables, prefix

    @abstractmethod
    def number(self, value: float) -> str:
        """A double that reads back to the same bits."""

    @abstractmethod
    def element(self, array: str, index: int, block: Block) -> str:
        """An element of an array, or "t"."""

    @abstractmethod
    def slot(self, slot: Slot, block: Block) -> str:
        """The element of an array that a run of a loop reads."""

    @abstractmethod
    def column(self, table: str) -> str:
        """The number that a run of a loop reads from a table of that name."""

    @abstractmethod
    def call(self, name: str, arguments: list[str]) -> str:
        """An elementary function, by its name in `ncgen.program.ir.functions`."""

    def lookup(self, pieces: Pieces, x: str) -> str:
        """A piecewise polynomial: a function "pieces" of x, the tables of its knots and rows, how many knots, degree and period."""
        tables = [self.table(pieces.knots), self.table(pieces.numbers)]
        return self.call(PIECES, [x, *tables, str(len(pieces.knots)), str(pieces.degree), self.number(pieces.period)])

    def table(self, values: tuple[float, ...]) -> str:
        """The name of a table of numbers."""
        return self.tables.number(values)

    @abstractmethod
    def comment(self, text: str) -> str:
        """A line for readers."""

    @abstractmethod
    def assignment(self, new: Assignment, block: Block) -> str:
        """A line that gives a value its name."""

    @abstractmethod
    def store(self, store: Store | TableStore, value: str, block: Block) -> str:
        """A line that writes an element of an array or adds to it; in a loop, that of the run."""

    def leaf(self, op: Op, block: Block) -> str:
        """What an operation without arguments reads."""
        if op.code == "load":
            return self.element(*op.input, block)
        slot = block.slots[op.slot]
        return self.slot(slot, block) if isinstance(slot, Slot) else self.column(self.table(slot.table))

    def kernel(self, program: Program) -> Record:
        """One kernel; how the sines and cosines of its angles are found, its language adds."""
        operations = cost(program)
        return {
            "name": program.name,
            "inputs": program.inputs,
            "output": program.output,
            "size": program.size,
            "temporaries": program.temporaries,
            "blocks": [self._block(block, program) for block in program.blocks],
            "operations": operations.total,
            "calls": operations.calls,
        }

    def records(self, programs: Iterable[Program]) -> Record:
        """All kernels of a file, with its tables."""
        return {
            "kernels": [self.kernel(program) for program in programs],
            "index_tables": [(name, values) for values, name in self.tables.indices.items()],
            "number_tables": [(name, [self.number(v) for v in values]) for values, name in self.tables.numbers.items()],
        }

    def _block(self, block: Block, program: Program) -> Record:
        names = Names([*program.inputs, program.output, *SHARED.values(), *self.reserved], self.prefix)
        written = write(block, self, names)
        lines: list[str] = []
        comment = ""
        for store, before, value in zip(block.stores, written.before, written.values, strict=True):
            if isinstance(store, Store) and store.comment not in ("", comment):
                comment = store.comment
                lines.append(self.comment(comment_text(comment)))
            lines += [self.assignment(new, block) for new in before]
            lines.append(self.store(store, value, block))
        return {
            "loop": isinstance(block, Loop),
            "count": block.count,
            "title": comment_text(block.title),
            "comments": loop_comments(block),
            "lines": lines,
        }
