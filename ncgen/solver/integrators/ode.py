"""What integrators in Python integrate, as SciPy's step-by-step solvers take it."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

import numpy as np

Derivative: TypeAlias = Callable[[float, np.ndarray], np.ndarray]
"""ẏ (k,) from t (s) and y (k,)."""

Slope: TypeAlias = Callable[[float, np.ndarray], np.ndarray]
"""∂ẏ/∂y (k, k) from t (s) and y (k,)."""
