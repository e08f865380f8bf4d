"""What students would write: the robot's hand-written derivative with SciPy and with RK4 of one's own, the paper's program in Octave; and
the paper's own times."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from benchmarks.rivals import octave
from ncgen.comparisons.rivals import handwritten
from ncgen.errors import NcgenError
from ncgen.mechanism.kernels import Kernels
from ncgen.report.precision import tolerances

STUDENT_STEPS = 100

Derivative = Callable[[float, np.ndarray], np.ndarray]
"""ẏ at a time and y."""


def _scipy(derivative: Derivative, duration: float, y0: np.ndarray) -> tuple[np.ndarray, int]:
    """End state and evaluations."""
    found = solve_ivp(derivative, (0.0, duration), y0, method="RK45", **tolerances(1e-6))
    return found.y[:, -1], int(found.nfev)


def _rk4(derivative: Derivative, duration: float, y: np.ndarray) -> tuple[np.ndarray, int]:
    """End state and evaluations."""
    h = duration / STUDENT_STEPS
    for t in h * np.arange(STUDENT_STEPS):
        a = derivative(t, y)
        b = derivative(t + h / 2, y + h / 2 * a)
        c = derivative(t + h / 2, y + h / 2 * b)
        y = y + h / 6 * (a + 2 * b + 2 * c + derivative(t + h, y + h * c))
    return y, 4 * STUDENT_STEPS


def hand_written(kernels: Kernels) -> tuple[Derivative, np.ndarray, list[str]] | None:
    """(derivative, y0, names of the positions in y) of the hand-written code."""
    module = handwritten(kernels)
    return None if module is None else _from_rest(module, kernels)


def _from_rest(module: Any, kernels: Kernels) -> tuple[Derivative, np.ndarray, list[str]]:
    """As `hand_written`; each begins with a guess of its own, which its derivative improves."""
    guess = kernels.q0.copy()
    y0 = np.concatenate([np.zeros(len(module.INDEPENDENT)), guess[module.INDEPENDENT]])
    return lambda t, y: module.derivative(t, y, guess), y0, [kernels.coordinates[i] for i in module.INDEPENDENT]


def student_records(kernels: Kernels, duration: float, reference: Mapping[str, float]) -> Iterator[dict]:
    """The hand-written derivative with SciPy's RK45 and with Runge and Kutta's own steps, and the paper's own times."""
    module = handwritten(kernels)
    if module is None:
        return
    for tool, setting, integrate in (("SciPy RK45", "rtol 1e-06", _scipy), ("RK4", f"{STUDENT_STEPS} steps", _rk4)):
        derivative, y0, names = _from_rest(module, kernels)
        start = time.perf_counter()
        y, evaluations = integrate(derivative, duration, y0)
        seconds = time.perf_counter() - start
        end = dict(zip(names, y[len(names) :], strict=True))
        error = float(max(abs(end[name] - value) for name, value in reference.items()))
        record = {"case": "simulation", "tool": f"hand-written NumPy, {tool}", "setting": setting, "error": error}
        yield record | {"seconds": seconds, "total": seconds, "evaluations": evaluations}
    yield from _octave(kernels, duration, reference)
    for tool, (seconds, _) in module.PAPER_TABLE_9.items():
        yield {"case": "simulation", "tool": f"the paper's Table 9, {tool}", "setting": "2007", "error": None, "seconds": seconds}


def _octave(kernels: Kernels, duration: float, reference: Mapping[str, float]) -> Iterator[dict]:
    """The paper's own program, where Octave is installed."""
    module = handwritten(kernels)
    if module is None or not octave.available(kernels):
        return
    names = [kernels.coordinates[i] for i in module.INDEPENDENT]
    try:
        found = octave.falls(kernels, duration=duration, steps=STUDENT_STEPS, **tolerances(1e-6))
    except NcgenError as error:
        yield {"case": "simulation", "tool": "hand-written Octave", "setting": "", "error": None, "seconds": None, "stopped": str(error)}
        return
    for run, setting in zip(found, (f"{STUDENT_STEPS} steps", "rtol 1e-06"), strict=True):
        end = dict(zip(names, run["psi"], strict=True))
        error = max(abs(end[name] - value) for name, value in reference.items())
        record = {"case": "simulation", "tool": f"hand-written Octave, {run['tool']}", "setting": setting, "error": error}
        yield record | {"seconds": run["seconds"], "total": run["seconds"], "evaluations": run["evaluations"]}
