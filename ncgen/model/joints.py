"""Joints between two bodies.

In natural coordinates most joints are shared elements: a revolute joint is a point and a vector that belong to
both bodies. These methods share what can be shared and add rows only for the rest (natural coordinates, 2.10).
`m.ground` is the body that does not move.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ncgen.errors import ModelError
from ncgen.model import measures
from ncgen.model import rows as row
from ncgen.model.bodies import Body
from ncgen.model.elements import Angle, Combination, Constant, Direction, Length, Point, Spatial, Vector, as_combination
from ncgen.model.facts import fact
from ncgen.model.rows import Owner, Row
from ncgen.model.structure import Structure
from ncgen.model.values import Value, as_sympy

if TYPE_CHECKING:
    import sympy

MIN_TILT = 1e-6
"""A disc whose axle is nearer than this (sine of the angle) to the normal of the plane lies flat."""


class Joints(Structure):
    """The part of a model that connects bodies."""

    @fact
    def spherical(self, a: Body, b: Body, point: Point) -> None:
        """Join two bodies by a ball joint: the point belongs to both. 3 degrees of freedom.

        Parameters
        ----------
        a, b : Body
            The bodies, of which one may be the ground.
        point : Point
            The centre of the joint.
        """
        self._share(a, b, point)

    @fact
    def revolute(self, a: Body, b: Body, point: Point, axis: Vector) -> None:
        """Join two bodies by a hinge: point and axis belong to both. 1 degree of freedom.

        Parameters
        ----------
        a, b : Body
            The bodies, of which one may be the ground.
        point : Point
            A point of the hinge.
        axis : Vector
            Its axis.
        """
        self._share(a, b, point, axis)

    @fact
    def universal(self, a: Body, b: Body, point: Point, u: Vector, v: Vector) -> Row:
        """Join two bodies by a Cardan joint: a shared point, and a constant angle between two axes. 2 degrees of freedom.

        Parameters
        ----------
        a, b : Body
            The bodies, of which one may be the ground.
        point : Point
            The centre of the joint.
        u, v : Vector
            The axis in a, and that in b.

        Returns
        -------
        Row
            The constraint of the axes.
        """
        self._share(a, b, point)
        self.extend(a, u)
        self.extend(b, v)
        owner, numeric = _joint("universal", a, b), measures.cosine_of(u.initial, v.initial)
        return self._keep(row.vector_vector(u, v, measures.cosine(as_combination(u), as_combination(v)), owner, numeric, self.scale))

    @fact
    def cylindrical(self, a: Body, b: Body, start: Point, end: Point, axis: Vector) -> None:
        """Let a body slide along an axis of another and turn about it. 2 degrees of freedom.

        Parameters
        ----------
        a, b : Body
            The bodies, of which one may be the ground; b slides on a.
        start, end : Point
            A point of a, and a point of b, both on the axis.
        axis : Vector
            The axis.
        """
        self._share(a, b, axis)
        self.extend(b, end)
        self._on_line(a, end, start, axis, _joint("cylindrical", a, b))

    @fact
    def prismatic(self, a: Body, b: Body, start: Point, end: Point, axis: Vector) -> None:
        """Let a body slide along an axis of another without turning. 1 degree of freedom.

        Parameters
        ----------
        a, b : Body
            The bodies, of which one may be the ground; b slides on a.
        start, end : Point
            A point of a, and a point of b, both on the axis.
        axis : Vector
            The axis.
        """
        self.cylindrical(a, b, start, end, axis)
        if not (a.frame.planar or b.frame.planar):
            first, second = self._transverse(a, b, axis)
            self._keep(row.dot(first, second, 0.0, 1.0, _joint("prismatic", a, b), f"no turning about {axis.name}", self.scale))

    @fact
    def slider(self, a: Body, b: Body, start: Point, end: Point, axis: Direction) -> None:
        """Let a body slide along an axis of another without turning, with few constraints in the plane. 1 degree of freedom.

        In the plane it adds 2 constraint equations, and 1 where b is a single point, such as a pin in a slot; no vector is added to a body.
        In space it is a prismatic joint, whose axis is a vector of both bodies.

        Parameters
        ----------
        a, b : Body
            The bodies, of which one may be the ground; b slides on a.
        start, end : Point
            A point of a, and a point of b, both on the axis.
        axis : Direction
            A vector of a, or in the plane a segment of it such as `T - P`.
        """
        if not all(body is self.ground or self._is_plane(body) for body in (a, b)):
            self.prismatic(a, b, start, end, _vector_of(axis, f"slider {a.name}-{b.name}"))
            return
        if a is b:
            raise ModelError(f"joint: body {a.name} is joined to itself; give two bodies")
        self.extend(a, start)
        self.extend(b, end)
        owner, along = _joint("slider", a, b), self._direction(axis, f"slider {a.name}-{b.name}")
        self.constrain(_turned(along, as_combination(end) - start)[1], f"{end.name} on the line of {a.name}", owner)
        segments = [as_combination(point) - b.points[0] for point in b.points[1:]]
        others = (
            [*segments, *map(as_combination, b.vectors)] if b is not self.ground else [as_combination(Constant.of("x", (1.0, 0.0, 0.0)))]
        )
        if inclined := [
            other for other in others if np.linalg.norm(other.initial[:2]) > MIN_TILT * max(1.0, np.linalg.norm(other.initial))
        ]:
            cosine, sine = _turned(along, inclined[0])
            now = _turned(along, inclined[0], at_start=True)
            turning, start_value = (sine, now[1]) if abs(self._number(now[1], "")) <= abs(self._number(now[0], "")) else (cosine, now[0])
            self.constrain(turning - start_value, f"no turning of {b.name} on {a.name}", owner)

    @staticmethod
    def _is_plane(body: Body) -> bool:
        """Whether all elements of a body stay in the plane z = 0, a single point as well."""
        return body.frame.planar or all(element.components[2].fixed for element in body.elements)

    @fact
    def planar(self, a: Body, b: Body, start: Point, end: Point, normal: Vector) -> None:
        """Let a body move in a plane of another. 3 degrees of freedom.

        Parameters
        ----------
        a, b : Body
            The bodies, of which one may be the ground; b moves on a.
        start, end : Point
            A point of a, and a point of b, both in the plane.
        normal : Vector
            The normal of the plane.
        """
        self._share(a, b, normal)
        self.extend(b, end)
        self.point_in_plane(a, end, start, normal, owner=_joint("planar", a, b))

    @fact
    def screw(self, a: Body, b: Body, start: Point, end: Point, axis: Vector, pitch: Value, name: str) -> tuple[Angle, Length]:
        """Join two bodies by a screw: turning and sliding go together. 1 degree of freedom.

        Parameters
        ----------
        a, b : Body
            The bodies, of which one may be the ground; b moves on a.
        start, end : Point
            A point of a, and a point of b, both on the axis.
        axis : Vector
            The axis.
        pitch : float or expression of parameters
            In m per turn.
        name : str
            Name of the joint; its coordinates are `name.angle` and `name.slide`.

        Returns
        -------
        tuple of Angle and Length
            The two coordinates.
        """
        self.cylindrical(a, b, start, end, axis)
        first, second = self._transverse(a, b, axis)
        psi = self.angle(f"{name}.angle", first, second, axis)
        s = self.slide(f"{name}.slide", start, end, axis)
        turned = (psi.symbol - psi.given[0]) * as_sympy(pitch) / (2 * np.pi)
        self.constrain(s.symbol - s.given[0] - turned, f"screw {name}", _joint("screw", a, b))
        return psi, s

    @fact
    def rigid(self, a: Body, b: Body) -> None:
        """Weld a body to another: its elements belong to both, and on the ground they rest. No degree of freedom.

        Parameters
        ----------
        a, b : Body
            The bodies, of which one may be the ground.

        Raises
        ------
        ModelError
            For a body with rigid=False.
        """
        if a is b:
            raise ModelError(f"rigid: body {a.name} is welded to itself; give two bodies")
        if self.ground in (a, b):
            body = b if a is self.ground else a
            self._check_kept(body)
            body.frame.resting = 0
            self._rest(body)
        else:
            kept, other = (a, b) if a.rigid else (b, a)
            self._check_kept(kept)
            self.extend(kept, *other.elements)

    @fact
    def point_on_line(self, a: Body, point: Point, start: Point, axis: Direction) -> None:
        """Keep a point on a line of a body. 2 constraint equations, 1 in the plane.

        Parameters
        ----------
        a : Body
            The body.
        point : Point
            The point.
        start : Point
            A point of the line.
        axis : Direction
            Its direction: a vector, or in the plane a segment of a such as `T - P`.
        """
        owner = Owner("joint", f"{point.name} on line of {a.name}", (a.name,), "point_on_line")
        if self._is_plane(a) and _single(axis) is None:
            self.extend(a, start)
            along = self._direction(axis, str(owner))
            self.constrain(_turned(along, as_combination(point) - start)[1], f"{point.name} on {along}", owner)
            return
        vector = _vector_of(axis, str(owner))
        self.extend(a, start, vector)
        self._on_line(a, point, start, vector, owner)

    @fact
    def point_in_plane(self, a: Body, point: Point, start: Point, normal: Vector, owner: Owner | None = None) -> Row:
        """Keep a point in a plane of a body. 1 constraint equation.

        Parameters
        ----------
        a : Body
            The body.
        point : Point
            The point.
        start : Point
            A point of the plane.
        normal : Vector
            Its normal.
        owner : Owner, optional
            What the constraint belongs to. Default: the joint itself.

        Returns
        -------
        Row
            The constraint.
        """
        self.extend(a, start, normal)
        owner = owner or Owner("joint", f"{point.name} in plane of {a.name}", (a.name,), "point_in_plane")
        segment = as_combination(point) - start
        height = measures.along(segment, as_combination(normal))
        return self._keep(row.in_plane(segment, as_combination(normal), height, self.extent(), owner, f"{point.name} in plane", self.scale))

    # -- helpers -------------------------------------------------------------------------------

    @staticmethod
    def _check_kept(body: Body) -> None:
        if not body.rigid:
            raise ModelError(f"rigid: body {body.name} has constraints of its own (rigid=False); write those of the weld, too")

    def _share(self, a: Body, b: Body, *elements: Spatial) -> None:
        if a is b:
            raise ModelError(f"joint: body {a.name} is joined to itself; give two bodies")
        self.extend(a, *elements)
        self.extend(b, *elements)

    def _on_line(self, a: Body, point: Point, start: Point, axis: Vector, owner: Owner) -> None:
        segment = as_combination(point) - start
        for across in self._directions_across(a, as_combination(axis)):
            new = row.in_plane(segment, across, 0.0, self.extent(), owner, f"{point.name} on {axis.name}", self.scale)
            if not row.is_trivial(new):
                self._keep(new)

    def _transverse(self, a: Body, b: Body, axis: Vector) -> tuple[Combination, Combination]:
        """A direction of a and one of b, perpendicular to the axis and to each other in the initial position."""
        first, _ = self._directions_across(a, as_combination(axis))
        parametric = axis.is_parametric or first.is_parametric
        across = measures.cross(axis.given, first.given) if parametric else np.cross(axis.initial, first.initial)
        second = self.direction_of(b, across, "across")
        return first, second


def _joint(kind: str, a: Body, b: Body) -> Owner:
    return Owner("joint", f"{kind} {a.name}-{b.name}", (a.name, b.name), kind)


def _single(axis: Direction) -> Vector | None:
    """The vector that a direction is, None for a segment."""
    if isinstance(axis, Combination):
        axis = axis.terms[0][1] if len(axis.terms) == 1 and axis.terms[0][0] == 1 else axis
    return axis if isinstance(axis, Vector) else None


def _vector_of(axis: Direction, where: str) -> Vector:
    if (vector := _single(axis)) is None:
        raise ModelError(f"{where}: {axis} is no vector; in space give a unit vector as the axis")
    return vector


def _turned(a: Combination, b: Combination, at_start: bool = False) -> tuple[sympy.Expr, sympy.Expr]:
    """|a| |b| times the cosine and the sine of the angle from a to b in the plane, in the coordinates or in the initial position."""

    def parts(each: Combination) -> list[Any]:
        if at_start:
            return [as_sympy(value) for value in each.given[:2]]
        return [sum(as_sympy(weight) * element.components[k].symbol for weight, element in each.terms) for k in range(2)]

    (ax, ay), (bx, by) = parts(a), parts(b)
    return ax * bx + ay * by, ax * by - ay * bx
