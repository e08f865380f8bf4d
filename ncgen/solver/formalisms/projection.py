"""Projection of positions and velocities onto the constraints, along the directions that inertia resists least.

The nearest position in the metric of M solves M dq + Φ_qᵀ μ = 0, Φ_q dq = −Φ: the equations of motion with other
right-hand sides, so coordinates without mass and redundant rows do no harm. Likewise for velocities.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import scipy

from ncgen.errors import ConvergenceError
from ncgen.mechanism.kernels import Kernels
from ncgen.solver.formalisms.instant import scaled_mass
from ncgen.solver.formalisms.kkt import KKT, MAX_DENSE_UNKNOWNS
from ncgen.solver.positions.position import TOLERANCE, residual
from ncgen.solver.positions.rank import scaled_jacobian, sparse_jacobian
from ncgen.solver.positions.sparse_rows import scaled

if TYPE_CHECKING:
    import scipy.sparse.linalg

LIMIT = 12


@dataclass(frozen=True, eq=False)
class Projected:
    """A consistent position and velocity, the Newton steps they took, and how far q moved, relative to its natural sizes."""

    q: np.ndarray
    qd: np.ndarray
    steps: int
    moved: float


def project(kernels: Kernels, q: np.ndarray, qd: np.ndarray, t: float = 0.0, p: np.ndarray | None = None) -> Projected:
    """The consistent position and velocity nearest to q and q̇; a consistent one comes back to the last bit.

    Raises ConvergenceError with the residual if q is too far from closed, SingularError where a motion has no inertia.
    """
    closed, steps = project_position(kernels, q, t, p)
    moved = float(np.max(np.abs(closed - q) / kernels.column_sizes, initial=0.0))
    return Projected(closed, project_velocity(kernels, closed, qd, t, p), steps, moved)


def project_position(kernels: Kernels, q: np.ndarray, t: float = 0.0, p: np.ndarray | None = None) -> tuple[np.ndarray, int]:
    """The consistent position (n,) nearest to q, and the Newton steps it took; else as `project`."""
    history = [residual(kernels, q, t, p)]
    while not history[-1] <= TOLERANCE:
        if len(history) > LIMIT or not np.isfinite(history[-1]):
            raise ConvergenceError(
                f"{kernels.name}: the position cannot be projected onto the constraints at t = {t:.6g} s, "
                f"the relative residual is {history[-1]:.2g}; take smaller steps (rtol, max_step)",
                tuple(history),
            )
        step = least_energy(kernels, q, t, p).solve(np.zeros(kernels.n), -kernels.phi(q, t, p) / kernels.row_sizes)[0]
        q = q + kernels.column_sizes * step
        history.append(residual(kernels, q, t, p))
    return q, len(history) - 1


def project_velocity(kernels: Kernels, q: np.ndarray, qd: np.ndarray, t: float = 0.0, p: np.ndarray | None = None) -> np.ndarray:
    """The velocity nearest to q̇ that satisfies Φ_q q̇ = ν; a consistent one comes back to the last bit."""
    rows, sizes = kernels.row_sizes, kernels.column_sizes
    jacobian_of = scaled_jacobian if kernels.n + kernels.m <= MAX_DENSE_UNKNOWNS else sparse_jacobian
    jacobian, nu = jacobian_of(kernels, q, t, p), kernels.nu(q, t, p) / rows
    rest = nu - jacobian @ (qd / sizes)
    terms = abs(jacobian) @ np.abs(qd / sizes) + np.abs(nu)
    if np.all(np.abs(rest) <= 4 * np.finfo(float).eps * terms):
        return qd
    return qd + sizes * least_energy(kernels, q, t, p).solve(np.zeros(kernels.n), rest)[0]


def least_energy(
    kernels: Kernels, q: np.ndarray, t: float = 0.0, p: np.ndarray | None = None, held: scipy.sparse.csr_array | None = None
) -> KKT:
    """The equations of the changes, in natural sizes, that constraints allow with the least kinetic energy.

    held (k, n): rows besides, of one number each
    Raises SingularError where a motion that they allow has no inertia.
    """
    held = scipy.sparse.csr_array((0, kernels.n)) if held is None else held
    if kernels.n + kernels.m + held.nnz <= MAX_DENSE_UNKNOWNS:
        rows = np.vstack([scaled_jacobian(kernels, q, t, p), held.toarray()])
        return KKT(scaled_mass(kernels, q, t, p)[0], rows, kernels)
    columns = kernels.column_sizes
    mass = scaled(kernels.mass(q, t, p), columns, columns)
    rows = scipy.sparse.csr_array(scipy.sparse.vstack([sparse_jacobian(kernels, q, t, p), held]))
    return KKT(mass / (float(np.max(mass.diagonal(), initial=0.0)) or 1.0), rows, kernels)
