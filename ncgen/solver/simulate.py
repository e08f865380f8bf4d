"""A simulation: from a position and independent velocities to a trajectory."""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from numbers import Integral, Real

import numpy as np

from ncgen.errors import ConvergenceError, ModelError, SingularError
from ncgen.solver import compiled
from ncgen.solver.assembly import assemble
from ncgen.solver.branches import refresh_branches
from ncgen.solver.coordinate_partitioning import Motion, Start, motion, motion_at
from ncgen.solver.integrators import find_integrator
from ncgen.solver.partition import BETTER, Partitions, choose_partitions, quality
from ncgen.solver.position import check_finite, check_mirror_roots
from ncgen.solver.protocol import Kernels
from ncgen.solver.trajectory import Statistics, Trajectory

DEGRADED = 0.7
"""Another partition is looked for when the quality falls below this share of what it was when chosen: late changes
cost more in short steps than early ones in restarts."""

RETRIES = 8
"""How often a step whose position problem fails is tried again, each time four times shorter."""

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
    if refused is None:
        piece = compiled.run(kernels, partitions, integrator, emitted, grid, q, zd, p, **options)
        partitions, refused = piece.partitions, piece.stopped or None
        if refused and engine != "auto":
            raise ConvergenceError(f"{kernels.name}: {refused}; engine='auto' goes on in Python")
        if refused and len(piece.q):
            q, zd = piece.q[-1], piece.qd[-1][partitions.velocity.independent]
    else:
        piece = _Piece(np.empty((0, kernels.n)), np.empty((0, kernels.n)), np.empty(0), np.zeros(5, dtype=int))
    if refused is not None:
        start = max(len(piece.q) - 1, 0)
        run = _Run(kernels, method, options, partitions, t0 + duration)
        piece = run.integrate(q, zd, grid[start], p, grid[start:], progress).after(piece, start)
        partitions = run.partitions
    if progress and refused is None:
        progress(grid[-1])
    statistics = Statistics(*map(int, piece.counts), time.perf_counter() - clock)
    said = f"python: {refused}" if refused else "emitted" if emitted else "c"
    return Trajectory(kernels, grid, piece.q, piece.qd, piece.work, p, partitions, statistics, formalism, integrator, said, chosen, kernels)


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


@dataclass(frozen=True)
class _Piece:
    """Part of a trajectory: rows of q, qd and work; counts in the order of Statistics."""

    q: np.ndarray
    qd: np.ndarray
    work: np.ndarray
    counts: np.ndarray

    def after(self, other, start: int) -> _Piece:
        """The other piece up to row `start`, then this one, whose work counts on."""
        before = other.work[start] if len(other.work) else 0.0
        q, qd = np.vstack([other.q[:start], self.q]), np.vstack([other.qd[:start], self.qd])
        return _Piece(q, qd, np.concatenate([other.work[:start], self.work + before]), other.counts + self.counts)


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


class _Run:
    """One integration: counters, the current partition, and the start of the current step."""

    def __init__(self, kernels: Kernels, method, options: dict, partitions: Partitions, end: float):
        self.kernels = kernels
        self.method = method
        self.options = options
        self.partitions = partitions
        self.end = end
        self.steps = self.evaluations = self.newton = self.changes = self.rejections = 0

    def integrate(self, q, zd, t, p, grid, progress) -> _Piece:
        """Positions, velocities and work at the times of the grid."""
        here = motion_at(self.kernels, self.partitions.velocity, t, q, zd, p)
        self.start = Start(t, here.q, here.qd, p)
        self.reference = self._quality(self.partitions, here)
        solver = self._solver(t, here, 0.0)
        motions, work = [here], [0.0]
        while solver.status == "running":
            solver = self._step(solver, here)
            between = None
            while len(motions) < len(grid) and grid[len(motions)] <= solver.t:
                instant = grid[len(motions)]
                if instant != solver.t:
                    between = between or solver.dense_output()
                y = solver.y if instant == solver.t else between(instant)
                motions.append(self._motion(instant, y))
                work.append(float(y[-1]))
            here = self._motion(solver.t, solver.y)
            self._accept(here)
            if progress:
                progress(solver.t)
            if solver.status == "running" and self._repartition(here):
                solver = self._solver(here.t, here, solver.y[-1])
        counts = np.array([self.steps, self.evaluations, self.newton, self.changes, self.rejections])
        return _Piece(np.array([m.q for m in motions]), np.array([m.qd for m in motions]), np.array(work), counts)

    def _solver(self, t: float, here: Motion, work: float, first_step: float | None = None):
        velocities, positions = self.partitions.velocity.independent, self.partitions.position.independent
        y = np.concatenate([here.qd[velocities], here.q[positions], [work]])
        return self.method(self._derivative, t, y, self.end, first_step=first_step, **self.options)

    def _step(self, solver, here: Motion):
        """One accepted step; returns the solver that made it, a fresh one if the position problem failed on the way."""
        work = solver.y[-1]
        for attempt in range(RETRIES + 1):
            try:
                with warnings.catch_warnings():
                    warnings.simplefilter("ignore", RuntimeWarning)  # SciPy warns of NaN; it is reported below
                    message = solver.step()
                break
            except (ConvergenceError, SingularError) as error:
                if attempt == RETRIES:
                    raise type(error)(self._stuck(here)) from error
                self.rejections += 1
                self._repartition(here, any_better=True)
                length = min(getattr(solver, "h_abs", np.inf), self.end - here.t) / 4 ** (attempt + 1)
                solver = self._solver(here.t, here, work, first_step=length)
        self.steps += 1
        if solver.status == "failed" or not np.all(np.isfinite(solver.y)):
            raise ConvergenceError(
                f"{self.kernels.name}: the integration stops at t = {solver.t:.6g} s ({message or 'the state is not finite'}); "
                "the motion may become singular there, or try another integrator or tolerance"
            )
        return solver

    def _derivative(self, t: float, y: np.ndarray) -> np.ndarray:
        self.evaluations += 1
        now = self._motion(t, y)
        velocities, positions = self.partitions.velocity.independent, self.partitions.position.independent
        return np.concatenate([now.qdd[velocities], now.qd[positions], [now.power]])

    def _motion(self, t: float, y: np.ndarray) -> Motion:
        count = len(self.partitions.velocity.independent)
        now = motion(self.kernels, self.partitions, self.start, t, y[count:-1], y[:count])
        self.newton += now.iterations
        return now

    def _accept(self, here: Motion) -> None:
        self.start = Start(here.t, here.q, here.qd, refresh_branches(self.kernels, here.q, self.start.p))

    def _stuck(self, here: Motion) -> str:
        return (
            f"{self.kernels.name}: the motion cannot go on beyond t = {here.t:.6g} s; the mechanism locks or comes to a "
            "singular position there, or take smaller steps (rtol, max_step)"
        )

    def _quality(self, partitions: Partitions, here: Motion) -> float:
        return min(quality(self.kernels, p, here.q, here.t, self.start.p) for p in {partitions.position, partitions.velocity})

    def _repartition(self, here: Motion, any_better: bool = False) -> bool:
        """Change to other independent coordinates for the same motion, if the present ones have become bad."""
        now = self._quality(self.partitions, here)
        if now > DEGRADED * self.reference and not any_better:
            return False
        try:
            other = choose_partitions(self.kernels, here.q, here.t, self.start.p, rows=self.partitions.velocity.rows)
        except SingularError:
            return False  # no choice is good here: the steps will show whether the motion can go on
        possible = self._quality(other, here)
        if possible < BETTER * now:
            return False
        self.partitions, self.reference = other, possible
        self.changes += 1
        return True
