"""A run in parts: in Python from break to break of its laws in time, which no step passes; in every engine from jump to jump of a driver's
velocity, where an impulse changes all velocities."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TypeAlias

import numpy as np

from ncgen.mechanism.break_times import outside_breaks
from ncgen.mechanism.kernels import Kernels
from ncgen.solver.formalisms.impulse import cross
from ncgen.solver.runs.path import Path
from ncgen.solver.runs.task import Task

Engine: TypeAlias = Callable[[Path, Kernels, Task], str | None]
"""Completes a path; returns why it stopped before the end, or None."""


def in_segments(engine: Engine, path: Path, kernels: Kernels, task: Task, ends: np.ndarray) -> str | None:
    """Complete a path as an engine would, which is asked once for every part of the run.

    ends (E, 2): the breaks (s) at which a part ends, those at which a driver's velocity jumps among them
    Returns why an engine stopped before the end, or None. Raises what it raises, the path holding what it reached.
    """
    if not len(ends):
        return engine(path, kernels, task)
    grid = outside_breaks(task.breaks, task.grid)
    t, end, jumps = float(grid[max(len(path.q) - 1, 0)]), float(grid[-1]), set(task.jumps[:, 0].tolist())
    q, qd, work, velocities = task.q, None, 0.0, task.velocities
    if len(path.q):
        q, qd, work = path.q[-1], path.qd[-1], float(path.work[-1])
        velocities = _velocities(path, task, qd)
    if task.method.is_constrained and not task.method.is_stepper:
        task = replace(task, rank=task.rank_at(kernels, task.q, float(grid[0])))
    path.impulses = [each for each in path.impulses if each.t < t]  # later ones are met again
    for before, after in [*ends[(ends[:, 1] > t) & (ends[:, 0] < end)].tolist(), [end, end]]:
        if t < before:
            part_task = replace(task, q=q, velocities=velocities, before=(float(grid[0]), int(path.counts[0])))
            reason, segment = _one(engine, path, kernels, part_task, grid, (t, before), work)
            if reason or segment.stopped is not None:
                return reason
            q, qd, work = segment.q[-1], segment.qd[-1], work + float(segment.work[-1])
        if before < after and before in jumps and qd is not None:
            crossing = cross(kernels, q, qd, before, after, task.p)
            qd, work = crossing.qd, work + crossing.work
            path.impulses += crossing.impulses
        t, velocities = after, velocities if qd is None else _velocities(path, task, qd)
    return None


def _velocities(path: Path, task: Task, qd: np.ndarray) -> np.ndarray:
    """What a run begins with: all velocities, or those of the independent coordinates."""
    return qd if task.method.is_constrained or path.partitions is None else qd[path.partitions.velocity.independent]


def _one(
    engine: Engine, path: Path, kernels: Kernels, task: Task, grid: np.ndarray, ends: tuple[float, float], work: float
) -> tuple[str | None, Path]:
    """Let an engine fill a part between two times (s), and add its rows to the path but for those of its ends that are not on the grid.

    Returns why the engine stopped before the end, or None, and the part.
    """
    segment = Path.empty(kernels.n, path.partitions)
    first, last = len(path.q), int(np.searchsorted(grid, ends[1], "right"))
    times = np.unique([ends[0], *grid[first:last], ends[1]])
    positions = np.searchsorted(times, grid[first:last])
    extra_times = np.zeros(len(times), dtype=bool)
    extra_times[positions] = task.movable_from(first)[: last - first]
    extra_times[[0, -1]] = False  # the ends are what the run goes on from
    inside = task.breaks[np.searchsorted(task.breaks[:, 0], ends[0], "right") : np.searchsorted(task.breaks[:, 1], ends[1])]
    try:
        return engine(
            segment, kernels, replace(task, grid=times, movable=extra_times, breaks=inside, inspected=None, sibling=None)
        ), segment
    finally:
        _take_over(path, segment, positions, work, float(grid[first - 1]) if first else -np.inf)
        task.looked_at(first, times[positions])


def _take_over(path: Path, segment: Path, positions: np.ndarray, work: float, reached: float) -> None:
    """Add what a part gave: its rows at places on the grid, and where it was stopped one more, unless that is at the time (s) reached."""
    count = len(segment.q) - (segment.stopped is not None)
    rows = positions[positions < count].tolist()
    if segment.stopped is not None and (segment.stopped > reached or len(rows)):
        rows.append(count)
    path.extend(segment.q[rows], segment.qd[rows], segment.work[rows] + work, segment.counts)
    path.partitions, path.stopped = segment.partitions, segment.stopped
    path.crossed, path.next_step = segment.crossed, segment.next_step
    path.take_counts(segment)
