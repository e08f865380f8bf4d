"""Conditions at which a run in C ends, as `ncgen_event` has them."""

from __future__ import annotations

from dataclasses import dataclass
from decimal import Decimal, localcontext
from fractions import Fraction
from functools import cache
from itertools import accumulate
from math import comb, cos, pi
from typing import TYPE_CHECKING

import numpy as np

from ncgen.mechanism.arguments import pointer
from ncgen.mechanism.runtime_library import formula_walker
from ncgen.toolchain.abi import InC, Interface, Number

if TYPE_CHECKING:
    from ncgen.program.motions.condition_formulas import FormulaTable

LINEAR, QUADRATIC = 8, 14
"""Degrees of the polynomials in time that conditions are within a step: interpolants have degree 7 at most, products of two of them 14."""

PI = Decimal("3.14159265358979323846264338327950288419716939937511")
"""π, more digits than a double has."""

UNWATCHED = 2
"""The direction of a condition that is not asked for."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Conditions:
    """C conditions, the first of which that is fulfilled ends a run.

    coordinates (C,): position in q, or n + position in q̇, −1 for one of the function; values (C,): what coordinates pass (m, rad, and per
    second); directions (C,): 1 rising, −1 falling, 0 either, UNWATCHED
    signs (C,): the side on which each begins, 0 for that of its value
    sampled (C,): True where nothing is known of a condition between samples; they are then as dense as it takes
    function: the address of an `ncgen_velocity_kernel` that gives of every condition its value and the size of its terms; None where all
        are coordinates
    degree: LINEAR or QUADRATIC
    formulas: of the conditions that are no such polynomials
    """

    coordinates: np.ndarray
    values: np.ndarray
    directions: np.ndarray
    signs: np.ndarray
    sampled: np.ndarray | None = None
    function: int | None = None
    degree: int = LINEAR
    formulas: Formulas | None = None


@dataclass(frozen=True, eq=False)
class Formulas:
    """Formulas of conditions. table: the formulas of some, one after the other; sampled (C,): True once a condition had no bounds on some
    part of a step, and was sampled there"""

    table: FormulaTable
    sampled: np.ndarray


class Watched:
    """Conditions in C for the time of a run."""

    def __init__(self, conditions: Conditions, ffi: Interface, number: Number) -> None:
        count, (nodes, inverse) = len(conditions.coordinates), basis(conditions.degree)
        integers = [np.array(a, dtype=np.intc) for a in (conditions.coordinates, conditions.directions, conditions.signs)]
        self._crossed = np.zeros(count, dtype=np.intc)
        samples = np.zeros((conditions.degree + 3, 2 * count))
        numbers = [np.array(a, dtype=number.dtype) for a in (conditions.values, nodes, inverse, samples)]
        self._arrays, self._signs = (*integers, *numbers), integers[2]
        names = "coordinates", "directions", "signs"
        members = {name: pointer(ffi, a, "int[]") for name, a in zip(names, integers, strict=True)}
        members |= {name: pointer(ffi, a, number.array) for name, a in zip(("values", "nodes", "inverse", "samples"), numbers, strict=True)}
        function = ffi.cast("ncgen_velocity_kernel *", conditions.function or 0)
        self._formulas = _FormulasInC(conditions, ffi, number) if conditions.formulas else None
        members |= {"formulas": self._formulas.struct} if self._formulas else {}
        if conditions.sampled is not None:
            self._sampled = np.array(conditions.sampled, dtype=np.intc)
            members["sampled"] = pointer(ffi, self._sampled, "int[]")
        members |= {
            "resumes": 1,
            "count": count,
            "degree": conditions.degree,
            "crossed": pointer(ffi, self._crossed, "int[]"),
            "function": function,
        }
        self.struct: InC = ffi.new("ncgen_event *", members)

    @property
    def signs(self) -> np.ndarray:
        """The side on which each condition was last, a copy."""
        return self._signs.copy()

    @property
    def crossed(self) -> tuple[int, ...]:
        """Numbers of the conditions that ended the run, all at the same instant."""
        return tuple(np.flatnonzero(self._crossed).tolist())

    def report(self) -> None:
        """Note which conditions were sampled."""
        if self._formulas:
            self._formulas.report()


class _FormulasInC:
    """Formulas as C reads them, for the time of a run."""

    def __init__(self, conditions: Conditions, ffi: Interface, number: Number) -> None:
        assert conditions.formulas
        self._formulas, table, count = conditions.formulas, conditions.formulas.table, len(conditions.coordinates)
        self._sampled = np.zeros(count, dtype=np.intc)
        integers, numbers, sizes = formula_arrays(table, count, conditions.degree)
        self._arrays = {name: np.array(a, dtype=np.intc) for name, a in integers.items()}
        self._arrays |= {name: np.array(a, dtype=number.dtype) for name, a in numbers.items()}
        self._arrays |= {name: np.zeros(size, dtype=number.dtype) for name, size in sizes.items()}
        members = {name: pointer(ffi, a, "int[]" if name in integers else number.array) for name, a in self._arrays.items()}
        members["walk"] = ffi.cast("ncgen_formula_walker *", formula_walker(number.name))
        members |= {"n_inputs": len(table.inputs), "sampled": pointer(ffi, self._sampled, "int[]")}
        self.struct: InC = ffi.new("ncgen_formulas *", members)

    def report(self) -> None:
        count = len(self._formulas.sampled)
        self._formulas.sampled[:] |= self._sampled[:count] > 0


def formula_arrays(table: FormulaTable, count: int, degree: int) -> tuple[dict[str, list[int]], dict[str, list[float]], dict[str, int]]:
    """Members of `ncgen_formulas` for some conditions: whole numbers, numbers, and the sizes of workspaces.

    count: conditions, those behind the table's having no formulas; degree: LINEAR or QUADRATIC
    """
    lengths = [*map(len, table.formulas), *[0] * (count - len(table.formulas))]
    operations = [number for formula in table.formulas for operation in formula for number in operation]
    integers = {"first": np.cumsum([0, *lengths]).tolist(), "operations": operations, "inputs": [*table.inputs] or [0]}
    numbers = {"numbers": [*table.numbers] or [0.0], "through": np.ravel(chebyshev(degree)).tolist(), "cosines": cosines(degree)}
    return integers, numbers, {"values": max(2 * (degree + 1) * len(table.inputs), 1), "workspace": 16 * max(lengths)}


@cache
def chebyshev(degree: int) -> np.ndarray:
    """The matrix (degree + 1, degree + 1) from values at the nodes of `basis` to coefficients in Chebyshev's basis."""
    rows = []
    for s in _nodes(degree):
        polynomials = [Fraction(1), 2 * s - 1]
        while len(polynomials) <= degree:
            polynomials.append(2 * (2 * s - 1) * polynomials[-1] - polynomials[-2])
        rows.append(polynomials)
    return _inverse(rows)


@cache
def cosines(degree: int) -> list[float]:
    """cos(π k/degree) for k = 0 … 2 degree − 1, by the same digits on every machine."""
    with localcontext() as context:
        context.prec = 50
        squares = [(PI * k / degree) ** 2 for k in range(2 * degree)]
        return [float(sum(accumulate(range(1, 40), lambda term, j, x=x: -term * x / ((2 * j - 1) * 2 * j), initial=1))) for x in squares]


@cache
def basis(degree: int) -> tuple[np.ndarray, np.ndarray]:
    """Shares of a step (degree + 1,) where conditions are evaluated, and the matrix from values there to coefficients in Bernstein's basis.

    Even shares; for the higher degree those of Chebyshev, with which rounding grows by 11,700 at most instead of 165,000.
    """
    n, nodes = degree, _nodes(degree)
    inverse = _inverse([[comb(n, k) * s**k * (1 - s) ** (n - k) for k in range(n + 1)] for s in nodes])
    return np.array([float(s) for s in nodes]), inverse


def _nodes(degree: int) -> list[Fraction]:
    if degree <= LINEAR:
        return [Fraction(k, degree) for k in range(degree + 1)]
    return [Fraction(round((1 - cos(pi * k / degree)) / 2 * 2**20), 2**20) for k in range(degree + 1)]


def _inverse(matrix: list[list[Fraction]]) -> np.ndarray:
    """By exact numbers, rounded at the end."""
    n = len(matrix)
    rows = [[*row, *(Fraction(j == i) for j in range(n))] for i, row in enumerate(matrix)]
    for column in range(n):
        pivot = next(r for r in range(column, n) if rows[r][column])
        rows[column], rows[pivot] = rows[pivot], rows[column]
        rows[column] = [x / rows[column][column] for x in rows[column]]
        for r in range(n):
            if r != column and (factor := rows[r][column]):
                rows[r] = [x - factor * y for x, y in zip(rows[r], rows[column], strict=True)]
    return np.array([[float(x) for x in row[n:]] for row in rows])
