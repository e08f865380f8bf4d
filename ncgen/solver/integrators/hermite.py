"""Interpolation within a step: cubic, for methods that have none of their own, or that of the library that took the step."""

from __future__ import annotations

from collections.abc import Callable
from typing import cast

import numpy as np
import scipy.integrate
from scipy.interpolate import CubicHermiteSpline


class Asked(scipy.integrate.DenseOutput):
    """What a library itself says of instants of its last step."""

    def __init__(self, solver: scipy.integrate.OdeSolver, ask: Callable[[float], np.ndarray]) -> None:
        super().__init__(cast(float, solver.t_old), solver.t)  # SciPy asks after a step only, when there is a time before it
        self._ask = ask

    def _call_impl(self, t: float) -> np.ndarray:
        return self._ask(t).copy()


class Hermite(scipy.integrate.DenseOutput):
    """Cubic interpolation between two states and their derivatives."""

    def __init__(self, t0: float, y0: np.ndarray, f0: np.ndarray, t1: float, y1: np.ndarray, f1: np.ndarray) -> None:
        super().__init__(t0, t1)
        self._spline = CubicHermiteSpline([t0, t1], [y0, y1], [f0, f1])

    def _call_impl(self, t: float) -> np.ndarray:
        return self._spline(t).T

    def rate(self, t: float) -> np.ndarray:
        """The derivative at one instant."""
        return self._spline(t, 1)
