"""What methods of fixed step have in common as SciPy's step-by-step solvers."""

from __future__ import annotations

from abc import abstractmethod

import numpy as np
from scipy.integrate import DenseOutput, OdeSolver

from ncgen.solver.integrators.hermite import Hermite
from ncgen.solver.integrators.ode import Derivative

ROUNDING = 1e-9
"""A time is the end of a step if less than this share of one lies between."""


class FixedStep(OdeSolver):
    """A method with the step `max_step`, the last one shorter, and cubic interpolation within it."""

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
        self.f = self.fun(t0, self.y)

    @abstractmethod
    def _moved(self, h: float, t: float) -> tuple[np.ndarray, np.ndarray] | None:
        """The state and its derivative at t, a step of h away, or None where Newton's method does not converge."""

    def _step_impl(self) -> tuple[bool, str | None]:
        left = self.t_bound - self.t
        h = left if left <= (1 + ROUNDING) * self._step else self._step
        t = self.t_bound if h == left else self.t + h
        found = self._moved(h, t)
        if found is None:
            return False, "Newton's method does not converge in a step"
        self._previous = (self.t, self.y, self.f)
        self.t, (self.y, self.f) = t, found
        return True, None

    def _dense_output_impl(self) -> DenseOutput:
        return Hermite(*self._previous, self.t, self.y, self.f)
