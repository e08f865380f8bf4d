"""What a run in C writes: rows, one a time of its grid, and why it ended."""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy

import numpy as np

from ncgen.mechanism.arguments import pointer
from ncgen.toolchain.abi import InC, Interface, Number


class RunRows:
    """Room for K rows of n coordinates and for the last state, behind them.

    work (K + 1,), states (2, K + 1, n): positions and velocities, once they are doubles
    in_c: where C writes positions, velocities and work; t_in_c: the same of times; asked_in_c: where it reads times
    block: all of them, times first
    """

    def __init__(self, ffi: Interface, number: Number, times: Sequence[float] | np.ndarray, n: int) -> None:
        rows, count = len(times), len(times) + 1
        self._n, self._count, self.block = n, count, np.empty(count * (2 * n + 3), number.dtype)
        last_block = count * (2 * n + 2)
        self.block[:rows] = self.block[last_block : last_block + rows] = times
        start = pointer(ffi, self.block, number.array)
        self.t_in_c, self.asked_in_c = start, start + last_block
        self.in_c: tuple[InC, InC, InC] = start + 2 * count, start + (2 + n) * count, start + count

    def as_doubles(self) -> None:
        """Convert what C wrote."""
        count = self._count
        if self.block.dtype != float:
            self.block = self.block.astype(float)
        self.work, self.states = self.block[count : 2 * count], self.block[2 * count : (2 + 2 * self._n) * count].reshape(2, count, self._n)


class Outcome:
    """What a run in C gave: rows written (less than asked if it stopped early), and why it ended.

    t (rows,) in s: their times, those asked for but for movable; q, qd (rows, n); work (rows,); status "ok" or the reason
    stiff: how often it was found stiff; next_step (s): what an explicit method with error control would try next
    raised: what ended the run from outside, or None; crossed: numbers of the conditions at which it stopped
    """

    def __init__(
        self, rows: RunRows, done: int, status: str, statistics: InC, raised: BaseException | None, crossed: tuple[int, ...]
    ) -> None:  # fmt: skip
        """done: how many rows C wrote; statistics: an ncgen_statistics"""
        rows.as_doubles()
        self.t, self.work, states = rows.block[:done], rows.work[:done], rows.states
        self.q, self.qd = states[0, :done], states[1, :done]
        self.status, self.raised, self.crossed = status, raised, crossed
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
