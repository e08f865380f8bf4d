"""The trapezoidal rule as a SciPy step-by-step solver: y₁ = y₀ + h/2 (f₀ + f₁) with a fixed step, order 2, A-stable."""

from __future__ import annotations

from typing import Any, TypeAlias

import numpy as np
from scipy.linalg import lu_factor, lu_solve

from ncgen.solver.integrators.fixed_step import FixedStep
from ncgen.solver.integrators.ode import Slope

Factors: TypeAlias = tuple[np.ndarray, np.ndarray]
"""LU and exchanges of rows."""

LIMIT = 10
"""Newton steps with one Jacobian; where they do not do, a fresh one is tried once."""

ENOUGH = 1e-13
"""Newton steps below this, relative to the state's size, end the iteration."""


class Trapezoidal(FixedStep):
    """Newton's method with the Jacobian of an earlier step, as long as it converges."""

    def __init__(self, *given: Any, jac: Slope | None = None, **options: Any) -> None:
        super().__init__(*given, **options)
        self._jac = jac or self._differences
        self._factors: tuple[float, Factors] | None = None

    def _moved(self, h: float, t: float) -> tuple[np.ndarray, np.ndarray] | None:
        y = self._newton(t, h, self._factors[1]) if self._factors and self._factors[0] == h else None
        if y is None:
            factors = lu_factor(np.eye(self.n) - h / 2 * self._jac(t, self.y + h * self.f))
            self._factors = h, factors
            y = self._newton(t, h, factors)
        return None if y is None else (y, self.fun(t, y))

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
