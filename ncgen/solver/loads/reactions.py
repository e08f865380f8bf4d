"""Loads between bodies.

Bodies that share a point or a vector have no joint equations, so multipliers are not joint loads. The load on a
body follows from its own balance, f = M_b q̈ − Q_b + Φ_{q,b}ᵀ λ_b, over the rows and masses it owns
(natural coordinates, 2.10): on a shared point f is the joint force, on a shared unit vector u it means the
moment u × f.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from ncgen.errors import ModelError
from ncgen.model.elements import Element, Point, Vector
from ncgen.solver import geometry
from ncgen.solver.argument_checks import finite, offer
from ncgen.solver.loads.between import RowLoad, loads_between, row_loads
from ncgen.solver.loads.sharing import Share, find_shared, kernels_of
from ncgen.solver.loads.teeth import ToothMesh, meshes
from ncgen.solver.trajectories.happening import refuse_pieces
from ncgen.symbolic.equations import build_springs

if TYPE_CHECKING:
    from ncgen.solver.trajectories.trajectory import Trajectory

PRESSURE_ANGLE = np.pi / 9
"""20 degrees, of nearly all gears and racks (rad)."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Reactions:
    """Loads on bodies along a trajectory, from their joints.

    loads: {body: {coordinate: (K,)}} generalised forces, over the fixed coordinates of the body too
    determinate: {body: {coordinate of its elements: bool}}: True where the balances leave one value only, of the force on a point and
        of the moment through a vector. Where it is False, one of many possible distributions is given
    shared: a sentence for every load whose share is arbitrary, such as "door: A.z and B.z share 98.1 N"
    changes: {instant: (loads, k)}: what can be added at some instants to all forces (N) and moments (N m), as of `felt`
    meshes: tooth forces of gears and racks, which wrenches between both sides and their carrier have; couples: labels of the rows of
        gears and racks that are felt as couples, and forces along slides, alone. The loads on elements have all of them so
    """

    run: Trajectory
    loads: dict[str, dict[str, np.ndarray]]
    determinate: dict[str, dict[str, bool]]
    shared: tuple[str, ...]
    changes: dict[int, np.ndarray]
    meshes: tuple[ToothMesh, ...] = ()
    couples: tuple[str, ...] = ()

    def __repr__(self) -> str:
        text = f"{len(self.shared)} shared arbitrarily" if self.shared else "all unique"
        text += f"; {', '.join(self.couples)} as couples" if self.couples else ""
        return f"<Reactions {self.run.name}: loads on {', '.join(self.loads)}; {text}>"

    @property
    def is_determinate(self) -> bool:
        """True if every load on every body is unique."""
        return all(all(each.values()) for each in self.determinate.values())

    @property
    def felt(self) -> np.ndarray:
        """All forces on points and moments through vectors (K, loads), three an element, body after body."""
        parts = [
            self.moment(body.name, e.name) if isinstance(e, Vector) else self.force(body.name, e.name)
            for body in self.run.model.bodies.values()
            for e in body.elements
        ]
        return np.hstack([np.zeros((len(self.run.t), 0)), *parts])

    def force(self, body: str, point: str) -> np.ndarray:
        """Return the joint force on a body at one of its points.

        Parameters
        ----------
        body : str
            Name of the body.
        point : str
            Name of one of its points.

        Returns
        -------
        numpy.ndarray
            Global components (N), shape (K, 3); at a fixed point, those of the ground.
        """
        return self._load(body, self._element(body, point))

    def moment(self, body: str, vector: str) -> np.ndarray:
        """Return the joint moment on a body through one of its unit vectors.

        Parameters
        ----------
        body : str
            Name of the body.
        vector : str
            Name of one of its vectors.

        Returns
        -------
        numpy.ndarray
            Global components (N m), shape (K, 3).
        """
        element = self._element(body, vector)
        return np.cross(geometry.element(self.run.kernels, element, self.run.q, self.run.p), self._load(body, element))

    def wrench(self, body: str, about: str, neighbour: str | None = None) -> tuple[np.ndarray, np.ndarray]:
        """Compute force and moment of joint loads on a body about a named point, along global axes.

        Joints made of rows, coordinates that are driven and the user's own rows are included.

        Parameters
        ----------
        body : str
            The body that the loads act on.
        about : str
            Any point of the model.
        neighbour : str, optional
            The body on the other side of the joint, or "ground"; None for all joints of the body.

        Returns
        -------
        tuple of numpy.ndarray
            Force (N) and moment (N m), shape (K, 3) each.

        Raises
        ------
        ModelError
            If both bodies have nothing in common, or something with a third body, whose load cannot be told from theirs.
        """
        run = self.run
        position = geometry.element(run.kernels, self._point(about), run.q, run.p)
        force, moment = np.zeros_like(position), np.zeros_like(position)
        for element, load in self._felt_from(body, neighbour):
            at = geometry.element(run.kernels, element, run.q, run.p)
            if isinstance(element, Vector):
                moment += np.cross(at, load)
            else:
                force += load
                moment += np.cross(at - position, load)
        for mesh in self.meshes:
            push = mesh.felt(body, neighbour or "") * mesh.force
            force += push
            moment += np.cross(mesh.point - position, push)
        return force, moment

    def _felt_from(self, body: str, neighbour: str | None) -> list[tuple[Element, np.ndarray]]:
        """The elements through which a body feels another one, and the loads; all of its elements without one."""
        if body not in self.loads:
            raise ModelError(f"there is no body {body}; {offer(body, tuple(self.loads), 'the bodies are')}")
        bodies, ground = self.run.model.bodies, self.run.model.ground.name
        if neighbour is None:
            return [(e, self._load(body, e)) for e in bodies[body].elements]
        if neighbour not in (ground, *bodies):
            raise ModelError(f"neighbour: there is no body {neighbour}; {offer(neighbour, (ground, *bodies), 'the bodies are')}")
        meet = any({body, neighbour} == {mesh.first, mesh.second} for mesh in self.meshes)
        return list(loads_between(self._rows, self.loads[body], bodies, ground, body, neighbour, meet))

    @cached_property
    def _rows(self) -> list[RowLoad]:
        largest = max((float(np.max(np.abs(load))) for loads in self.loads.values() for load in loads.values()), default=0.0)
        racks = {mesh.slide: (mesh.second, mesh.carrier) for mesh in self.meshes if mesh.slide}
        return row_loads(self.run, largest, racks)

    def _point(self, name: str) -> Point:
        element_named = self.run.model.elements.get(name)
        if not isinstance(element_named, Point):
            points = tuple(e.name for e in self.run.model.elements.values() if isinstance(e, Point))
            raise ModelError(f"about: there is no point {name}; {offer(name, points, 'the points are')}")
        return element_named

    def _load(self, body: str, element: Element) -> np.ndarray:
        return np.stack([self.loads[body][c.name] for c in element.components], axis=-1)

    def _element(self, body: str, name: str) -> Element:
        if body not in self.loads:
            raise ModelError(f"there is no body {body}; {offer(body, tuple(self.loads), 'the bodies are')}")
        elements = {e.name: e for e in self.run.model.bodies[body].elements}
        if name not in elements:
            raise ModelError(f"body {body} has no element {name}; {offer(name, tuple(elements))}")
        return elements[name]


def reactions(run: Trajectory, pressure_angle: float = PRESSURE_ANGLE) -> Reactions:
    """The loads on every body at every instant of a trajectory.

    pressure_angle: of the teeth of gears and racks (rad)

    Where the balances leave a load open, one of many possible distributions is given (rows that are not kept carry nothing);
    `determinate` and `shared` say so.
    """
    if not 0 <= finite(pressure_angle, "pressure_angle") < np.pi / 2:
        raise ModelError(f"pressure_angle: {pressure_angle:g} rad given; it is from 0 on and below a quarter of a turn")
    refuse_pieces(run, "joint reactions")
    shares = [Share(run, body) for body in run.model.bodies.values()]
    pulls, loads, felt = _pulls(run), {}, {}
    for equations in shares:
        own_pulls = pulls.get(equations.body.name, {})
        history = np.array([_load(equations, run, k) for k in range(len(run.t))])
        history -= np.array([own_pulls.get(c, 0.0 * run.t) for c in equations.coordinates]).T
        loads[equations.body.name] = dict(zip(equations.coordinates, history.T, strict=True))
        felt[equations.body.name] = _felt(run, equations, history)
    unique = find_shared(run, shares, felt)
    tooth_meshes, couples = meshes(run, pressure_angle)
    return Reactions(
        run=run, loads=loads, determinate=unique.unique, shared=unique.shared, changes=unique.changes, meshes=tooth_meshes, couples=couples
    )


def _pulls(run: Trajectory) -> dict[str, dict[str, np.ndarray]]:
    """{body: {coordinate: (K,)}} forces of springs and potentials, each on the first body that has the coordinate."""
    if not (springs_apart := build_springs(run.model)).forces:
        return {}
    springs = kernels_of(springs_apart)
    history = np.array([springs.force(q, qd, t, run.p) for t, q, qd in zip(run.t, run.q, run.qd, strict=True)])
    pulls: dict[str, dict[str, np.ndarray]] = {}
    for name, column in zip(run.coordinates, history.T, strict=True):
        for body in run.model.bodies.values():
            if any(c.name == name for e in body.elements for c in e.components):
                pulls.setdefault(body.name, {})[name] = column
                break
    return pulls


def _load(equations: Share, run: Trajectory, k: int) -> np.ndarray:
    """f = M q̈ − Q + Φ_qᵀ λ of one body at instant k, over its own and all free coordinates."""
    t, p, kernels = run.t[k], run.kernels.present(run.t[k], run.p), equations.kernels
    q, qd, qdd = equations.position(run.q[k]), equations.rate(run.qd[k]), equations.rate(run.qdd[k])
    return kernels.mass(q, t, p) @ qdd - kernels.force(q, qd, t, p) + kernels.phi_q(q, t, p).T @ run.lam[k]


def _felt(run: Trajectory, equations: Share, history: np.ndarray) -> np.ndarray:
    """Forces (N) on points and moments (N m) through vectors of a body, (K, elements, 3)."""
    felt = history[:, equations.indices].reshape(len(history), -1, 3)
    for i, element in enumerate(equations.body.elements):
        if isinstance(element, Vector):
            felt[:, i] = np.cross(geometry.element(run.kernels, element, run.q, run.p), felt[:, i])
    return felt
