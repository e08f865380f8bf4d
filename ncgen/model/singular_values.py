"""Singular values and what follows from them: ranks, pseudoinverses, least squares.

NumPy's method, divide and conquer of LAPACK, fails for some regular matrices, which take QR iterations here. So nothing calls NumPy's
functions but this module.
"""

from __future__ import annotations

import numpy as np


def svd(matrix: np.ndarray, full: bool = False) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return (U, singular values, Vᵀ); full: with all columns of U and V. Raises LinAlgError where a number is not finite."""
    try:
        return np.linalg.svd(matrix, full_matrices=full)
    except np.linalg.LinAlgError:
        if not np.all(np.isfinite(matrix)):
            raise
        import scipy.linalg  # which takes longer than most of what needs singular values

        return scipy.linalg.svd(matrix, full_matrices=full, lapack_driver="gesvd")


def singular_values(matrix: np.ndarray) -> np.ndarray:
    """Return the singular values alone, the largest first; of a stack of matrices (…, m, n) those of each."""
    try:
        return np.linalg.svd(matrix, compute_uv=False)
    except np.linalg.LinAlgError:
        if np.ndim(matrix) > 2:
            return np.array([singular_values(each) for each in matrix])
        return svd(matrix)[1]


def rank_above(matrix: np.ndarray, tolerance: float) -> np.ndarray:
    """Return how many singular values are above a tolerance; of a stack of matrices (…, m, n) those of each."""
    return np.count_nonzero(singular_values(matrix) > tolerance, axis=-1)


def pseudoinverse(matrix: np.ndarray, least: float) -> np.ndarray:
    """Return A⁺; singular values up to `least` times the largest are zero."""
    left, values, right = svd(matrix)
    kept = values > least * np.max(values, initial=0.0)
    return (right[kept].T / values[kept]) @ left[:, kept].T


def least_squares(matrix: np.ndarray, right: np.ndarray, least: float | None = None) -> np.ndarray:
    """Return the shortest x with the least |A x − right|; singular values up to `least` times the largest are zero (default: rounding)."""
    try:
        return np.linalg.lstsq(matrix, right, rcond=least)[0]
    except np.linalg.LinAlgError:
        rounding = np.finfo(float).eps * max(np.shape(matrix))
        return pseudoinverse(np.asarray(matrix), rounding if least is None else least) @ right
