"""A known factor of a sum of known multiples, taken into it: k (a x + b y) becomes (k a) x + (k b) y, which is a multiplication less.

Known are numbers, and parameters where what depends on them alone is computed before. Products with powers of two are not rounded, and with
other numbers they would be: sums of such products stay.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Sequence

from ncgen.program.ir.graph import Graph, Op

MAX_TERMS = 100
"""Terms of a sum, or factors of a product, that are looked at together: longer ones are taken in parts, or stay."""


def is_known(op: Op, arguments: Sequence[bool], parameters: int) -> bool:
    """True of an operation on nothing but numbers and parameters; arguments: whether that is true of each."""
    if op.args:
        return all(arguments)
    return op.code == "const" or (op.code == "load" and op.input.array == "p" and op.input.position < parameters)


def is_exact(op: Op) -> bool:
    """Whether a product with it is not rounded: a power of two."""
    return op.code == "const" and math.frexp(abs(op.value))[0] == 0.5


def spread(ops: Sequence[Op], stored: Iterable[int], parameters: int = 0) -> tuple[Graph, list[int]] | None:
    """A graph in which known factors stand within sums, and its node for every operation of a graph; None where no factor would.

    stored: operations that are read by others than operations; parameters: how many numbers of p are known
    """
    work = _Spreading(ops, stored, parameters)
    return work.spread() if work.multiples else None


class _Spreading:
    """Operations, and a graph that grows by them.

    known: whether it is; terms: of how many known multiples each is a sum, all read by nobody else, 0 if it is not a sum
    multiples: {operation: (known factor, sum of known multiples)} of those whose factor goes into the sum
    """

    def __init__(self, ops: Sequence[Op], stored: Iterable[int], parameters: int) -> None:
        self.graph, self.nodes = Graph(), list[int]()
        self._ops, self._known, self._terms = ops, list[bool](), list[int]()
        self._count = Counter([*stored, *(a for op in ops for a in op.args)])
        self.multiples: dict[int, tuple[int, int]] = {}
        for number, op in enumerate(ops):
            self._known.append(is_known(op, [self._known[a] for a in op.args], parameters))
            self._terms.append(self._size(op))
            if op.code == "mul":
                self._look_at(number, op)

    def _size(self, op: Op) -> int:
        if self._known[-1]:
            return 1
        if op.code == "mul":
            return int(any([self._known[a] and not is_exact(self._ops[a]) for a in op.args]))
        if op.code not in ("add", "sub", "neg"):
            return 0
        parts = [self._terms[a] if self._count[a] == 1 or self._known[a] else 0 for a in op.args]
        return sum(parts) if all(parts) else 0

    def _look_at(self, number: int, op: Op) -> None:
        for factor, other in (op.args, op.args[::-1]):
            is_wide = self._known[factor] and not self._known[other] and 1 < self._terms[other] <= MAX_TERMS and self._count[other] == 1
            if is_wide:
                self.multiples[number] = factor, other
                return

    def spread(self) -> tuple[Graph, list[int]]:
        """The graph, and its node for every operation."""
        for number, op in enumerate(self._ops):
            if number in self.multiples:
                factor, other = self.multiples[number]
                self.nodes.append(self._multiple(self.nodes[factor], other))
            else:
                self.nodes.append(self.graph.copied(op, [self.nodes[a] for a in op.args]))
        return self.graph, self.nodes

    def _multiple(self, factor: int, number: int) -> int:
        """A known factor times an operation that is a sum of known multiples, or one of them."""
        op = self._ops[number]
        if self._known[number]:
            return self.graph.mul(factor, self.nodes[number])
        if op.code in ("add", "sub", "neg"):
            return self.graph.apply(op, tuple(self._multiple(factor, a) for a in op.args))
        known, rest = op.args if self._known[op.args[0]] else op.args[::-1]
        return self.graph.mul(self.graph.mul(factor, self.nodes[known]), self.nodes[rest])
