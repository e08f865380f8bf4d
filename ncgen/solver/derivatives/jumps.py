"""Jumps of laws in time that parameters move, in the derivatives of a motion.

At the time τ(p) of a jump accelerations change from f⁻ to f⁺. What is a little later feels f⁻ for that much longer, so that at a fixed time

    dq̇⁺ = dq̇⁻ + (f⁻ − f⁺) dτ/dp dp

(the saltation term: di Bernardo et al., Piecewise-smooth Dynamical Systems, 2008, section 2.5). Backwards the same product goes to p.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import TypeAlias

import numpy as np

from ncgen.errors import MAX_ECHO, ModelError, shortened
from ncgen.mechanism.break_times import outside_breaks
from ncgen.mechanism.driver_jumps import refuse_jumps
from ncgen.mechanism.kernels import Kernels
from ncgen.mechanism.moving_breaks import Jump, MovingBreaks, moving_breaks
from ncgen.solver.formalisms import accelerations_by
from ncgen.solver.positions.branches import refresh_branches
from ncgen.solver.runs.signals import Signals
from ncgen.solver.trajectories.trajectory import Trajectory

NO_JUMP = 1e-9
"""Relative to the accelerations there, or to those that move a body by its size in a run: a difference below this is rounding."""

ON_THE_GRID = 1e-9
"""An instant nearer to a break than this share of the shortest step is there."""


Stepping: TypeAlias = Callable[[np.ndarray, np.ndarray], Trajectory]
"""From times (E,), s, and breaks (B, 2) to a run with one step from each of the times to the next, as of `simulate_steps`."""


@dataclass(frozen=True, eq=False)
class Ends:
    """When steps of a motion end.

    t (E,): s; on_grid (K,): which of them are instants of the grid
    is_crossed (E − 1,): between which ends no step is taken, since a law jumps there; begins (E,): where laws begin with another formula
    """

    t: np.ndarray
    on_grid: np.ndarray
    is_crossed: np.ndarray
    begins: np.ndarray

    @property
    def of_steps(self) -> np.ndarray:
        """Those at which a step ends, or the first one begins."""
        return self.t[~np.append(False, self.is_crossed)]

    def spread(self, rows: np.ndarray) -> np.ndarray:
        """Rows (E, …) from those at the ends of steps: nothing moves where a jump is crossed."""
        return rows[np.cumsum(~np.append(False, self.is_crossed)) - 1]


@dataclass(frozen=True, eq=False, kw_only=True)
class Jumps:
    """The breaks of one motion with parameters p (n_p,), and what parameters do that move them. Called, it gives the jumps (`Jumping`).

    length: of the motion (s)
    reasons: {number of a parameter: why there is no derivative by it}, filled while states at the jumps become known
    """

    kernels: Kernels
    p: np.ndarray
    breaks: MovingBreaks
    length: float
    signals: Signals | None = None
    reasons: dict[int, str] = field(default_factory=dict)

    @classmethod
    def of(cls, kernels: Kernels, p: np.ndarray, q: np.ndarray, times: np.ndarray, signals: Signals | None) -> Jumps:
        """Those of a motion over times (s) from q (n,). Raises ModelError where a driver's velocity jumps."""
        breaks = moving_breaks(kernels, p, times, signals.laws if signals else ())
        refuse_jumps(kernels, p, q, breaks.rows, "derivatives")
        why = "moves jumps of a law whose argument depends on an input that changes with time, or which are too many"
        return cls(
            kernels=kernels,
            p=p,
            breaks=breaks,
            length=float(times[-1] - times[0]),
            signals=signals,
            reasons=dict.fromkeys(sorted(breaks.unknown), why),
        )

    def ends(self, times: np.ndarray) -> Ends:
        """The ends of steps over times (K,) of a grid (s), one from each to the next, or to a break."""
        rows = self.rows
        ends_of_grid = outside_breaks(rows, times)
        if len(rows):  # what lies nearer to a break than that is there
            near = rows.ravel()[np.argmin(np.abs(rows.ravel() - ends_of_grid[:, None]), axis=1)]
            ends_of_grid = np.where(np.abs(ends_of_grid - near) <= ON_THE_GRID * np.min(np.diff(times)), near, ends_of_grid)
            ends_of_grid = outside_breaks(rows, ends_of_grid)
        ends = np.union1d(ends_of_grid, rows)
        return Ends(
            ends, np.searchsorted(ends, ends_of_grid), np.isin(ends[:-1], rows[rows[:, 0] < rows[:, 1], 0]), np.isin(ends, rows[:, 1])
        )

    @property
    def rows(self) -> np.ndarray:
        """The breaks (B, 2), s."""
        return self.breaks.rows

    def __call__(self, times: np.ndarray, q: np.ndarray, qd: np.ndarray) -> dict[int, Jump]:
        """The jumps by the number of the instant just before, from all instants (K,), s, at which steps end, and q and q̇ there (K, n)."""
        jumps = {}
        for row in self.breaks.moved:
            before, after = self.rows[row]
            k = int(np.searchsorted(times, before))
            if k == len(times) or not (times[k] == before or (k == 0 and times[0] <= after)):
                continue
            jump = self._jump(row, float(times[max(k - 1, 0)]), q[k], qd[k])
            if jump is not None and times[k] == before and k + 1 < len(times):
                jumps[k] = jump
        return jumps

    def _jump(self, row: int, begun: float, q: np.ndarray, qd: np.ndarray) -> Jump | None:
        """The jump in a row, before which a step began at a time (s); None where nothing jumps."""
        (t, after), rates, kernels, sizes = self.rows[row].tolist(), self.breaks.rates[row], self.kernels, self.kernels.column_sizes
        sides = [self._present(min(begun, t), t, q), self._present(after, after, q)]
        accelerations = [accelerations_by("lagrange").motion(kernels, q, qd, each, p, {}).qdd for each, p in sides]
        change = accelerations[0] - accelerations[1]
        if np.max(np.abs(change) / sizes) <= NO_JUMP * max(np.max(np.abs(accelerations) / sizes), 1.0 / self.length**2):
            return None
        why = (
            f"moves a jump of a law at t = {t:.6g} s, where another one jumps that does not move with it, the law's argument only touches "
            "its zero, or the motion begins or ends"
        )
        self.reasons.update(dict.fromkeys(np.flatnonzero(np.isnan(rates)).tolist(), why))
        return Jump(change, rates)

    def _present(self, begun: float, t: float, q: np.ndarray) -> tuple[float, np.ndarray]:
        """The time, and parameters there with the inputs of a step that began at another one."""
        p = self.signals.begun_at(begun)(t, self.p) if self.signals else self.p
        return t, refresh_branches(self.kernels, q, p)

    def check_along(self, directions: np.ndarray) -> None:
        """As of `check`, for directions (columns, D), parameters first."""
        moved = np.flatnonzero(np.any(directions[: len(self.p)] != 0.0, axis=1)).tolist()
        self.check([self.kernels.parameters[k] for k in moved])

    def check(self, names: Iterable[str] | None = None) -> None:
        """Raise ModelError for the first of these names, None for all, of a parameter by which there is no derivative."""
        wanted = None if names is None else set(names)
        for k in sorted(self.reasons):
            name = self.kernels.parameters[k]
            if wanted is not None and name not in wanted:
                continue
            raise ModelError(
                f"{self.kernels.name}: there is no derivative by {name}, which {self.reasons[k]}; give {name} another value or leave "
                "it out (by=…)"
            )

    def check_second(self) -> None:
        """Raise ModelError where first derivatives jump at a break that parameters move: second ones are not those of the steps."""
        if self.breaks.bending:
            names = shortened(", ".join(self.kernels.parameters[k] for k in sorted(self.breaks.bending)), MAX_ECHO)
            raise ModelError(
                f"{self.kernels.name}: there are no second derivatives, since {names} may move the corner or jump of a law in time; take "
                "differences of gradient, or make it a number"
            )
