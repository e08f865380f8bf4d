"""Cubic interpolation within a step, for methods that have no interpolation of their own."""

from __future__ import annotations

import numpy as np
import scipy.integrate
from scipy.interpolate import CubicHermiteSpline


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
