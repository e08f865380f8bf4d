"""Inertia of a body on its basis, in exact rational arithmetic.

For a base point r and directions x₁…x₃ the kinetic energy is ½ Σ s_kl v_k·v_l over (r, x₁, x₂, x₃) with

    S = [ m    m aᵀ ]    a = X⁻¹ d,  Z = X⁻¹ (J_G + m d dᵀ) X⁻ᵀ,  d = com − r,  J_G = ½ tr(I) 1 − I
        [ m a   Z   ]

(natural coordinates, 2.2). Numbers are doubles taken as fractions, so S is exact and is rounded once.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

import numpy as np
import sympy

from ncgen.errors import ModelError
from ncgen.model.bodies import Body, Inertia
from ncgen.model.catalogue import cross, dot
from ncgen.model.elements import Component, Point
from ncgen.model.rigid import NORMAL
from ncgen.model.values import Parameter, as_sympy, is_number

ROUNDING = 1e-14
"""Relative weights below this are rounding of the user's decimal numbers (a centre meant to be on a line) and count as zero."""

OFF_AXIS = 1e-9
"""How far (relative to the bar's length) a bar's centre of mass may be from its line."""


@dataclass(frozen=True)
class StandardInertia:
    """S over base point and directions, and the directions as linear forms.

    directions: per direction the pairs (weight, components); the base point is first
    matrix: entries are Fractions, or sympy expressions where the mass is a parameter
    crossed: True if the last row belongs to x₁ × x₂ instead of an element
    """

    directions: tuple[tuple[tuple[float, tuple[Component, ...]], ...], ...]
    matrix: tuple[tuple[object, ...], ...]
    crossed: bool = False


def standard_inertia(body: Body) -> StandardInertia:
    """The inertia of a body over its basis; raises ModelError where a small basis cannot carry it."""
    inertia = body.inertia
    basis = body.basis
    base = next(e for e in basis if isinstance(e, Point))
    others = [e for e in basis if e is not base]
    forms = [((1.0, base.components),)]
    for element in others:
        forms.append(((1.0, element.components), (-1.0, base.components)) if isinstance(element, Point) else ((1.0, element.components),))
    axes = [_fractions(e.initial) for e in others]
    origin = _fractions(base.initial)
    axes = [[x - (o if isinstance(e, Point) else 0) for x, o in zip(v, origin, strict=True)] for v, e in zip(axes, others, strict=True)]
    offset = [c - o for c, o in zip(_fractions(inertia.com), origin, strict=True)]
    if not others:
        return _point_mass(body, offset, forms)
    if len(others) == 1:
        if not _is_planar(base, others[0]):
            return _bar(body, axes[0], offset, forms)
        forms.append(((1.0, NORMAL.components),))
        axes.append(_fractions([0.0, 0.0, 1.0]))
    crossed = len(axes) == 2
    if crossed:
        axes.append(list(cross(axes[0], axes[1])))
    return StandardInertia(tuple(forms), _standard(inertia, axes, offset), crossed)


def centre_weights(standard: StandardInertia) -> tuple[object, ...]:
    """m (1, a): how the body's weight is shared between base point and directions."""
    return standard.matrix[0]


def _standard(inertia: Inertia, axes, offset):
    inverse = _inverse(axes)
    a = [_cleaned(dot(row, offset), 1) for row in inverse]
    tensor = [_fractions(row) for row in inertia.tensor]
    half = sum(tensor[k][k] for k in range(3)) / 2
    planar = [[(half if k == l else 0) - tensor[k][l] for l in range(3)] for k in range(3)]
    spread = [[dot(row, [dot(planar[k], other) for k in range(3)]) for other in inverse] for row in inverse]
    largest = max(abs(spread[k][k]) for k in range(3))
    spread = [[_cleaned(x, largest) for x in row] for row in spread]
    mass = _mass(inertia.mass)
    top = (mass, *(_times(mass, x) for x in a))
    rows = [(_times(mass, a[k]), *(_plus(spread[k][l], _times(mass, a[k] * a[l])) for l in range(3))) for k in range(3)]
    return (top, *map(tuple, rows))


def _cleaned(value: Fraction, scale) -> Fraction:
    return value if abs(value) > ROUNDING * scale else Fraction(0)


def _point_mass(body: Body, offset, forms):
    if any(offset) or np.any(body.inertia.tensor):
        raise ModelError(f"body {body.name}: on one point only a point mass is possible; give com at the point and no inertia, or more elements")
    return StandardInertia(tuple(forms), ((_mass(body.inertia.mass),),))


def _bar(body: Body, axis, offset, forms):
    """Two points in space: the rotational inertia across the bar counts, spin about it cannot be described."""
    squared = dot(axis, axis)
    along = dot(axis, offset) / squared
    across = [float(o - along * x) for o, x in zip(offset, axis, strict=True)]
    if max(map(abs, across)) > OFF_AXIS * float(squared) ** 0.5:
        raise ModelError(f"body {body.name}: its centre of mass is not on the line of its two points; add a vector to the basis")
    tensor = [_fractions(row) for row in body.inertia.tensor]
    spin = dot(axis, [dot(row, axis) for row in tensor]) / squared
    transverse = (sum(tensor[k][k] for k in range(3)) - spin) / 2
    moments = np.linalg.eigvalsh(body.inertia.tensor)
    if min(abs(moments - float(transverse))) > 1e-9 * max(moments[-1], 1e-300) or _asymmetric(body.inertia.tensor, axis):
        raise ModelError(f"body {body.name}: a body on two points must be symmetric about their line; add a vector to the basis")
    mass = _mass(body.inertia.mass)
    ma = _times(mass, along)
    return StandardInertia(tuple(forms), ((mass, ma), (ma, _plus(transverse / squared, _times(mass, along * along)))))


def _asymmetric(tensor: np.ndarray, axis) -> bool:
    direction = np.array([float(x) for x in axis])
    direction /= np.linalg.norm(direction)
    turned = tensor @ direction
    bar = tensor - (direction @ turned) * np.outer(direction, direction)
    transverse = np.trace(bar) / 2
    ideal = transverse * (np.eye(3) - np.outer(direction, direction))
    return bool(np.max(np.abs(bar - ideal)) > 1e-9 * max(np.trace(tensor), 1e-300))


def _is_planar(*points: Point) -> bool:
    """True if the points share one fixed z: then the plane's normal is the body's third direction."""
    heights = [p.components[2] for p in points]
    return all(h.fixed and h.value == heights[0].value for h in heights)


def _fractions(values) -> list[Fraction]:
    return [Fraction(float(v)) for v in values]


def _inverse(axes) -> list[list[Fraction]]:
    """Rows of X⁻¹, the reciprocal basis, of the columns `axes`."""
    volume = dot(axes[0], cross(axes[1], axes[2]))
    return [[x / volume for x in cross(axes[(k + 1) % 3], axes[(k + 2) % 3])] for k in range(3)]


def _mass(mass):
    return Fraction(mass) if is_number(mass) else as_sympy(mass) if isinstance(mass, Parameter) else mass


def _times(mass, factor: Fraction):
    """mass·factor: exact for numbers, a sympy expression for parameters."""
    return mass * factor if isinstance(mass, Fraction) else mass * sympy.Float(float(factor)) if factor else Fraction(0)


def _plus(number: Fraction, term):
    if isinstance(term, Fraction):
        return number + term
    return term + sympy.Float(float(number)) if number else term
