"""Declaring bodies: elements that move together, with mass."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ncgen.errors import ModelError, shown
from ncgen.model import arithmetic, measures
from ncgen.model import rows as row
from ncgen.model.argument_readers import value
from ncgen.model.bodies import (
    WORDS_OF_INERTIA,
    Body,
    Inertia,
    check_basis,
    check_inertia,
    check_moments,
    check_pairs,
    rod_tensor,
    symmetric,
)
from ncgen.model.elements import Combination, Constant, Point, Spatial, Vector, as_combination
from ncgen.model.facts import fact
from ncgen.model.measures import Scalars
from ncgen.model.own_constraints import OwnConstraints
from ncgen.model.rigid import Frame, include
from ncgen.model.rows import Owner, Row
from ncgen.model.values import Scalar, Tensor, Value, Values, as_number_if_constant, as_sympy, is_number


class Structure(OwnConstraints):
    """The part of a model that owns bodies."""

    @fact
    def body(
        self,
        name: str,
        points: Sequence[Point] = (),
        vectors: Sequence[Vector] = (),
        mass: Value | None = None,
        com: Values | None = None,
        inertia: Tensor | None = None,
        basis: Sequence[Spatial] | None = None,
        *,
        rigid: bool = True,
        constant_mass: bool = False,
        as_given: bool = False,
    ) -> Body:
        """Add a rigid body.

        Parameters
        ----------
        name : str
            Name of the body.
        points, vectors : sequence of Point, sequence of Vector
            The elements that move with it.
        mass : float or expression of parameters, optional
            Mass in kg. Default: a body without inertia.
        com : sequence of float or expression of parameters, shape (3,) or (2,), optional
            Centre of mass in m, in global axes and the initial position. Default: the middle of the basis' points.
        inertia : float, array_like, shape (3,) or (3, 3), or str, optional
            Tensor about the centre of mass in kg m², in global axes and the initial position: all of it, its diagonal, or one number for a
            flat body (about z); "rod" for a uniform rod between the body's two points, "point" for all mass at the centre. Entries may be
            expressions of parameters. A body on a single point needs none.
        basis : sequence of Point and Vector, optional
            The elements that carry the inertia. Default: four independent ones if there are, else what there is.
        rigid : bool
            Whether ncgen adds the constraints that keep the body rigid; False if you add them.
        constant_mass : bool
            Whether to add an auxiliary unit vector where that makes the mass matrix constant.
        as_given : bool
            Whether to take moments of inertia that no body has, as robots' files may have them. A run warns of times at which the mass
            matrix is then not positive definite, and is refused at the start.

        Returns
        -------
        Body
            The body.

        Raises
        ------
        ModelError
            Where the inertia is impossible, or missing although the body can rotate, or where its elements are degenerate.
        """
        if name in self.bodies or name == self.ground.name:
            raise ModelError(f"body {name}: there is already a body of that name; choose another")
        body = Body(name=name, rigid=rigid, constant_mass=constant_mass, frame=Frame(owner=Owner("body", name)))
        self.bodies[name] = body
        self.extend(body, *points, *vectors)
        if mass is None and (com is not None or inertia is not None):
            raise ModelError(f"body {name}: it has a centre of mass or an inertia but no mass; give its mass")
        if mass is not None:
            body.inertia = self._inertia(body, mass, com, inertia, basis, as_given=as_given)
            check_moments(body)
        return body

    @fact
    def payload(
        self,
        body: Body,
        name: str,
        mass: Value,
        com: Values,
        inertia: Tensor = 0.0,
        basis: Sequence[Spatial] | None = None,
        *,
        as_given: bool = False,
    ) -> None:
        """Fix a mass to a body, such as a tool. It adds to what the body has.

        Parameters
        ----------
        body : Body
            The body.
        name : str
            Name in messages.
        mass : float or expression of parameters
            Mass in kg.
        com : sequence of float or expression of parameters, shape (3,) or (2,)
            Centre of mass in m, in global axes and the initial position.
        inertia : float or array_like, shape (3,) or (3, 3)
            Tensor about its centre in kg m², as of `body`.
        basis : sequence of Point and Vector, optional
            The elements that carry it, where the body has no inertia yet, as of `body`.
        as_given : bool
            As of `body`.

        Raises
        ------
        ModelError
            Where the inertia is impossible.
        """
        if body is self.ground:
            raise ModelError(f"payload {name}: the ground does not move; give a body")
        if isinstance(inertia, str):
            raise ModelError(f"payload {name}, inertia: {shown(inertia)} given; give numbers (kg m2), or leave it out for a point mass")
        basis = body.inertia.basis if body.inertia else basis
        added = replace(self._inertia(body, mass, com, inertia, basis, name, as_given), name=name)
        body.inertia = body.inertia.plus([added], self.parameters) if body.inertia else added

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

    # -- helpers -------------------------------------------------------------------------------

    def _inertia(
        self,
        body: Body,
        mass: Value,
        com: Values | None,
        tensor: Tensor | None,
        basis: Sequence[Spatial] | None,
        name: str = "",
        as_given: bool = False,
    ) -> Inertia:
        """name: in messages, where it is not the body's"""
        name = name or body.name
        carriers = None if basis is None else tuple(basis)
        if carriers is not None:
            check_basis(body.name, carriers)
        points = [e for e in carriers or body.elements if isinstance(e, Point)]
        if not points:
            raise ModelError(f"body {body.name}: inertia needs at least one point; give it one")
        is_rod, assumed = isinstance(tensor, str) and tensor == "rod", tensor is None
        if isinstance(tensor, str):
            self._check_word(body.name, tensor)
        if is_rod:
            points = self._ends(body, points, com)
        if com is None:
            com = _middle(points)
        if len(com) == 2 and body.frame.planar:
            com = (*com, points[0].given[2])
        if is_rod:
            tensor = rod_tensor(mass, *(p.given for p in points))
        else:
            tensor = self._tensor(name, 0.0 if tensor is None or isinstance(tensor, str) else tensor)
        check_inertia(name, self._number(mass, ""), self._numbers(com), self._numbers(tensor), as_given)
        if not all(map(is_number, tensor.flat)):
            check_pairs(name, tensor, self.parameters)
        return Inertia(mass=mass, com=tuple(com), tensor=symmetric(tensor), basis=carriers, assumed=assumed, is_judged=not as_given)

    def _check_word(self, name: str, word: str) -> None:
        """Raise ModelError where an inertia is called by a word that has no meaning, or two."""
        if word not in WORDS_OF_INERTIA:
            raise ModelError(f'body {name}, inertia: {shown(word)} given; give numbers (kg m2), "point" or "rod"')
        if word in self.numbers:
            raise ModelError(f"body {name}, inertia: {word} is the name of a parameter, too; rename the parameter")

    @staticmethod
    def _ends(body: Body, points: list[Point], com: Values | None) -> list[Point]:
        """The two points of a body that is a uniform rod. Raises ModelError where there are not two, or a centre is given."""
        if com is not None:
            raise ModelError(f'body {body.name}: the centre of a uniform rod (inertia="rod") is its middle; leave com out')
        ends = body.points if len(body.points) == 2 else points
        if len(ends) != 2:
            raise ModelError(
                f'body {body.name}: inertia="rod" is between two points, and it has {len(body.points)}; give two as its basis, or numbers'
            )
        return ends

    def _rest(self, body: Body) -> None:
        """Rows that keep a body where it stands: its origin, and three components of the first two directions of its base."""
        frame, owner = body.frame, Owner("joint", f"rigid {body.name}-{self.ground.name}", (body.name, self.ground.name), "rigid")
        made: list[Row] = []
        if frame.resting == 0 and frame.origin is not None and not all(c.fixed for c in frame.origin.components):
            rest_point = self.point(self.free_name(f"{body.name}.rest"), frame.origin.given, fixed=True)
            self.extend(self.ground, rest_point)
            offset = frame.origin - rest_point
            size = measures.natural_length(offset, self.extent())
            made = [row.affine(axis, offset, offset, offset, 0.0, size, owner, f"rest of {frame.origin.name}") for axis in range(3)]
        for number in range(frame.resting or 0, min(len(frame.directions), 2)):
            direction = frame.directions[number]
            if number == 0:
                across = self.directions_across(self.ground, direction)
            else:
                normal = measures.cross(frame.directions[0].given, direction.given)
                across = [as_combination(Constant.of("across", measures.unit(normal), self._numbers(measures.unit(normal))))]
            made += [row.dot(direction, n, 0.0, arithmetic.norm(direction.initial), owner, f"rest {direction}", self.scale) for n in across]
        frame.resting = max(1, len(frame.directions))
        self.rows += [replace(new, measured=True) for new in made if not row.is_trivial(new)]

    def _tensor(self, name: str, tensor: Tensor) -> np.ndarray:
        """An inertia tensor as 3×3 values, from one for a flat body, its diagonal, or all."""
        try:
            tensor = np.array(tensor, dtype=object)
        except ValueError:
            raise ModelError(f"body {name}, inertia: {shown(tensor)} given; give one number, three, or 3×3") from None
        if tensor.shape not in ((), (3,), (3, 3)):
            raise ModelError(f"body {name}: the inertia has shape {tensor.shape}; give one number (planar), (3,) or (3, 3)")
        values = np.array([value(self, x, f"body {name}, inertia") for x in tensor.flat], dtype=object).reshape(tensor.shape)
        if values.ndim == 0:
            moment = as_sympy(values.item())
            values = np.array([moment * fraction for fraction in (0.5, 0.5, 1.0)], dtype=object)
        return np.diag(values) if values.ndim == 1 else values

    def _complete(self, body: Body) -> None:
        """An auxiliary unit vector that completes a body's base of two directions to three."""
        if len(body.frame.directions) != 2 or body.frame.planar:
            return
        if body.frame.is_parametric:
            direction = measures.cross(*body.frame.given)
            size = measures.norm(direction)
        else:
            direction = np.cross(*body.frame.matrix().T)
            size = arithmetic.norm(direction)
        self.attach_vector(body, f"{body.name}.aux", tuple(x / size for x in direction))

    def directions_across(self, body: Body, axis: Combination) -> tuple[Combination, Combination]:
        """Return two directions of a body that are perpendicular to an axis and to each other in the initial position.

        They are combinations of the body's base where that has three directions that are numbers, otherwise vectors of the body: those that
        it has, or new ones.

        Parameters
        ----------
        body : Body
            The body.
        axis : Combination
            The axis.

        Returns
        -------
        tuple of Combination
            The two directions.
        """
        e = arithmetic.unit(axis.initial)
        helper = np.eye(3)[np.argmin(np.abs(e))]
        if axis.is_parametric:
            e = measures.unit(axis.given)
            first = measures.unit(measures.cross(e, helper))
            second = measures.cross(e, first)
        else:
            first = arithmetic.unit(np.cross(e, helper))
            second = np.cross(e, first)
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
            return as_combination(self.attach_vector_in_plane(body, direction, wish))
        if len(body.frame.directions) < 3 or body.frame.is_parametric or not all(map(is_number, direction)):
            same = next((v for v in body.vectors if v.given == tuple(direction)), None)
            return as_combination(same or self.attach_vector(body, self.free_name(f"{body.name}.{wish}"), direction))
        weights = arithmetic.weights(body.frame.matrix().T, numbers)
        parts = [other * weight for weight, other in zip(weights, body.frame.directions, strict=True) if abs(weight) > 1e-14]
        return sum(parts[1:], parts[0])

    def attach_vector_in_plane(self, body: Body, direction: Scalars, wish: str) -> Vector:
        """Add a new unit vector of the plane to a body.

        Parameters
        ----------
        body : Body
            The body.
        direction : sequence of float or expression of parameters, shape (3,)
            Initial direction, of which z is left out.
        wish : str
            How it is called, if that name is free.

        Returns
        -------
        Vector
            The vector.
        """
        vector = self.vector(self.free_name(f"{body.name}.{wish}"), (direction[0], direction[1], 0.0), fixed="z")
        self.extend(body, vector)
        return vector


def _middle(points: list[Point]) -> tuple[Scalar, ...]:
    """The mean of some points."""
    if not any(p.is_parametric for p in points):
        return tuple(np.mean([p.initial for p in points], axis=0).tolist())
    return tuple(as_number_if_constant(sum(column) / len(points)) for column in zip(*(p.given for p in points), strict=True))
