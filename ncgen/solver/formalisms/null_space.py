"""Accelerations split by an orthonormal basis: q̈ = Y y + N v̇, the columns of N a basis of the motions Φ_q allows.

From Φ_qᵀ Π = [Y N] [R; 0], a QR factorisation with column exchanges: y follows from the rows, v̇ from
NᵀMN v̇ = Nᵀ(Q − M Y y), the multipliers from the rest of the balance. Redundant rows come last and are left out.
"""

from __future__ import annotations

from typing import cast

import numpy as np
import scipy.linalg

from ncgen.solver.formalisms.instant import InstantMatrices
from ncgen.solver.formalisms.kkt import SMALLEST_PIVOT, undetermined
from ncgen.solver.lapack import dpotrf
from ncgen.solver.positions.rank import RELATIVE_ZERO


def null_space(now: InstantMatrices) -> tuple[np.ndarray, np.ndarray]:
    factors = scipy.linalg.qr(now.jacobian.T, pivoting=True)
    basis, triangle, order = cast("tuple[np.ndarray, np.ndarray, np.ndarray]", factors)  # SciPy has no types
    pivots = np.abs(np.diag(triangle))
    rank = int(np.sum(pivots > RELATIVE_ZERO * np.max(pivots, initial=0.0)))
    kept, triangle = order[:rank], triangle[:rank, :rank]
    ranged, free = basis[:, :rank], basis[:, rank:]
    x = ranged @ scipy.linalg.solve_triangular(triangle, now.gamma[kept], trans=1) if rank else np.zeros(len(now.force))
    if free.shape[1]:
        x = x + free @ _free_accelerations(free, now, x)
    y = np.zeros(len(now.gamma))
    if rank:
        y[kept] = scipy.linalg.solve_triangular(triangle, ranged.T @ (now.force - now.mass @ x))
    return x, y


def _free_accelerations(free: np.ndarray, now: InstantMatrices, particular: np.ndarray) -> np.ndarray:
    reduced = free.T @ now.mass @ free
    factor, failed = dpotrf(reduced)
    if failed or np.min(np.diag(factor)) ** 2 <= SMALLEST_PIVOT * np.max(np.diag(reduced)):
        raise undetermined(now.kernels, now.mass, now.jacobian)
    return scipy.linalg.cho_solve((factor, False), free.T @ (now.force - now.mass @ particular))
