"""Accelerations of an open tree by its tables beside those of the factored matrix, at positions and velocities that are drawn."""

from __future__ import annotations

import numpy as np

from ncgen.mechanism.kernels import Kernels
from ncgen.mechanism.moving import Moving, Stepping
from ncgen.solver.engines import acceleration_forms, capabilities, compiled
from ncgen.solver.positions.assembly import assemble
from ncgen.solver.positions.open_tree import tree_with_loops
from ncgen.solver.positions.rank import freedom, scaled_jacobian

AWAY = 0.3
"""How far from the start, in natural sizes."""

LEAST = 1e-3
"""Smaller accelerations, in natural sizes, are differences of larger ones."""


RANK, LEAST_SHARE = 1e-9, 1e-4
"""Singular values of the constraints, over the largest: below the first they are zero, between the two a position is nearly singular."""


class Near(Exception):
    """A position is too near a singular one to be compared."""


def apart(kernels: Kernels, seed: int) -> float:
    """The largest difference of the accelerations, over the largest; parameters are drawn, too."""
    tree = tree_with_loops(kernels)
    assert tree is not None
    generator = np.random.default_rng(seed)
    p = kernels.p0 * generator.uniform(0.97, 1.03, len(kernels.p0)) + generator.uniform(-0.1, 0.1, len(kernels.p0)) * (kernels.p0 == 0)
    moved = tree.velocities(kernels.q0, generator.uniform(-1, 1, len(tree.screws)))[: kernels.n]
    q = assemble(kernels, kernels.q0 + AWAY * moved / np.max(np.abs(moved) / kernels.column_sizes), p=p)
    sizes = np.array([1.0 if screw.point else kernels.length for screw in tree.screws])
    qd = tree.velocities(q, sizes * generator.uniform(-1, 1, len(tree.screws)))[: kernels.n]
    if tree.closing:
        qd = _allowed(kernels, q, p, qd)
    by_matrix, by_tables = (_accelerations(kernels, form, q, qd, p) / kernels.column_sizes for form in ("dense", "tree"))
    return float(np.max(np.abs(by_tables - by_matrix)) / max(np.max(np.abs(by_matrix)), LEAST))


def _allowed(kernels: Kernels, q: np.ndarray, p: np.ndarray, qd: np.ndarray) -> np.ndarray:
    """The nearest velocities that loops allow. Raises Near where constraints are about to depend on each other."""
    jacobian = scaled_jacobian(kernels, q, 0.0, p)
    _, values, directions = np.linalg.svd(jacobian, full_matrices=False)
    share = values / values[0]
    if np.any((share > RANK) & (share < LEAST_SHARE)):
        raise Near
    directions = directions[share > RANK]
    x = qd / kernels.column_sizes
    return (x - directions.T @ (directions @ x)) * kernels.column_sizes


def _accelerations(kernels: Kernels, form: compiled.Form, q: np.ndarray, qd: np.ndarray, p: np.ndarray) -> np.ndarray:
    dynamics = acceleration_forms.all_coordinates(capabilities.checked_compiled(kernels), form=form)
    moving = Moving(Stepping(dynamics, "dop853", freedom(kernels).rank, 1e-8, 1e-10, None, 1e-12))
    moving.q[:], moving.qd[:], moving.p[:] = q, qd, p
    if moving.evaluate() != "ok":  # neither form has accelerations there
        assert form == "dense"
        raise Near
    return moving.qdd.copy()
