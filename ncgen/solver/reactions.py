"""Loads between bodies.

Bodies that share a point or a vector have no joint equations, so multipliers are not joint loads. The load on a
body follows from its own balance, f = M_b q̈ − Q_b + Φ_{q,b}ᵀ λ_b, over the rows and masses it owns
(natural coordinates, 2.10): on a shared point f is the joint force, on a shared unit vector u it means the
moment u × f.
"""

from __future__ import annotations

from dataclasses import dataclass


import numpy as np

from ncgen.build.numpy_module import NumPyKernels
from ncgen.emit.sources import Sources
from ncgen.errors import ModelError
from ncgen.model.rows import Owner
from ncgen.program.assemble import assemble
from ncgen.solver import geometry
from ncgen.solver.rank import freedom, scaled_jacobian
from ncgen.symbolic.equations import build_equations, build_springs


@dataclass(frozen=True)
class Reactions:
    """Loads on bodies along a trajectory, from their joints.

    loads: {body: {coordinate: (K,)}} generalised forces, over the fixed coordinates of the body too
    determinate: {body: True if redundant rows leave its loads unique}
    """

    run: object
    loads: dict[str, dict[str, np.ndarray]]
    determinate: dict[str, bool]

    def force(self, body: str, point: str) -> np.ndarray:
        """Joint force (N) on a body at one of its points, global axes, shape (K, 3); at a fixed point, that of the ground."""
        return self._load(body, self._element(body, point))

    def moment(self, body: str, vector: str) -> np.ndarray:
        """Joint moment (N m) on a body through one of its unit vectors, shape (K, 3)."""
        thing = self._element(body, vector)
        return np.cross(geometry.element(self.run.kernels, thing, self.run.q, self.run.p), self._load(body, thing))

    def _load(self, body: str, element) -> np.ndarray:
        return np.stack([self.loads[body][c.name] for c in element.components], axis=-1)

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
    pulls = _pulls(run)
    fixed = {c.name: geometry.component(run.kernels, c, run.q[0], run.p) for c in run.model.components if c.fixed}
    for name in run.model.bodies:
        share = _share(run.kernels, name)
        history = np.array([_load(share, run, fixed, k) for k in range(len(run.t))])
        history -= np.array([pulls.get(name, {}).get(c, 0.0 * run.t) for c in share.coordinates]).T
        loads[name] = dict(zip(share.coordinates, history.T, strict=True))
        effect = share.jacobian(_spread(share, run, run.q[0], fixed), run.t[0], run.p).T @ uncertain
        determinate[name] = bool(np.max(np.abs(effect), initial=0.0) < 1e-8)
    return Reactions(run, loads, determinate)


def _share(kernels, body: str):
    """The rows, masses and forces that one body owns, as kernels of their own."""
    return _kernels(build_equations(kernels.model, Owner("body", body)))


def _kernels(equations):
    return NumPyKernels(Sources(assemble(equations, "tabled")))


def _pulls(run) -> dict[str, dict[str, np.ndarray]]:
    """{body: {coordinate: (K,)}} forces of springs and potentials, each on the first body that has the coordinate."""
    if not (run.model.springs or run.model.potentials):
        return {}
    springs = _kernels(build_springs(run.model))
    history = np.array([springs.force(q, qd, t, run.p) for t, q, qd in zip(run.t, run.q, run.qd, strict=True)])
    pulls: dict[str, dict[str, np.ndarray]] = {}
    for name, column in zip(run.coordinates, history.T, strict=True):
        for body in run.model.bodies.values():
            if any(c.name == name for e in body.elements for c in e.components):
                pulls.setdefault(body.name, {})[name] = column
                break
    return pulls


def _load(share, run, fixed: dict, k: int) -> np.ndarray:
    """f = M q̈ − Q + Φ_qᵀ λ of one body at instant k, over its own and all free coordinates."""
    t, p = run.t[k], run.p
    q = _spread(share, run, run.q[k], fixed)
    qd, qdd = (_spread(share, run, values[k], dict.fromkeys(fixed, 0.0)) for values in (run.qd, run.qdd))
    inertia = share.mass_matrix(q, t, p) @ qdd - share.force(q, qd, t, p)
    return inertia + share.jacobian(q, t, p).T @ run.lam[k]


def _spread(share, run, values, fixed: dict) -> np.ndarray:
    """Values over the share's coordinates: free ones from the run, released ones as they are fixed."""
    index = run.kernels.index
    return np.array([values[index[name]] if name in index else fixed[name] for name in share.coordinates])


def _uncertain_directions(run) -> np.ndarray:
    """Multipliers that do no work in general position, columns over the rows."""
    kernels = run.kernels
    rank = freedom(kernels, run.q[0], run.t[0], run.p).rank
    left = np.linalg.svd(scaled_jacobian(kernels, run.q[0], run.t[0], run.p).T, full_matrices=True)[2]
    return left[rank:].T / kernels.row_sizes[:, None]


