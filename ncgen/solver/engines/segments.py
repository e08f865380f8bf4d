"""A run in Python from break to break of its laws in time: no step passes a break. In C steps end there by themselves."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TypeAlias

import numpy as np

from ncgen.mechanism.break_times import beside, smooth_parts
from ncgen.mechanism.kernels import Kernels
from ncgen.solver.runs.path import Path
from ncgen.solver.runs.task import Task

Engine: TypeAlias = Callable[[Path, Kernels, Task], None]


def in_segments(engine: Engine, path: Path, kernels: Kernels, task: Task) -> None:
    """Complete a path as an engine would, which is asked once a segment. Raises what it raises, the path holding what it reached."""
    if not len(task.breaks):
        engine(path, kernels, task)
        return
    grid = beside(task.breaks, task.grid)
    q, velocities, work = task.q, task.velocities, 0.0
    if len(path.q):
        q, qd, work = path.take_last()
        velocities = _velocities(path, task, qd)
    for start, end in smooth_parts(task.breaks, float(grid[len(path.q)]), float(grid[-1])):
        part = Path.empty(kernels.n, path.partitions)
        times = np.unique(np.concatenate([[start], grid[(grid > start) & (grid < end)], [end]]))
        here = replace(task, grid=times, q=q, velocities=velocities, before=(float(grid[0]), int(path.counts[0])))
        try:
            engine(part, kernels.driven_by(task.signals.begun_at(float(start))) if task.signals else kernels, here)
        finally:
            _take_over(path, part, times, grid, work)
        if part.stopped is not None:
            return
        q, velocities, work = part.q[-1], _velocities(part, task, part.qd[-1]), work + part.work[-1]


def _velocities(path: Path, task: Task, qd: np.ndarray) -> np.ndarray:
    """What a run begins with: all velocities, or those of the independent coordinates."""
    return qd if task.method.is_constrained or path.partitions is None else qd[path.partitions.velocity.independent]


def _take_over(path: Path, part: Path, times: np.ndarray, grid: np.ndarray, work: float) -> None:
    """What a segment gave, without those of its ends that are not on the grid."""
    count = len(part.q) - (part.stopped is not None)  # rows on the segment's own times; where it was stopped one more
    wanted = np.isin(times[:count], grid) & (times[:count] >= grid[min(len(path.q), len(grid) - 1)])
    rows = [*np.flatnonzero(wanted), *range(count, len(part.q))]
    path.extend(part.q[rows], part.qd[rows], part.work[rows] + work, part.counts)
    path.partitions, path.stopped = part.partitions, part.stopped
    path.projections += part.projections
    path.largest_projection = max(path.largest_projection, part.largest_projection)
    path.jacobians += part.jacobians
