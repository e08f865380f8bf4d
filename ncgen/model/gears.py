"""Declaring gears, racks and rolling discs: joints whose motions depend on each other."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from ncgen.errors import ModelError, shown
from ncgen.model import arithmetic, measures
from ncgen.model import rows as row
from ncgen.model.bodies import Body
from ncgen.model.elements import Point, Relative, Vector
from ncgen.model.facts import fact
from ncgen.model.joints import MIN_TILT, Joints
from ncgen.model.own_constraints import USER
from ncgen.model.rows import Owner, Row
from ncgen.model.value_conditions import UNIT_LENGTH, Bound
from ncgen.model.values import Scalar, Value, Values, as_sympy, is_number

if TYPE_CHECKING:
    import sympy


class Gears(Joints):
    """The part of a model that couples motions."""

    @fact
    def gear(self, first: Relative, second: Relative, radius_first: Value, radius_second: Value) -> Row:
        """Let two angles turn together: radius_first·ψ1 + radius_second·ψ2 stays constant.

        `run.reactions()` has the tooth force where both angles are between a carrier and a wheel.

        Parameters
        ----------
        first, second : Relative
            The angles ψ1 and ψ2.
        radius_first, radius_second : float or expression of parameters
            Radii in m; of opposite sign where both turn in the same sense.

        Returns
        -------
        Row
            The constraint.

        Raises
        ------
        ModelError
            For a radius of 0.
        """
        for argument, radius in (("radius_first", radius_first), ("radius_second", radius_second)):
            self._check_radius(f"gear {first.name}, {second.name}: {argument}", radius)
        balance = radius_first * first.symbol + radius_second * second.symbol
        start = radius_first * first.given[0] + radius_second * second.given[0]
        return self._turn_together("gear", first, second, balance - start)

    @fact
    def follow(self, coordinate: Relative, other: Relative, ratio: Value, offset: Value = 0.0) -> Row:
        """Let an angle or a displacement follow another one: coordinate = ratio·other + offset, as the mimic of a robot's file does.

        Parameters
        ----------
        coordinate, other : Relative
            The one that follows, and the one that leads.
        ratio : float or expression of parameters
            How much faster the first one is.
        offset : float or expression of parameters
            What it is, in rad or m, where the other is 0.

        Returns
        -------
        Row
            The constraint.
        """
        label = f"{coordinate.name} follows {other.name}"
        _check_two(label, coordinate, other)
        for argument, value in (("ratio", ratio), ("offset", offset)):
            self._number(value, f"{label}: {argument}")
        return self._keep(row.follow(coordinate, other, ratio, offset, USER))

    @fact
    def rack(self, slide: Relative, angle: Relative, radius: Value) -> Row:
        """Let a pinion drive a rack: slide − radius·angle stays constant.

        `run.reactions()` has the tooth force where one body carries both: the angle is between it and the pinion, the slide between it and
        the rack.

        Parameters
        ----------
        slide : Relative
            Displacement of the rack.
        angle : Relative
            Angle of the pinion.
        radius : float or expression of parameters
            Radius of the pinion in m.

        Returns
        -------
        Row
            The constraint.

        Raises
        ------
        ModelError
            For a radius of 0.
        """
        self._check_radius(f"rack {slide.name}, {angle.name}: radius", radius)
        balance = slide.symbol - as_sympy(radius) * angle.symbol
        start = slide.given[0] - as_sympy(radius) * angle.given[0]
        return self._turn_together("rack", slide, angle, balance - start)

    @fact
    def rolling(self, disc: Body, centre: Point, axle: Vector, across: Vector, radius: Value, normal: Values = (0.0, 0.0, 1.0)) -> None:
        """Let a thin disc roll without slipping on the fixed plane through its contact in the initial position.

        One constraint keeps the rim on the plane, two constraints of velocities keep the contact point of the disc at rest: ṙ + ω × ρ = 0
        with ρ = −R (n − (n·u) u)/|…|.

        Parameters
        ----------
        disc : Body
            The disc.
        centre : Point
            Its centre.
        axle, across : Vector
            Its axis, and a unit vector of the disc perpendicular to it.
        radius : float or expression of parameters
            Radius in m.
        normal : sequence of float, shape (3,)
            Normal of the plane, towards the disc.

        Raises
        ------
        ModelError
            For a disc that lies flat, and for vectors that are not perpendicular.
        """
        import sympy

        self._check_rolling(disc, axle, across, radius, normal)
        self.extend(disc, centre, axle, across)
        owner = Owner("joint", f"rolling of {disc.name}", (self.ground.name, disc.name), "rolling")
        n = sympy.Matrix(normal)
        radius = as_sympy(radius)
        r, u, v = (sympy.Matrix([c.symbol for c in e.components]) for e in (centre, axle, across))
        dr, du, dv = (sympy.Matrix([0 if c.fixed else c.rate for c in e.components]) for e in (centre, axle, across))
        w, dw = u.cross(v), du.cross(v) + u.cross(dv)
        lean = n.dot(u)
        steep = sympy.sqrt(1 - lean**2)
        rho = -(n - lean * u) * (radius / steep)
        slip = dr + v.dot(rho) * dv + w.dot(rho) * dw
        start = _height(normal, centre) - radius * _steepness(normal, axle)
        self.constrain(n.dot(r) - radius * steep - start, f"contact of {disc.name}", owner)
        upright = np.asarray(normal)
        first = arithmetic.across(upright)
        for tangent in (first, np.cross(upright, first)):
            self.constrain_velocity(sympy.Matrix(arithmetic.without_rounding(tangent)).dot(slip), f"no slip of {disc.name}", owner)

    def _check_rolling(self, disc: Body, axle: Vector, across: Vector, radius: Value, normal: Values) -> None:
        where = f"rolling of {disc.name}"
        if len(normal) != 3 or not all(map(is_number, normal)) or abs(np.linalg.norm(np.asarray(normal)) - 1.0) > UNIT_LENGTH:
            raise ModelError(f"{where}: the normal of the plane is {shown(normal)}; give a unit vector of three numbers")
        self._require(Bound(wording=f"{where}: the radius is", value=radius, relation=">", unit="m", remedy="give a positive one"))
        if abs(axle.initial @ across.initial) > 1e-9:
            raise ModelError(f"{where}: {across.name} must be perpendicular to the axle {axle.name}")
        if np.linalg.norm(np.cross(np.asarray(normal), axle.initial)) < MIN_TILT:
            raise ModelError(
                f"{where}: the disc lies flat, its axle {axle.name} is along the normal; a rim has no lowest point then, tilt it"
            )

    def _check_radius(self, where: str, radius: Value) -> None:
        self._require(
            Bound(
                wording=f"{where} is",
                value=radius,
                relation="!=",
                unit="m",
                remedy="give another number, negative for teeth on the other side",
            )
        )

    def _turn_together(self, kind: str, first: Relative, second: Relative, balance: sympy.Expr) -> Row:
        _check_two(kind, first, second)
        owner = Owner("joint", f"{kind} {first.name}-{second.name}", joint=kind)
        return self.constrain(balance, f"{kind} {first.name}, {second.name}", owner)


def _check_two(where: str, first: Relative, second: Relative) -> None:
    if first is second:
        raise ModelError(f"{where}: {first!r} is tied to itself; give two coordinates")


def _height(normal: Values, centre: Point) -> Scalar:
    if centre.is_parametric:
        return measures.dot(map(as_sympy, normal), centre.given)
    return arithmetic.dot(np.asarray(normal, dtype=float), centre.initial)


def _steepness(normal: Values, axle: Vector) -> Scalar:
    """The sine of the angle between a disc's axle and the normal of the plane."""
    if axle.is_parametric:
        return measures.norm(measures.cross([as_sympy(x) for x in normal], axle.given))
    return math.sqrt(1 - arithmetic.dot(np.asarray(normal, dtype=float), axle.initial) ** 2)
