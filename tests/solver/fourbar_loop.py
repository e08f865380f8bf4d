"""The four-bar linkage of the examples as one equation in its crank angle θ: loop closure by circles, then Lagrange.

Uniform bars, so a bar whose ends move with a and b has the kinetic energy m/6 (a·a + a·b + b·b). With
T = ½ J(θ) θ̇² the motor torque is τ = J θ̈ + ½ J′ θ̇² + V′. Derivatives with respect to θ are sympy's.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np
import sympy
from scipy.integrate import solve_ivp

GRAVITY = 9.81
CRANK, COUPLER, ROCKER = 0.2, 0.8, 0.6
A, D = np.zeros(2), np.array([0.4, 0.0])
B0, C0 = np.array([0.1, 0.0]), np.array([0.35, 0.3])


class FourbarLoop:
    """Positions of B and C, inertia, potential and forces as functions of the crank's angle."""

    @cached_property
    def _curves(self):
        """θ ↦ (B, C), (B′, C′), (B″, C″), each shape (2, 2)."""
        theta = sympy.Symbol("theta")
        crank, coupler, rocker = (float(np.linalg.norm(v)) for v in (B0 - A, C0 - B0, C0 - D))
        b = sympy.Matrix([crank * sympy.cos(theta), crank * sympy.sin(theta)])
        to_d = sympy.Matrix(D) - b
        square = to_d.dot(to_d)
        along = (coupler**2 - rocker**2 + square) / (2 * square)
        across = sympy.sqrt(coupler**2 / square - along**2)
        c = b + along * to_d + across * sympy.Matrix([-to_d[1], to_d[0]])
        places = sympy.Matrix([b.T, c.T])
        return sympy.lambdify(theta, [places, places.diff(theta), places.diff(theta, 2)], cse=True)

    def places(self, theta):
        """B and C (m), shape (2, 2)."""
        return np.asarray(self._curves(theta)[0])

    def accelerations(self, theta, rate, acceleration):
        """Of B and C (m/s²), shape (2, 2)."""
        _, first, second = map(np.asarray, self._curves(theta))
        return first * acceleration + second * rate**2

    def _bars(self, theta):
        """(mass, ends, their first and second derivatives) of the three bars."""
        still = np.zeros(2)
        (b, c), (db, dc), (ddb, ddc) = self._curves(theta)
        yield CRANK, (A, b), (still, db), (still, ddb)
        yield COUPLER, (b, c), (db, dc), (ddb, ddc)
        yield ROCKER, (c, D), (dc, still), (ddc, still)

    def inertia(self, theta):
        """(J, J′): kg m²."""
        J = slope = 0.0
        for m, _, (a, b), (da, db) in self._bars(theta):
            J += m / 3 * (a @ a + a @ b + b @ b)
            slope += m / 3 * (2 * a @ da + da @ b + a @ db + 2 * b @ db)
        return J, slope

    def potential(self, theta):
        """(V, V′): J, with the height of A as zero."""
        V = sum(m * GRAVITY * (a[1] + b[1]) / 2 for m, (a, b), _, _ in self._bars(theta))
        return V, sum(m * GRAVITY * (a[1] + b[1]) / 2 for m, _, (a, b), _ in self._bars(theta))

    def energy(self, theta, rate):
        return 0.5 * self.inertia(theta)[0] * rate**2 + self.potential(theta)[0]

    def torque(self, theta, rate, acceleration):
        """What turns the crank in this way (N m)."""
        (J, slope), (_, pull) = self.inertia(theta), self.potential(theta)
        return J * acceleration + 0.5 * slope * rate**2 + pull

    def acceleration(self, theta, rate):
        """θ̈ of the free motion."""
        return -self.torque(theta, rate, 0.0) / self.inertia(theta)[0]

    def motion(self, rate, times, tolerance=1e-12):
        """θ and θ̇ of the free motion at some times, shape (2, K)."""

        def derivative(_, y):
            return y[1], self.acceleration(*y)

        span = times[0], times[-1]
        return solve_ivp(derivative, span, (0.0, rate), method="DOP853", t_eval=times, rtol=tolerance, atol=tolerance).y

    def pin_forces(self, theta, rate, acceleration):
        """Forces (N) on the coupler at B and at C: its own balances, and the rocker's moments about D."""
        b, c = self.places(theta)
        b2, c2 = self.accelerations(theta, rate, acceleration)
        arm, rocker = (c - b) / 2, c - D
        spin = _cross(c - b, c2 - b2) / ((c - b) @ (c - b))
        turn = _cross(rocker, c2) / (rocker @ rocker)
        weight = np.array([0.0, GRAVITY])
        push = COUPLER * ((b2 + c2) / 2 + weight)
        balance = np.array([
            [1, 0, 1, 0],
            [0, 1, 0, 1],
            [arm[1], -arm[0], -arm[1], arm[0]],
            [0, 0, rocker[1], -rocker[0]],
        ])  # fmt: skip
        moments = [
            COUPLER * (c - b) @ (c - b) / 12 * spin,
            ROCKER * (rocker @ rocker / 3 * turn + rocker[0] / 2 * GRAVITY),
        ]
        return np.linalg.solve(balance, [*push, *moments]).reshape(2, 2)


def _cross(a, b):
    return a[0] * b[1] - a[1] * b[0]
