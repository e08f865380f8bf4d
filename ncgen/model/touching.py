"""What touches at a contact: the gap between two surfaces, and the velocity at which they slide past each other, as expressions.

Both follow from the elements of the two bodies. What a body carries along, such as the point of a ball that touches, is a combination of
the body's own directions with constant weights for as long as one looks at the velocity; so its velocity is the same combination of their
velocities, and no angle appears anywhere.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from ncgen.errors import ModelError
from ncgen.model import arithmetic, measures
from ncgen.model.bodies import Body
from ncgen.model.curves import Curve
from ncgen.model.elements import Combination, Component, Direction, Point, as_combination
from ncgen.model.values import Scalar, Value, as_sympy, is_number

if TYPE_CHECKING:
    import sympy

    Three: TypeAlias = "sympy.Matrix"


@dataclass(frozen=True, eq=False)
class Touching:
    """gap: m, negative where the bodies overlap; place: the point of the first body that touches (m), three expressions

    sliding: m/s of the first body past the second, one expression in the plane, two in space
    """

    gap: Scalar
    position: tuple[Scalar, ...]
    sliding: tuple[Scalar, ...]


@dataclass(frozen=True, eq=False)
class Tip:
    """The first body's side: a point, the centre of a sphere (radius above 0), or of a disc whose rim touches (edge: its axis)."""

    body: Body
    point: Point
    radius: Value
    edge: Direction | None


@dataclass(frozen=True, eq=False, kw_only=True)
class ContactSurface:
    """The second body's side, at a point: a plane (normal), a cylinder (axis, radius), a sphere (radius), or a curve in the plane.

    inside: the first body is within the sphere or cylinder; start: the direction from which the curve counts its angle
    """

    body: Body
    point: Point
    normal: Direction | None
    axis: Direction | None
    radius: Value
    inside: bool
    curve: Curve | None
    start: Direction | None
    is_ground: bool


ROUNDING = 1e-14
"""Numbers of directions below this share of the largest are rounding."""


def touching(tip: Tip, surface: ContactSurface, initial: dict[str, float], where: str) -> Touching:
    """The gap and the sliding velocity of a contact. Raises ModelError for what cannot touch.

    initial: numbers of coordinates and parameters in the initial position
    """
    flat = tip.body.frame.planar and (surface.is_ground or surface.body.frame.planar)
    if surface.curve is not None and not flat:
        raise ModelError(f"{where}: a curve is touched in the plane only; in space take a sphere, a cylinder or a plane")
    gap, normal, offset = _distance(tip, surface, where)
    position = _position(tip.point) + offset
    tip_velocity = _velocity(tip.point) + _carried(tip.body, offset, where)
    other = (
        _velocity(surface.point) + _carried(surface.body, position - _position(surface.point), where)
        if not surface.is_ground
        else 0 * tip_velocity
    )
    if flat:
        tangents = [_vector((normal[1], -normal[0], 0))]
    else:
        tangents = _tangents(normal, surface, initial)
    return Touching(gap, tuple(position), tuple(t.dot(tip_velocity - other) for t in tangents))


def _distance(tip: Tip, surface: ContactSurface, where: str) -> tuple[Scalar, Three, Three]:
    """The gap, the unit normal towards the first body, and the point of the first body that touches, from its point on."""
    import sympy

    reach, across = as_sympy(tip.radius), _position(tip.point) - _position(surface.point)
    if surface.normal is not None:
        normal = _unit(surface.normal)
        offset = -reach * normal
        if tip.edge is not None:
            axis = _unit(tip.edge)
            lean = normal.dot(axis)
            offset = -(normal - lean * axis) * reach / sympy.sqrt(1 - lean**2)
            return normal.dot(across) - reach * sympy.sqrt(1 - lean**2), normal, offset
        return normal.dot(across) - reach, normal, offset
    if tip.edge is not None:
        raise ModelError(f"{where}: an edge touches a plane only; give its normal, or leave edge out")
    if surface.curve is not None:
        gap, normal = _from_curve(across, surface)
        return gap, normal, -reach * normal
    side = -1 if surface.inside else 1
    length = as_sympy(surface.radius) + side * reach
    if surface.axis is not None:
        axis = _unit(surface.axis)
        across = across - axis.dot(across) * axis
    normal = side * across / length
    return side * (sympy.expand(across.dot(across)) - length**2) / (2 * length), normal, -reach * normal


def _from_curve(across: Three, surface: ContactSurface) -> tuple[Scalar, Three]:
    """The distance from a curve, exact where it vanishes to the first order, and the normal there."""
    import sympy

    assert surface.curve is not None and surface.start is not None
    e = _unit(surface.start)
    angle = sympy.atan2(e[0] * across[1] - e[1] * across[0], e.dot(across))
    rho = sympy.sqrt(across.dot(across))
    slope = surface.curve(angle, 1) / rho
    root = sympy.sqrt(1 + slope**2)
    normal = (across - slope * _vector((-across[1], across[0], 0))) / (rho * root)
    return (rho - surface.curve(angle)) / root, normal


def _carried(body: Body, vector: Three, where: str) -> Three:
    """The velocity of the end of a vector that a body carries along, less that of its beginning."""
    if all(x == 0 for x in vector):
        return 0 * vector
    directions = body.frame.directions[:3]
    if len(directions) < 2:
        raise ModelError(f"{where}: body {body.name} has no directions with which it turns; give it another point, or vectors")
    base, rates = ([_symbols(d, rate) for d in directions] for rate in (False, True))
    axes = [d.given for d in directions]
    if len(base) == 2:
        rates.append(rates[0].cross(base[1]) + base[0].cross(rates[1]))
        base.append(base[0].cross(base[1]))
        axes.append(measures.cross(*axes))
    dual = measures.reciprocal(axes)
    inverse = _without_rounding([[measures.dot(a, b) for b in dual] for a in dual])
    along = [vector.dot(each) for each in base]
    shares = [sum(w * x for w, x in zip(row, along, strict=True)) for row in inverse]
    turned = 0 * vector
    for coefficient, rate in zip(shares, rates, strict=True):
        turned += coefficient * rate
    return turned


def _without_rounding(matrix: list[list[Scalar]]) -> list[list[Scalar]]:
    """Entries that are zero but for rounding as zeros."""
    largest = max((abs(float(x)) for row in matrix for x in row if is_number(x)), default=0.0)
    return [[0 if is_number(x) and abs(x) < ROUNDING * largest else x for x in row] for row in matrix]


def _tangents(normal: Three, surface: ContactSurface, initial: dict[str, float]) -> list[Three]:
    """Two unit vectors across the normal: of a cylinder along its axis and about it, else those of the initial position, turned along with
    the normal by the shortest way."""
    if surface.axis is not None:
        axis = _unit(surface.axis)
        return [axis, normal.cross(axis)]
    first = arithmetic.unit([float(as_sympy(x).subs({s: initial[s.name] for s in x.free_symbols})) for x in normal])
    one = arithmetic.across(first)
    start, tangents = _vector(first), []
    for each in (one, np.cross(first, one)):
        tangent = _vector([0.0 if abs(x) < ROUNDING else float(x) for x in each])
        tangents.append(tangent - (normal + start) * normal.dot(tangent) / (1 + normal.dot(start)) if normal.free_symbols else tangent)
    return tangents


def _position(point: Point) -> Three:
    return _symbols(as_combination(point))


def _velocity(point: Point) -> Three:
    return _symbols(as_combination(point), rate=True)


def _unit(direction: Direction) -> Three:
    combination = as_combination(direction)
    return _symbols(combination) / measures.length(combination)


def _symbols(direction: Combination, rate: bool = False) -> Three:
    """A combination, or its velocity, with numbers for what is fixed."""
    return _vector(
        [
            sum((_component(e.components[k], rate) if w == 1.0 else w * _component(e.components[k], rate)) for w, e in direction.terms)
            for k in range(3)
        ]
    )


def _component(component: Component, rate: bool) -> Scalar:
    if component.fixed:
        return 0 if rate else as_sympy(component.value) or 0
    return component.rate if rate else component.symbol


def _vector(values: object) -> Three:
    import sympy

    return sympy.Matrix(list(values))  # type: ignore[call-overload]
