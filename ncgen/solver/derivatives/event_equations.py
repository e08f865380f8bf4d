"""What derivatives of events have in common: linear equations at a state, changes of what has a Jacobian, and the refusal."""

from __future__ import annotations

import numpy as np

from ncgen.errors import ModelError
from ncgen.mechanism.kernels import Kernels
from ncgen.solver.events.state import State
from ncgen.solver.formalisms.instant import scaled_mass
from ncgen.solver.formalisms.kkt import KKT
from ncgen.solver.positions.rank import scaled_jacobian


def no_derivative(kernels: Kernels, names: str, why: str, remedy: str) -> ModelError:
    """The refusal of events of these names."""
    return ModelError(f"{kernels.name}: there is no derivative through the event {names}, which {why}; {remedy}")


def along(columns: np.ndarray, time: np.ndarray, change: np.ndarray) -> np.ndarray:
    """How something with a Jacobian (…, 1 + N) by t, q, q̇ and p changes, (…, N), with the instant and the state."""
    return columns @ np.vstack([time, change])


def solved(
    kernels: Kernels, at: State, rows: np.ndarray, force: np.ndarray, right: np.ndarray, constraints: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """x (n, c) and y (m + k, c) of M x + Aᵀ y = force, A x = right, where A has the constraints and rows (k, n); redundant ones do no
    harm. constraints: numbers of the constraints that A has, None for all"""
    constraints = np.arange(kernels.m) if constraints is None else constraints
    columns = kernels.column_sizes[:, None]
    norms = np.max(np.abs(rows) * columns.T, axis=1, initial=0.0)
    sizes = np.concatenate([kernels.row_sizes[constraints], norms])[:, None]
    mass, unit = scaled_mass(kernels, at.q, at.t, at.p)
    scaled = np.vstack([scaled_jacobian(kernels, at.q, at.t, at.p)[constraints], rows * columns.T / norms[:, None]])
    x, y = KKT(mass, scaled, kernels).solve(columns * force / unit, right / sizes)
    return columns * x, unit * y / sizes


def impulses_to(kernels: Kernels, at: State, qd: np.ndarray, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Those of the constraints (m,), and along other rows (k, n), that change velocities to qd (n,)."""
    jump = qd - at.qd
    right = np.concatenate([kernels.jacobian(at.q, at.t, at.p) @ jump, rows @ jump])[:, None]
    _, y = solved(kernels, at, rows, np.zeros((kernels.n, 1)), right)
    return y[: kernels.m, 0], y[kernels.m :, 0]


def reactions(kernels: Kernels, at: State, qd: np.ndarray, force: np.ndarray) -> np.ndarray:
    """Impulses (m,) of the constraints where those along coordinates, force (n,), change velocities to qd (n,)."""
    right = kernels.jacobian(at.q, at.t, at.p) @ (qd - at.qd)
    return solved(kernels, at, np.zeros((0, kernels.n)), force[:, None], right[:, None])[1][:, 0]
