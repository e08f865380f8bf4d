"""A simulation: from a position and velocities to a trajectory."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Unpack

import numpy as np
from numpy.typing import ArrayLike

from ncgen.errors import ConvergenceError, DomainError, Interrupted, SingularError, warn
from ncgen.mechanism.kernels import Kernels
from ncgen.solver.argument_checks import checked_kernels
from ncgen.solver.events.passage import Passage
from ncgen.solver.groups import MotionArguments
from ncgen.solver.motions.prepared_motion import PreparedMotion
from ncgen.solver.motions.run_under_way import RunUnderWay, Stopwatch
from ncgen.solver.positions.negative_mass import negative_instant
from ncgen.solver.positions.partition import singular_message
from ncgen.solver.positions.rank import freedom_at
from ncgen.solver.runs.alarms import doubts
from ncgen.solver.runs.progress_reports import ProgressOption, check_progress, reporting
from ncgen.solver.runs.run import Run
from ncgen.solver.trajectories.trajectory import Trajectory


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
    check_progress(progress)
    motion = PreparedMotion.of_arguments(checked_kernels(kernels), duration, points=points, stop=stop, **arguments)
    if progress is not True:
        return _carry_out(motion, progress or None)
    with reporting(progress, f"simulating {kernels.name}", motion.run.initial.t, motion.run.duration) as advance:
        return _carry_out(motion, advance)


def simulate_steps(kernels: Kernels, times: np.ndarray, breaks: np.ndarray, **options: Any) -> Trajectory:
    """As `simulate_one` by a method with a fixed step, with one step from each of the times (K,), s, to the next.

    breaks (B, 2): of the laws in time, as of `break_times`; no step goes from one side of a row to the other
    """
    step, length = float(np.max(np.diff(times))), float(times[-1] - times[0])
    run = Run.from_arguments(checked_kernels(kernels), length, points=times, max_step=step, **options)
    return _carry_out(PreparedMotion(kernels, run, given_breaks=breaks), None)


def simulate_events(kernels: Kernels, times: np.ndarray, **options: Any) -> Passage:
    """As `simulate_one` over times (K,), s, from the first of them on: what a run with events meets on its way."""
    run = Run.from_arguments(checked_kernels(kernels), float(times[-1] - times[0]), points=times, **options)
    prepared = PreparedMotion(kernels, run, rows=run.grid.plain)
    for message in prepared.warnings:
        warn(message)
    motion = RunUnderWay(prepared, None)
    motion.advance()
    return motion.passage


def _carry_out(motion: PreparedMotion, progress: Callable[[float], None] | None) -> Trajectory:
    """The motion of a run on its grid, with warnings where something speaks against it. Raises Interrupted with what was reached."""
    kernels, start, t0 = motion.kernels, motion.start, motion.run.initial.t
    for message in motion.warnings:
        warn(message)
    has_doubtful = motion.mass_is_doubtful
    under_way, clock = RunUnderWay(motion, progress), Stopwatch()
    try:
        under_way.advance()
    except KeyboardInterrupt as stopped:
        if len(under_way.path.q) < 2:
            raise
        raise Interrupted(under_way.trajectory(clock)) from stopped
    except (SingularError, ConvergenceError, DomainError) as error:
        under_way.refuse_negative()
        if trajectory := under_way.diverged():
            raise trajectory from error
        raise
    trajectory = under_way.trajectory(clock)
    if under_way.passage.rests:
        warn(f"{kernels.name}: {under_way.passage.rests}")
    method = under_way.choice.method
    if method.is_constrained and motion.mobility[1]:
        warn(singular_message(kernels, freedom_at(kernels, start.q, t0, start.p)))
    if has_doubtful and (negative := negative_instant(kernels, trajectory.t, trajectory.q, start.p)):
        warn(f"{kernels.name}: {negative}")
    if not motion.limits(method).allow(under_way.path.inspection):
        for doubt in doubts(trajectory, under_way.inspected(), motion.tolerances, method):
            warn(f"{kernels.name}: {doubt}")
    return trajectory
