"""Rows of large mechanisms, which are sparse: whether they are independent, the smallest steps that close them, motions that they allow.

All of it by Φ_q Φ_qᵀ, which is as sparse as the mechanism. Where rows are dependent or nearly so, dense linear algebra answers instead.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, cast

import numpy as np
import scipy

if TYPE_CHECKING:
    import scipy.sparse.linalg

DENSE = 200
"""From this many rows on sparse algebra is tried before dense one."""

MAX_CONDITION = 1e12
"""Rows are clearly independent when the condition number of Φ_q Φ_qᵀ, scaled, is below this."""

DAMPING = 1e-13
"""Of steps with dependent rows, relative to the norm of Φ_q Φ_qᵀ."""

MAX_DAMPED_RESIDUAL = 1e-6
"""What such a step may leave of the right-hand side, relative; more is left where rows contradict each other or are nearly dependent."""


@dataclass(frozen=True, eq=False)
class IndependentRows:
    """A sparse matrix (m, n) of full row rank, and the factors of its product with its transpose."""

    matrix: scipy.sparse.csr_array
    factors: scipy.sparse.linalg.SuperLU

    def least(self, right: np.ndarray) -> np.ndarray:
        """The smallest x (n,) with A x = right (m,)."""
        x = self.matrix.T @ self.factors.solve(right)
        return x + self.matrix.T @ self.factors.solve(right - self.matrix @ x)  # what squaring the condition number has lost

    def allowed(self, x: np.ndarray) -> np.ndarray:
        """The part of x (n,) that the rows do not see."""
        return x - self.least(self.matrix @ x)


def independent_rows(matrix: scipy.sparse.csr_array) -> IndependentRows | None:
    """The factors of a sparse matrix (m, n) that certainly has full row rank; None leaves the question open.

    Φ_q Φ_qᵀ is factorised and its condition number estimated in the 1-norm (Higham and Tisseur 2000), which bounds
    that in the 2-norm for a symmetric matrix: below MAX_CONDITION, every singular value of Φ_q is far above rounding.
    """
    gram = (matrix @ matrix.T).tocsc()
    try:
        factors = scipy.sparse.linalg.splu(gram, permc_spec="MMD_AT_PLUS_A")
    except RuntimeError:  # SuperLU's word for an exactly singular matrix
        return None
    operator = cast(Any, scipy.sparse.linalg.LinearOperator)  # what it is made of stands in __new__, where no type is found
    inverse = operator(gram.shape, factors.solve, rmatvec=factors.solve, dtype=float)
    norm = cast(float, scipy.sparse.linalg.onenormest(inverse))  # with vectors only if they are asked for
    return IndependentRows(matrix, factors) if norm * scipy.sparse.linalg.norm(gram, 1) < MAX_CONDITION else None


def least_step(matrix: scipy.sparse.csr_array, right: np.ndarray) -> np.ndarray | None:
    """The smallest x (n,) with A x = right (m,), also where rows are dependent and agree; None leaves the question open."""
    if rows := independent_rows(matrix):
        return rows.least(right)
    damping = DAMPING * cast(float, scipy.sparse.linalg.norm(matrix, 1)) * cast(float, scipy.sparse.linalg.norm(matrix, np.inf))
    x = least_damped(matrix, right, damping)
    x = x + least_damped(matrix, right - matrix @ x, damping)
    is_solved = np.max(np.abs(right - matrix @ x)) <= MAX_DAMPED_RESIDUAL * np.max(np.abs(right))
    return x if is_solved else None


def least_damped(matrix: scipy.sparse.csr_array, right: np.ndarray, damping: float) -> np.ndarray:
    """x (n,) with the least |A x − right|² + damping |x|²."""
    gram = (matrix @ matrix.T + damping * scipy.sparse.eye_array(len(right))).tocsc()
    return matrix.T @ scipy.sparse.linalg.splu(gram, permc_spec="MMD_AT_PLUS_A").solve(right)


def scaled(matrix: scipy.sparse.csr_array, rows: np.ndarray, columns: np.ndarray) -> scipy.sparse.csr_array:
    """The matrix with its rows and columns multiplied by numbers."""
    return scipy.sparse.csr_array(scipy.sparse.diags_array(rows) @ matrix @ scipy.sparse.diags_array(columns))
