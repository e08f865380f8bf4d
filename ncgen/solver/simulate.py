"""A simulation: from a position and independent velocities to a trajectory."""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable
from numbers import Integral, Real

import numpy as np

from ncgen.errors import ConvergenceError, ModelError
from ncgen.solver import compiled, python_engine
from ncgen.solver.assembly import assemble
from ncgen.solver.branches import refresh_branches
from ncgen.solver.integrators import find_integrator
from ncgen.solver.partition import Partition, choose_partitions
from ncgen.solver.path import Path
from ncgen.solver.position import check_finite, check_mirror_roots
from ncgen.solver.protocol import Kernels
from ncgen.solver.trajectory import Statistics, Trajectory

FORMALISMS = ("coordinate-partitioning",)
ENGINES = ("auto", "c", "emitted", "python")


def simulate(
    kernels: Kernels,
    duration: float,
    *,
    formalism: str = "coordinate-partitioning",
    integrator: str = "dopri5",
    rtol: float = 1e-8,
    atol: float = 1e-10,
    q0=None,
    zd0=None,
    z=None,
    p=None,
    t0: float = 0.0,
    points: int = 101,
    max_step: float = np.inf,
    engine: str = "auto",
    progress: Callable[[float], None] | None = None,
) -> Trajectory:
    """Simulate a mechanism and return its trajectory on an even time grid.

    duration: s; t0: start time
    formalism: "coordinate-partitioning" (the paper's Table 8)
    integrator: dopri5, dop853, rk4 (fixed step max_step), adams, bdf, radau, rk23, lsoda, or Matlab's and SciPy's names
        (ode45, RK45, ode113 …)
    rtol, atol: tolerances on the independent velocities and positions
    q0: initial position, shape (n,) (default: the model's); if it is only approximate it is assembled first
    zd0: initial independent velocities by name, {"psi2": 1.0}, or as an array in the order of z (default: rest)
    z: names of the independent coordinates (default: the model's choice, else found by pivoting)
    p: parameters (default: the model's)
    points: how many instants the trajectory holds
    max_step: the longest step (s)
    engine: "c" (the whole run in compiled code), "emitted" (the same with the state derivative written out and compiled
        for this mechanism: several times faster, after a compile of a second or so), "python" (the reference), or
        "auto": C where it can be; the trajectory's `engine` says which it was and why
    progress: called with the time reached: after every step in Python, at the end of a run in C

    Raises ConvergenceError naming the rows where the start does not close, SingularError for a singular one, ConvergenceError naming the
    time where the motion cannot go on.
    """
    if formalism not in FORMALISMS:
        raise ModelError(f"formalism {formalism!r} is unknown; choose one of {', '.join(FORMALISMS)}")
    method = find_integrator(integrator)
    duration = _positive(duration, "duration", "s")
    for name, value in (("rtol", rtol), ("atol", atol)):
        _positive(value, name)
    if max_step != np.inf:
        _positive(max_step, "max_step", "s")
    if not (isinstance(t0, Real) and np.isfinite(t0)):
        raise ModelError(f"t0: {t0!r} given; it must be a number of seconds")
    if engine not in ENGINES:
        raise ModelError(f"engine {engine!r} is unknown; choose one of {', '.join(ENGINES)}")
    if not (isinstance(points, Integral) and points >= 2):
        raise ModelError(f"points: {points} given; a trajectory has at least 2")
    q = np.array(kernels.q0 if q0 is None else q0, dtype=float)
    p = refresh_branches(kernels, q, kernels.p0 if p is None else np.asarray(p, dtype=float))
    check_finite(kernels, q, t0, p)
    q = _assembled(kernels, q, t0, p)
    check_mirror_roots(kernels, q, p)
    chosen = tuple(z or kernels.model.chosen_independent)
    partitions = choose_partitions(kernels, q, t0, p, chosen)
    zd = _rates(kernels, partitions.velocity, zd0)
    grid = np.linspace(t0, t0 + duration, points)
    options = dict(rtol=rtol, atol=atol, max_step=max_step)
    clock = time.perf_counter()
    emitted = engine == "emitted"
    refused = "asked for" if engine == "python" else compiled.refusal(kernels, integrator, partitions, emitted)
    if refused and engine in ("c", "emitted"):
        raise ModelError(f"{kernels.name} cannot be simulated in C: {refused}; use engine='auto'")
    path = Path.empty(kernels.n, partitions)
    if refused is None:
        refused = compiled.run(path, kernels, integrator, emitted, grid, q, zd, p, **options)
        if refused and engine != "auto":
            raise ConvergenceError(f"{kernels.name}: {refused}; engine='auto' goes on in Python")
    if refused is not None:
        python_engine.run(path, kernels, method, grid, q, zd, p, progress, **options)
    if progress and refused is None:
        progress(grid[-1])
    statistics = Statistics(*map(int, path.counts), time.perf_counter() - clock)
    said = f"python: {refused}" if refused else "emitted" if emitted else "c"
    return Trajectory(
        kernels, grid, path.q, path.qd, path.work, p, path.partitions, statistics, formalism, integrator, said, chosen, kernels
    )  # fmt: skip


def _assembled(kernels: Kernels, q, t: float, p) -> np.ndarray:
    """The start closed; a warning says what moved most if it was open."""
    closed = assemble(kernels, q, t, p)
    moved = np.abs(closed - q)
    if np.any(moved > 0):
        most = int(np.argmax(moved))
        warnings.warn(
            f"{kernels.name}: the initial position was open and has been assembled; {kernels.coordinates[most]} moved most, "
            f"by {moved[most]:.3g}",
            stacklevel=3,
        )
    return closed


def _positive(value: float, name: str, unit: str = "") -> float:
    if not (isinstance(value, Real) and np.isfinite(value) and value > 0):
        raise ModelError(f"{name}: {value!r} given; it must be a positive number{' of seconds' if unit else ''}")
    return float(value)


def _rates(kernels: Kernels, partition: Partition, zd0) -> np.ndarray:
    names = partition.names(kernels)
    if zd0 is None:
        return np.zeros(len(names))
    if isinstance(zd0, dict):
        unknown = [name for name in zd0 if name not in names]
        if unknown:
            raise ModelError(f"initial velocity of {unknown[0]}: it is not independent; the independent coordinates are {', '.join(names)}")
        zd0 = [zd0.get(name, 0.0) for name in names]
    try:
        rates = np.asarray(zd0, dtype=float)
    except (TypeError, ValueError):
        rates = np.array([np.nan])
    if rates.shape != (len(names),) or not np.all(np.isfinite(rates)):
        raise ModelError(f"zd0: {rates.shape} finite numbers needed for the {len(names)} independent coordinates {', '.join(names)}")
    return rates
