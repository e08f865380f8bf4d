"""Straight-line code under construction: hash-consed operations with local simplification.

Every operation is looked up before it is made, so equal subexpressions exist once and common
subexpression elimination costs nothing. Numbers of operations grow only; arguments come first.

The rules are those that never change more than the last bits: constants are folded, 0 and 1 vanish,
signs move outward, a division by a constant becomes a multiplication.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Container, Iterable, Mapping, Sequence
from typing import NamedTuple, TypeAlias

from ncgen.model.pieces import Pieces
from ncgen.program.ir.functions import FUNCTIONS


class ArrayElement(NamedTuple):
    """One number of an array: of an argument such as q, or of a temporary one."""

    array: str
    position: int


Leaf: TypeAlias = float | int | ArrayElement | Pieces | None
"""What an operation without arguments stands for: a constant (a float), a loop's slot (an int, its number), or an input; and the
polynomials among which a lookup, which has one argument, chooses."""


class Op(NamedTuple):
    """One operation: code, the numbers of its arguments, and for leaves what they stand for.

    Leaves: ("const", (), value) · ("load", (), input) · ("slot", (), number of a loop's slot)
    A lookup: ("pieces", (argument,), polynomials)
    """

    code: str
    args: tuple[int, ...]
    leaf: Leaf = None

    def renumbered(self, new: Mapping[int, int]) -> Op:
        """The same with other numbers for its arguments; what has none is itself."""
        code, args, leaf = self
        return _plain(Op, (code, tuple(map(new.__getitem__, args)), leaf)) if args else self

    @property
    def value(self) -> float:
        """The number of a constant."""
        assert isinstance(self.leaf, float), f"{self} is no constant"
        return self.leaf

    @property
    def input(self) -> ArrayElement:
        """What a load reads."""
        assert isinstance(self.leaf, ArrayElement), f"{self} is no load"
        return self.leaf

    @property
    def slot(self) -> int:
        """The number of a loop's slot."""
        assert isinstance(self.leaf, int), f"{self} is no slot"
        return self.leaf

    @property
    def pieces(self) -> Pieces:
        """What a lookup looks into."""
        assert isinstance(self.leaf, Pieces), f"{self} is no lookup"
        return self.leaf


_plain = tuple.__new__
"""Makes an Op of its three parts in a third of the time that calling it takes: long programs are made of hundreds of thousands."""

FOLDING = frozenset({"const", "neg"})
"""Codes of the arguments that sums and products simplify, besides a product with a constant factor."""

MIN_NORMAL = sys.float_info.min
"""The smallest number with all its digits."""


def _is_normal(value: float) -> bool:
    """True if a constant may take part in folding: finite, and with all its digits."""
    return math.isfinite(value) and abs(value) >= MIN_NORMAL


PIECES = "pieces"
"""The code of a lookup."""

ARITHMETIC = {"add": "+", "sub": "-", "mul": "*", "div": "/", "neg": "-"}


class Graph:
    """A growing list of operations; the methods return operation numbers."""

    def __init__(self) -> None:
        self.ops: list[Op] = []
        self._known: dict[tuple[str, tuple[int, ...], Leaf | str], int] = {}
        self._folding = bytearray()  # of every operation, whether its code is in FOLDING

    @classmethod
    def of(cls, ops: Iterable[Op]) -> Graph:
        """A graph that continues from the operations of another one, as they are."""
        graph = cls()
        for op in ops:
            graph._make(*op)
        return graph

    def _make(self, code: str, args: tuple[int, ...] = (), leaf: Leaf = None) -> int:
        key = (code, args, leaf.hex() if isinstance(leaf, float) else leaf)
        node = self._known.get(key)
        if node is None:
            node = self._known[key] = len(self.ops)
            self.ops.append(_plain(Op, (code, args, leaf)))
            self._folding.append(code in FOLDING)
        return node

    def below(self, nodes: Iterable[int], ends: Container[int] = ()) -> set[int]:
        """Nodes and all that they need; what the ends need is not looked at. In the order of their numbers arguments come first."""
        reached: set[int] = set()
        waiting = list(nodes)
        while waiting:
            node = waiting.pop()
            if node not in reached:
                reached.add(node)
                waiting.extend(() if node in ends else self.ops[node].args)
        return reached

    # -- leaves --------------------------------------------------------------------------------

    def const(self, value: float) -> int:
        """A number. Raises OverflowError for infinity and nan."""
        if not math.isfinite(value):
            raise OverflowError(f"a constant becomes {value}")
        return self._make("const", leaf=float(value) + 0.0)  # + 0.0 turns -0.0 into 0.0

    def load(self, array: str, index: int) -> int:
        return self._make("load", leaf=ArrayElement(array, index))

    def slot(self, number: int) -> int:
        return self._make("slot", leaf=number)

    def value(self, node: int) -> float | None:
        """The number of a constant, None for anything else."""
        leaf = self.ops[node].leaf
        return leaf if isinstance(leaf, float) else None

    # -- arithmetic ----------------------------------------------------------------------------

    def neg(self, a: int) -> int:
        op = self.ops[a]
        if isinstance(op.leaf, float):
            return self.const(-op.leaf)
        return op.args[0] if op.code == "neg" else self._make("neg", (a,))

    def add(self, a: int, b: int) -> int:
        if not (self._folding[a] or self._folding[b]):  # then nothing but an operation on them comes out
            return self._make("add", (a, b) if a < b else (b, a))
        x, y = self.value(a), self.value(b)
        if x is not None and y is not None:
            return self.const(x + y)
        if x == 0.0:
            return b
        if y == 0.0:
            return a
        if self.ops[b].code == "neg" or (y is not None and y < 0.0):
            return self.sub(a, self.neg(b))
        if self.ops[a].code == "neg" or (x is not None and x < 0.0):
            return self.sub(b, self.neg(a))
        return self._make("add", (min(a, b), max(a, b)))

    def sub(self, a: int, b: int) -> int:
        if not (self._folding[a] or self._folding[b]):
            return self._difference(a, b)
        x, y = self.value(a), self.value(b)
        if x is not None and y is not None:
            return self.const(x - y)
        if x == 0.0:
            return self.neg(b)
        if y == 0.0:
            return a
        if self.ops[b].code == "neg" or (y is not None and y < 0.0):
            return self.add(a, self.neg(b))
        if self.ops[a].code == "neg":
            return self.neg(self.add(self.ops[a].args[0], b))
        return self._difference(a, b)

    def _difference(self, a: int, b: int) -> int:
        if a == b:
            return self.const(0.0)
        if (turned := self._known.get(("sub", (b, a), None))) is not None:
            return self.neg(turned)  # exactly: of a - b and b - a one is enough
        return self._make("sub", (a, b))

    def mul(self, a: int, b: int) -> int:
        if not (self._folding[a] or self._folding[b]):
            return self._make("mul", (a, b) if a < b else (b, a))
        x, y = self.value(a), self.value(b)
        if x is not None and y is not None:
            return self.const(x * y)
        if y is not None:
            a, b, x, y = b, a, y, x
        if x == 0.0:
            return a
        if x == 1.0:
            return b
        if x is not None and x < 0.0:
            return self.neg(self.mul(self.const(-x), b))
        if self.ops[a].code == "neg":
            return self.neg(self.mul(self.ops[a].args[0], b))
        if self.ops[b].code == "neg":
            return self.neg(self.mul(a, self.ops[b].args[0]))
        if x is not None and self.ops[b].code == "mul" and (factor := self.value(self.ops[b].args[0])) is not None:
            if _is_normal(x * factor):
                return self.mul(self.const(x * factor), self.ops[b].args[1])
        if x is not None:
            return self._make("mul", (a, b))
        return self._make("mul", (min(a, b), max(a, b)))

    def div(self, a: int, b: int) -> int:
        x, y = self.value(a), self.value(b)
        if y == 0.0:
            raise ZeroDivisionError("a division by zero")
        if x is not None and y is not None:
            return self.const(x / y)
        if y is not None and abs(y) > MIN_NORMAL and _is_normal(1.0 / y):
            return self.mul(self.const(1.0 / y), a)
        if x == 0.0:
            return a
        if self.ops[a].code == "neg":
            return self.neg(self.div(self.ops[a].args[0], b))
        if self.ops[b].code == "neg":
            return self.neg(self.div(a, self.ops[b].args[0]))
        return self._make("div", (a, b))

    def call(self, name: str, *args: int) -> int:
        numbers = [self.value(a) for a in args]
        if None not in numbers:
            return self.const(FUNCTIONS[name].python(*numbers))
        return self._make(name, args)

    def lookup(self, pieces: Pieces, a: int) -> int:
        """A piecewise polynomial."""
        if pieces.constant is not None:
            return self.const(pieces.constant)
        x = self.value(a)
        return self._make(PIECES, (a,), pieces) if x is None else self.const(pieces.at(x))

    def power(self, a: int, exponent: int) -> int:
        """An integer power by repeated squaring."""
        if exponent < 0:
            return self.div(self.const(1.0), self.power(a, -exponent))
        result, square = self.const(1.0), a
        while exponent:
            if exponent & 1:
                result = self.mul(result, square)
            exponent >>= 1
            if exponent:
                square = self.mul(square, square)
        return result

    def sum(self, nodes: Iterable[int]) -> int:
        total = self.const(0.0)
        for node in nodes:
            total = self.add(total, node)
        return total

    def replaced(self, node: int, inputs: Mapping[ArrayElement, int]) -> int:
        """A node with other nodes for inputs."""
        new: dict[int, int] = {}
        for operand in sorted(self.below([node])):
            op = self.ops[operand]
            new[operand] = self.apply(op, tuple(new[a] for a in op.args)) if op.args else operand
            if op.code == "load":
                new[operand] = inputs.get(op.input, operand)
        return new[node]

    def copied(self, op: Op, args: Sequence[int]) -> int:
        """An operation of another graph on arguments of this one, simplified again; what has none is read here as there."""
        return self.apply(op, tuple(args)) if op.args else self._make(op.code, leaf=op.leaf)

    def apply(self, op: Op, args: tuple[int, ...]) -> int:
        """The operation `op` on other arguments, simplified again."""
        if op.code == PIECES:
            return self.lookup(op.pieces, *args)
        return getattr(self, op.code)(*args) if op.code in ARITHMETIC else self.call(op.code, *args)
