"""A simulation: from a position and independent velocities to a trajectory."""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable
from numbers import Integral, Real

import numpy as np

from ncgen.build.abi import NUMBERS
from ncgen.errors import ConvergenceError, ModelError, SingularError
from ncgen.solver import compiled, full_coordinates, python_engine, steppers
from ncgen.solver.branches import refresh_branches
from ncgen.solver.methods import Method, find_method
from ncgen.solver.partition import Partition, Partitions, choose_partitions
from ncgen.solver.path import Path
from ncgen.solver.position import check_finite, check_mirror_roots
from ncgen.solver.protocol import Kernels
from ncgen.solver.rank import DENSE
from ncgen.solver.start import closed_position, given_velocity, velocity_from_rates
from ncgen.solver.stop import stop_at
from ncgen.solver.trajectory import Statistics, Trajectory

ENGINES = ("auto", "c", *compiled.EMITTED, "python")

MANY = 100
"""Degrees of freedom from which coordinate partitioning, whose matrices are dense, is worth a warning."""

LOOKS = 9
"""Instants at which the energy is looked at after a run; fewer may all be instants of rest, which tell nothing of its size."""

DRIFT = 1e-2
"""Relative change of energy from which a motion whose constraints are held by feedback alone is not believed."""


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
    qd0=None,
    z=None,
    p=None,
    t0: float = 0.0,
    points: int = 101,
    max_step: float = np.inf,
    engine: str = "auto",
    number: str = "double",
    options: dict | None = None,
    stop: dict | None = None,
    progress: Callable[[float], None] | None = None,
) -> Trajectory:
    """Simulate a mechanism and return its trajectory on an even time grid.

    duration: s; t0: start time
    formalism: what the accelerations come from
        "coordinate-partitioning" (the paper's Table 8): the independent coordinates alone are integrated
        "null-space", "lagrange" (index 1), "augmented-lagrangian" (index 1), "udwadia-phohomsiri", "penalty": all
        coordinates are integrated, and after every step projected onto the constraints (penalty: Baumgarte's terms)
        "ali3p": index-3 augmented Lagrangian with mass-orthogonal projections, by the trapezoidal rule
    integrator: dopri5, dop853, rk23, adams, bdf, radau, lsoda, or with the fixed step max_step rk4 and trapezoidal, or
        Matlab's and SciPy's names (ode45, RK45, ode113 …); with SUNDIALS (`pip install 'ncgen[sundials]'`) cvode-adams and
        cvode-bdf, on coordinate-partitioning
        with "lagrange" also those that discretise the constrained equations, with the fixed step max_step: rattle
        (symplectic), energy-momentum (exact energy), generalized-alpha (numerical damping)
    options: {name: value} for formalism and integrator: stabilisation ("projection", "baumgarte", "none"), omega (1/s) and
        xi of Baumgarte's terms, alpha, the penalty over the largest inertia (ali3p: times h²/4, over that of its tangent); project_velocities of
        energy-momentum; rho, ρ∞ of generalized-alpha, or hht, α of HHT in its place
    rtol, atol: tolerances on the velocities and positions that are integrated
    q0: initial position, shape (n,) (default: the model's); if it is only approximate it is assembled first
    zd0: initial independent velocities by name, {"psi2": 1.0}, or as an array in the order of z (default: rest)
    qd0: initial velocities of any coordinates by name (the others follow with the least kinetic energy), or of all as an
        array; what the constraints do not allow is projected, with a warning
    z: names of the independent coordinates (default: the model's choice, else found by pivoting)
    p: parameters (default: the model's)
    points: how many instants the trajectory holds
    max_step: the longest step (s)
    engine: "c" (the whole run in compiled code), "emitted" (the same with the state derivative written out and compiled
        for this mechanism: several times faster, after a compile of a second or so), "refined" (emitted, with a step of
        iterative refinement, which keeps digits where the fixed order of pivots is unlucky), "python" (the reference), or
        "auto": C where it can be; the trajectory's `engine` says which it was and why
    number: what C computes with: "double", "float" (as a small controller would) or "long double"; tolerances finer than
        its rounding are raised to that, and the trajectory has doubles in any case
    stop: {coordinate: value} to end where a coordinate, or a velocity {"rate(psi)": 0.0}, passes a value; with a direction,
        {"psi": (1.2, "rising")} or "falling". The last instant of the trajectory is that one, and its `stopped` is True
    progress: called with the time reached: after every step in Python, at the end of a run in C

    Raises ConvergenceError naming the rows where the start does not close, SingularError for a singular one, ConvergenceError naming the
    time where the motion cannot go on. Warns where the energy of what was found says that it cannot be right, and where another
    formalism would be many times faster.
    """
    method = find_method(formalism, integrator, options)
    duration = _positive(duration, "duration", "s")
    for name, value in (("rtol", rtol), ("atol", atol)):
        _positive(value, name)
    if max_step != np.inf:
        _positive(max_step, "max_step", "s")
    elif method.is_stepper:
        raise ModelError(f"{kernels.name}: {integrator} has a fixed step: give max_step in seconds")
    if not (isinstance(t0, Real) and np.isfinite(t0)):
        raise ModelError(f"t0: {t0!r} given; it must be a number of seconds")
    if engine not in ENGINES:
        raise ModelError(f"engine {engine!r} is unknown; choose one of {', '.join(ENGINES)}")
    if number not in NUMBERS:
        raise ModelError(f"number {number!r} is unknown; choose one of {', '.join(NUMBERS)}")
    if not (isinstance(points, Integral) and points >= 2):
        raise ModelError(f"points: {points} given; a trajectory has at least 2")
    q = np.array(kernels.q0 if q0 is None else q0, dtype=float)
    p = refresh_branches(kernels, q, kernels.p0 if p is None else np.asarray(p, dtype=float))
    check_finite(kernels, q, t0, p)
    q = closed_position(kernels, q, t0, p)
    check_mirror_roots(kernels, q, p)
    chosen = tuple(z or kernels.model.chosen_independent)
    if not _is_constrained(method) and (freedom := kernels.n - kernels.m) > MANY:
        warnings.warn(
            f"{kernels.name}: coordinate partitioning solves densely for {freedom} degrees of freedom in every evaluation; "
            "formalism='lagrange' solves sparsely, many times faster",
            stacklevel=2,
        )
    partitions = _partitions(kernels, q, t0, p, chosen, needed=method.formalism.solve is None or zd0 is not None)
    qd = _velocity(kernels, partitions, q, t0, p, zd0, qd0)
    grid = np.linspace(t0, t0 + duration, points)
    rtol, atol = compiled.kept(rtol, atol, kernels.length, number)
    steps = dict(rtol=rtol, atol=atol, max_step=max_step, stop=stop_at(kernels, stop))
    clock = time.perf_counter()
    path = Path.empty(kernels.n, partitions)
    form = engine if engine in compiled.EMITTED else "dense"
    refused = _refusal(kernels, method, engine, integrator, partitions, number)
    only_c = engine in ("c", *compiled.EMITTED) or number != "double"
    remedy = "engine='auto'" if number == "double" else "number='double'"
    if refused and only_c:
        raise ModelError(f"{kernels.name} cannot be simulated in C{'' if number == 'double' else f' with {number}'}: {refused}; use {remedy}")
    if refused is None:
        refused = _run_in_c(path, kernels, method, integrator, form, grid, q, qd, p, steps | {"number": number})
        if refused and only_c:
            raise ConvergenceError(f"{kernels.name}: {refused}; with {remedy} it goes on in Python")
    if refused is not None:
        if _is_constrained(method):
            path = Path.empty(kernels.n, partitions)  # what C has left of it is done again
        _run_in_python(path, kernels, method, grid, q, qd, p, progress, steps)
    if progress and refused is None:
        progress(grid[-1] if path.stopped is None else path.stopped)
    if path.stopped is not None:
        grid = np.append(grid[: len(path.q) - 1], path.stopped)
    seconds, others = time.perf_counter() - clock, (path.projections, path.largest_projection, path.jacobians, path.fallbacks)
    statistics = Statistics(*map(int, path.counts), seconds, *others)
    said = f"python: {refused}" if refused else form if form in compiled.EMITTED else "c"
    run = Trajectory(
        kernels, grid, path.q, path.qd, path.work, p, path.partitions, statistics, formalism, integrator, said, chosen, kernels,
        method.options, path.stopped is not None, number,
    )  # fmt: skip
    if doubt := _doubt(run, method, rtol):
        warnings.warn(f"{kernels.name}: {doubt}", stacklevel=2)
    return run


def _doubt(run: Trajectory, method: Method, rtol: float) -> str | None:
    """What the energy says against a run, in words."""
    if method.options.get("stabilisation") in ("baumgarte", "none"):
        if run.energy_drift > DRIFT:
            return (
                f"{run.formalism} without projection changes the energy by {run.energy_drift:.1g} of what moves; "
                "the motion may have left its branch, take smaller steps or another formalism"
            )
    elif method.has_error_control and len(run.t) >= LOOKS and (drift := run.thinned(LOOKS).energy_drift) > np.sqrt(rtol):
        return (
            f"the energy changes by {drift:.1g} of what moves, although rtol is {rtol:g}: the motion may have passed a singular "
            "position, which formalism='lagrange' does better, or be too long for the tolerance"
        )
    return None


def _is_constrained(method: Method) -> bool:
    """True where all coordinates are integrated, not the independent ones alone."""
    return method.is_stepper or method.formalism.solve is not None


def _run_in_c(path: Path, kernels: Kernels, method: Method, integrator: str, form: str, grid, q, qd, p, steps: dict) -> str | None:
    if _is_constrained(method):
        return compiled.run_constrained(path, kernels, method.formalism.name, integrator, method.options, grid, q, qd, p, **steps)
    return compiled.run(path, kernels, integrator, form, grid, q, qd[path.partitions.velocity.independent], p, **steps)


def _run_in_python(path: Path, kernels: Kernels, method: Method, grid, q, qd, p, progress, steps: dict) -> None:
    if method.is_stepper:
        steppers.run(path, kernels, method.integrator, method.options, grid, q, qd, p, progress, steps["max_step"], steps["stop"])
    elif method.formalism.solve is None:
        rates = qd[path.partitions.velocity.independent]
        python_engine.run(path, kernels, method.integrator, grid, q, rates, p, progress, **steps)
    else:
        full_coordinates.run(path, kernels, method, grid, q, qd, p, progress, **steps)


def _refusal(kernels: Kernels, method: Method, engine: str, integrator: str, partitions: Partitions | None, number: str) -> str | None:
    """Why the run is not in C, or None if it is."""
    if engine == "python":
        return "engine='python' was asked for" if number != "double" else "asked for"
    return _refusal_in_c(kernels, method, engine, integrator, partitions) or compiled.refusal_in(number, kernels, integrator)


def _refusal_in_c(kernels: Kernels, method: Method, engine: str, integrator: str, partitions: Partitions | None) -> str | None:
    if _is_constrained(method):
        return compiled.refusal_constrained(kernels, method.formalism.name, integrator, method.options, engine)
    return compiled.refusal(kernels, integrator, partitions, engine in compiled.EMITTED)


def _partitions(kernels: Kernels, q, t: float, p, chosen: tuple[str, ...], needed: bool) -> Partitions | None:
    """Independent coordinates at the start; None at a singular position where the formalism does without them."""
    if not needed and not chosen and kernels.m >= DENSE:
        return None  # dense linear algebra that nothing asks for
    try:
        return choose_partitions(kernels, q, t, p, chosen)
    except SingularError:
        if needed:
            raise
        return None


def _velocity(kernels: Kernels, partitions: Partitions | None, q, t: float, p, zd0, qd0) -> np.ndarray:
    """All initial velocities."""
    if qd0 is not None and zd0 is not None:
        raise ModelError("zd0 and qd0 are both given; give the initial velocities once")
    if qd0 is None and partitions is None and not np.any(kernels.nu(q, t, p)):
        return np.zeros(kernels.n)
    if qd0 is not None or partitions is None:
        return given_velocity(kernels, {} if qd0 is None else qd0, q, t, p)
    return velocity_from_rates(kernels, partitions.velocity, _rates(kernels, partitions.velocity, zd0), q, t, p)


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
