"""The constraint catalogue: one entry a row type, and the only place where a constraint is written down.

A formula works on anything that can be added and multiplied (floats, sympy symbols, mpmath numbers):
its vectors are tuples of three scalars and `f` is a module with `sin` and `cos`. Everything else
(Jacobian, acceleration terms, C, NumPy) is derived from it.

Codes 1000-1003 and 1010-1015 are those of Tables 2 and 4 of the paper (DETC2007-35358).
"""

from __future__ import annotations

import pickle
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Protocol, Self, TypeAlias, TypeVar


class Arithmetic(Protocol):
    """What a formula does with numbers, of whatever kind they are."""

    def __add__(self, other: Self, /) -> Self: ...
    def __sub__(self, other: Self | int, /) -> Self: ...
    def __mul__(self, other: Self | int, /) -> Self: ...
    def __truediv__(self, other: Self | int, /) -> Self: ...
    def __pow__(self, exponent: int, /) -> Self: ...


N = TypeVar("N", bound=Arithmetic)


class Functions(Protocol[N]):
    """A module of functions of such numbers, such as `math` or `sympy`."""

    def sin(self, x: N, /) -> N: ...
    def cos(self, x: N, /) -> N: ...


Triple: TypeAlias = Sequence[N]
"""A 3-vector of numbers."""

Formula: TypeAlias = Callable[..., Any]
"""(f, **arguments) -> number, for the arguments of a row type: of whatever kind they are, so is the number."""


def dot(a: Triple[N], b: Triple[N]) -> N:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a: Triple[N], b: Triple[N]) -> tuple[N, N, N]:
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


@dataclass(frozen=True, kw_only=True)
class RowType:
    """A kind of constraint equation.

    vectors, scalars: names of the arguments, 3-vectors (linear in q) first
    data: names of the constants
    formula(f, **arguments): the raw equation, zero when satisfied
    scale: the constants whose product divides the scaled row, and a factor
    size: the constants whose product is the natural size of the raw row, unless it has that of a segment (`Row.along`); None where only its
    gradient can tell
    equation: the text printed next to the generated code, over the arguments' names
    """

    key: str
    vectors: tuple[str, ...]
    scalars: tuple[str, ...]
    data: tuple[str, ...]
    formula: Formula
    scale_factor: float
    scale_data: tuple[str, ...]
    size: tuple[str, ...] | None
    equation: str

    def __reduce__(self) -> tuple[Callable[[str], RowType], tuple[str]]:
        """Pickled by its key, since formulas are functions; refused where the catalogue does not have it."""
        if ROW_TYPES.get(self.key) is not self:
            raise pickle.PicklingError(f"row type {self.key} is not in the catalogue")
        return row_type, (self.key,)


def row_type(key: str) -> RowType:
    """The catalogue's entry of a key."""
    return ROW_TYPES[key]


def _distance(f: Functions[N], a: Triple[N], L: N) -> N:
    return dot(a, a) - L * L


def _unit(f: Functions[N], u: Triple[N]) -> N:
    return dot(u, u) - 1


def _vector_segment(f: Functions[N], u: Triple[N], a: Triple[N], L: N, c: N) -> N:
    return dot(u, a) - L * c


def _vector_vector(f: Functions[N], u: Triple[N], v: Triple[N], c: N) -> N:
    return dot(u, v) - c


def _angle_cosine(f: Functions[N], a: Triple[N], b: Triple[N], n: Triple[N], psi: N, la: N, lb: N, ln: N) -> N:
    return dot(a, b) - la * lb * f.cos(psi)


def _angle_sine(axis: int) -> Formula:
    def formula(f: Functions[N], a: Triple[N], b: Triple[N], n: Triple[N], psi: N, la: N, lb: N, ln: N) -> N:
        return cross(a, b)[axis] - la * lb / ln * n[axis] * f.sin(psi)

    return formula


def _angle_smooth(f: Functions[N], a: Triple[N], b: Triple[N], n: Triple[N], psi: N, la: N, lb: N, ln: N) -> N:
    return f.sin(psi) * (dot(a, b) - dot(a, n) * dot(b, n) / ln**2) - f.cos(psi) / ln * dot(cross(a, b), n)


def _angle_smooth_perpendicular(f: Functions[N], a: Triple[N], b: Triple[N], n: Triple[N], psi: N, la: N, lb: N, ln: N) -> N:
    return f.sin(psi) * dot(a, b) - f.cos(psi) / ln * dot(cross(a, b), n)


def _angle_paper(
    f: Functions[N], a: Triple[N], b: Triple[N], n: Triple[N], psi: N, la: N, lb: N, ln: N, wc: N, wx: N, wy: N, wz: N
) -> N | int:
    rows = [_angle_cosine, _angle_sine(0), _angle_sine(1), _angle_sine(2)]
    return sum(w * row(f, a, b, n, psi, la, lb, ln) for w, row in zip((wc, wx, wy, wz), rows, strict=True))


def _dot(f: Functions[N], a: Triple[N], b: Triple[N], c: N, L: N) -> N:
    return dot(a, b) - c


def _affine(axis: int) -> Formula:
    def formula(f: Functions[N], e: Triple[N], a: Triple[N], b: Triple[N], c: N) -> N:
        return e[axis] - c * cross(a, b)[axis]

    return formula


def _length(f: Functions[N], a: Triple[N], s: N, L: N) -> N:
    return dot(a, a) - s * s


def _slide(f: Functions[N], a: Triple[N], n: Triple[N], s: N) -> N:
    return dot(a, n) - s


def _follow(f: Functions[N], s: N, z: N, k: N, c: N) -> N:
    return s - k * z - c


def _angle(key: str, formula: Formula, equation: str, extra: tuple[str, ...] = ()) -> RowType:
    return RowType(
        key=key,
        vectors=("a", "b", "n"),
        scalars=("psi",),
        data=("la", "lb", "ln", *extra),
        formula=formula,
        scale_factor=1.0,
        scale_data=("la", "lb"),
        size=("la", "lb"),
        equation=equation,
    )


BRANCH_WEIGHTS = ("wc", "wx", "wy", "wz")
"""Data of the `angle-paper` row: exactly one is 1, the one whose equation is in force."""

ROW_TYPES = {
    row.key: row
    for row in [
        RowType(
            key="distance",
            vectors=("a",),
            scalars=(),
            data=("L",),
            formula=_distance,
            scale_factor=0.5,
            scale_data=("L",),
            size=("L", "L"),
            equation="|a|^2 - L^2",
        ),
        RowType(
            key="unit", vectors=("u",), scalars=(), data=(), formula=_unit, scale_factor=0.5, scale_data=(), size=(), equation="|u|^2 - 1"
        ),
        RowType(
            key="vector-segment",
            vectors=("u", "a"),
            scalars=(),
            data=("L", "c"),
            formula=_vector_segment,
            scale_factor=1.0,
            scale_data=("L",),
            size=("L",),
            equation="u.a - L c",
        ),
        RowType(
            key="vector-vector",
            vectors=("u", "v"),
            scalars=(),
            data=("c",),
            formula=_vector_vector,
            scale_factor=1.0,
            scale_data=(),
            size=(),
            equation="u.v - c",
        ),
        RowType(
            key="dot",
            vectors=("a", "b"),
            scalars=(),
            data=("c", "L"),
            formula=_dot,
            scale_factor=1.0,
            scale_data=("L",),
            size=("L",),
            equation="a.b - c",
        ),
        *(
            RowType(
                key=f"affine-{x}",
                vectors=("e", "a", "b"),
                scalars=(),
                data=("c",),
                formula=_affine(k),
                scale_factor=1.0,
                scale_data=(),
                size=(),
                equation=f"(e - c a x b).{x}",
            )
            for k, x in enumerate("xyz")
        ),
        RowType(
            key="length",
            vectors=("a",),
            scalars=("s",),
            data=("L",),
            formula=_length,
            scale_factor=0.5,
            scale_data=("L",),
            size=("L", "L"),
            equation="|a|^2 - s^2",
        ),
        RowType(
            key="slide",
            vectors=("a", "n"),
            scalars=("s",),
            data=(),
            formula=_slide,
            scale_factor=1.0,
            scale_data=(),
            size=(),
            equation="a.n - s",
        ),
        RowType(
            key="follow",
            vectors=(),
            scalars=("s", "z"),
            data=("k", "c"),
            formula=_follow,
            scale_factor=1.0,
            scale_data=(),
            size=None,
            equation="s - k z - c",
        ),
        _angle("angle-cosine", _angle_cosine, "a.b - la lb cos psi"),
        _angle("angle-sine-x", _angle_sine(0), "(a x b - la lb n/ln sin psi).x"),
        _angle("angle-sine-y", _angle_sine(1), "(a x b - la lb n/ln sin psi).y"),
        _angle("angle-sine-z", _angle_sine(2), "(a x b - la lb n/ln sin psi).z"),
        _angle("angle-smooth", _angle_smooth, "sin psi [a.b - (a.n)(b.n)/ln^2] - cos psi (a x b).n/ln"),
        _angle("angle-smooth-perpendicular", _angle_smooth_perpendicular, "sin psi a.b - cos psi (a x b).n/ln"),
        _angle(
            "angle-paper",
            _angle_paper,
            "a.b - la lb cos psi, or one component of a x b - la lb n/ln sin psi, as chosen at run time",
            BRANCH_WEIGHTS,
        ),
    ]
}

PAPER_CODES = {"distance": 1000, "unit": 1001, "vector-segment": 1002, "vector-vector": 1003}
"""The paper's code of a rigid-body row type (Table 2)."""

PAPER_ANGLE_CODES = {
    ("segment", "segment", "vector"): 1010,
    ("segment", "segment", "segment"): 1011,
    ("vector", "vector", "vector"): 1012,
    ("vector", "vector", "segment"): 1013,
    ("vector", "segment", "vector"): 1014,
    ("vector", "segment", "segment"): 1015,
}
"""The paper's code of an angle by what it is measured from, to and about (Table 4, comment numbers)."""
