"""The midpoint scheme that conserves energy: M (v₁ − v₀)/h = Q̄ − Āᵀ λ, q₁ − q₀ = h (v₀ + v₁)/2, Φ(q₁) = 0.

Natural coordinates invite it: with M constant and Φ quadratic, Φ_q in the middle times q₁ − q₀ is Φ(q₁) − Φ(q₀) exactly, so
the multipliers do no work, and a linear potential (weight) gives exact forces. What is not of that kind is corrected along
q₁ − q₀ (Gonzalez' discrete gradient), for rows and forces alike, so that T + V − W is kept to rounding in any case, W being
the work by the midpoint rule. Order 2. The momenta of bodies that float are kept where M is constant.
The velocity level of the constraints is hidden in this scheme and violated by O(h); `project_velocities` puts the velocities
onto it after every step, at the cost of exact energy.
Gonzalez: Time integration and discrete Hamiltonian systems, J. Nonlinear Sci. 6 (1996), doi 10.1007/BF02440162.
"""

from __future__ import annotations

import numpy as np

from ncgen.solver.formalisms.projection import project_velocity
from ncgen.solver.steppers.stepper import Stepper

STILL = 1e-10
"""A step that moves less than this, in natural sizes, needs no correction: it would be rounding over rounding."""


class EnergyMomentum(Stepper):
    """options: project_velocities."""

    def _advance(self, end: float) -> None:
        h, half, kernels, p = self.h, (self.t + end) / 2, self.kernels, self.p
        qd, lam = self.qd, self.lam

        def correct() -> float:
            nonlocal qd, lam
            q, at, rate, change = *self._places(qd), qd - self.qd
            rows, force = self._discrete(q, qd, end)
            mass = kernels.mass_matrix(at, half, p)
            stiffness, damping = self.tangents(at, rate, change / h, lam, half)
            weight = mass + h / 2 * damping + h**2 / 4 * stiffness
            rest = h * (force - rows.T @ lam) - mass @ change
            more, push = self.solve(weight, rows.T, self.closure_slope(q, end), rest, -2 / h * self.closure(q, end))
            qd, lam = qd + more, lam + push / h
            return self.relative(h / 2 * more)

        self.iterate(correct)
        q, at, rate = self._places(qd)
        self.work += h * float(kernels.energy(at, rate, half, p)[2] - kernels.nu(at, half, p) @ lam)
        qdd = (qd - self.qd) / h
        if self.settings["project_velocities"]:
            qd = project_velocity(kernels, q, qd, end, p)
        self.q, self.qd, self.qdd, self.lam = q, qd, qdd, lam

    def _places(self, qd: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """q₁, and position and velocity in the middle of the step."""
        rate = (self.qd + qd) / 2
        return self.q + self.h * rate, self.q + self.h / 2 * rate, rate

    def _discrete(self, q: np.ndarray, qd: np.ndarray, end: float) -> tuple[np.ndarray, np.ndarray]:
        """Φ_q and Q in the middle, corrected along q₁ − q₀ so that their work is the change of Φ and of energy."""
        kernels, h, half, p = self.kernels, self.h, (self.t + end) / 2, self.p
        _, at, rate = self._places(qd)
        rows, force = kernels.jacobian(at, half, p), kernels.force(at, rate, half, p)
        moved = q - self.q
        along = moved / self.columns**2
        if moved @ along < STILL**2:
            return rows, force
        along = along / (moved @ along)
        gap = kernels.phi(q, end, p) - kernels.phi(self.q, self.t, p) + h * kernels.nu(at, half, p) - rows @ moved
        before, after = kernels.energy(self.q, self.qd, self.t, p), kernels.energy(q, qd, end, p)
        kinetic = rate @ kernels.mass_matrix(at, half, p) @ (qd - self.qd) - (after[0] - before[0])
        work = before[1] - after[1] + h * kernels.energy(at, rate, half, p)[2] + kinetic
        return rows + np.outer(np.where(self._rolling, 0.0, gap), along), force + (work - force @ moved) * along
