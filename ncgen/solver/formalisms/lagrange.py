"""Accelerations and multipliers together: [M Φ_qᵀ; Φ_q 0][q̈; λ] = [Q; γ] (index 1)."""

from __future__ import annotations

import numpy as np

from ncgen.solver.formalisms.instant import InstantMatrices
from ncgen.solver.formalisms.kkt import KKT


def lagrange(now: InstantMatrices) -> tuple[np.ndarray, np.ndarray]:
    return KKT(now.mass, now.jacobian, now.kernels).solve(now.force, now.gamma)
