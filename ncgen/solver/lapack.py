"""The routines of LAPACK that the solver calls, for doubles, with types: SciPy's module of them tells their names at run time only."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
import scipy

Found: TypeAlias = tuple[np.ndarray, int]
"""What a routine computes, and where it failed, 0 for nowhere."""


def dgetrf(matrix: np.ndarray) -> tuple[np.ndarray, np.ndarray, int]:
    """(LU, exchanges, failed) of a matrix."""
    return scipy.linalg.lapack.dgetrf(matrix)


def dgetrs(lu: np.ndarray, exchanges: np.ndarray, right: np.ndarray, trans: int = 0) -> Found:
    """(x, failed) of A x = right from LU, exchanges and right; trans=1: of Aᵀ x = right."""
    return scipy.linalg.lapack.dgetrs(lu, exchanges, right, trans=trans)


def dposv(matrix: np.ndarray, right: np.ndarray) -> tuple[np.ndarray, np.ndarray, int]:
    """(factor, x, failed) of A x = right for a positive definite A."""
    return scipy.linalg.lapack.dposv(matrix, right)


def dpotrf(matrix: np.ndarray) -> Found:
    """(factor, failed) of a positive definite matrix."""
    return scipy.linalg.lapack.dpotrf(matrix)


def dpotrs(factor: np.ndarray, right: np.ndarray) -> Found:
    """(x, failed) of A x = right from that factor and right."""
    return scipy.linalg.lapack.dpotrs(factor, right)
