"""What robotics calls the basics, over the rates of the joints: mass matrix, forces, inverse and forward dynamics, Jacobians of frames.

    space = ncgen.joint_space(kernels)
    q = space.position({"shoulder": 0.4, "elbow": -1.2})
    space.mass_matrix(q), space.gravity(q), space.inverse_dynamics(q, v, a), space.jacobian("tip", q)

Rates v are those of the tree of bodies (`space.rates` has their names): of a joint with a coordinate the rate of that coordinate; of a body
that moves freely the velocity of its first point and its angular velocity, in global axes. Loops are not closed here.
Source: Featherstone, Rigid Body Dynamics Algorithms (2008); natural coordinates give a joint's screw as (u, r × u) at once.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property

import numpy as np
import scipy.linalg
from numpy.typing import ArrayLike

from ncgen.errors import ModelError, SingularError
from ncgen.mechanism.functions import Functions, functions
from ncgen.mechanism.kernels import Kernels
from ncgen.model.elements import Point, Spatial
from ncgen.model.values import Value, evaluate
from ncgen.solver import given
from ncgen.solver.frames import transformation
from ncgen.solver.joint_names import carried, followed_by, names_of
from ncgen.symbolic.tree import moving, spanning_tree

INPUTS = {
    "joint_position": ("t", "x", "p"),
    "joint_screws": ("t", "q", "p"),
    "joint_mass": ("t", "q", "p"),
    "joint_inverse": ("t", "q", "v", "a", "p"),
    "joint_loads": ("t", "q", "v", "p"),
}
"""The programs of `ncgen.program.joint_space`, and what they take."""


def joint_space(kernels: Kernels) -> JointSpace:
    """The joint space of a mechanism whose bodies are an open tree, made once for every kernels object.

    Raises ModelError where loops are closed, where a body is too thin to be part of a tree, or where a coordinate is that of no joint.
    """
    return given.checked_kernels(kernels).remember("joint space", (), lambda: JointSpace(kernels))


class JointSpace:
    """A mechanism over the rates of its joints.

    rates: their names; coordinates: names of the joints that have one; n: how many rates there are
    Positions q are ncgen's natural coordinates (n_q,), consistent, as `position` gives them; with NumPy kernels leading axes are batches,
    with compiled ones states of a batch go through one after the other. Parameters have their defaults. Forces are N along what slides,
    N m along what turns.
    """

    def __init__(self, kernels: Kernels) -> None:
        self.kernels, self.tree = kernels, spanning_tree(kernels.model)
        self._check()
        self.followed = followed_by(kernels, self.tree)
        self.rates = names_of(kernels, self.tree, self.followed)
        self.n = len(self.rates)
        self.coordinates = tuple(kernels.coordinates[c] for c in self.followed)

    def __repr__(self) -> str:
        return f"<JointSpace {self.kernels.name}: {self.n} rates>"

    # -- positions -----------------------------------------------------------------------------

    def position(self, values: Mapping[str, float] | None = None, base: tuple[ArrayLike, ArrayLike] | None = None) -> np.ndarray:
        """Natural coordinates (n_q,) where joints have these values (m, rad), by the names of their rates; others keep their initial ones.

        A joint without a coordinate has as its value how far it has turned or slid since the initial position.
        base: displacement of the one body that moves freely from where it is initially: rotation (3, 3) about the origin, and
            translation (3,) in m
        Raises ModelError for what is no joint, or for a base where no body, or more than one, moves freely.
        """
        q = self.placed(self._joint_values(values, "values"))
        return q if base is None else self._displaced(q, *base)

    def placed(self, x: np.ndarray) -> np.ndarray:
        """The same for values of all joints in their order (…, n)."""
        return self._functions("joint_position", 0.0, x, self.kernels.p0)

    def _joint_values(self, values: Mapping[str, float] | None, what: str) -> np.ndarray:
        """Values of all joints (n,): those given by name, else the initial ones."""
        found = self.values(self.kernels.q0)
        for name, value in (values or {}).items():
            given.known_name(name, self.rates, what, "joint")
            found[self.rates.index(name)] = given.finite(value, f"{what}: {name}")
        return found

    def values(self, q: ArrayLike) -> np.ndarray:
        """Values of the joints that have a coordinate (…, n), 0 for the others."""
        q = self._array(q)
        found = np.zeros((*q.shape[:-1], self.n))
        for c, (k, _) in self.followed.items():
            found[..., k] = q[..., c]
        return found

    def _displaced(self, q: np.ndarray, rotation: ArrayLike, shift: ArrayLike) -> np.ndarray:
        """The one body that moves freely, and all that it carries, turned about the origin and shifted."""
        links = self.tree.links
        free = [number for number, link in enumerate(links) if len(link.screws) == 6]
        if len(free) != 1:
            raise ModelError(f"{self.kernels.name}: base given, but {len(free)} bodies move freely; it needs one")
        rotation, shift = np.asarray(rotation, dtype=float), np.asarray(shift, dtype=float)
        together = set(free)
        for number, link in enumerate(links):
            together |= {number} if link.parent in together else set()
        found = q.copy()
        for c, (element, axis) in self._where.items():
            if self.tree.home[element] in together:
                found[c] = (rotation @ self.element(element, q) + (shift if isinstance(element, Point) else 0.0))[axis]
        return found

    def inverse_kinematics(
        self,
        point: str,
        place: ArrayLike,
        rotation: ArrayLike | None = None,
        body: str | None = None,
        start: Mapping[str, float] | None = None,
    ) -> dict[str, float]:
        """Values of the joints that bring a point to a place (3,) in m, by least squares from a start, and from some beside it.

        rotation: what the body shall have turned by since the initial position (3, 3); None for any
        body: the one that the point is taken with, by default that nearest to the ground
        start: values of joints to begin with, others are those of the initial position
        Raises ConvergenceError with what is left where the point cannot get there, or not from this start.
        """
        from ncgen.solver.inverse_kinematics import values_for

        return values_for(self, point, place, rotation, body, self._joint_values(start, "start"))

    def centre_of_mass(self, q: ArrayLike) -> np.ndarray:
        """Of all bodies that move (…, 3), in m."""
        q = self._array(q)
        total, moment = 0.0, np.zeros((*q.shape[:-1], 3))
        for body in (link.body for link in self.tree.links if link.body.inertia):
            mass, com = self._numbers(body.own_inertia.mass), np.array([self._numbers(x) for x in body.own_inertia.com])
            base = body.points[0]
            turned = transformation(self.kernels, body.name, q) @ (com - base.initial)
            total, moment = total + mass, moment + mass * (self.element(base, q) + turned)
        if not total > 0:
            raise ModelError(f"{self.kernels.name}: nothing has mass; give a body one")
        return moment / total

    def _numbers(self, value: Value) -> float:
        return evaluate(value, self.kernels.model.parameters, "inertia")

    # -- velocities ----------------------------------------------------------------------------

    def screws(self, q: ArrayLike) -> np.ndarray:
        """For every rate the angular velocity, and the velocity at the origin, of what it moves, shape (…, n, 6)."""
        found = self._of("joint_screws", q)
        return found.reshape(*found.shape[:-1], self.n, 6)

    def velocities(self, q: ArrayLike, v: ArrayLike) -> np.ndarray:
        """Rates of all natural coordinates (…, n_q) for rates v (…, n) of the joints."""
        q, v = self._array(q), self._over_rates(v, "v")
        twists = self._twists(self.screws(q), v)
        found = np.empty(np.broadcast_shapes(q.shape[:-1], v.shape[:-1]) + q.shape[-1:])
        for c, (element, axis) in self._where.items():
            twist = twists[self.tree.home[element]]
            found[..., c] = carried(twist, self.element(element, q), isinstance(element, Point))[..., axis]
        for c, (k, _) in self.followed.items():
            found[..., c] = v[..., k]
        return found

    def _twists(self, screws: np.ndarray, v: np.ndarray) -> list[np.ndarray]:
        """(ω, v at the origin) of every link."""
        return [np.einsum("...k,...ki->...i", v[..., path], screws[..., path, :]) for path in self._paths]

    def jacobian(self, point: str, q: ArrayLike, body: str | None = None, local: bool = False) -> np.ndarray:
        """Velocity of a point, and angular velocity of the body it is taken with, for rate 1 of every joint, shape (…, 6, n).

        point: the name of a point of the model; body: by default the one nearest to the ground that has it
        local: along axes that turn with the body and are the global ones initially
        """
        q, element, link = self._array(q), self.point(point), self.link(point, body)
        screws, path = self.screws(q), self._paths[link]
        place = self.element(element, q)[..., None, :]
        found = np.zeros((*q.shape[:-1], 6, self.n))
        turning, along = screws[..., path, :3], screws[..., path, 3:]
        found[..., :3, path] = np.swapaxes(along + np.cross(turning, place), -1, -2)
        found[..., 3:, path] = np.swapaxes(turning, -1, -2)
        if not local:
            return found
        back = np.swapaxes(transformation(self.kernels, self.tree.links[link].body.name, q), -1, -2)
        return np.concatenate([back @ found[..., :3, :], back @ found[..., 3:, :]], axis=-2)

    # -- forces --------------------------------------------------------------------------------

    def mass_matrix(self, q: ArrayLike) -> np.ndarray:
        """Symmetric and positive, shape (…, n, n)."""
        lower = self._of("joint_mass", q)
        found = np.zeros((*lower.shape[:-1], self.n, self.n))
        i, j = np.tril_indices(self.n)
        found[..., i, j] = found[..., j, i] = lower
        return found

    def inverse_dynamics(self, q: ArrayLike, v: ArrayLike | None = None, a: ArrayLike | None = None) -> np.ndarray:
        """Forces along the joints (…, n) that rates v and accelerations a (…, n; None: zero) need against inertia and gravity.

        Springs, dampers and other forces of the model are not in them: `loads`.
        """
        return self._functions("joint_inverse", 0.0, self._array(q), self._over_rates(v, "v"), self._over_rates(a, "a"), self.kernels.p0)

    def gravity(self, q: ArrayLike) -> np.ndarray:
        """The forces that hold the mechanism against gravity (…, n)."""
        return self.inverse_dynamics(q)

    def coriolis(self, q: ArrayLike, v: ArrayLike) -> np.ndarray:
        """The forces that rates v need without accelerations and gravity (…, n): Coriolis' and centrifugal ones."""
        return self.inverse_dynamics(q, v) - self.gravity(q)

    def loads(self, q: ArrayLike, v: ArrayLike | None = None, t: float = 0.0) -> np.ndarray:
        """What springs, dampers and other forces of the model do along the joints (…, n), at a time t (s)."""
        return self._functions("joint_loads", given.finite(t, "t"), self._array(q), self._over_rates(v, "v"), self.kernels.p0)

    def forward_dynamics(self, q: ArrayLike, v: ArrayLike | None = None, forces: ArrayLike | None = None, t: float = 0.0) -> np.ndarray:
        """Accelerations of the joints (n,) with forces along them beside those of the model (n,; None: zero).

        Raises SingularError where a joint moves nothing that has inertia.
        """
        q = self._array(q)
        right = self.loads(q, v, t) - self.inverse_dynamics(q, v) + self._over_rates(forces, "forces")
        try:
            return scipy.linalg.solve(self.mass_matrix(q), right, assume_a="pos")
        except np.linalg.LinAlgError:
            raise SingularError(f"{self.kernels.name}: a joint moves nothing that has inertia; give its bodies mass") from None

    # -- helpers -------------------------------------------------------------------------------

    @cached_property
    def _functions(self) -> Functions:
        from ncgen.program.joint_space import assemble_joint_space

        n, equations = self.n, self.kernels.programs.equations
        sizes = {"position": self.kernels.n, "screws": 6 * n, "mass": n * (n + 1) // 2, "inverse": n, "loads": n}
        sizes = {f"joint_{name}": size for name, size in sizes.items()}
        return functions(self.kernels, "joint_space", INPUTS, sizes, lambda: assemble_joint_space(equations, self.followed))

    def _of(self, name: str, q: ArrayLike) -> np.ndarray:
        return self._functions(name, 0.0, self._array(q), self.kernels.p0)

    def _array(self, q: ArrayLike) -> np.ndarray:
        return self._checked(q, self.kernels.n, "q", "coordinates")

    def _over_rates(self, values: ArrayLike | None, name: str) -> np.ndarray:
        """Numbers over the rates; zero for None."""
        return np.zeros(self.n) if values is None else self._checked(values, self.n, name, "rates")

    def _checked(self, values: ArrayLike, count: int, name: str, what: str) -> np.ndarray:
        found = np.asarray(values, dtype=float)
        if found.shape[-1:] != (count,):
            raise ModelError(f"{name}: its shape is {found.shape}, and {self.kernels.name} has {count} {what}; give (…, {count})")
        return found

    @cached_property
    def _where(self) -> dict[int, tuple[Spatial, int]]:
        """{coordinate: (element, axis)} of what moves with a link."""
        return moving(self.kernels.programs.equations, self.tree)

    @cached_property
    def _paths(self) -> list[list[int]]:
        return self.tree.paths

    def element(self, element: Spatial, q: np.ndarray) -> np.ndarray:
        index = self.kernels.index
        parts = [np.broadcast_to(c.initial, q.shape[:-1]) if c.fixed else q[..., index[c.name]] for c in element.components]
        return np.stack(parts, axis=-1)

    def point(self, name: str) -> Point:
        found = self.kernels.model.elements.get(name)
        if not isinstance(found, Point):
            points = [e.name for e in self.kernels.model.elements.values() if isinstance(e, Point)]
            raise ModelError(f"point: there is no {name}; the points are {', '.join(points)}")
        return found

    def link(self, point: str, body: str | None) -> int:
        """The number of the link that a point is taken with."""
        element = self.point(point)
        for number, link in enumerate(self.tree.links):
            if element in link.body.elements and body in (None, link.body.name):
                return number
        raise ModelError(f"point {point}: {'no body that moves has it' if body is None else f'body {body} does not have it'}")

    def _check(self) -> None:
        name, tree = self.kernels.name, self.tree
        if tree.loose:
            raise ModelError(f"{name}: joint space needs bodies that tell their rotation; {tree.loose[0].name} does not")
