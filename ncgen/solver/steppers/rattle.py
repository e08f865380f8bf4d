"""RATTLE: half a kick, a drift onto Φ(q₁) = 0, half a kick onto Φ_q q̇₁ = ν.

Symmetric and of order 2; symplectic where M is constant and forces have a potential, so that energy errors do not grow.
Forces that depend on velocities take that of the drift in both kicks, which keeps the symmetry.
Andersen: Rattle: a "velocity" version of the Shake algorithm, J. Comput. Phys. 52 (1983), doi 10.1016/0021-9991(83)90014-1.
"""

from __future__ import annotations

from ncgen.solver.steppers.stepper import Stepper


class Rattle(Stepper):
    def _advance(self, end: float) -> None:
        kernels, h, t, p = self.kernels, self.h, self.t, self.p
        mass = kernels.mass_matrix(self.q, t, p)
        before = kernels.jacobian(self.q, t, p)
        middle, lam = self.qd + h / 2 * self.qdd, self.lam

        def correct() -> float:
            nonlocal middle, lam
            q = self.q + h * middle
            force = kernels.force(self.q, middle, t, p)
            rest = h / 2 * (force - before.T @ lam) - mass @ (middle - self.qd)
            weight = mass + h / 2 * kernels.damping(self.q, middle, t, p).toarray()
            more, push = self.solve(weight, before.T, self.closure_slope(q, end), rest, -self.closure(q, end) / h)
            middle, lam = middle + more, lam + 2 / h * push
            return self.relative(h * more)

        self.iterate(correct)
        q = self.q + h * middle
        after, mass, nu = kernels.jacobian(q, end, p), kernels.mass_matrix(q, end, p), kernels.nu(q, end, p)
        kick = h / 2 * kernels.force(q, middle, end, p)
        change, push = self.solve(mass, after.T, after, kick, nu - after @ middle)
        qd, lam = middle + change, 2 / h * push
        self.add_work(end, q, qd)
        self.q, self.qd, self.qdd, self.lam = q, qd, 2 / h * change, lam
