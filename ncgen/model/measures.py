"""What is measured in the initial position: lengths, cosines, angles, and weights of combinations.

A measure is a number, or an expression of parameters where positions have some: so a body whose point stands at a
parameter is, at any p, the body that would have been built with that number. What is decided, such as which elements
make a base, is decided at the parameters' defaults.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import TypeAlias

import numpy as np

from ncgen.model import arithmetic
from ncgen.model.elements import Combination, Point
from ncgen.model.values import Scalar, as_number_if_constant, is_number, total

Scalars: TypeAlias = "Sequence[Scalar] | np.ndarray"
"""A vector of values."""

ROUNDING = 4 * np.finfo(float).eps
"""Cosines between unit vectors below this are zero."""

MIN_RELATIVE_LENGTH = 1e-3
"""A segment shorter than this, over the model's extent, is no length to measure with: ends may coincide but for rounding."""


def shape(direction: Combination) -> str:
    """ "segment" for a difference of points, "vector" otherwise."""
    return "segment" if all(isinstance(e, Point) for e in direction.elements) else "vector"


def length(direction: Combination) -> Scalar:
    """The length of a direction in the initial position; exactly 1 for a unit vector."""
    if shape(direction) == "vector" and len(direction.terms) == 1:
        return 1.0
    return norm(direction.given) if direction.is_parametric else arithmetic.norm(direction.initial)


def natural_length(segment: Combination, extent: float) -> float:
    """A length to divide by what happens along a segment (m): its own, or where it is short or 0 that of the whole model."""
    segment_length = arithmetic.norm(segment.initial)
    return segment_length if segment_length > MIN_RELATIVE_LENGTH * extent else extent or 1.0


def cosine(a: Combination, b: Combination) -> Scalar:
    """The cosine of the angle between two directions; what is zero but for rounding is zero."""
    if a.is_parametric or b.is_parametric:
        return as_number_if_constant(dot(a.given, b.given) / (length(a) * length(b)))
    return cosine_of(a.initial, b.initial, max(_rounding_of(a), _rounding_of(b)))


def cosine_of(a: np.ndarray, b: np.ndarray, rounding: float = ROUNDING) -> float:
    """The same of two vectors of numbers, of which `rounding` says what is zero."""
    value = arithmetic.dot(a, b) / (arithmetic.norm(a) * arithmetic.norm(b))
    return 0.0 if abs(value) < rounding else value


def _rounding_of(direction: Combination) -> float:
    """By which a direction may miss what is perpendicular to it: between points by more, the closer they are and the farther away."""
    size = sum(abs(float(weight)) * max(map(abs, element.initial.tolist())) for weight, element in direction.terms)
    return ROUNDING * max(1.0, size / arithmetic.norm(direction.initial))


def along(direction: Combination, axis: Combination) -> Scalar:
    """The scalar product of two directions."""
    if direction.is_parametric or axis.is_parametric:
        return dot(direction.given, axis.given)
    return arithmetic.dot(direction.initial, axis.initial)


def angle(start: Combination, end: Combination, axis: Combination) -> Scalar:
    """The angle from `start` to `end` about `axis`, in (−π, π]."""
    if not any(d.is_parametric for d in (start, end, axis)):
        return angle_of(start.initial, end.initial, arithmetic.unit(axis.initial))
    import sympy

    a, b, n = start.given, end.given, unit(axis.given)
    return as_number_if_constant(sympy.atan2(dot(cross(a, b), n), dot(a, b) - dot(a, n) * dot(b, n)))


def angle_of(a: np.ndarray, b: np.ndarray, n: np.ndarray) -> float:
    """The same of vectors of numbers, n of length 1."""
    dot = arithmetic.dot
    return math.atan2(dot(arithmetic.cross(a, b), n), dot(a, b) - dot(a, n) * dot(b, n))


def weights(base: Sequence[Scalars], target: Scalars) -> list[Scalar]:
    """Numbers w of the least squares target = Σ w · base, of vectors of values; one to three vectors that are independent."""
    return [as_number_if_constant(dot(target, other)) for other in reciprocal(base)[: len(base)]]


def reciprocal(base: Sequence[Scalars]) -> list[tuple[Scalar, ...]]:
    """Vectors whose products with the base are 1 and 0, in the space of the base."""
    if len(base) == 1:
        squared = dot(base[0], base[0])
        return [tuple(x / squared for x in base[0])]
    if len(base) == 2:
        base = [*base, cross(*base)]
    volume = dot(base[0], cross(base[1], base[2]))
    return [tuple(x / volume for x in cross(base[(k + 1) % 3], base[(k + 2) % 3])) for k in range(3)]


# -- arithmetic of values: zeros are left out, so that what is zero stays a plain zero -----------------


def dot(a: Iterable[Scalar], b: Iterable[Scalar]) -> Scalar:
    """The scalar product of two vectors of values."""
    return total(_product(x, y) for x, y in zip(a, b, strict=True))


def cross(a: Scalars, b: Scalars) -> tuple[Scalar, ...]:
    """The cross product of two vectors of values."""
    return tuple(as_number_if_constant(_product(a[i - 2], b[i - 1]) - _product(a[i - 1], b[i - 2])) for i in range(3))


def norm(a: Iterable[Scalar]) -> Scalar:
    """The length of a vector of values."""
    squared = dot(a, a)
    if is_number(squared):
        return math.sqrt(squared)
    import sympy

    return sympy.sqrt(squared)


def unit(a: Scalars) -> tuple[Scalar, ...]:
    """A vector of values divided by its length."""
    size = norm(a)
    return tuple(as_number_if_constant(x / size) if is_number(size) or x != 0.0 else 0.0 for x in a)


def _product(x: Scalar, y: Scalar) -> Scalar:
    return 0 if x == 0.0 or y == 0.0 else x * y
