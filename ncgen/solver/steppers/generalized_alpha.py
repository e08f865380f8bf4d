"""The generalised-α method for constrained systems (index 3), and HHT as its special case.

Φ(q₁) = 0 and M q̈₁ + Φ_qᵀ λ₁ = Q at the end of the step; positions and velocities follow from the auxiliary acceleration a by
Newmark's formulas, and (1 − αm) a₁ + αm a₀ = (1 − αf) q̈₁ + αf q̈₀. Order 2, damping of high frequencies by ρ∞.
Arnold, Brüls: Convergence of the generalized-α scheme for constrained mechanical systems, Multibody Syst. Dyn. 18 (2007),
doi 10.1007/s11044-007-9084-0. The velocity level of the constraints is not enforced: its violation stays of order h².
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ncgen.mechanism.kernels import Kernels
from ncgen.solver.steppers.stepper import Stepper


class GeneralizedAlpha(Stepper):
    """options: rho, ρ∞ from 0 (most damping) to 1 (none); hht, α of HHT from 0 to 1/3 in its place."""

    def __init__(self, kernels: Kernels, t: float, q: np.ndarray, qd: np.ndarray, p: np.ndarray, h: float, **options: Any) -> None:
        super().__init__(kernels, t, q, qd, p, h, **options)
        self.alpha_m, self.alpha_f, self.beta, self.gamma = newmark(self.settings["rho"], self.settings["hht"])
        self.a = self.qdd

    def _advance(self, end: float) -> None:
        h, beta, gamma, kernels = self.h, self.beta, self.gamma, self.kernels
        share = (1 - self.alpha_f) / (1 - self.alpha_m)
        base = (self.alpha_f * self.qdd - self.alpha_m * self.a) / (1 - self.alpha_m)  # a₁ = base + share q̈₁
        q0 = self.q + h * self.qd + h**2 * ((0.5 - beta) * self.a + beta * base)
        qd0 = self.qd + h * ((1 - gamma) * self.a + gamma * base)
        by_q, by_qd = h**2 * beta * share, h * gamma * share
        # Newton starts from the straight motion: accelerations of stiff springs would take it to another branch.
        qdd, lam = (self.q + h * self.qd - q0) / by_q, self.lam

        def correct() -> float:
            nonlocal qdd, lam
            q, qd = q0 + by_q * qdd, qd0 + by_qd * qdd
            jacobian, mass = kernels.jacobian(q, end, self.p), kernels.mass_matrix(q, end, self.p)
            stiffness, damping = self.tangents(q, qd, qdd, lam, end)
            rest = kernels.force(q, qd, end, self.p) - mass @ qdd - jacobian.T @ lam
            weight = mass + by_qd * damping + by_q * stiffness
            more, push = self.solve(weight, jacobian.T, self.closure_slope(q, end), rest, -self.closure(q, end) / by_q)
            qdd, lam = qdd + more, lam + push
            return self.relative(by_q * more)

        self.iterate(correct)
        q, qd = q0 + by_q * qdd, qd0 + by_qd * qdd
        self.add_work(end, q, qd)
        self.a = base + share * qdd
        self.q, self.qd, self.qdd, self.lam = q, qd, qdd, lam


def newmark(rho: float, hht: float | None) -> tuple[float, float, float, float]:
    """αm, αf, β and γ, of ρ∞ or of HHT's α."""
    alpha_m, alpha_f = (0.0, hht) if hht is not None else ((2 * rho - 1) / (rho + 1), rho / (rho + 1))
    gamma = 0.5 - alpha_m + alpha_f
    return alpha_m, alpha_f, (gamma + 0.5) ** 2 / 4, gamma
