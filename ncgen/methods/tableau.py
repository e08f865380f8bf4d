"""Explicit Runge-Kutta methods as numbers, which check themselves.

A step from y with slopes k_0 = f(t, y), k_s = f(t + c_s h, y + h Σ_j a_sj k_j) ends at y + h Σ_j b_j k_j. A slope is taken there, too,
which is the first of the next step. Coefficients are exact: fractions, or decimals with all the digits that were published.

Order conditions: one a rooted tree, Σ b_i Φ_i(tree) = 1/γ(tree) (Butcher; Hairer, Nørsett & Wanner, Solving Ordinary Differential
Equations I, II.2).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from fractions import Fraction
from functools import cache
from math import prod
from typing import NamedTuple

import numpy as np

from ncgen.methods.explicit import Published

Row = tuple[Fraction, ...]

ROUNDING = 1e-11
"""What is left of a condition in double precision, relative to the size of what is added up, is below this."""


class WrongTableau(Exception):
    """Coefficients that are not those of the method that they are called."""


@dataclass(frozen=True, kw_only=True)
class Tableau:
    """An explicit Runge-Kutta method.

    c: nodes; a: rows of increasing length, how each stage after the first is reached from the slopes before it. The row `stages` is
        that of the end of the step; rows after it are stages that only the interpolant needs
    order: of the end of the step
    errors: pairs (order, weights e): b − e is another end of the step, of that order, so that h Σ e_j k_j estimates its error;
        none with a fixed step
    higher: what the interpolant adds to the cubic between both ends of a step, a row of weights a term (`dense`)
    dense_order: of the interpolant

    Raises WrongTableau where these contradict each other.
    """

    stages: int
    order: int
    c: Row
    a: tuple[Row, ...]
    errors: tuple[tuple[int, Row], ...] = ()
    higher: tuple[Row, ...] = ()
    dense_order: int = 3

    def __post_init__(self) -> None:
        self._check()

    @classmethod
    def of(cls, published: Published) -> Tableau:
        """What was published, read. Raises WrongTableau as above."""
        a = rows(published.a)
        errors = [(order, row(error)) for order, error in published.errors]
        for order, end in published.ends:
            errors.append((order, tuple(b - other for b, other in zip(a[published.stages - 1], row(end), strict=True))))
        c, higher = row(published.c), rows(published.higher)
        return cls(
            stages=published.stages, order=published.order, c=c, a=a, errors=tuple(errors), higher=higher, dense_order=published.dense_order
        )

    @property
    def width(self) -> int:
        """Slopes of a step at most, with those of its interpolant."""
        return len(self.a) + 1

    @property
    def weights(self) -> Row:
        """b, padded to the width: how the end of a step follows from its slopes."""
        return self._padded(self.a[self.stages - 1])

    @property
    def successive(self) -> tuple[tuple[Fraction, Fraction], ...]:
        """(c_i, b_i) of a method whose stages follow from the one before alone: k_i = f(t + c_i h, y + c_i h k_{i−1}), y + h Σ b_i k_i.

        Raises WrongTableau for others.
        """
        if any(any(row[:-1]) for row in self.a[: self.stages - 1]):
            raise WrongTableau("a stage follows from more than the one before it")
        return tuple(zip(self.c, self.weights))[: self.stages]

    @property
    def dense(self) -> tuple[Row, ...]:
        """Rows D_k of the interpolant y + h Σ_j k_j s (D_0j + (1 − s) (D_1j + s (D_2j + (1 − s) (D_3j + …)))), s from 0 to 1.

        The first three make the cubic with the slopes of both ends (Hairer, Nørsett & Wanner, II.6).
        """
        first, last = (self._padded((Fraction(0),) * stage + (Fraction(1),)) for stage in (0, self.stages))
        rest = tuple(f - b for f, b in zip(first, self.weights, strict=True))
        both = tuple(2 * b - f - e for b, f, e in zip(self.weights, first, last, strict=True))
        return (self.weights, rest, both, *map(self._padded, self.higher))

    @property
    def stability(self) -> float:
        """How far steps may go along the negative real axis: the least x with |1 + Σ_k b Aᵏ 1 (−x)ᵏ⁺¹| > 1."""
        slopes = np.array([[float(x) for x in self._padded(row)] for row in ((), *self.a)])
        terms, reached = [], np.ones(self.width)
        for _ in range(self.stages):
            terms.append(np.array([float(x) for x in self.weights]) @ reached)
            reached = slopes @ reached
        x = np.arange(1, 20_000) * 1e-3
        grown = np.abs(1.0 + sum(term * (-x) ** (k + 1) for k, term in enumerate(terms)))
        return float(x[np.argmax(grown > 1.0 + ROUNDING)])

    def _padded(self, row: Row) -> Row:
        return (*row, *(Fraction(0),) * (self.width - len(row)))

    def _check(self) -> None:
        if len(self.c) != self.width:
            raise WrongTableau(f"{len(self.c)} nodes for {self.width} slopes")
        for s, row in enumerate(self.a, 1):
            if len(row) != s:
                raise WrongTableau(f"row {s} has {len(row)} coefficients; an explicit stage has one a slope before it, {s}")
            if abs(float(sum(row) - self.c[s])) > ROUNDING * float(1 + sum(map(abs, row))):
                raise WrongTableau(f"row {s} adds up to {float(sum(row))!r}, its node is {float(self.c[s])!r}")
        slopes = np.array([[float(x) for x in self._padded(row)] for row in ((), *self.a)])
        weights = np.array([float(x) for x in self.weights])
        _exact(weights, slopes, self.order, 1.0, "the end of a step")
        for order, estimate in self.errors:
            _exact(weights - [float(x) for x in self._padded(estimate)], slopes, order, 1.0, "what an error is estimated with")
        nested = np.zeros(self.width)
        for row in reversed(self.dense):  # at s = ½ both factors are ½
            nested = 0.5 * (nested + np.array([float(x) for x in row]))
        _exact(nested, slopes, self.dense_order, 0.5, "the interpolant")


class Nonzeros(NamedTuple):
    """What is not 0 in rows of coefficients, one row after another: stages and their weights; rows: of each how many, and where the first
    is."""

    stages: list[int]
    weights: list[Fraction]
    rows: list[tuple[int, int]]


def nonzeros(rows: Iterable[Row]) -> Nonzeros:
    result = Nonzeros([], [], [])
    for row in rows:
        terms = {j: x for j, x in enumerate(row) if x}
        result.rows.append((len(terms), len(result.stages)))
        result.stages.extend(terms)
        result.weights.extend(terms.values())
    return result


def _exact(weights: np.ndarray, slopes: np.ndarray, order: int, s: float, label: str) -> None:
    """Raise WrongTableau unless weights of the slopes give y(t + s h) up to an order: Σ w_i Φ_i = s^nodes / γ for every tree."""
    for tree in trees(order):
        elementary, wanted = _elementary(tree, slopes), s ** _nodes(tree) / _density(tree)
        if abs(weights @ elementary - wanted) > ROUNDING * (1 + np.abs(weights) @ np.abs(elementary)):
            raise WrongTableau(
                f"{label} is not of order {order}: {weights @ elementary!r} in place of {wanted!r} in the condition of the tree {tree}"
            )


Tree = tuple


@cache
def trees(order: int) -> tuple[Tree, ...]:
    """All rooted trees of 1 to `order` nodes; a tree is the sorted tuple of the trees at its root."""
    return tuple(tree for size in range(1, order + 1) for tree in _of_size(size))


@cache
def _of_size(size: int) -> tuple[Tree, ...]:
    return tuple(sorted(_forests(size - 1, size - 1)))


def _forests(size: int, largest: int) -> Iterator[Tree]:
    """Sorted tuples of trees with `size` nodes together, none larger than `largest`."""
    if size == 0:
        yield ()
        return
    forests = set()
    for first in range(min(size, largest), 0, -1):
        for tree in _of_size(first):
            for rest in _forests(size - first, first):
                forest = tuple(sorted((tree, *rest)))
                if forest not in forests:
                    forests.add(forest)
                    yield forest


@cache
def _nodes(tree: Tree) -> int:
    return 1 + sum(map(_nodes, tree))


@cache
def _density(tree: Tree) -> int:
    """γ of a tree."""
    return _nodes(tree) * prod(map(_density, tree))


def _elementary(tree: Tree, slopes: np.ndarray) -> np.ndarray:
    """Φ_i of a tree for every slope i."""
    result = np.ones(len(slopes))
    for branch in tree:
        result = result * (slopes @ _elementary(branch, slopes))
    return result


def rows(text: str) -> tuple[Row, ...]:
    """Rows of exact numbers, a line a row."""
    return tuple(row(line) for line in text.strip().splitlines())


def row(text: str) -> Row:
    """A row of exact numbers such as 35/384 or 2.5e-1, with blanks between them; 0*5 stands for five zeros."""
    numbers: list[Fraction] = []
    for word in text.split():
        value, _, times = word.partition("*")
        numbers += [Fraction(value)] * int(times or 1)
    return tuple(numbers)
