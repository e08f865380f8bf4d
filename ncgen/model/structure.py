"""Declaring bodies and constraint rows: what holds elements together."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ncgen.errors import ModelError
from ncgen.model import rows as row
from ncgen.model.bodies import Body, Inertia, check_basis, check_inertia
from ncgen.model.coordinates import check_name
from ncgen.model.elements import Combination, Component, Constant, Point, Relative, Spatial, Vector, as_combination
from ncgen.model.facts import fact
from ncgen.model.rigid import Frame, include
from ncgen.model.rows import Owner, Row
from ncgen.model.values import as_sympy, as_value, evaluate, is_number

USER = Owner("user", "model")


class Structure:
    """The part of a model that owns bodies and rows."""

    bodies: dict[str, Body]
    rows: list[Row]
    scale: bool

    @fact
    def body(
        self, name: str, points=(), vectors=(), mass=None, com=None, inertia=None, basis=None, *, rigid=True, constant_mass=False
    ) -> Body:
        """A rigid body.

        points, vectors: the elements that move with it
        mass: kg; None for a body without inertia
        com: centre of mass (m, global axes, initial position); default: the middle of the basis' points
        inertia: tensor about the centre of mass (kg m², global axes, initial position), 3×3, its diagonal, or one
            number for a flat body (the moment about z); default 0
        basis: the elements that carry the inertia (default: four independent ones if there are, else what there is)
        rigid: False if you write the rows that keep the body rigid yourself
        constant_mass: add an auxiliary unit vector where that makes the body's mass matrix constant

        Raises ModelError naming the body where its inertia is impossible or its elements are degenerate.
        """
        check_name(name, "body")
        if name in self.bodies:
            raise ModelError(f"body {name}: there is already a body of that name; choose another")
        body = Body(name, rigid=rigid, frame=Frame(Owner("body", name)))
        self.bodies[name] = body
        self.extend(body, *points, *vectors)
        if constant_mass:
            self._complete(body)
        if mass is not None:
            body.inertia = self._inertia(body, mass, com, inertia, basis)
        return body

    @fact
    def extend(self, body: Body, *elements: Spatial) -> None:
        """Add points and vectors to a body, with the rows that keep them in place."""
        new = [self._own(e, Spatial, f"body {body.name}") for e in elements]
        new = [e for e in dict.fromkeys(new) if e not in body.elements]
        if body is self.ground:
            loose = [e for e in new if not e.fixed]
            if loose:
                raise ModelError(f"ground: {loose[0]!r} can move; make it fixed, or give it to a body")
        body.points += [e for e in new if isinstance(e, Point)]
        body.vectors += [e for e in new if isinstance(e, Vector)]
        if body.rigid and new:
            self.rows += include(body.frame, new, self._related, self.scale)

    @fact
    def attach_point(self, body: Body, name: str, position) -> Point:
        """A new point of a body (m, initial position), such as where a spring is fixed; on the ground it is fixed."""
        point = self.point(name, position, fixed=True if body is self.ground else "z" if body.frame.planar else False)
        self.extend(body, point)
        return point

    @fact
    def attach_vector(self, body: Body, name: str, direction) -> Vector:
        """A new unit vector of a body (initial position)."""
        vector = self.vector(name, direction, fixed=body is self.ground)
        self.extend(body, vector)
        return vector

    @fact
    def distance(self, start: Point, end: Point, length=None, owner: Body | None = None) -> Row:
        """Row 1000: a constant distance (m; default: the one of the initial position); a massless rod, or your own row."""
        start, end = (self._own(p, Point, "distance") for p in (start, end))
        value = row.length(start - end) if length is None else as_value(length, f"distance {start.name}-{end.name}")
        number = evaluate(value, self.parameters, f"distance {start.name}-{end.name}")
        return self._keep(row.distance(start, end, value, _owner(owner), number, self.scale), length is None)

    @fact
    def unit(self, vector: Vector, owner: Body | None = None) -> Row:
        """Row 1001: a vector keeps its unit length."""
        return self._keep(row.unit(self._own(vector, Vector, "unit"), _owner(owner), self.scale))

    @fact
    def vector_segment(self, vector: Vector, segment, length=None, cosine=None, owner: Body | None = None) -> Row:
        """Row 1002: a constant angle between a unit vector and a segment of constant length."""
        vector = self._own(vector, Vector, "vector_segment")
        segment = self._direction(segment, f"angle {vector.name}")
        measured = length is None or cosine is None
        length = row.length(segment) if length is None else as_value(length, f"angle {vector.name}, {segment}")
        if is_number(length) and not length > 0:
            raise ModelError(f"angle {vector.name}, {segment}: the segment has length {length:g} m; give points that are apart")
        cosine = row.cosine(vector.initial, segment.initial) if cosine is None else as_value(cosine, f"angle {vector.name}, {segment}, cosine")
        return self._keep(row.vector_segment(vector, segment, length, cosine, _owner(owner), self.scale), measured)

    @fact
    def vector_vector(self, u: Vector, v: Vector, cosine=None, owner: Body | None = None) -> Row:
        """Row 1003: a constant angle between two unit vectors."""
        measured = cosine is None
        u, v = (self._own(w, Vector, "vector_vector") for w in (u, v))
        cosine = row.cosine(u.initial, v.initial) if cosine is None else as_value(cosine, f"angle {u.name}, {v.name}, cosine")
        return self._keep(row.vector_vector(u, v, cosine, _owner(owner), self.scale), measured)

    @fact
    def constrain(self, expression, label: str = "constraint", owner: Owner = USER) -> Row:
        """A constraint of your own: a sympy expression of coordinates, `m.time` and parameters that stays zero."""
        return self._keep(Row(owner, label, expression=as_sympy(expression), scaled=False))

    @fact
    def constrain_velocity(self, expression, label: str = "velocity constraint", owner: Owner = USER) -> Row:
        """A nonholonomic constraint: a sympy expression that is linear in rates (`q.rate`) and stays zero."""
        return self._keep(Row(owner, label, expression=as_sympy(expression), scaled=False, level="velocity"))

    @fact
    def drive(self, coordinate: Component | Relative, law) -> Row:
        """A rheonomic driver: coordinate = law(t), a sympy expression of `m.time` and parameters."""
        name = coordinate.name
        if not any(c is each for each in self.components for c in (coordinate, *getattr(coordinate, "components", ()))):
            raise ModelError(f"drive {name}: the coordinate belongs to another model; use this model's own")
        self.chosen_independent = tuple(n for n in self.chosen_independent if n != name)  # what is driven is not independent
        return self.constrain(coordinate.symbol - as_sympy(law), f"driver of {name}", Owner("driver", name))

    # -- helpers -------------------------------------------------------------------------------

    def _keep(self, new: Row, measured: bool = False) -> Row:
        self.rows.append(replace(new, measured=measured))
        return self.rows[-1]

    def _inertia(self, body: Body, mass, com, tensor, basis) -> Inertia:
        mass = as_value(mass, f"body {body.name}, mass")
        chosen = tuple(self._own(e, Spatial, f"body {body.name}") for e in basis) if basis is not None else None
        carriers = chosen or tuple(body.elements)
        points = [e.initial for e in carriers if isinstance(e, Point)]
        if not points:
            raise ModelError(f"body {body.name}: inertia needs at least one point; give it one")
        com = np.mean(points, axis=0) if com is None else np.asarray(com, dtype=float)
        if com.shape == (2,) and body.frame.planar:
            com = np.append(com, points[0][2])
        tensor = check_inertia(body.name, mass, com, np.zeros((3, 3)) if tensor is None else tensor)
        if chosen is not None:
            check_basis(body.name, chosen)
        return Inertia(mass, com, tensor, chosen)

    def _complete(self, body: Body) -> None:
        """An auxiliary unit vector that completes a body's base of two directions to three."""
        base = body.frame.matrix().T
        if len(base) != 2 or body.frame.planar:
            return
        direction = np.cross(*base)
        self.attach_vector(body, f"{body.name}.aux", direction / np.linalg.norm(direction))

    def directions_across(self, body: Body, axis: Combination) -> tuple[Combination, Combination]:
        """Two directions of a body that are perpendicular to an axis and to each other in the initial position.

        Written as combinations of the body's base where it has three directions, otherwise as new vectors.
        """
        e = axis.initial / np.linalg.norm(axis.initial)
        helper = np.eye(3)[np.argmin(np.abs(e))]
        first = np.cross(e, helper)
        first /= np.linalg.norm(first)
        return tuple(self.direction_of(body, d, f"across{k}") for k, d in enumerate((first, np.cross(e, first)), 1))

    def direction_of(self, body: Body, direction: np.ndarray, wish: str) -> Combination:
        """A direction that moves with a body, given in the initial position."""
        if body is self.ground:
            return as_combination(Constant.of(wish, direction))
        if body.frame.planar and abs(direction[2]) < 1e-12:
            return as_combination(self.attach_vector_in_plane(body, direction, wish))
        base = body.frame.matrix()
        if len(body.frame.directions) < 3:
            return as_combination(self.attach_vector(body, self._free_name(f"{body.name}.{wish}"), direction))
        weights = np.linalg.solve(base, direction)
        combination = None
        for weight, other in zip(weights, body.frame.directions, strict=True):
            if abs(weight) > 1e-14:
                combination = other * float(weight) if combination is None else combination + other * float(weight)
        return combination

    def attach_vector_in_plane(self, body: Body, direction: np.ndarray, wish: str) -> Vector:
        vector = self.vector(self._free_name(f"{body.name}.{wish}"), (direction[0], direction[1], 0.0), fixed="z")
        self.extend(body, vector)
        return vector

    def _free_name(self, wish: str) -> str:
        name, number = wish, 2
        while name in self.elements:
            name, number = f"{wish}_{number}", number + 1
        return name


def _owner(body: Body | None) -> Owner:
    return USER if body is None else Owner("body", body.name)
