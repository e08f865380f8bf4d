"""A simulation: from a position and velocities to a trajectory."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Unpack

import numpy as np
from numpy.typing import ArrayLike

from ncgen.errors import ConvergenceError, DomainError, Interrupted, SingularError, counted, warn
from ncgen.mechanism.kernels import Kernels
from ncgen.solver.argument_checks import checked_kernels
from ncgen.solver.events.passage import Passage
from ncgen.solver.groups import MotionArguments
from ncgen.solver.motions.run_under_way import RunUnderWay, Stopwatch
from ncgen.solver.positions.massless import check_mass
from ncgen.solver.positions.negative_mass import doubtful, negative_instant
from ncgen.solver.positions.partition import singular_message
from ncgen.solver.positions.rank import REMEMBERED, freedom_at
from ncgen.solver.runs.alarms import doubts
from ncgen.solver.runs.choice import Choice, choose
from ncgen.solver.runs.progress_reports import ProgressOption, reporting
from ncgen.solver.runs.run import Run
from ncgen.solver.runs.start import Start, begin
from ncgen.solver.trajectories.trajectory import Trajectory

MAX_PARTITIONED_DOF = 100
"""Degrees of freedom from which coordinate partitioning, whose matrices are dense, is worth a warning."""


def simulate_one(
    kernels: Kernels,
    duration: float,
    *,
    points: int | ArrayLike = 101,
    stop: Mapping[str, Any] | None = None,
    progress: ProgressOption = None,
    **arguments: Unpack[MotionArguments],
) -> Trajectory:
    """Simulate one motion; arguments, results and errors as of `simulate` without rows."""
    run = Run.from_arguments(checked_kernels(kernels), duration, points=points, stop=stop, progress=progress, **arguments)
    kernels = kernels.driven_by(run.signals)
    choice = choose(run.settings)
    is_partitioned = not choice.method.is_constrained
    start = begin(kernels, run.initial, is_partitioned)
    if is_partitioned and (freedom := kernels.n - kernels.m) > MAX_PARTITIONED_DOF:
        warn(
            f"{kernels.name}: coordinate partitioning solves densely for {counted(freedom, 'degree of freedom')} in every evaluation; "
            "formalism='lagrange' solves sparsely, many times faster"
        )
    if progress is not True:
        return _carry_out(kernels, run, choice, start, progress or None)
    with reporting(progress, f"simulating {kernels.name}", run.initial.t, run.duration) as advance:
        return _carry_out(kernels, run, choice, start, advance)


def simulate_steps(kernels: Kernels, times: np.ndarray, breaks: np.ndarray, **options: Any) -> Trajectory:
    """As `simulate_one` by a method with a fixed step, with one step from each of the times (K,), s, to the next.

    breaks (B, 2): of the laws in time, as of `break_times`; no step goes from one side of a row to the other
    """
    step, length = float(np.max(np.diff(times))), float(times[-1] - times[0])
    run = Run.from_arguments(checked_kernels(kernels), length, points=times, max_step=step, **options)
    kernels, choice = kernels.driven_by(run.signals), choose(run.settings)
    start = begin(kernels, run.initial, partitioned=not choice.method.is_constrained)
    return _carry_out(kernels, run, choice, start, None, breaks)


def simulate_events(kernels: Kernels, times: np.ndarray, **options: Any) -> Passage:
    """As `simulate_one` over times (K,), s, from the first of them on: what a run with events meets on its way."""
    run = Run.from_arguments(checked_kernels(kernels), float(times[-1] - times[0]), points=times, **options)
    kernels, choice = kernels.driven_by(run.signals), choose(run.settings)
    start = begin(kernels, run.initial, partitioned=False)
    motion = RunUnderWay(kernels=kernels, run=run, choice=choice, start=start, rows=run.grid.plain, progress=None)
    motion.advance()
    return motion.passage


def _carry_out(
    kernels: Kernels, run: Run, choice: Choice, start: Start, progress: Callable[[float], None] | None, breaks: np.ndarray | None = None
) -> Trajectory:
    """The motion of a run on its grid, or by steps from row to row where breaks are given, with warnings where something speaks against it.

    Raises Interrupted with what was reached.
    """
    has_doubtful = kernels.remember("masses at starts", start, lambda: _check_masses(kernels, start, run.initial.t), REMEMBERED)
    rows = run.grid.plain if choice.method.has_fixed_step else run.grid.monitored  # other times would change the steps of these
    motion = RunUnderWay(kernels=kernels, run=run, choice=choice, start=start, rows=rows, progress=progress, given_breaks=breaks)
    clock = Stopwatch()
    try:
        motion.advance()
    except KeyboardInterrupt as stopped:
        if len(motion.path.q) < 2:
            raise
        raise Interrupted(motion.trajectory(clock)) from stopped
    except (SingularError, ConvergenceError, DomainError) as error:
        motion.refuse_negative()
        if trajectory := motion.diverged():
            raise trajectory from error
        raise
    trajectory = motion.trajectory(clock)
    if motion.passage.rests:
        warn(f"{kernels.name}: {motion.passage.rests}")
    if choice.method.is_constrained and motion.mobility[1]:
        warn(singular_message(kernels, freedom_at(kernels, start.q, run.initial.t, start.p)))
    if has_doubtful and (negative := negative_instant(kernels, trajectory.t, trajectory.q, start.p)):
        warn(f"{kernels.name}: {negative}")
    for doubt in doubts(trajectory, motion.inspected(), motion.tolerances, choice.method):
        warn(f"{kernels.name}: {doubt}")
    return trajectory


def _check_masses(kernels: Kernels, start: Start, t: float) -> bool:
    """Raise SingularError where the mass matrix at a start leaves a motion without inertia; whether it may on the way."""
    check_mass(kernels, start.q, t, start.p)
    return bool(doubtful(kernels))
