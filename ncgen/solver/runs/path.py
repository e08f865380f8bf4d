"""The rows of a trajectory while an engine makes them; one engine may go on where another stopped."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import cache

import numpy as np

from ncgen.mechanism.run_rows import Inspection, Outcome
from ncgen.solver.formalisms.impulse import Impulse
from ncgen.solver.positions.partition import Partitions


@dataclass(kw_only=True)
class Path:
    """q, qd (rows, n) and work (rows,) at the first times of a grid; the partitions in use at the end, None where the
    start is singular and the formalism needs none.

    counts: steps, evaluations, Newton steps, changes of partition, repeated steps, in the order of `Statistics`
    stopped: time (s) of the last row where the run ended before the end of the grid, at its `Stop` or since something was
        raised, such as by Ctrl-C; None where it did not
    projections, largest_projection: how often a state was projected, and how far a position moved at most, relative
    jacobians, fallbacks: as in `Statistics`
    stiff: how often dopri5 or dop853 in C found that stability, not the error, holds the steps down
    impulses: of drivers whose velocity jumped on the way
    halted: time (s), position, velocities and work at which steps became too short, None where they did not
    inspection: of a run in C that made all of it
    crossed: numbers of the conditions at which C stopped; next_step: length of the step that it would try next (s), 0 where it does not say
    """

    q: np.ndarray
    qd: np.ndarray
    work: np.ndarray
    counts: list[int]
    partitions: Partitions | None
    projections: int = 0
    largest_projection: float = 0.0
    stopped: float | None = None
    halted: tuple[float, np.ndarray, np.ndarray, float] | None = None
    jacobians: int = 0
    fallbacks: int = 0
    stiff: int = 0
    impulses: list[Impulse] = field(default_factory=list)
    inspection: Inspection | None = None
    crossed: tuple[int, ...] = ()
    next_step: float = 0.0

    @classmethod
    def empty(cls, n: int, partitions: Partitions | None) -> Path:
        """A path that begins; its defaults stay those of the class, as setting each of them takes as long as a short run's steps."""
        path, none = cls.__new__(cls), _no_rows(n)
        path.q, path.qd, path.work, path.counts, path.partitions, path.impulses = none, none, _NO_WORK, [0] * 5, partitions, []
        return path

    @property
    def evaluations(self) -> int:
        """So far."""
        return self.counts[1]

    def extend(self, q: np.ndarray, qd: np.ndarray, work: np.ndarray, counts: Iterable[int] = ()) -> None:
        """Add rows behind the last one; counts add up."""
        if len(self.q):
            q, qd, work = np.vstack([self.q, q]), np.vstack([self.qd, qd]), np.concatenate([self.work, work])
        self.q, self.qd, self.work, self.inspection = q, qd, work, None
        self.add_counts(counts)

    def add_counts(self, counts: Iterable[int]) -> None:
        """Add to `counts`."""
        for k, count in enumerate(counts):
            self.counts[k] += count

    def take_run(self, done: Outcome, work: float, projects: bool) -> None:
        """Add the rows of a run in C, and what it counted; work: done before it; projects: whether it projects the end of every step."""
        if not len(self.q):
            self.inspection = done.inspection
            self.q, self.qd, self.work = done.q, done.qd, done.work + work if work else done.work
        else:
            self.extend(done.q, done.qd, done.work + work)
        self.count_run(done)
        self.projections += done.steps if projects else 0
        self.largest_projection = max(self.largest_projection, done.largest_projection)
        self.crossed, self.next_step = done.crossed, done.next_step

    def count_run(self, done: Outcome) -> None:
        """Add what a run in C counted besides its projections."""
        counts = self.counts
        counts[0] += done.steps
        counts[1] += done.evaluations
        counts[2] += done.newton_steps
        counts[4] += done.repeated
        self.jacobians += done.jacobians
        self.fallbacks += done.fallbacks
        self.stiff += done.stiff

    def take_counts(self, segment: Path) -> None:
        """Add what a part counted besides its rows, and its impulses."""
        self.projections += segment.projections
        self.largest_projection = max(self.largest_projection, segment.largest_projection)
        self.jacobians += segment.jacobians
        self.fallbacks += segment.fallbacks
        self.stiff += segment.stiff
        self.impulses += segment.impulses

    def stop(self, t: float, q: np.ndarray, qd: np.ndarray, work: float) -> None:
        """End with the state at which a run stops."""
        self.extend(q[None], qd[None], np.array([work]))
        self.stopped = float(t)

    def break_off(self, grid: np.ndarray, t: float, q: np.ndarray, qd: np.ndarray, work: float) -> None:
        """End where a run was interrupted: with the state that it had reached, unless that is a row already."""
        if len(self.q) and grid[len(self.q) - 1] >= t:
            self.stopped = float(grid[len(self.q) - 1])
        else:
            self.stop(t, q, qd, work)

    def note_projection(self, moved: float, steps: int = 0) -> None:
        self.projections += 1
        self.largest_projection = max(self.largest_projection, moved)
        self.counts[2] += steps

    def take_last(self) -> tuple[np.ndarray, np.ndarray, float]:
        """Remove the last row and return it: where another engine continues."""
        last = self.q[-1], self.qd[-1], float(self.work[-1])
        self.q, self.qd, self.work, self.inspection = self.q[:-1], self.qd[:-1], self.work[:-1], None
        return last


_NO_WORK = np.empty(0)


@cache
def _no_rows(n: int) -> np.ndarray:
    """An array of no rows, which every path begins with."""
    return np.empty((0, n))
