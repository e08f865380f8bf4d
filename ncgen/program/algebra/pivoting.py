"""The order in which a QR factorisation with exchanges takes the columns of a matrix."""

from __future__ import annotations

from typing import cast

import numpy as np
import scipy

MAX_DENSE_ENTRIES = 40_000
"""Entries up to which the factorisation is done here: importing SciPy's linear algebra takes longer, a quarter of a first start."""


def _firmly(matrix: np.ndarray) -> np.ndarray:
    """A matrix whose columns are a little smaller the later they come, so that of equal ones the first is chosen, whatever the rounding."""
    return matrix * (1.0 - 1e-6 * np.arange(matrix.shape[1]) / max(1, matrix.shape[1]))


def column_order(matrix: np.ndarray) -> np.ndarray:
    """Return the columns of a matrix (rows, columns) as a QR factorisation with exchanges takes them, the farthest from dependent first, of
    equal ones the first (Golub & Van Loan, Matrix Computations, 2013, section 5.4.2)."""
    matrix = _firmly(matrix)
    if matrix.size > MAX_DENSE_ENTRIES:
        _, order = cast("tuple[np.ndarray, np.ndarray]", scipy.linalg.qr(matrix, mode="r", pivoting=True))  # SciPy has no types
        return order
    return _by_reflections(matrix)


def _by_reflections(matrix: np.ndarray) -> np.ndarray:
    """As LAPACK's dgeqp3, by Householder's reflections; what is left of every column is measured anew in each step."""
    left, order = np.array(matrix, dtype=float), np.arange(matrix.shape[1])
    for k in range(min(matrix.shape)):
        rest = left[k:, k:]
        best = k + int(np.argmax(np.einsum("ij,ij->j", rest, rest)))
        if best != k:
            left[:, [k, best]], order[[k, best]] = left[:, [best, k]], order[[best, k]]
        normal = left[k:, k].copy()
        normal[0] += np.copysign(np.sqrt(normal @ normal), normal[0])
        if square := normal @ normal:
            left[k:, k:] -= np.outer(2.0 / square * normal, normal @ left[k:, k:])
    return order
