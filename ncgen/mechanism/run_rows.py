"""What a run in C writes: rows, one a time of its grid, and why it ended."""

from __future__ import annotations

from copy import copy
from typing import NamedTuple

import numpy as np

from ncgen.mechanism.arguments import pointer
from ncgen.toolchain.abi import InC, Interface, Number

FLOAT = np.dtype(float)


class Inspection(NamedTuple):
    """What rows of a run say against it, as of `ncgen_inspection`.

    energy: T + V − W in the first of them (J); change: the farthest that it is from there; kinetic: the largest T
    remainder: of Φ_q q̇ − ν, the largest of all rows, relative to their sizes
    """

    energy: float
    change: float
    kinetic: float
    remainder: float


class RunRows:
    """Room for K rows of n coordinates and for the last state, behind them.

    work (K + 1,), states (2, K + 1, n): positions and velocities, once they are doubles
    in_c: where C writes positions, velocities and work; t_in_c: the same of times, which are those that were asked for until then
    block: all of them, times first
    """

    def __init__(self, ffi: Interface, number: Number, times: np.ndarray, n: int) -> None:
        """times: of C's type"""
        rows, count = len(times), len(times) + 1
        self._n, self._count, self.block = n, count, np.empty(count * (2 * n + 2), number.dtype)
        self.block[:rows] = times
        self.t_in_c = start = pointer(ffi, self.block, number.array)
        self.in_c: tuple[InC, InC, InC] = start + 2 * count, start + (2 + n) * count, start + count

    def as_doubles(self) -> None:
        """Convert what C wrote."""
        count = self._count
        if self.block.dtype is not FLOAT:
            self.block[count - 1] = 0  # a time that nobody reads, nor writes
            self.block = self.block.astype(float)
        self.work, self.states = self.block[count : 2 * count], self.block[2 * count :].reshape(2, count, self._n)


class Outcome:
    """What a run in C gave: rows written (less than asked if it stopped early), and why it ended.

    t (rows,) in s: their times, those asked for but for movable; q, qd (rows, n); work (rows,); status "ok" or the reason
    stiff: how often it was found stiff; next_step (s): what an explicit method with error control would try next
    raised: what ended the run from outside, or None; crossed: numbers of the conditions at which it stopped
    inspection: of a run that was inspected, and came to its end
    """

    raised: BaseException | None = None
    crossed: tuple[int, ...] = ()
    inspection: Inspection | None = None

    def __init__(self, rows: RunRows, done: int, status: str, statistics: InC) -> None:
        """done: how many rows C wrote; statistics: an ncgen_statistics"""
        rows.as_doubles()
        self.t, self.work, states = rows.block[:done], rows.work[:done], rows.states
        self.q, self.qd = states[0, :done], states[1, :done]
        self.status = status
        self.steps: int = statistics.steps
        self.evaluations: int = statistics.evaluations
        self.newton_steps: int = statistics.newton_steps
        self.repeated: int = statistics.repeated
        self.jacobians: int = statistics.jacobians
        self.fallbacks: int = statistics.fallbacks
        self.stiff: int = statistics.stiff
        self.stopped = statistics.stopped != 0
        self.largest_projection = float(statistics.largest_projection)
        self.next_step = float(statistics.next_step)
        self._rows, self._statistics = rows, statistics

    @property
    def reached(self) -> float:
        """Time (s) of the state `last`."""
        return float(self._statistics.t)

    @property
    def tried(self) -> float:
        """Time of the last stage (s)."""
        return float(self._statistics.tried)

    @property
    def factorisations(self) -> int:
        """Of the matrix of the equations."""
        return self._statistics.factorisations

    @property
    def refinements(self) -> int:
        """Of solutions of linear equations."""
        return self._statistics.refinements

    @property
    def last(self) -> tuple[np.ndarray, np.ndarray, float]:
        """Position, velocities and work of the last state."""
        states = self._rows.states
        return states[0, -1].copy(), states[1, -1].copy(), float(self._rows.work[-1])

    def with_rows(self, **rows: np.ndarray) -> Outcome:
        """The same with other t, q, qd and work."""
        other = copy(self)
        vars(other).update(rows)
        return other

    def completed(self) -> Outcome:
        """This outcome, unless something was raised while the run went on: that is raised now."""
        if self.status == "interrupted":
            raise self.raised or KeyboardInterrupt()
        return self
