"""The kinematics of a choice of independent coordinates at a position: R, and whether a step has passed a singular position.

With dependent coordinates d and independent z, Φ_q^d q̇_d = ν − Φ_q^z ż (the paper's eqs 49-53), so
q̇ = R ż + S ν and q̈ = R z̈ + S γ, where R = [−(Φ_q^d)⁻¹ Φ_q^z; 1] and S = [(Φ_q^d)⁻¹; 0] over the kept rows.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TypeAlias

import numpy as np

from ncgen.errors import SingularError
from ncgen.mechanism.kernels import Kernels
from ncgen.solver.lapack import dgetrf, dgetrs
from ncgen.solver.positions.partition import Partition

Factors: TypeAlias = tuple[np.ndarray, np.ndarray] | tuple[()]
"""LU and exchanges of rows of a square matrix; nothing of an empty one."""

TWO_NEGATIVE = 1.5
"""Two negative eigenvalues of B add more than this to the trace of 1 − B."""


@dataclass(frozen=True, eq=False)
class Kinematics:
    """The factorised Jacobian at a position: velocities and accelerations from independent ones; columns: Φ_q^d, over the kept rows."""

    partition: Partition
    factors: Factors
    R: np.ndarray
    columns: np.ndarray

    def has_turned(self, start: Kinematics) -> bool:
        """Whether Φ_q^d is singular between the start of a step and here, so that this may be another branch.

        Where one singular value passes 0, the determinant changes its sign, but where several do at once that tells nothing. With the
        columns A at the start of the step and B here, A + s (B − A) is singular for an s between 0 and 1 where A⁻¹B has a negative
        eigenvalue e. Those that do not pass 0 are near 1, or come nearer to 0: for them 0 ≤ (1 − e)² ≤ 1 − e, so if the sum of the
        squares is larger one has passed. As of `ncgen_dependent.c`.
        """
        if not self.factors:
            return False
        if self.orientation != start.orientation:
            return True
        rest = np.eye(len(self.columns)) - solve(start.factors, self.columns)
        total = np.trace(rest)
        return not (total < TWO_NEGATIVE or np.sum(rest * rest.T) <= total)

    @cached_property
    def orientation(self) -> int:
        """The sign of the determinant of Φ_q^d: it changes only where the partition or the mechanism is singular."""
        if not self.factors:
            return 1
        lu, exchanges = self.factors
        negative = int(np.sum(np.diag(lu) < 0)) + int(np.sum(exchanges != np.arange(len(exchanges))))
        return -1 if negative % 2 else 1

    def particular(self, right: np.ndarray) -> np.ndarray:
        """S·right over all coordinates: what satisfies Φ_q x = right with x_z = 0; right: (m,), or (m, k) for k of them."""
        result = np.zeros((self.R.shape[0], *right.shape[1:]))
        if len(self.partition.rows):
            result[self.partition.dependent] = solve(self.factors, right[self.partition.rows])
        return result

    def multipliers(self, right: np.ndarray, rows: int) -> np.ndarray:
        """λ with Φ_qᵀ λ = right on the dependent coordinates; rows that are not kept get zero. right: (n,), or (n, k)."""
        result = np.zeros((rows, *right.shape[1:]))
        if len(self.partition.rows):
            kept = solve(self.factors, right[self.partition.dependent], transposed=1)
            result[self.partition.rows] = kept
        return result


def kinematics(kernels: Kernels, partition: Partition, q: np.ndarray, t: float = 0.0, p: np.ndarray | None = None) -> Kinematics:
    """Factor Φ_q^d at q and form R. Raises SingularError where the factorisation breaks down."""
    jacobian = kernels.jacobian(q, t, p)[partition.rows]
    columns = jacobian[:, partition.dependent]
    R = np.zeros((kernels.n, len(partition.independent)))
    R[partition.independent, np.arange(len(partition.independent))] = 1.0
    if not len(partition.rows):
        return Kinematics(partition, (), R, columns)
    factors = factor(columns, kernels.name)
    R[partition.dependent] = -solve(factors, jacobian[:, partition.independent])
    return Kinematics(partition, factors, R, columns)


def kinematics_of_many(
    kernels: Kernels, partition: Partition, q: np.ndarray, t: float, p: np.ndarray, right: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """R (B, n, nz) at positions q (B, n) with parameters p (B, n_p), and S·right, (B, n), of right (B, m), as of `Kinematics`.

    Raises LinAlgError where a factorisation breaks down.
    """
    count, n = q.shape
    R, particular = np.zeros((count, n, len(partition.independent))), np.zeros((count, n))
    R[:, partition.independent, np.arange(len(partition.independent))] = 1.0
    if len(partition.rows):
        one = slice(0, 1) if (q == q[0]).all() and (p == p[0]).all() and (right == right[0]).all() else slice(None)  # a start for all
        jacobian, right = kernels.phi_q_pattern.dense(kernels.batch.phi_q(q[one], t, p[one]))[:, partition.rows], right[one]
        known = np.concatenate([-jacobian[:, :, partition.independent], right[:, partition.rows, None]], axis=2)
        solution = np.linalg.solve(jacobian[:, :, partition.dependent], known)
        R[:, partition.dependent], particular[:, partition.dependent] = solution[:, :, :-1], solution[:, :, -1]
    return R, particular


def factor(matrix: np.ndarray, name: str) -> Factors:
    """LU factors, none of an empty matrix; SingularError instead of infinities."""
    if not matrix.size:
        return ()
    lu, exchanges, _ = dgetrf(matrix)
    pivots = np.abs(np.diag(lu))
    if not np.min(pivots) > 1e-14 * np.max(pivots):
        raise SingularError(f"{name}: the Jacobian of the dependent coordinates is singular; choose other independent coordinates")
    return lu, exchanges


def solve(factors: Factors, right: np.ndarray, transposed: int = 0) -> np.ndarray:
    """x of A x = right, or of Aᵀ x = right."""
    return dgetrs(*factors, right, trans=transposed)[0] if factors else right
