"""The trapezoidal rule as a SciPy step-by-step solver: y₁ = y₀ + h/2 (f₀ + f₁) with a fixed step, order 2, A-stable."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
import scipy.integrate
from scipy.integrate import DenseOutput
from scipy.linalg import lu_factor, lu_solve

from ncgen.solver.hermite import Hermite
from ncgen.solver.ode import Derivative, Slope

Factors: TypeAlias = tuple[np.ndarray, np.ndarray]
"""LU and exchanges of rows."""

LIMIT = 10
"""Newton steps with one Jacobian; where they do not do, a fresh one is tried once."""

ENOUGH = 1e-13
"""Newton steps below this, relative to the state's size, end the iteration."""


class Trapezoidal(scipy.integrate.OdeSolver):
    """Newton's method with the Jacobian of an earlier step, as long as it converges."""

    def __init__(
        self,
        fun: Derivative,
        t0: float,
        y0: np.ndarray,
        t_bound: float,
        max_step: float = np.inf,
        vectorized: bool = False,
        first_step: float | None = None,
        jac: Slope | None = None,
        **extra: object,
    ) -> None:
        super().__init__(fun, t0, y0, t_bound, vectorized)
        self._step = max_step if first_step is None else min(max_step, first_step)
        self._jac = jac or self._differences
        self._factors: tuple[float, Factors] | None = None
        self.f = self.fun(t0, self.y)

    def _step_impl(self) -> tuple[bool, str | None]:
        h = min(self._step, self.t_bound - self.t)
        t = self.t_bound if self.t + h >= self.t_bound else self.t + h
        self._previous = (self.t, self.y, self.f)
        y = self._newton(t, h, self._factors[1]) if self._factors and self._factors[0] == h else None
        if y is None:
            factors = lu_factor(np.eye(self.n) - h / 2 * self._jac(t, self.y + h * self.f))
            self._factors = h, factors
            y = self._newton(t, h, factors)
        if y is None:
            return False, "Newton's method does not converge in a step"
        self.t, self.y, self.f = t, y, self.fun(t, y)
        return True, None

    def _newton(self, t: float, h: float, factors: Factors) -> np.ndarray | None:
        """y₁, or None if the iteration does not converge."""
        y, last = self.y + h * self.f, np.inf
        size = last
        for _ in range(LIMIT):
            step = lu_solve(factors, self.y + h / 2 * (self.f + self.fun(t, y)) - y)
            y = y + step
            size = float(np.max(np.abs(step)))
            if size <= ENOUGH * max(np.max(np.abs(y)), 1.0):
                return y
            if not size < last:
                break
            last = size
        # Rounding ends the fall of the steps before they reach the bound: that is converged as well.
        return y if size < 100 * ENOUGH * max(np.max(np.abs(y)), 1.0) else None

    def _differences(self, t: float, y: np.ndarray) -> np.ndarray:
        """∂f/∂y by forward differences, good enough for Newton's method."""
        base = self.fun(t, y)
        steps = 1e-8 * np.maximum(np.abs(y), 1.0)
        return np.column_stack([(self.fun(t, y + h * e) - base) / h for h, e in zip(steps, np.eye(self.n), strict=True)])

    def _dense_output_impl(self) -> DenseOutput:
        return Hermite(*self._previous, self.t, self.y, self.f)
