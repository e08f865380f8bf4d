"""Declaring bodies: elements that move together, with mass."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ncgen.errors import ModelError, shown
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
from ncgen.model.elements import Point, Spatial, Vector
from ncgen.model.facts import fact
from ncgen.model.polynomial_loads import PolynomialLoads
from ncgen.model.rigid import Frame
from ncgen.model.rows import Owner
from ncgen.model.values import Scalar, Tensor, Value, Values, as_number_if_constant, as_sympy, is_number


class Structure(PolynomialLoads):
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


def _middle(points: list[Point]) -> tuple[Scalar, ...]:
    """The mean of some points."""
    if not any(p.is_parametric for p in points):
        return tuple(np.mean([p.initial for p in points], axis=0).tolist())
    return tuple(as_number_if_constant(sum(column) / len(points)) for column in zip(*(p.given for p in points), strict=True))
