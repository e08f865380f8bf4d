"""The equations with multipliers as one linear system, regular also where rows are redundant.

[W Aᵀ; A 0][x; y] = [f; c] is singular as soon as a row of A follows from others. With −ε in place of 0 it is regular wherever
[W; A] has full column rank, and each refinement by the residual of the system itself brings x nearer to the solution by
the factor ε/(ε + σ²) and y to the multipliers of smallest norm. It is the augmented Lagrangian method with penalty 1/ε.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, TypeAlias

import numpy as np
import scipy

from ncgen.errors import SingularError
from ncgen.mechanism.kernels import Kernels
from ncgen.solver.lapack import dgetrf, dgetrs
from ncgen.solver.positions.massless import massless

if TYPE_CHECKING:
    import scipy.sparse.linalg
    from scipy.sparse import csr_array

Matrix: TypeAlias = "np.ndarray | csr_array"

Solution: TypeAlias = Callable[[np.ndarray], np.ndarray]
"""From a right-hand side to [x; y]."""

EPSILON = 1e-10
REFINEMENTS = 6
SMALLEST_PIVOT = 1e-14
"""Smaller pivots, relative to the largest, mean a motion that has no inertia."""

MAX_DENSE_UNKNOWNS = 300
"""Systems with more unknowns are factored as sparse ones."""


class KKT:
    """The factored system for W (n, n) and A (m, n); `left` (n, m) stands for Aᵀ where it is not the transpose of A."""

    def __init__(self, weight: Matrix, jacobian: Matrix, kernels: Kernels, left: Matrix | None = None) -> None:
        left = jacobian.T if left is None else left
        if _is_large(weight, jacobian):
            weight, left, jacobian = (scipy.sparse.csr_array(matrix) for matrix in (weight, left, jacobian))
        self.weight, self.left, self.jacobian = weight, left, jacobian
        self._solve = factored(weight, left, jacobian, kernels, EPSILON)

    def solve(self, force: np.ndarray, gamma: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """x (n,) and y (m,), or (n, k) and (m, k) for k right-hand sides, refined until the residual no longer falls."""
        n = len(force)
        x, y, smallest = np.zeros_like(force), np.zeros_like(gamma), np.inf
        for _ in range(REFINEMENTS):
            rest = np.concatenate([force - self.weight @ x - self.left @ y, gamma - self.jacobian @ x])
            size = float(np.max(np.abs(rest), initial=0.0))
            if not size < smallest / 4:
                break
            step = self._solve(rest)
            x, y, smallest = x + step[:n], y + step[n:], size
        return x, y


def undetermined(kernels: Kernels, weight: np.ndarray, jacobian: np.ndarray) -> SingularError:
    """The refusal where accelerations are not determined: [M; Φ_q] has not full column rank."""
    return massless(kernels, np.vstack([weight, jacobian]))


def factored(weight: Matrix, left: Matrix, jacobian: Matrix, kernels: Kernels, corner: float) -> Solution:
    """A function that solves [W L; A −corner] [x; y] = right once. Raises SingularError where that has no inverse."""
    if _is_large(weight, jacobian):
        return _sparse(weight, left, jacobian, kernels, corner)
    return _dense(_full(weight), _full(left), _full(jacobian), kernels, corner)


def _is_large(weight: Matrix, jacobian: Matrix) -> bool:
    return _rows(weight) + _rows(jacobian) > MAX_DENSE_UNKNOWNS


def _rows(matrix: Matrix) -> int:
    return matrix.shape[0] if matrix.shape else 0


def _full(matrix: Matrix) -> np.ndarray:
    return matrix if isinstance(matrix, np.ndarray) else matrix.toarray()


def _dense(weight: np.ndarray, left: np.ndarray, jacobian: np.ndarray, kernels: Kernels, corner: float) -> Solution:
    n = len(weight)
    if not n + len(jacobian):
        return lambda right: right  # nothing moves and nothing holds it: LAPACK takes no empty system
    matrix = np.block([[weight, left], [jacobian, -corner * np.eye(len(jacobian))]])
    lu, exchanges, _ = dgetrf(matrix)
    pivots = np.abs(np.diag(lu))
    if n and not np.min(pivots) > SMALLEST_PIVOT * np.max(pivots):
        raise undetermined(kernels, weight, jacobian)
    return lambda right: dgetrs(lu, exchanges, right)[0]


def _sparse(weight: Matrix, left: Matrix, jacobian: Matrix, kernels: Kernels, corner: float) -> Solution:
    diagonal, csc_array = -corner * scipy.sparse.eye_array(_rows(jacobian)), scipy.sparse.csc_array
    blocks = scipy.sparse.block_array([[csc_array(weight), csc_array(left)], [csc_array(jacobian), diagonal]])
    try:
        factors = scipy.sparse.linalg.splu(csc_array(blocks))
    except RuntimeError:  # SuperLU's word for an exactly singular matrix
        raise undetermined(kernels, _full(weight), _full(jacobian)) from None
    return factors.solve
