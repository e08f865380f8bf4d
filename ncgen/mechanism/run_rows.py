"""What a run in C writes: rows, one a time of its grid, and why it ended."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ncgen.mechanism.arguments import pointer
from ncgen.toolchain.abi import InC, Interface, Number


@dataclass(eq=False, kw_only=True)
class Outcome:
    """What a run in C gave: rows written (less than asked if it stopped early), and why it ended.

    rows: that it wrote; status "ok" or the reason
    reached: time (s) of the state `last`; tried: time of the last stage; stiff: how often it was found stiff
    raised: what ended the run from outside, or None; crossed: numbers of the conditions at which it stopped
    next_step (s): what an explicit method with error control would try next
    """

    rows: Rows
    done: int
    status: str
    reached: float
    steps: int
    rejected: int
    repeated: int
    evaluations: int
    newton_steps: int
    factorisations: int = 0
    perturbed: int = 0
    refinements: int = 0
    stopped: bool = False
    largest_projection: float = 0.0
    jacobians: int = 0
    fallbacks: int = 0
    tried: float = 0.0
    stiff: int = 0
    raised: BaseException | None = None
    crossed: tuple[int, ...] = ()
    next_step: float = 0.0

    @cached_property
    def t(self) -> np.ndarray:
        """Times of the rows, (rows,) in s: those asked for but for movable."""
        return self.rows.t[: self.done]

    @cached_property
    def q(self) -> np.ndarray:
        """Positions, (rows, n)."""
        return self.rows.q[: self.done]

    @cached_property
    def qd(self) -> np.ndarray:
        """Velocities, (rows, n)."""
        return self.rows.qd[: self.done]

    @cached_property
    def work(self) -> np.ndarray:
        """Work, (rows,) in J."""
        return self.rows.work[: self.done]

    @cached_property
    def last(self) -> tuple[np.ndarray, np.ndarray, float]:
        """Position, velocities and work of the last state."""
        return self.rows.q[-1].copy(), self.rows.qd[-1].copy(), float(self.rows.work[-1])

    def completed(self) -> Outcome:
        """This outcome, unless something was raised while the run went on: that is raised now."""
        if self.status == "interrupted":
            raise self.raised or KeyboardInterrupt()
        return self


class Rows:
    """Room for K rows of n coordinates and for the last state, behind them.

    in_c: where C writes positions, velocities and work; t_in_c: the same of times
    """

    def __init__(self, ffi: Interface, number: Number, times: np.ndarray, n: int) -> None:
        self._n, self._count = n, len(times) + 1
        self._block = np.empty(self._count * (2 * n + 2), number.dtype)
        self._block[: len(times)] = times
        start, count = pointer(ffi, self._block, number.array), self._count
        self.t_in_c: InC = start
        self.in_c: tuple[InC, InC, InC] = start + 2 * count, start + (2 + n) * count, start + count

    @cached_property
    def _numbers(self) -> np.ndarray:
        return self._block.astype(float, copy=False)

    @property
    def t(self) -> np.ndarray:
        """Times, (K,) in s, as of C where it moved them."""
        return self._numbers[: self._count - 1]

    @property
    def work(self) -> np.ndarray:
        """Work, (K + 1,) in J."""
        return self._numbers[self._count : 2 * self._count]

    @property
    def q(self) -> np.ndarray:
        """Positions, (K + 1, n)."""
        return self._numbers[2 * self._count : (2 + self._n) * self._count].reshape(self._count, self._n)

    @property
    def qd(self) -> np.ndarray:
        """Velocities, (K + 1, n)."""
        return self._numbers[(2 + self._n) * self._count :].reshape(self._count, self._n)

    def outcome(self, done: int, status: str, statistics: InC, raised: BaseException | None, crossed: tuple[int, ...]) -> Outcome:
        """What a run gave that wrote so many rows; statistics: an ncgen_statistics."""
        s = statistics
        return Outcome(
            rows=self, done=done, status=status, reached=float(s.t), steps=s.steps, rejected=s.rejected,
            repeated=s.repeated, evaluations=s.evaluations, newton_steps=s.newton_steps, factorisations=s.factorisations,
            perturbed=s.perturbed, refinements=s.refinements, stopped=bool(s.stopped), largest_projection=float(s.largest_projection),
            jacobians=s.jacobians, fallbacks=s.fallbacks, tried=float(s.tried), stiff=s.stiff, raised=raised, crossed=crossed,
            next_step=float(s.next_step),
        )  # fmt: skip
