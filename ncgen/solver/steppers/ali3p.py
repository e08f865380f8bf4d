"""Index-3 augmented Lagrangian by the trapezoidal rule, with mass-orthogonal projections of velocities and accelerations.

Positions: Newton on (h²/4)(M q̈ + Φ_qᵀ(λ + αΦ) − Q) with tangent P + (h²/4) α Φ_qᵀΦ_q, P = M + (h/2) C + (h²/4) K, and
λ += αΦ after each step. Then, with the same matrix, velocities and accelerations are brought onto Φ_q q̇ = ν and
Φ_q q̈ = γ in the metric of P, repeated until the rows close to rounding. All systems have n unknowns and are regular
for redundant rows and singular M.
Bayo, Ledesma: Augmented Lagrangian and mass-orthogonal projection methods for constrained multibody dynamics,
Nonlinear Dyn. 9 (1996), doi 10.1007/BF01833296; Cuadrado, Gutiérrez, Naya, Morer, IJNME 51 (2001).
"""

from __future__ import annotations

import numpy as np

from ncgen.mechanism.kernels import Kernels
from ncgen.solver.lapack import dgetrf, dgetrs
from ncgen.solver.positions.massless import massless
from ncgen.solver.positions.partition import Factors
from ncgen.solver.steppers.stepper import Stepper

PROJECTIONS = 6


class Ali3p(Stepper):
    """options: alpha, the penalty α h²/4 over the largest entry that P has had."""

    takes_all_rows = True

    _unit = 0.0
    """That entry. It never falls: a P made of nothing but rounded multipliers would make the penalty nothing, too."""

    def _advance(self, end: float) -> None:
        h, kernels = self.h, self.kernels
        q, lam = self.q + h * self.qd, self.lam

        def rates(q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            qd = 2 / h * (q - self.q) - self.qd
            return qd, 2 / h * (qd - self.qd) - self.qdd

        def correct() -> float:
            nonlocal q, lam
            qd, qdd = rates(q)
            self._factor(q, qd, qdd, lam, end)
            value = self.closure(q, end)
            balance = kernels.force(q, qd, end, self.p) - kernels.mass_matrix(q, end, self.p) @ qdd - self._transposed @ lam
            more = self._solve(h**2 / 4 * balance, -value)
            q = q + more
            lam = lam + 4 / h**2 * self._push(self._rows @ more + value)
            return self.relative(more)

        self.iterate(correct)
        qd, qdd = rates(q)
        self._factor(q, qd, qdd, lam, end)
        qd = self._projected(qd, kernels.nu(q, end, self.p))
        qdd = self._projected(qdd, kernels.gamma(q, qd, end, self.p))
        self.add_work(end, q, qd)
        self.q, self.qd, self.qdd, self.lam = q, qd, qdd, lam

    def _factor(self, q: np.ndarray, qd: np.ndarray, qdd: np.ndarray, lam: np.ndarray, end: float) -> None:
        h = self.h
        stiffness, damping = self.tangents(q, qd, qdd, lam, end)
        tangent = self.kernels.mass_matrix(q, end, self.p) + h / 2 * damping + h**2 / 4 * stiffness
        self._rows, self._transposed = self.closure_slope(q, end), self.kernels.jacobian(q, end, self.p).T
        scaled = self._rows * self.columns / self.rows[:, None]
        left = self.columns[:, None] * self._transposed / self.rows
        tangent = self.columns[:, None] * tangent * self.columns
        self._unit = max(self._unit, float(np.max(np.abs(np.diag(tangent)), initial=0.0))) or 1.0
        self._factors = _factored(tangent / self._unit + self.settings["alpha"] * left @ scaled, self.kernels)

    def _solve(self, force: np.ndarray, gap: np.ndarray) -> np.ndarray:
        """x of P x + αΦ_qᵀ(Φ_q x − gap) = force."""
        right = self.columns * (force + self._transposed @ self._push(gap)) / self._unit
        return self.columns * dgetrs(*self._factors, right)[0] if self._factors else right

    def _push(self, gap: np.ndarray) -> np.ndarray:
        """The multipliers that a violation calls forth: α times it."""
        return self.settings["alpha"] * self._unit * gap / self.rows**2

    def _projected(self, x: np.ndarray, right: np.ndarray) -> np.ndarray:
        """The nearest to x in the metric of P with Φ_q x = right; each pass divides the violation by about α."""
        rows, last = self._transposed.T, np.inf
        for _ in range(PROJECTIONS):
            gap = right - rows @ x
            size = float(np.max(np.abs(gap) / self.rows, initial=0.0))
            if not size < last / 4:
                break
            x, last = x + self._solve(np.zeros(len(x)), gap), size
        return x


def _factored(matrix: np.ndarray, kernels: Kernels) -> Factors:
    """LU factors, none of an empty matrix; SingularError where a motion has neither inertia nor anything else against it."""
    if not matrix.size:
        return ()
    lu, exchanges, _ = dgetrf(matrix)
    if not np.min(np.abs(np.diag(lu))) > 0.0:
        raise massless(kernels, matrix)
    return lu, exchanges
