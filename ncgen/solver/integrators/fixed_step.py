"""Explicit Runge-Kutta methods with a fixed step, as SciPy's step-by-step solvers."""

from __future__ import annotations

import numpy as np
from scipy.integrate import DenseOutput, OdeSolver
from scipy.interpolate import CubicHermiteSpline

from ncgen.methods.tableau import Tableau
from ncgen.solver.integrators.ode import Derivative

ROUNDING = 1e-9
"""A time is the end of a step if less than this share of one lies between."""


class FixedRungeKutta(OdeSolver):
    """Steps of max_step, the last one shorter, with cubic interpolation within them; children have the method's `tableau`."""

    tableau: Tableau
    f: np.ndarray
    """The derivative of the present state."""

    def __init__(
        self,
        fun: Derivative,
        t0: float,
        y0: np.ndarray,
        t_bound: float,
        max_step: float = np.inf,
        vectorized: bool = False,
        first_step: float | None = None,
        **extra: object,
    ) -> None:
        super().__init__(fun, t0, y0, t_bound, vectorized)
        self._step = max_step if first_step is None else min(max_step, first_step)
        self._rows = [np.array([float(x) for x in row]) for row in self.tableau.a[: self.tableau.stages]]
        self._nodes = [float(x) for x in self.tableau.c]
        self.f = self.fun(t0, self.y)

    def _step_impl(self) -> tuple[bool, str | None]:
        left = self.t_bound - self.t
        h = left if left <= (1 + ROUNDING) * self._step else self._step
        derivatives, end = [self.f], self.y
        for node, row in zip(self._nodes[1:], self._rows, strict=False):
            end = self.y + h * (row @ np.array(derivatives))
            derivatives.append(self.fun(self.t + node * h, end))
        self._before = self.t, self.y, self.f
        self.t, self.y, self.f = self.t_bound if h == left else self.t + h, end, derivatives[-1]
        return True, None

    def _dense_output_impl(self) -> DenseOutput:
        return _Cubic(*self._before, self.t, self.y, self.f)


class _Cubic(DenseOutput):
    """The cubic between two states with these derivatives."""

    def __init__(self, t0: float, y0: np.ndarray, f0: np.ndarray, t1: float, y1: np.ndarray, f1: np.ndarray) -> None:
        super().__init__(t0, t1)
        self._spline = CubicHermiteSpline([t0, t1], [y0, y1], [f0, f1])

    def _call_impl(self, t: float) -> np.ndarray:
        return self._spline(t).T
