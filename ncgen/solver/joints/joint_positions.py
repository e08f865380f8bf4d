"""Positions over the joints of a tree of bodies, and the functions that are made for it."""

from __future__ import annotations

import copy
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from functools import cached_property, partial
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from ncgen.errors import ModelError
from ncgen.mechanism.kernels import Kernels
from ncgen.mechanism.program_functions import ProgramFunctions, functions
from ncgen.mechanism.shared_docstrings import shares
from ncgen.model.elements import Component, Point, Spatial
from ncgen.model.values import is_number
from ncgen.program.ir.blocks import Program
from ncgen.program.tree.joint_programs import Made
from ncgen.solver import argument_checks, geometry
from ncgen.symbolic.tree import Tree, moving

INPUTS = {
    "joint_position": ("t", "x", "p"),
    "joint_screws": ("t", "q", "p"),
    "joint_mass": ("t", "q", "p"),
    "joint_inverse": ("t", "q", "v", "a", "p"),
    "joint_loads": ("t", "q", "v", "p"),
    "joint_momenta": ("t", "q", "p"),
}
"""The programs of `ncgen.program.tree.joint_programs`, and what they take."""


ARGUMENTS = {
    "q": "array_like\nNatural coordinates, shape (…, n_q).",
    "v": "array_like\nRates of the joints, shape (…, n); None for zero.",
    "a": "array_like\nAccelerations of the joints, shape (…, n); None for zero.",
    "t": "float\nTime (s).",
    "forces": "array_like\nForces along the joints in addition to those of the model, shape (…, n); None for zero.",
    "about": "array_like\nPoint (3,) in m; None for the centre of mass, which gives the centroidal momentum matrix.",
}
"""What the arguments of a joint space are, of methods that do not say otherwise."""


@shares(**ARGUMENTS)
class JointPositions(ABC):
    """A tree of bodies with values of its joints, and natural coordinates from them."""

    kind: str
    """A word for the functions that are made for it."""

    inputs: Mapping[str, tuple[str, ...]] = INPUTS
    """What these functions take, but slopes."""

    why: str = ""
    """Why it is no open tree, where it is none."""

    def __init__(self, kernels: Kernels, tree: Tree, rates: tuple[str, ...]) -> None:
        self.kernels, self.tree, self.p = kernels, tree, kernels.p0
        self.rates, self.n = rates, len(rates)
        self.coordinates = tuple(name for name in rates if name in kernels.index)

    def __repr__(self) -> str:
        return f"<JointSpace {self.kernels.name}: {self.n} rates>"

    def at(self, p: argument_checks.ArrayOrNamed) -> Self:
        """Return the same joint space at other parameters, without compiling anything.

        Parameters
        ----------
        p : array_like or dict
            Parameters, shape (n_p,), or {name: number}; others have their defaults.

        Returns
        -------
        JointSpace
            The joint space at p.

        Raises
        ------
        ModelError
            For an unknown parameter, and for a value that the model rejects, such as a negative mass.
        """
        copied = copy.copy(self)
        copied.p = argument_checks.parameters(self.kernels, p)
        return copied

    def position(self, values: Mapping[str, float] | None = None, base: tuple[ArrayLike, ArrayLike] | None = None) -> np.ndarray:
        """Compute natural coordinates from values of the joints.

        The value of a joint without a coordinate is how far it has turned or slid since the initial position. Loops are closed on the way
        from the initial position.

        Parameters
        ----------
        values : dict of str to float, optional
            Values (m, rad) by the names of rates; others keep their initial values.
        base : tuple of array_like, optional
            Displacement of the one free body from its initial position: rotation (3, 3) about the origin, and translation (3,) in m.

        Returns
        -------
        numpy.ndarray
            Natural coordinates, shape (n_q,), with closed loops.

        Raises
        ------
        ModelError
            For an unknown joint, or for a base where no body, or more than one, moves freely.
        ConvergenceError
            If the loops do not close.
        """
        q = self.placed(self._joint_values(values, "values"))
        if base is None:
            return q
        if not (isinstance(base, (tuple, list)) and len(base) == 2):
            raise ModelError(f"base: {argument_checks.echo(base)} given; give (rotation (3, 3), translation (3,) in m)")
        return self._displaced(
            q, argument_checks.rotation_of(base[0], "base: rotation"), argument_checks.array_of(base[1], (3,), "base: translation")
        )

    @abstractmethod
    def placed(self, x: np.ndarray) -> np.ndarray:
        """Compute natural coordinates from values of all joints.

        Parameters
        ----------
        x : numpy.ndarray
            Values of all joints in their order, shape (…, n).

        Returns
        -------
        numpy.ndarray
            Natural coordinates, shape (…, n_q).
        """

    def _joint_values(self, values: Mapping[str, float] | None, label: str) -> np.ndarray:
        """Values of all joints (n,): those given by name, else the initial ones."""
        joint_values = self.values(self.kernels.start(self.p))
        for name, value in argument_checks.numbers_by_name({} if values is None else values, self.rates, label, "joint").items():
            joint_values[self.rates.index(name)] = value
        return joint_values

    def values(self, q: ArrayLike) -> np.ndarray:
        """Return the values of the joints that have a coordinate.

        Returns
        -------
        numpy.ndarray
            Values (m, rad), shape (…, n); 0 for joints without a coordinate.
        """
        q = self._array(q)
        joint_values = np.zeros((*q.shape[:-1], self.n))
        for name in self.coordinates:
            joint_values[..., self.rates.index(name)] = q[..., self.kernels.index[name]]
        return joint_values

    def _displaced(self, q: np.ndarray, rotation: np.ndarray, shift: np.ndarray) -> np.ndarray:
        """The one body that moves freely, and all that it carries, turned about the origin and shifted."""
        links = self.tree.links
        free = [number for number, link in enumerate(links) if len(link.screws) == 6]
        if len(free) != 1:
            raise ModelError(f"{self.kernels.name}: base given, but {len(free)} bodies move freely; it needs one")
        together = set(free)
        for number, link in enumerate(links):
            together |= {number} if link.parent in together else set()
        displaced = q.copy()
        for c, (element, axis) in self._where.items():
            if self.tree.home[element] in together:
                displaced[c] = (rotation @ self.element(element, q) + (shift if isinstance(element, Point) else 0.0))[axis]
        return displaced

    # -- helpers -------------------------------------------------------------------------------

    @cached_property
    def _functions(self) -> ProgramFunctions:
        return self._functions_of("basics", self.inputs, self._sizes)

    def _functions_of(
        self, group: Made, inputs: Mapping[str, tuple[str, ...]], sizes: Callable[[], dict[str, int]], kind: str = ""
    ) -> ProgramFunctions:
        """Functions that are the same at all parameters. kind: a word for them, where they depend on more than the equations"""

        def make() -> ProgramFunctions:
            return functions(self.kernels, f"{self.kind}_{kind or group}", inputs, sizes(), self._counts(), partial(self.made, group))

        return self.kernels.remember("joint space functions", group, make)

    def _counts(self) -> dict[str, int]:
        """{input of a function: how many numbers it has}."""
        return dict.fromkeys(("x", "v", "a", "dx", "dv"), self.n) | {"q": self.kernels.n, "p": len(self.p)}

    def _sizes(self) -> dict[str, int]:
        """Of the outputs of all functions but slopes."""
        n, joints = self.n, self.tree.dof
        sizes = {"inverse": n, "loads": n, "position": self.kernels.n, "screws": 6 * joints, "mass": n * (n + 1) // 2}
        return {f"joint_{name}": size for name, size in (sizes | {"momenta": 4 + 6 * joints}).items()}

    @abstractmethod
    def made(self, group: Made) -> dict[str, Program]:
        """Assemble the programs.

        Parameters
        ----------
        group : str
            Which group of programs.

        Returns
        -------
        dict of str to Program
            The programs by name.
        """

    def _of(self, name: str, q: ArrayLike) -> np.ndarray:
        return self._functions(name, 0.0, self._array(q), self.p)

    def _array(self, q: ArrayLike) -> np.ndarray:
        return self._checked(q, self.kernels.n, "q", "coordinates")

    def _over_rates(self, values: ArrayLike | None, name: str) -> np.ndarray:
        """Numbers over the rates; zero for None."""
        return np.zeros(self.n) if values is None else self._checked(values, self.n, name, "rates")

    def _checked(self, values: ArrayLike, count: int, name: str, noun: str) -> np.ndarray:
        array = argument_checks.numbers_of(values, name)
        if array.shape[-1:] != (count,):
            raise ModelError(f"{name}: its shape is {array.shape}, and {self.kernels.name} has {count} {noun}; give (…, {count})")
        return array

    @cached_property
    def _where(self) -> dict[int, tuple[Spatial, int]]:
        """{coordinate: (element, axis)} of what moves with a link."""
        return moving(self.kernels.programs.equations, self.tree)

    def element(self, element: Spatial, q: np.ndarray) -> np.ndarray:
        """Return a point or a vector at a position.

        Parameters
        ----------
        element : Spatial
            The point or vector.
        q : numpy.ndarray
            Natural coordinates, shape (…, n_q).

        Returns
        -------
        numpy.ndarray
            Global components, shape (…, 3).
        """
        index = self.kernels.index
        parts = [self._fixed(c, q) if c.fixed else q[..., index[c.name]] for c in element.components]
        return np.stack(parts, axis=-1)

    def _fixed(self, component: Component, q: np.ndarray) -> np.ndarray:
        if is_number(component.value):
            return np.broadcast_to(component.initial, q.shape[:-1])
        return geometry.component(self.kernels, component, q, self.p)

    def point(self, name: str) -> Point:
        """Return a point by its name.

        Parameters
        ----------
        name : str
            Name of the point.

        Returns
        -------
        Point
            The point of the model.

        Raises
        ------
        ModelError
            If there is no such point.
        """
        element_named = self.kernels.model.elements.get(name) if isinstance(name, str) else None
        if not isinstance(element_named, Point):
            points = [e.name for e in self.kernels.model.elements.values() if isinstance(e, Point)]
            raise ModelError(f"point: there is no {argument_checks.echo(name)}; {argument_checks.offer(name, points, 'the points are')}")
        return element_named

    def link(self, point: str, body: str | None) -> int:
        """Return the number of the link that has a point.

        Parameters
        ----------
        point : str
            Name of the point.
        body : str or None
            The body; None for that nearest to the ground.

        Returns
        -------
        int
            Number in the tree of bodies.
        """
        element = self.point(point)
        if not isinstance(body, str | None):
            raise ModelError(f"body: {argument_checks.echo(body)} is no name; give that of a body")
        for number, link in enumerate(self.tree.links):
            if element in link.body.elements and body in (None, link.body.name):
                return number
        raise ModelError(f"point {point}: {'no body that moves has it' if body is None else f'body {body} does not have it'}")
