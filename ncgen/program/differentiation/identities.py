"""What holds at all values of the parameters: operations on them alone that are a number, or each other.

A number in the place of a parameter folds: what it makes 0 vanishes, and equal results exist once. Expressions of parameters that are 0
or equal by algebra alone, such as a moment less itself, do the same here. They are found by numbers: what holds for parameters of many
sizes and signs that are drawn at random holds for all. Results are compared up to bounds of their own rounding errors, so that what is
dropped could not be seen. Of elementary functions nothing is believed: their results are drawn, too.
Source of the bounds: Higham, Accuracy and Stability of Numerical Algorithms (2002), section 3.3.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from ncgen.program.ir.graph import Graph, Op
from ncgen.program.ir.multiples import is_known

N_PARAMETER_SETS = 16
"""Sets of parameters beside the defaults; the root of a square is told from what was squared by one in which that is negative."""

MIN_RESULTS = 6
"""In how many of them a result must exist."""

UNIT = float(np.finfo(float).eps) / 2
"""What a rounding changes a number by, over the number."""

ERROR_FACTOR = 4.0
"""What differs by no more than this many times the bounds of its errors is the same."""

DIGITS = 9
"""To how many digits results agree that are compared at all."""


def simplified(graph: Graph, outputs: Sequence[Sequence[int]], defaults: Sequence[float]) -> tuple[Graph, list[list[int]]]:
    """The graph with its identities, and its outputs there; defaults: of the parameters, the first numbers of p."""
    work = _Simplifying(defaults)
    new: list[int] = []
    for op in graph.ops:
        new.append(work.taken(op, tuple(new[a] for a in op.args)))
    return work.graph, [[new[node] for node in nodes] for nodes in outputs]


class IdentityResult(NamedTuple):
    """What an operation gives at the defaults, then with every other set of parameters, and bounds of its errors."""

    value: np.ndarray
    error: np.ndarray

    def is_near(self, value: np.ndarray | float, error: np.ndarray | float = 0.0) -> bool:
        """Whether another result differs by errors alone, wherever this one exists; it must at the defaults."""
        exists = np.isfinite(self.value) & np.isfinite(self.error)
        gap = np.abs(self.value - value) <= ERROR_FACTOR * (self.error + error)
        return bool(exists[0] and np.sum(exists) > MIN_RESULTS and np.all(gap | ~exists))


class _Simplifying:
    """A graph that grows by operations of another one; what is known of each: its result, and what it is the same as."""

    def __init__(self, defaults: Sequence[float]) -> None:
        self.graph = Graph()
        self._defaults, self._generator = defaults, np.random.default_rng(1)
        self._results: dict[int, IdentityResult] = {}
        self._same: list[int] = []
        self._alike: dict[tuple[str, ...], list[int]] = {}

    def taken(self, op: Op, arguments: tuple[int, ...]) -> int:
        """The operation on arguments of this graph."""
        if op.code == "mul":
            return self._simplified(self._product(*arguments))
        if op.args:
            return self._simplified(self.graph.apply(op, arguments))
        return self._simplified(self.graph.const(op.value) if op.code == "const" else self.graph.load(*op.input))

    def _product(self, a: int, b: int) -> int:
        """Known factors come together, as numbers do."""
        for factor, other in ((a, b), (b, a)):
            op = self.graph.ops[other]
            if op.code == "mul" and factor in self._results and other not in self._results:
                for known_factor, rest in (op.args, op.args[::-1]):
                    if known_factor in self._results:
                        return self.graph.mul(self._simplified(self.graph.mul(factor, known_factor)), rest)
        return self.graph.mul(a, b)

    def _simplified(self, node: int) -> int:
        """What a node is at all values of the parameters."""
        while len(self._same) < len(self.graph.ops):
            new = len(self._same)
            self._same.append(new)
            op = self.graph.ops[new]
            if is_known(op, [a in self._results for a in op.args], len(self._defaults)):
                self._results[new] = self._result(op)
                self._same[new] = self._identity(new) if op.args else new
        return self._same[node]

    def _result(self, op: Op) -> IdentityResult:
        drawn = self._generator.uniform(0.5, 2.0, 1 + N_PARAMETER_SETS) * self._generator.choice([-1.0, 1.0], 1 + N_PARAMETER_SETS)
        if op.code == "const":
            return IdentityResult(np.full_like(drawn, op.value), np.full_like(drawn, UNIT * abs(op.value)))
        if op.code == "load":
            default = self._defaults[op.input.position]
            return IdentityResult(np.array([default, *((abs(default) or 1.0) * drawn[1:])]), np.zeros_like(drawn))
        if op.code not in ERROR_RULES:
            return IdentityResult(drawn, np.zeros_like(drawn))
        with np.errstate(all="ignore"):
            value, error = ERROR_RULES[op.code](*(self._results[a] for a in op.args))
            return IdentityResult(value, error + UNIT * np.abs(value))

    def _identity(self, node: int) -> int:
        """A number, or the first of those that are the same but for the sign."""
        value, error = result = self._results[node]
        first = float(value[0])
        for number in (round(first) if np.isfinite(first) else 0.0, first):
            if result.is_near(number, error[0]):
                return self.graph.const(float(number))
        key = tuple(f"{abs(x):.{DIGITS}e}" for x in value)
        for other in self._alike.setdefault(key, []):
            before = self._results[other]
            if result.is_near(before.value, before.error):
                return other
            if result.is_near(-before.value, before.error):
                return self.graph.neg(other)
        self._alike[key].append(node)
        return node


Rule = Callable[..., tuple[np.ndarray, np.ndarray]]


def _product(a: IdentityResult, b: IdentityResult) -> tuple[np.ndarray, np.ndarray]:
    return a.value * b.value, np.abs(a.value) * b.error + np.abs(b.value) * a.error


def _quotient(a: IdentityResult, b: IdentityResult) -> tuple[np.ndarray, np.ndarray]:
    value = a.value / b.value
    return value, (a.error + np.abs(value) * b.error) / np.abs(b.value)


def _root(a: IdentityResult) -> tuple[np.ndarray, np.ndarray]:
    value = np.sqrt(a.value)
    return value, a.error / value


ERROR_RULES: dict[str, Rule] = {
    "add": lambda a, b: (a.value + b.value, a.error + b.error),
    "sub": lambda a, b: (a.value - b.value, a.error + b.error),
    "neg": lambda a: (-a.value, a.error),
    "abs": lambda a: (np.abs(a.value), a.error),
    "mul": _product,
    "div": _quotient,
    "sqrt": _root,
}
"""{code: rule} of operations of which identities are found: the value, and what errors of the arguments make of it."""
