"""Derivatives from values: differences of Φ, and steps into the complex plane."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from ncgen.comparisons.rivals.base import Inputs, Rival, called, differentiable, nonzeros
from ncgen.mechanism.kernels import Kernels

EPSILON = np.finfo(float).eps
IMAGINARY = 1e-200

Function = Callable[[np.ndarray], np.ndarray]

Slope = Callable[[Function, np.ndarray, np.ndarray], np.ndarray]
"""slope(function, x, direction): the derivative of a function at x along a direction."""


def rivals(kernels: Kernels, complex_kernels: Kernels, inputs: Inputs, names: Sequence[str]) -> list[Rival]:
    """Φ_q from Φ, γ from Φ_q q̇ along q̇; complex_kernels: those of NumPy, which take complex numbers."""
    if not differentiable(kernels):
        return []

    ways: dict[str, tuple[Slope, Kernels]] = {
        "finite differences, 2 points": (forward, kernels),
        "finite differences, 3 points": (central, kernels),
        "complex step, NumPy": (complex_step, complex_kernels),
    }
    tools = []
    for name, (derivative, used) in ways.items():
        functions = {
            "phi_q": lambda derivative=derivative, used=used: jacobian(derivative, lambda x: used.phi(x, inputs.t, inputs.p), inputs.q),
            "gamma": lambda derivative=derivative, used=used: -derivative(_rate(used, inputs), inputs.q, inputs.qd),
        }
        functions = {k: f for k, f in functions.items() if k in names}
        tools.append(called(name, functions, lambda k, functions=functions: nonzeros(kernels, k, functions[k]())))
    return tools


def _rate(kernels: Kernels, inputs: Inputs) -> Function:
    return lambda x: kernels.jacobian(x, inputs.t, inputs.p) @ inputs.qd


def jacobian(derivative: Slope, function: Function, x: np.ndarray) -> np.ndarray:
    """∂function/∂x, column by column."""
    return np.column_stack([derivative(function, x, unit) for unit in np.eye(len(x))])


def forward(function: Function, x: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """Error h |f''|/2 + ε |f|/h, least at h = √ε."""
    h = np.sqrt(EPSILON) * _size(x, direction)
    return (function(x + h * direction) - function(x)) / h


def central(function: Function, x: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """Error h² |f'''|/6 + ε |f|/h, least at h = ∛ε."""
    h = np.cbrt(EPSILON) * _size(x, direction)
    return (function(x + h * direction) - function(x - h * direction)) / (2 * h)


def complex_step(function: Function, x: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """Nothing cancels, so the step may be as small as one likes (Squire and Trapp 1998)."""
    return np.imag(function(x + 1j * IMAGINARY * direction)) / IMAGINARY


def _size(x: np.ndarray, direction: np.ndarray) -> float:
    return max(1.0, float(np.max(np.abs(x[direction != 0]), initial=0.0))) / float(np.max(np.abs(direction)))
