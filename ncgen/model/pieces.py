"""Polynomials piece by piece: what splines, tables and smooth steps are made of.

A piece begins at every knot, and one goes before the first. Each is a row: its origin, then its coefficients, lowest power first. The
derivative is of the same kind, one degree lower, so that every order of it is exact.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np


@dataclass(frozen=True)
class Pieces:
    """knots: where pieces begin, increasing; rows: of every piece, one more than knots; period: 0 where nothing repeats itself"""

    knots: tuple[float, ...]
    rows: tuple[tuple[float, ...], ...]
    period: float = 0.0

    def __repr__(self) -> str:
        return f"<Pieces of degree {self.degree}, {len(self.knots)} knots>"

    @property
    def degree(self) -> int:
        return len(self.rows[0]) - 2

    @property
    def numbers(self) -> tuple[float, ...]:
        """The rows one after the other, as a table of generated code has them."""
        return tuple(number for row in self.rows for number in row)

    @property
    def constant(self) -> float | None:
        """What it is everywhere; None where it is not the same."""
        polynomials = {row[1:] for row in self.rows}
        (coefficients,) = polynomials if len(polynomials) == 1 else ((0.0, 1.0),)
        return None if any(coefficients[1:]) else coefficients[0]

    def at(self, x: Any) -> Any:
        """Its value at a number of any kind that has a real part and can be compared, or at an array of them."""
        if isinstance(x, np.ndarray):
            return np.array([self.at(each) for each in x.ravel()]).reshape(x.shape)
        first = self.knots[0]
        if self.period:
            x = x - self.period * float(np.floor(float((x.real - first) / self.period)))
        origin, *lower, value = self.rows[bisect_right(self.knots, x.real)]
        s = x - origin
        for coefficient in reversed(lower):
            value = value * s + coefficient
        return value

    def derivative(self) -> Pieces:
        return _derivative(self)


@cache
def _derivative(pieces: Pieces) -> Pieces:
    rows = tuple((origin, *([k * c for k, c in enumerate(powers)][1:] or [0.0])) for origin, *powers in pieces.rows)
    return Pieces(pieces.knots, rows, pieces.period)


def cubic(knots: tuple[float, ...], values: tuple[float, ...], slopes: tuple[float, ...], period: float = 0.0) -> Pieces:
    """Pieces with given values and slopes at the knots; beyond the ends they go on straight."""
    rows = [(knots[0], values[0], slopes[0], 0.0, 0.0)]
    for k, (h, d) in enumerate(zip(_steps(knots), _chords(knots, values), strict=True)):
        a, b = slopes[k], slopes[k + 1]
        rows.append((knots[k], values[k], a, (3.0 * d - 2.0 * a - b) / h, (a + b - 2.0 * d) / h / h))
    return Pieces(knots, (*rows, (knots[-1], values[-1], slopes[-1], 0.0, 0.0)), period)


def linear(knots: tuple[float, ...], values: tuple[float, ...], period: float = 0.0) -> Pieces:
    """Straight lines from knot to knot; the first and the last go on."""
    chords = _chords(knots, values)
    starts = [(knot, value, d) for knot, value, d in zip(knots, values, chords)]
    return Pieces(knots, (starts[0], *starts, (knots[-1], values[-1], chords[-1])), period)


def slopes_of(knots: tuple[float, ...], values: tuple[float, ...], end: str) -> tuple[float, ...]:
    """The slopes at the knots of the cubic spline with continuous second derivatives (de Boor, A Practical Guide to Splines, chapter IV).

    end: "natural", "clamped", "not-a-knot" or "periodic"
    Plain sums and products in a fixed order: the same bits on every machine, since they become part of generated code.
    """
    h, d = _steps(knots), _chords(knots, values)
    inner = [
        (h[k], 2.0 * (h[k - 1] + h[k]), h[k - 1], 3.0 * (h[k] * d[k - 1] + h[k - 1] * d[k])) for k in range(1, len(h))
    ]  # (below, on and above the diagonal, right-hand side)
    if end == "periodic":
        around = (h[0], 2.0 * (h[-1] + h[0]), h[-1], 3.0 * (h[0] * d[-1] + h[-1] * d[0]))
        slopes = _solved_around([around, *inner])
        return (*slopes, slopes[0])
    first, last = _end(end, h, d), _end(end, h[::-1], d[::-1])
    return tuple(_solved([(0.0, *first), *inner, (last[1], last[0], 0.0, last[2])]))


ENDS = {"natural": 2, "clamped": 2, "not-a-knot": 4, "periodic": 4}
"""{end of a spline: how many knots it takes}."""


def _end(end: str, h: list[float], d: list[float]) -> tuple[float, float, float]:
    """The equation of a first slope: its factor, that of the next one, and the right-hand side; of a last one told backwards."""
    if end == "natural":
        return 2.0, 1.0, 3.0 * d[0]
    if end == "clamped":
        return 1.0, 0.0, 0.0
    both = h[0] + h[1]
    return h[1], both, ((h[0] + 2.0 * both) * h[1] * d[0] + h[0] * h[0] * d[1]) / both


def _steps(knots: tuple[float, ...]) -> list[float]:
    return [b - a for a, b in zip(knots, knots[1:])]


def _chords(knots: tuple[float, ...], values: tuple[float, ...]) -> list[float]:
    """Slopes of the straight lines from knot to knot."""
    return [(b - a) / h for a, b, h in zip(values, values[1:], _steps(knots))]


def _solved(rows: list[tuple[float, float, float, float]]) -> list[float]:
    """Of a tridiagonal system, by elimination in its order."""
    made: list[tuple[float, float]] = []
    above = right = 0.0
    for below, on, over, side in rows:
        pivot = on - below * above
        above, right = over / pivot, (side - below * right) / pivot
        made.append((above, right))
    solution: list[float] = []
    for above, right in reversed(made):
        solution.append(right - above * solution[-1] if solution else right)
    return solution[::-1]


def _solved_around(rows: list[tuple[float, float, float, float]]) -> list[float]:
    """The same where the first unknown follows the last one, by the formula of Sherman and Morrison."""
    corner, diagonal = rows[0][0], rows[0][1]
    under = rows[-1][2]
    changed = [(below, on, over) for below, on, over, _ in rows]
    changed[0] = (0.0, 2.0 * diagonal, changed[0][2])
    changed[-1] = (changed[-1][0], changed[-1][1] + under * corner / diagonal, 0.0)
    sides = [-diagonal, *(0.0 for _ in rows[2:]), under]
    plain = _solved([(*row, side) for row, (_, _, _, side) in zip(changed, rows, strict=True)])
    correction = _solved([(*row, side) for row, side in zip(changed, sides, strict=True)])
    factor = (plain[0] - corner / diagonal * plain[-1]) / (1.0 + correction[0] - corner / diagonal * correction[-1])
    return [x - factor * z for x, z in zip(plain, correction, strict=True)]


def are_finite(pieces: Pieces) -> bool:
    """False where knots are so close, or values so large, that a coefficient is no double."""
    return all(map(math.isfinite, pieces.numbers))
