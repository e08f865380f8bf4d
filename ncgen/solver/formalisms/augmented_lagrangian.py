"""Multipliers by iteration on a penalty: (M + αΦ_qᵀΦ_q) is positive definite wherever accelerations are determined.

q̈ₖ₊₁ solves M q̈ + Φ_qᵀ(λₖ + α(Φ_q q̈ − γ)) = Q, and λₖ₊₁ = λₖ + α(Φ_q q̈ₖ₊₁ − γ). Each iteration is written as a correction,
since its right-hand side then holds what the rounding of the large penalty has spoilt.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ncgen.solver.formalisms.instant import InstantMatrices
from ncgen.solver.formalisms.kkt import undetermined
from ncgen.solver.lapack import dpotrf, dpotrs

ITERATIONS = 12
CORRECTION_TOLERANCE = 1e-14
"""Corrections below this, relative to the accelerations, end the iteration."""


def augmented_lagrangian(now: InstantMatrices, alpha: float) -> tuple[np.ndarray, np.ndarray]:
    x, y = np.zeros(len(now.force)), np.zeros(len(now.gamma))
    correct = _correction(now, alpha)
    last = np.inf
    for _ in range(ITERATIONS):
        step = correct(x, y)
        x = x + step
        y = y + alpha * (now.jacobian @ x - now.gamma)
        size = float(np.max(np.abs(step), initial=0.0))
        if size <= CORRECTION_TOLERANCE * np.max(np.abs(x), initial=0.0) or size >= last:
            break
        last = size
    return x, y


def _correction(now: InstantMatrices, alpha: float) -> Callable[[np.ndarray, np.ndarray], np.ndarray]:
    """The correction of accelerations x with multipliers y."""
    jacobian = now.jacobian
    if not len(now.force):
        return lambda x, y: x  # nothing can move, which LAPACK does not take
    factor, failed = dpotrf(now.mass + alpha * jacobian.T @ jacobian)
    if failed:
        raise undetermined(now.kernels, now.mass, now.jacobian)

    def correct(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        rest = now.force - now.mass @ x - jacobian.T @ (y + alpha * (jacobian @ x - now.gamma))
        return dpotrs(factor, rest)[0]

    return correct
