"""What robotics calls the basics, over the rates of the joints: mass matrix, forces, inverse and forward dynamics, Jacobians of frames.

    space = ncgen.joint_space(kernels)
    q = space.position({"shoulder": 0.4, "elbow": -1.2})
    space.mass_matrix(q), space.gravity(q), space.inverse_dynamics(q, v, a), space.jacobian("tip", q)

Rates v are those of the tree of bodies (`space.rates` has their names): of a joint with a coordinate the rate of that coordinate; of a body
that moves freely the velocity of its first point and its angular velocity, in global axes. Loops are not closed here.
Source: Featherstone, Rigid Body Dynamics Algorithms (2008); natural coordinates give a joint's screw as (u, r × u) at once.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from functools import cached_property

import numpy as np
import scipy.linalg
from numpy.typing import ArrayLike

from ncgen.errors import ModelError
from ncgen.mechanism.functions import Functions, functions
from ncgen.mechanism.kernels import Kernels
from ncgen.model.elements import AXES, Point, Relative, Spatial
from ncgen.solver import given
from ncgen.symbolic.tree import Link, Tree, spanning_tree

INPUTS = {
    "joint_position": ("t", "x", "p"),
    "joint_screws": ("t", "q", "p"),
    "joint_mass": ("t", "q", "p"),
    "joint_inverse": ("t", "q", "v", "a", "p"),
    "joint_loads": ("t", "q", "v", "p"),
}
"""The programs of `ncgen.program.joint_space`, and what they take."""

SAME = 1e-9
"""By which the share of a joint in a coordinate's rate may differ from 1, −1 or 0 and still be that."""


def joint_space(kernels: Kernels) -> JointSpace:
    """The joint space of a mechanism whose bodies are an open tree, made once for every kernels object.

    Raises ModelError where loops are closed, where a body is too thin to be part of a tree, or where a coordinate is that of no joint.
    """
    return given.checked_kernels(kernels).remember("joint space", (), lambda: JointSpace(kernels))


class JointSpace:
    """A mechanism over the rates of its joints.

    rates: their names; coordinates: names of the joints that have one; n: how many rates there are
    Positions q are ncgen's natural coordinates (n_q,), consistent, as `position` gives them; with NumPy kernels leading axes are batches,
    with compiled ones states of a batch go through one after the other. Forces are N along what slides, N m along what turns.
    """

    def __init__(self, kernels: Kernels) -> None:
        self.kernels, self.tree = kernels, spanning_tree(kernels.model)
        self._check()
        self.followed = _followed(kernels, self.tree)
        self.rates = _names(kernels, self.tree, self.followed)
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
        kernels, values = self.kernels, dict(values or {})
        for name in values:
            given.known_name(name, self.rates, "values", "joint")
        wanted = self.values(kernels.q0)
        for name, value in values.items():
            wanted[self.rates.index(name)] = given.finite(value, f"values: {name}")
        q = self._functions("joint_position", 0.0, wanted, kernels.p0)
        return q if base is None else self._displaced(q, *base)

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
        carried = set(free)
        for number, link in enumerate(links):
            carried |= {number} if link.parent in carried else set()
        found = q.copy()
        for c, (element, axis) in self._where.items():
            if self.tree.home[element] in carried:
                found[c] = (rotation @ self._vector(element, q) + (shift if isinstance(element, Point) else 0.0))[axis]
        return found

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
            found[..., c] = _carried(twist, self._vector(element, q), isinstance(element, Point))[..., axis]
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
        q, element, link = self._array(q), self._point(point), self._link(point, body)
        screws, path = self.screws(q), self._paths[link]
        place = self._vector(element, q)[..., None, :]
        found = np.zeros((*q.shape[:-1], 6, self.n))
        turning, along = screws[..., path, :3], screws[..., path, 3:]
        found[..., :3, path] = np.swapaxes(along + np.cross(turning, place), -1, -2)
        found[..., 3:, path] = np.swapaxes(turning, -1, -2)
        if not local:
            return found
        from ncgen.solver.frames import transformation

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
        """Accelerations of the joints (n,) with forces along them beside those of the model (n,; None: zero)."""
        q = self._array(q)
        right = self.loads(q, v, t) - self.inverse_dynamics(q, v) + self._over_rates(forces, "forces")
        return scipy.linalg.solve(self.mass_matrix(q), right, assume_a="pos")

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
        return _moving(self.kernels, self.tree)

    @cached_property
    def _own(self) -> list[range]:
        return _ranges(self.tree.links)

    @cached_property
    def _paths(self) -> list[list[int]]:
        """For every link the rates that move it."""
        found: list[list[int]] = []
        for link, own in zip(self.tree.links, self._own, strict=True):
            found.append([*(found[link.parent] if link.parent is not None else []), *own])
        return found

    def _vector(self, element: Spatial, q: np.ndarray) -> np.ndarray:
        index = self.kernels.index
        parts = [np.broadcast_to(c.initial, q.shape[:-1]) if c.fixed else q[..., index[c.name]] for c in element.components]
        return np.stack(parts, axis=-1)

    def _point(self, name: str) -> Point:
        found = self.kernels.model.elements.get(name)
        if not isinstance(found, Point):
            points = [e.name for e in self.kernels.model.elements.values() if isinstance(e, Point)]
            raise ModelError(f"point: there is no {name}; the points are {', '.join(points)}")
        return found

    def _link(self, point: str, body: str | None) -> int:
        """The number of the link that a point is taken with."""
        element = self._point(point)
        for number, link in enumerate(self.tree.links):
            if element in link.body.elements and body in (None, link.body.name):
                return number
        raise ModelError(f"point {point}: {'no body that moves has it' if body is None else f'body {body} does not have it'}")

    def _check(self) -> None:
        name, tree = self.kernels.name, self.tree
        if tree.loose:
            raise ModelError(f"{name}: joint space needs bodies that tell their rotation; {tree.loose[0].name} does not")


def _followed(kernels: Kernels, tree: Tree) -> dict[int, tuple[int, float]]:
    """{relative coordinate: (rate, its share)}, seen in what each screw does to the rows at the start.

    Raises ModelError where a coordinate follows no single joint, or where a row holds joints together.
    """
    where = _moving(kernels, tree)
    relative = {kernels.index[e.name] for e in kernels.model.elements.values() if isinstance(e, Relative) and e.name in kernels.index}
    if others := [kernels.coordinates[c] for c in range(kernels.n) if c not in where and c not in relative]:
        raise ModelError(f"{kernels.name}: joint space needs one tree of bodies; {others[0]} belongs to none")
    moved = _columns(kernels, tree, where)
    jacobian = kernels.jacobian(kernels.q0)
    own = sorted(relative)
    # Rows over relative coordinates and rates: each relative coordinate has one row of its own, the others must vanish.
    over_rates, over_own = jacobian @ moved, jacobian[:, own]
    shares = -np.linalg.lstsq(over_own, over_rates, rcond=None)[0] if own else np.zeros((0, moved.shape[1]))
    left = np.abs(over_rates + over_own @ shares) / kernels.row_sizes[:, None]
    if left.size and left.max() > 1e-6:
        row = kernels.rows[int(np.argmax(left.max(axis=1)))]
        raise ModelError(f"{kernels.name}: joint space is that of an open tree, and row {row.label} ({row.owner}) closes a loop")
    found = {}
    for c, share in zip(own, shares, strict=True):
        k = int(np.argmax(np.abs(share)))
        if np.max(np.abs(np.delete(share, k)), initial=0.0) > SAME * abs(share[k]):
            raise ModelError(f"{kernels.name}: joint space needs coordinates of single joints; {kernels.coordinates[c]} is that of none")
        found[c] = k, float(np.sign(share[k])) if abs(abs(share[k]) - 1.0) < SAME else float(share[k])
    return found


def _columns(kernels: Kernels, tree: Tree, where: Mapping[int, tuple[Spatial, int]]) -> np.ndarray:
    """What every rate does to the coordinates of elements at the start, shape (n_q, rates)."""
    found = np.zeros((kernels.n, tree.freedoms))
    paths: list[list[int]] = []
    screws = [_screw(screw) for link in tree.links for screw in link.screws]
    for link, own in zip(tree.links, _ranges(tree.links), strict=True):
        paths.append([*(paths[link.parent] if link.parent is not None else []), *own])
    for c, (element, axis) in where.items():
        for k in paths[tree.home[element]]:
            found[c, k] = _carried(screws[k], element.initial, isinstance(element, Point))[axis]
    return found


def _screw(screw) -> np.ndarray:
    """(ω, v at the origin) of a joint's freedom at the start."""
    axis = screw.axis.initial
    return np.concatenate([np.zeros(3), axis]) if screw.point is None else np.concatenate([axis, np.cross(screw.point.initial, axis)])


def _carried(twist: np.ndarray, place: np.ndarray, is_point: bool) -> np.ndarray:
    """The velocity of a point or vector that moves with a twist (…, 6)."""
    turned = np.cross(twist[..., :3], place)
    return twist[..., 3:] + turned if is_point else turned


def _moving(kernels: Kernels, tree: Tree) -> dict[int, tuple[Spatial, int]]:
    return {
        kernels.index[component.name]: (element, axis)
        for element in tree.home
        for axis, component in enumerate(element.components)
        if not component.fixed
    }


def _ranges(links: Iterable[Link]) -> list[range]:
    """The rates of every link's joint."""
    found, first = [], 0
    for link in links:
        found.append(range(first, first + len(link.screws)))
        first += len(link.screws)
    return found


def _names(kernels: Kernels, tree: Tree, followed: Mapping[int, tuple[int, float]]) -> tuple[str, ...]:
    """Of all rates: of their coordinate, else of the body with v or w and a global axis, or with the word for what it does."""
    coordinates = {k: kernels.coordinates[c] for c, (k, _) in followed.items()}
    names: list[str] = []
    for link in tree.links:
        for screw in link.screws:
            along = [axis for axis, x in zip(AXES, screw.axis.initial, strict=True) if x == 1.0] if screw.is_constant else []
            letter, word = ("v", "slide") if screw.point is None else ("w", "turn")
            name = coordinates.get(len(names), f"{link.body.name}.{letter + along[0] if along else word}")
            names.append(name)
    return tuple(names)
