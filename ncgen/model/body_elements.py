"""Elements of bodies: points and vectors that move together, and directions that bodies have."""

from __future__ import annotations

import numpy as np

from ncgen.errors import ModelError
from ncgen.model import arithmetic, measures
from ncgen.model import rows as row
from ncgen.model.bodies import Body, check_moments
from ncgen.model.elements import Combination, Constant, Point, Spatial, Vector, as_combination
from ncgen.model.facts import fact
from ncgen.model.measures import Scalars
from ncgen.model.own_constraints import OwnConstraints
from ncgen.model.rigid import include
from ncgen.model.rows import Owner, Row
from ncgen.model.values import Values, is_number

WEIGHT_ROUNDING = 1e-14
"""A part of a direction below this fraction of it is rounding."""


class BodyElements(OwnConstraints):
    """The part of a model that gives elements to bodies."""

    @fact
    def extend(self, body: Body, *elements: Spatial) -> None:
        """Add points and vectors to a body, with the constraints that keep them in place.

        Parameters
        ----------
        body : Body
            The body; the ground takes what is fixed.
        *elements : Point or Vector
            What moves with it.
        """
        new = [e for e in dict.fromkeys(elements) if e not in body.elements]
        if body is self.ground:
            loose = [e for e in new if not e.fixed]
            if loose:
                raise ModelError(f"ground: {loose[0]!r} can move; make it fixed, or give it to a body")
        body.points += [e for e in new if isinstance(e, Point)]
        body.vectors += [e for e in new if isinstance(e, Vector)]
        if any(isinstance(e, Point) for e in new):
            check_moments(body)  # vectors come with joints, too; what could turn with them alone has no inertia, which a run refuses
        if body.rigid and new:
            self.rows += include(body.frame, new, self._related, self.parameters, self.scale, self.extent())
            if body.constant_mass:
                self._complete(body)
            if body.frame.resting is not None:
                self._rest(body)

    @fact
    def attach_point(self, body: Body, name: str, position: Values) -> Point:
        """Add a new point to a body, such as where a spring is fixed.

        Parameters
        ----------
        body : Body
            The body; on the ground the point is fixed.
        name : str
            Name of the point.
        position : sequence of float or expression of parameters, shape (3,) or (2,)
            Initial position in m.

        Returns
        -------
        Point
            The point.
        """
        point = self.point(name, position, fixed=True if body is self.ground else "z" if body.frame.planar else False)
        self.extend(body, point)
        return point

    @fact
    def attach_vector(self, body: Body, name: str, direction: Values) -> Vector:
        """Add a new unit vector to a body.

        Parameters
        ----------
        body : Body
            The body; on the ground the vector is fixed.
        name : str
            Name of the vector.
        direction : sequence of float or expression of parameters, shape (3,) or (2,)
            Initial direction.

        Returns
        -------
        Vector
            The vector.
        """
        vector = self.vector(name, direction, fixed=body is self.ground)
        self.extend(body, vector)
        return vector

    def _directions_across(self, body: Body, axis: Combination) -> tuple[Combination, Combination]:
        """Two directions of a body that are perpendicular to an axis and to each other in the initial position: combinations of its base
        where that has three directions that are numbers, otherwise vectors of the body, those that it has or new ones."""
        e = arithmetic.unit(axis.initial)
        helper = np.eye(3)[np.argmin(np.abs(e))]
        if axis.is_parametric:
            e = measures.unit(axis.given)
            first = measures.unit(measures.cross(e, helper))
            second = measures.cross(e, first)
        else:
            first = arithmetic.unit(arithmetic.cross(e, helper))
            second = arithmetic.cross(e, first)
        return self.direction_of(body, first, "across1"), self.direction_of(body, second, "across2")

    def direction_of(self, body: Body, direction: Scalars, wish: str) -> Combination:
        """Return a direction that moves with a body.

        Parameters
        ----------
        body : Body
            The body.
        direction : sequence of float or expression of parameters, shape (3,)
            The direction in the initial position.
        wish : str
            How a new vector is called, if that name is free.

        Returns
        -------
        Combination
            The direction.
        """
        numbers = self._numbers(direction)
        if body is self.ground:
            return as_combination(Constant.of(wish, direction, numbers))
        if body.frame.planar and abs(numbers[2]) < 1e-12:
            return as_combination(self._vector_in_plane(body, direction, wish))
        if len(body.frame.directions) < 3 or body.frame.is_parametric or not all(map(is_number, direction)):
            same = next((v for v in body.vectors if v.given == tuple(direction)), None)
            return as_combination(same or self.attach_vector(body, self.free_name(f"{body.name}.{wish}"), direction))
        base = body.frame.matrix().T
        for known, initial in zip(body.frame.directions, base, strict=True):
            if np.array_equal(initial, numbers):
                return known * 1.0
        sizes = WEIGHT_ROUNDING * arithmetic.norm(numbers) / np.linalg.norm(base, axis=1)
        weights = zip(arithmetic.weights(base, numbers), body.frame.directions, sizes, strict=True)
        parts = [other * weight for weight, other, size in weights if abs(weight) > size]
        return sum(parts[1:], parts[0])

    def _vector_in_plane(self, body: Body, direction: Scalars, wish: str) -> Vector:
        """A new unit vector of the plane, of a body; wish: how it is called, if that name is free."""
        vector = self.vector(self.free_name(f"{body.name}.{wish}"), (direction[0], direction[1], 0.0), fixed="z")
        self.extend(body, vector)
        return vector

    def _rest(self, body: Body) -> None:
        """Rows that keep a body where it stands: its origin, and three components of the first two directions of its base."""
        frame, owner = body.frame, Owner("joint", f"rigid {body.name}-{self.ground.name}", (body.name, self.ground.name), "rigid")
        made: list[Row] = []
        if frame.resting == 0 and frame.origin is not None and not all(c.fixed for c in frame.origin.components):
            rest_point = self.point(self.free_name(f"{body.name}.rest"), frame.origin.given, fixed=True)
            self.extend(self.ground, rest_point)
            offset = frame.origin - rest_point
            made = row.affine(offset, offset, offset, 0.0, offset, owner, f"rest of {frame.origin.name}")
        for number in range(frame.resting or 0, min(len(frame.directions), 2)):
            direction = frame.directions[number]
            if number == 0:
                across = self._directions_across(self.ground, direction)
            else:
                normal = measures.cross(frame.directions[0].given, direction.given)
                across = [as_combination(Constant.of("across", measures.unit(normal), self._numbers(measures.unit(normal))))]
            made += [row.dot(direction, n, 0.0, arithmetic.norm(direction.initial), owner, f"rest {direction}", self.scale) for n in across]
        frame.resting = max(1, len(frame.directions))
        self.rows += [new.as_measured() for new in made if not row.is_trivial(new)]

    def _complete(self, body: Body) -> None:
        """An auxiliary unit vector that completes a body's base of two directions to three."""
        if len(body.frame.directions) != 2 or body.frame.planar:
            return
        if body.frame.is_parametric:
            direction = measures.cross(*body.frame.given)
            size = measures.norm(direction)
        else:
            direction = arithmetic.cross(*body.frame.matrix().T)
            size = arithmetic.norm(direction)
        self.attach_vector(body, f"{body.name}.aux", tuple(x / size for x in direction))
