"""What to say of runs whose fixed steps were too long: a step that cannot be solved, or a motion that grew beyond bounds."""

from __future__ import annotations

import numpy as np

from ncgen.errors import ConvergenceError
from ncgen.mechanism.kernels import Kernels
from ncgen.methods.method import Method
from ncgen.model.elements import rate_name
from ncgen.solver.runs.path import Path
from ncgen.solver.trajectories.energy import Instants, drift

FROM_NOTHING = 0.5
"""Share of all energy that moves which must have come from nothing."""


def unsolved_step(name: str, t: float, h: float) -> str:
    """One line about a fixed step of h (s) from t (s) on whose equations are not solved."""
    return f"{name}: the step of {h:.6g} s from t = {t:.6g} s does not converge; take smaller steps (max_step)"


def divergence(kernels: Kernels, path: Path, start: float, method: Method, step: float | None, p: np.ndarray) -> ConvergenceError | None:
    """What to say of a run that failed at the end of a path, if steps of a fixed length (s) made its energy; None for any other.

    start: of the run (s); p (n_p,): its parameters
    """
    if step is None or len(path.q) < 2 or path.stopped is None:
        return None
    ends = [0, -1]
    q, qd, work = path.q[ends], path.qd[ends], path.work[ends]
    sizes = np.abs(qd[-1]) / kernels.column_sizes
    with np.errstate(all="ignore"):
        change = drift(kernels, Instants(np.array([start, path.stopped]), q, qd, work), p)
    if np.isfinite(change) and change < FROM_NOTHING:
        return None
    largest = int(np.argmax(np.where(np.isfinite(sizes), sizes, np.inf)))
    return ConvergenceError(
        f"{kernels.name}: the motion has diverged: {rate_name(kernels.coordinates[largest])} is {qd[-1, largest]:.3g} a second at "
        f"t = {path.stopped:.6g} s; steps of {step:g} s are too long for {method.integrator.name} here, take smaller ones (max_step) or a "
        "method with error control"
    )
