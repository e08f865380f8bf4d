"""The program: what a kernel computes, as straight-line blocks and loops over index tables.

A `Program` reads named input arrays (t, q, qd, p), may use temporaries, and writes one output array.
Its blocks run in order. A `Straight` block is a list of operations and stores. A `Loop` runs one small
list of operations `count` times; its slots say where each run reads, its stores where it writes.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import ClassVar, Literal, NamedTuple, TypeAlias, TypeVar

import numpy as np

from ncgen.program.ir.graph import ArrayElement, Graph, Op

AnyStore = TypeVar("AnyStore", "Store", "TableStore")


@dataclass(frozen=True, kw_only=True)
class Store:
    """array[index] = node (or += where `accumulate`); `comment` says what the value is."""

    array: str
    index: int
    node: int
    accumulate: bool = False
    comment: str = ""

    @property
    def table(self) -> tuple[int]:
        """Its index, as a loop that runs once would have it."""
        return (self.index,)

    def of(self, node: int) -> Store:
        """The same of another operation, in a sixth of the time of `dataclasses.replace`: long programs have tens of thousands."""
        return _with_node(self, node)


@dataclass(frozen=True)
class Slot:
    """What a loop reads from an array such as q, qd, p or d; `table` holds the index of every run."""

    array: str
    table: tuple[int, ...]


@dataclass(frozen=True)
class Column:
    """Numbers that a loop reads: `table` holds the one of every run."""

    table: tuple[float, ...]

    array: ClassVar[Literal["const"]] = "const"


@dataclass(frozen=True)
class Straight:
    """names: suggested variable names of operations, for readers."""

    ops: tuple[Op, ...]
    stores: tuple[Store, ...]
    names: dict[int, str] = field(default_factory=dict, compare=False)
    title: str = ""

    count: ClassVar[int] = 1
    slots: ClassVar[tuple[Slot | Column, ...]] = ()


def written(graph: Graph, array: str, nodes: Iterable[int]) -> Straight:
    """All operations of a graph, and stores of some in an array, one after the other."""
    return Straight(tuple(graph.ops), tuple(Store(array=array, index=k, node=node) for k, node in enumerate(nodes)))


@dataclass(frozen=True)
class TableStore:
    """array[table[run]] = node (or +=)."""

    array: str
    table: tuple[int, ...]
    node: int
    accumulate: bool = False

    def of(self, node: int) -> TableStore:
        """As of `Store`."""
        return _with_node(self, node)


def _with_node(store: AnyStore, node: int) -> AnyStore:
    other = object.__new__(type(store))
    vars(other).update(vars(store), node=node)
    return other


@dataclass(frozen=True, kw_only=True)
class Loop:
    """`comments` has one line a run, saying what it computes."""

    count: int
    ops: tuple[Op, ...]
    slots: tuple[Slot | Column, ...]
    stores: tuple[TableStore, ...]
    names: dict[int, str] = field(default_factory=dict, compare=False)
    title: str = ""
    comments: tuple[str, ...] = ()


Block: TypeAlias = Straight | Loop


class Phases(NamedTuple):
    """How a program is cut into blocks of which several programs consist.

    The first phase finds what the second and the later ones need, and numbers in the temporary `rates`; the second one puts others in their
    place, from which the third finds the leading outputs, and the last one all others.

    rates: how many there are; leading: positions of these outputs, in ascending order; ends: behind which block each of the first three
        phases ends, once it is cut
    """

    rates: int
    leading: tuple[int, ...]
    ends: tuple[int, int, int] = (0, 0, 0)


@dataclass(frozen=True, kw_only=True)
class Program:
    """One kernel.

    inputs: names of the arrays it reads, in the order of its arguments; "t" is a scalar
    output: name of the array it writes, `size` its length
    temporaries: {name: length} of local arrays
    angles: positions in q whose sines and cosines fill the arrays `sine` and `cosine` before the first block
    phases: of several programs in one
    """

    name: str
    inputs: tuple[str, ...]
    output: str
    size: int
    blocks: tuple[Block, ...]
    temporaries: dict[str, int] = field(default_factory=dict, compare=False)
    angles: tuple[int, ...] = ()
    phases: Phases | None = None

    def __repr__(self) -> str:
        return f"<Program {self.name}: {self.size} numbers, {self.length} statements>"

    @property
    def length(self) -> int:
        """How many operations are written down: what compilers need time for. Those of a loop count once."""
        return sum(len(block.ops) for block in self.blocks)

    @property
    def beginning(self) -> Program:
        """A program with phases that writes its leading outputs alone, one after the other."""
        assert self.phases is not None, "a program without phases"
        order = {position: k for k, position in enumerate(self.phases.leading)}
        first = replace(self, blocks=self.blocks[: self.phases.ends[2]], phases=None)
        return replace(first.reordered(order), size=len(order))

    @property
    def uncorrected(self) -> Program:
        """All outputs of a program with phases, without the second one."""
        assert self.phases is not None, "a program without phases"
        first, second, _ = self.phases.ends
        return replace(self, blocks=self.blocks[:first] + self.blocks[second:], phases=None)

    def reordered(self, order: Sequence[int] | Mapping[int, int]) -> Program:
        """The same outputs in other order: what was in k is in order[k]. For programs without loops."""

        def moved(op: Op) -> Op:
            is_own = op.code == "load" and op.input.array == self.output
            return Op("load", (), ArrayElement(self.output, order[op.input.position])) if is_own else op

        blocks: list[Block] = []
        for block in self.blocks:
            assert isinstance(block, Straight), "a straight line"
            stores = [replace(s, index=order[s.index]) if s.array == self.output else s for s in block.stores]
            blocks.append(replace(block, ops=tuple(map(moved, block.ops)), stores=tuple(stores)))
        return replace(self, blocks=tuple(blocks))

    @property
    def is_constant(self) -> bool:
        """True if the output does not depend on any input."""
        return all(op.code != "load" for b in self.blocks for op in b.ops) and all(
            slot.array == "const" for b in self.blocks for slot in b.slots
        )


@dataclass(frozen=True)
class Pattern:
    """Sparsity of a matrix in compressed rows: sorted column numbers of each row."""

    shape: tuple[int, int]
    indptr: tuple[int, ...]
    indices: tuple[int, ...]

    def __repr__(self) -> str:
        return f"<Pattern {self.shape[0]} × {self.shape[1]}: {self.nonzeros} nonzeros>"

    @classmethod
    def of(cls, shape: tuple[int, int], positions: Iterable[tuple[int, ...]]) -> Pattern:
        """The pattern of a set of (row, column) places."""
        columns: list[list[int]] = [[] for _ in range(shape[0])]
        for row, column in sorted(set(positions)):
            columns[row].append(column)
        indptr = [0]
        for numbers in columns:
            indptr.append(indptr[-1] + len(numbers))
        return cls(shape, tuple(indptr), tuple(c for numbers in columns for c in numbers))

    @property
    def nonzeros(self) -> int:
        return len(self.indices)

    @cached_property
    def rows(self) -> np.ndarray:
        """Row of every nonzero."""
        return np.repeat(np.arange(self.shape[0]), np.diff(self.indptr))

    @cached_property
    def columns(self) -> np.ndarray:
        """Column of every nonzero."""
        return np.array(self.indices, dtype=int)

    @cached_property
    def flat(self) -> np.ndarray:
        """Position of every nonzero in the dense matrix, row by row."""
        return self.rows * self.shape[1] + self.columns

    def times(self, values: np.ndarray, x: np.ndarray) -> np.ndarray:
        """The product of the matrix of these values with a vector, shape (rows,)."""
        return np.bincount(self.rows, weights=values * x[self.columns], minlength=self.shape[0])

    def diagonal(self, values: np.ndarray) -> np.ndarray:
        """The diagonal of the matrix of these values, shape (rows,)."""
        on_it = self.rows == self.columns
        return np.bincount(self.rows[on_it], weights=values[on_it], minlength=self.shape[0])

    def dense(self, values: np.ndarray) -> np.ndarray:
        """The matrices (…, rows, columns) of values (…, nonzeros)."""
        dense = np.zeros((*values.shape[:-1], self.shape[0] * self.shape[1]), dtype=values.dtype)
        dense[..., self.flat] = values
        return dense.reshape(*values.shape[:-1], *self.shape)

    def positions(self) -> dict[tuple[int, int], int]:
        """{(row, column): position in the values}."""
        rows = (r for r in range(self.shape[0]) for _ in range(self.indptr[r], self.indptr[r + 1]))
        return {position: k for k, position in enumerate(zip(rows, self.indices, strict=True))}
