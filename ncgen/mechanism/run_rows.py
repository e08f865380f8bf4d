"""What a run in C writes: rows, one a time of its grid, and why it ended."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ncgen.mechanism.arguments import pointer
from ncgen.toolchain.abi import InC, Interface, Number


@dataclass(eq=False, kw_only=True)
class Outcome:
    """What a run in C gave: rows written (less than asked if it stopped early), and why it ended.

    t (rows,) in s: their times, those asked for but for movable; q, qd (rows, n); work (rows,); status "ok" or the reason
    ends: the last state, where C wrote it
    reached: time (s) of the state `last`; tried: time of the last stage; stiff: how often it was found stiff
    raised: what ended the run from outside, or None; crossed: numbers of the conditions at which it stopped
    next_step (s): what an explicit method with error control would try next
    """

    t: np.ndarray
    q: np.ndarray
    qd: np.ndarray
    work: np.ndarray
    ends: tuple[np.ndarray, np.ndarray, np.floating]
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

    @property
    def last(self) -> tuple[np.ndarray, np.ndarray, float]:
        """Position, velocities and work of the last state."""
        q, qd, work = self.ends
        return q.copy(), qd.copy(), float(work)

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

    def outcome(self, done: int, status: str, statistics: InC, raised: BaseException | None, crossed: tuple[int, ...]) -> Outcome:
        """What a run gave that wrote so many rows; statistics: an ncgen_statistics."""
        n, count = self._n, self._count
        block = self._block if self._block.dtype == float else self._block.astype(float)
        work, states = block[count : 2 * count], block[2 * count :].reshape(2, count, n)
        q, qd = states
        s = statistics
        return Outcome(
            t=block[:done], q=q[:done], qd=qd[:done], work=work[:done], ends=(q[-1], qd[-1], work[-1]),
            status=status, reached=float(s.t), steps=s.steps, rejected=s.rejected,
            repeated=s.repeated, evaluations=s.evaluations, newton_steps=s.newton_steps, factorisations=s.factorisations,
            perturbed=s.perturbed, refinements=s.refinements, stopped=bool(s.stopped), largest_projection=float(s.largest_projection),
            jacobians=s.jacobians, fallbacks=s.fallbacks, tried=float(s.tried), stiff=s.stiff, raised=raised, crossed=crossed,
            next_step=float(s.next_step),
        )  # fmt: skip
