"""Joints between two bodies.

In natural coordinates most joints are shared elements: a revolute joint is a point and a vector that belong to
both bodies. These methods share what can be shared and add rows only for the rest (natural coordinates, 2.10).
`m.ground` is the body that does not move.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ncgen.errors import ModelError, shown
from ncgen.model import arithmetic, measures
from ncgen.model import rows as row
from ncgen.model.bodies import Body, BodyFrame
from ncgen.model.elements import AXES, Angle, Combination, Constant, Direction, Length, Point, Relative, Spatial, Vector, as_combination
from ncgen.model.facts import fact
from ncgen.model.rows import Owner, Row
from ncgen.model.structure import Structure
from ncgen.model.value_conditions import UNIT_LENGTH, Bound
from ncgen.model.values import Scalar, Value, Values, as_sympy, is_number

if TYPE_CHECKING:
    import sympy

MIN_TILT = 1e-6
"""A disc whose axle is nearer than this (sine of the angle) to the normal of the plane lies flat."""


CLOSINGS = ("weld", "hinge", "ball", "point")
"""How two frames can meet."""

WELD = [(np.eye(3)[i], np.eye(3)[j]) for i, j in ((0, 1), (1, 2), (2, 0))]
"""Directions of two frames that are perpendicular to each other where the frames are parallel."""


class _End(NamedTuple):
    """Where a loop is closed: a point of a body, and the axes of a frame there as columns (3, 3)."""

    body: Body
    point: Point
    rotation: np.ndarray


def _hinge(axis: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
    """An axis of one frame, and the two directions of the other that it stays perpendicular to."""
    along = arithmetic.unit(axis)
    first = arithmetic.across(along)
    return [(along, first), (along, np.cross(along, first))]


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
        size = measures.natural_length(segment, self.extent())
        return self._keep(row.dot(segment, as_combination(normal), height, size, owner, f"{point.name} in plane", self.scale))

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
        for what, radius in (("radius_first", radius_first), ("radius_second", radius_second)):
            self._check_radius(f"gear {first.name}, {second.name}: {what}", radius)
        balance = radius_first * first.symbol + radius_second * second.symbol
        start = radius_first * first.given[0] + radius_second * second.given[0]
        return self._turn_together("gear", first, second, balance - start)

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
            self.constrain_velocity(sympy.Matrix(_clean(tangent)).dot(slip), f"no slip of {disc.name}", owner)

    def close(
        self,
        frame_a: Point | BodyFrame | str,
        frame_b: Point | BodyFrame | str,
        kind: str,
        *,
        axis: Sequence[float] = (0.0, 0.0, 1.0),
        name: str = "",
    ) -> None:
        """Close a loop: two frames meet from now on.

        A robot is assembled at once, before anything is added to its model: elements taken from it before are no longer its own, and
        `assembled` lists what moved. Other models begin as they were drawn, and are assembled when they run.

        Parameters
        ----------
        frame_a, frame_b : Point, BodyFrame or str
            Names of frames of a robot's file (`frames`); in other models frames of bodies, or points.
        kind : str
            "weld" (the frames coincide), "hinge" (their origins and the axis do), "ball" or "point" (their origins do).
        axis : sequence of float, shape (3,)
            Of a hinge, the same in both frames.
        name : str
            Name of the joint in messages. Default: the names of both ends.

        Raises
        ------
        ModelError
            For a loop that cannot close, with its gap, and for one that changes nothing.
        """
        if kind not in CLOSINGS:
            raise ModelError(f"close: the kind {shown(kind)} is not known; give {', '.join(CLOSINGS)}")
        ends = frame_a, frame_b
        label = name or "-".join(end.body if isinstance(end, BodyFrame) else getattr(end, "name", str(end)) for end in ends)
        if not arithmetic.norm(np.asarray(axis, dtype=float)) > 0:
            raise ModelError(f"close {label}: its axis is {shown(axis)}; give a direction of three numbers")
        if self.closing is not None:
            vars(self).update(vars(self.closing(self, ends, kind, axis, label)))
            return
        a, b = (self._end(end, label, kind) for end in ends)
        if a.body is b.body or a.point is b.point:
            raise ModelError(f"close {label}: both ends belong to one body, so it changes nothing; leave it out")
        owner, planar = Owner("joint", f"close {label}", (a.body.name, b.body.name), kind), any(e.body.frame.planar for e in (a, b))
        for k in range(2 if planar else 3):
            self.constrain(a.point.components[k].symbol - b.point.components[k].symbol, f"{label}.{AXES[k]}", owner)
        turns = {"hinge": [] if planar else _hinge(np.asarray(axis, dtype=float)), "weld": WELD[:1] if planar else WELD}.get(kind, [])
        for first, second in turns:
            one, other = (self._along(e, d) for e, d in ((a, first), (b, second)))
            self.constrain(sum(x * y for x, y in zip(one, other, strict=True)), f"{label}, directions", owner)

    # -- helpers -------------------------------------------------------------------------------

    def _end(self, end: Point | BodyFrame | str, label: str, kind: str) -> _End:
        """A body, its point and its rotation where a loop is closed."""
        frame = self.frames.get(end) if isinstance(end, str) else end
        if isinstance(frame, Point):
            body = next((body for body in (*self.bodies.values(), self.ground) if frame in body.points), None)
            if body is None and frame.fixed:
                body = self.ground
            if body is None or kind not in ("ball", "point"):
                raise ModelError(f"close {label}: point {frame.name} {'has no axes' if body else 'is on no body'}; give a BodyFrame")
            return _End(body, frame, np.eye(3))
        body = None if frame is None else self.ground if frame.body == self.ground.name else self.bodies.get(frame.body)
        if frame is None or body is None:
            raise ModelError(f"close {label}: {shown(end)} is no frame of a body; give a point, or BodyFrame(body, rotation, position)")
        point = self.attach_point(body, self.free_name(f"{body.name}.closing"), np.asarray(frame.position, dtype=float).tolist())
        return _End(body, point, np.asarray(frame.rotation, dtype=float))

    def _along(self, end: _End, direction: np.ndarray) -> list[Scalar]:
        """The components of a direction of an end's frame that moves with its body."""
        now = _clean(end.rotation @ direction)
        if end.body is self.ground:
            return [as_sympy(x) for x in now]
        terms = self.direction_of(end.body, now, "across").terms
        return [sum(as_sympy(weight) * element.components[k].symbol for weight, element in terms) for k in range(3)]

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

    @staticmethod
    def _check_kept(body: Body) -> None:
        if not body.rigid:
            raise ModelError(f"rigid: body {body.name} has rows of its own (rigid=False); write those of the weld, too")

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
        if first is second:
            raise ModelError(f"{kind}: {first!r} is tied to itself; give two coordinates")
        owner = Owner("joint", f"{kind} {first.name}-{second.name}", joint=kind)
        return self.constrain(balance, f"{kind} {first.name}, {second.name}", owner)

    def _share(self, a: Body, b: Body, *elements: Spatial) -> None:
        if a is b:
            raise ModelError(f"joint: body {a.name} is joined to itself; give two bodies")
        self.extend(a, *elements)
        self.extend(b, *elements)

    def _on_line(self, a: Body, point: Point, start: Point, axis: Vector, owner: Owner) -> None:
        segment = as_combination(point) - start
        size = measures.natural_length(segment, self.extent())
        for across in self.directions_across(a, as_combination(axis)):
            new = row.dot(segment, across, 0.0, size, owner, f"{point.name} on {axis.name}", self.scale)
            if not row.is_trivial(new):
                self._keep(new)

    def _transverse(self, a: Body, b: Body, axis: Vector) -> tuple[Combination, Combination]:
        """A direction of a and one of b, perpendicular to the axis and to each other in the initial position."""
        first, _ = self.directions_across(a, as_combination(axis))
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


def _height(normal: Values, centre: Point) -> Scalar:
    if centre.is_parametric:
        return measures.dot(map(as_sympy, normal), centre.given)
    return arithmetic.dot(np.asarray(normal, dtype=float), centre.initial)


def _steepness(normal: Values, axle: Vector) -> Scalar:
    """The sine of the angle between a disc's axle and the normal of the plane."""
    if axle.is_parametric:
        return measures.norm(measures.cross([as_sympy(x) for x in normal], axle.given))
    return math.sqrt(1 - arithmetic.dot(np.asarray(normal, dtype=float), axle.initial) ** 2)


def _clean(vector: np.ndarray) -> list[float]:
    return [0.0 if abs(x) < 1e-15 else float(x) for x in vector]
