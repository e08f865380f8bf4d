"""Loads between bodies.

Bodies that share a point or a vector have no joint equations, so multipliers are not joint loads. The load on a
body follows from its own balance, f = M_b q̈ − Q_b + Φ_{q,b}ᵀ λ_b, over the rows and masses it owns
(natural coordinates, 2.10): on a shared point f is the joint force, on a shared unit vector u it means the
moment u × f.
"""

from __future__ import annotations

from dataclasses import dataclass


import numpy as np

from ncgen.errors import ModelError
from ncgen.model.rows import Owner
from ncgen.solver import geometry
from ncgen.solver.rank import freedom, scaled_jacobian


@dataclass(frozen=True)
class Reactions:
    """Loads on bodies along a trajectory, from their joints.

    loads: {body: (K, n)} generalised forces over the free coordinates
    determinate: {body: True if redundant rows leave its loads unique}
    """

    run: object
    loads: dict[str, np.ndarray]
    determinate: dict[str, bool]

    def force(self, body: str, point: str) -> np.ndarray:
        """Joint force (N) on a body at one of its points, global axes, shape (K, 3)."""
        return geometry.element_rate(self.run.kernels, self._element(body, point), self.loads[body])

    def moment(self, body: str, vector: str) -> np.ndarray:
        """Joint moment (N m) on a body through one of its unit vectors, shape (K, 3)."""
        thing = self._element(body, vector)
        pull = geometry.element_rate(self.run.kernels, thing, self.loads[body])
        return np.cross(geometry.element(self.run.kernels, thing, self.run.q), pull)

    def _element(self, body: str, name: str):
        if body not in self.loads:
            raise ModelError(f"there is no body {body}; the bodies are {', '.join(self.loads)}")
        mine = {e.name: e for e in self.run.model.bodies[body].elements}
        if name not in mine:
            raise ModelError(f"body {body} has no element {name}; it has {', '.join(mine)}")
        return mine[name]


def reactions(run) -> Reactions:
    """The loads on every body at every instant of a trajectory.

    Where a body's rows are part of a redundancy, one of many possible distributions is given (rows that are not
    kept carry nothing) and `determinate` says so.
    """
    loads, determinate = {}, {}
    uncertain = _uncertain_directions(run)
    for name in run.model.bodies:
        share = _share(run.kernels, name)
        instants = zip(run.t, run.q, run.qd, run.qdd, run.lam, strict=True)
        loads[name] = np.array([_load(share, *instant, run.p) for instant in instants])
        effect = share.jacobian(run.q[0], run.t[0], run.p).T @ uncertain
        determinate[name] = bool(np.max(np.abs(effect), initial=0.0) < 1e-8)
    return Reactions(run, loads, determinate)


def _share(kernels, body: str):
    """The rows, masses and forces that one body owns, as kernels of their own."""
    from ncgen.build.numpy_module import NumPyKernels
    from ncgen.emit.sources import Sources
    from ncgen.program.assemble import assemble
    from ncgen.symbolic.equations import build_equations

    return NumPyKernels(Sources(assemble(build_equations(kernels.model, Owner("body", body)), "tabled")))


def _load(share, t, q, qd, qdd, lam, p) -> np.ndarray:
    inertia = share.mass_matrix(q, t, p) @ qdd - share.force(q, qd, t, p)
    return inertia + share.jacobian(q, t, p).T @ lam


def _uncertain_directions(run) -> np.ndarray:
    """Multipliers that do no work in general position, columns over the rows."""
    kernels = run.kernels
    rank = freedom(kernels, run.q[0], run.t[0], run.p).rank
    left = np.linalg.svd(scaled_jacobian(kernels, run.q[0], run.t[0], run.p).T, full_matrices=True)[2]
    return left[rank:].T / kernels.row_sizes[:, None]


