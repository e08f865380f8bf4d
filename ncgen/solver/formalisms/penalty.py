"""Forces of a penalty in place of constraints: M q̈ + Φ_qᵀλ = Q with λ = α(Φ_q q̈ − γ), so accelerations violate the rows by λ/α.

Both are solved for as one system: in M + αΦ_qᵀΦ_q the rounding of the penalty would spoil M.
"""

from __future__ import annotations

import numpy as np

from ncgen.solver.formalisms.instant import InstantMatrices
from ncgen.solver.formalisms.kkt import factored


def penalty(now: InstantMatrices, alpha: float) -> tuple[np.ndarray, np.ndarray]:
    n, solve = len(now.force), factored(now.mass, now.jacobian.T, now.jacobian, now.kernels, 1 / alpha)
    solution = solve(np.concatenate([now.force, now.gamma]))
    return solution[:n], solution[n:]
