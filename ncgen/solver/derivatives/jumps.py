"""Jumps of laws in time that parameters move, in the derivatives of a motion.

At the time τ(p) of a jump accelerations change from f⁻ to f⁺. What is a little later feels f⁻ for that much longer, so that at a fixed time

    dq̇⁺ = dq̇⁻ + (f⁻ − f⁺) dτ/dp dp

(the saltation term: di Bernardo et al., Piecewise-smooth Dynamical Systems, 2008, section 2.5). Backwards the same product goes to p.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from typing import TypeAlias

import numpy as np

from ncgen.errors import SHOWN, ModelError, shortened
from ncgen.mechanism.break_times import beside
from ncgen.mechanism.driver_jumps import refuse_jumps
from ncgen.mechanism.kernels import Kernels
from ncgen.mechanism.moving_breaks import Jump, MovingBreaks, moving_breaks
from ncgen.solver.formalisms import accelerations_by
from ncgen.solver.positions.branches import refresh_branches
from ncgen.solver.runs.signals import Signals
from ncgen.solver.trajectories.trajectory import Trajectory

NO_JUMP = 1e-9
"""Relative to the accelerations, or velocities, there: a difference below this is rounding."""

ON_THE_GRID = 1e-9
"""An instant nearer to a break than this share of the shortest step is there."""

LOOKS = 9
"""Instants of a motion at which the sizes of these derivatives are seen, beside which a jump is one."""

SECOND = ("balance_p", "phid_p", "phidd_p")
"""Derivatives by parameters that must not jump at a break that parameters move, if second derivatives are to be those of the steps."""


Stepping: TypeAlias = Callable[[np.ndarray, np.ndarray], Trajectory]
"""From times (E,), s, and breaks (B, 2) to a run with one step from each of the times to the next, as of `simulate_steps`."""


@dataclass(frozen=True, eq=False)
class Ends:
    """When steps of a motion end.

    t (E,): s; seen (K,): which of them are instants of the grid
    is_crossed (E − 1,): between which ends no step is taken, since a law jumps there; begins (E,): where laws begin with another formula
    """

    t: np.ndarray
    seen: np.ndarray
    is_crossed: np.ndarray
    begins: np.ndarray

    @property
    def of_steps(self) -> np.ndarray:
        """Those at which a step ends, or the first one begins."""
        return self.t[~np.append(False, self.is_crossed)]

    def spread(self, rows: np.ndarray) -> np.ndarray:
        """Rows (E, …) from those at the ends of steps: nothing moves where a jump is crossed."""
        return rows[np.cumsum(~np.append(False, self.is_crossed)) - 1]


@dataclass(frozen=True, eq=False)
class Jumps:
    """The breaks of one motion with parameters p (n_p,), and what parameters do that move them.

    reasons: {number of a parameter: why there is no derivative by it}, filled while states at the jumps become known
    """

    kernels: Kernels
    p: np.ndarray
    breaks: MovingBreaks
    signals: Signals | None = None
    reasons: dict[int, str] = field(default_factory=dict)

    @classmethod
    def of(cls, kernels: Kernels, p: np.ndarray, times: np.ndarray, signals: Signals | None) -> Jumps:
        """Those of a motion over times (s)."""
        breaks = moving_breaks(kernels, p, times, signals.told if signals else ())
        why = "moves jumps of a law whose argument depends on an input that changes with time, or which are too many"
        return cls(kernels, p, breaks, signals, dict.fromkeys(breaks.unknown, why))

    def ends(self, times: np.ndarray, q: np.ndarray) -> Ends:
        """The ends of steps over times (K,) of a grid (s), one from each to the next, or to a break; of methods that do not go through the
        impulse where a driver's velocity jumps. q (n,): a position. Raises ModelError where one does."""
        refuse_jumps(self.kernels, self.p, q, self.rows, "derivatives by these steps")
        rows = self.rows
        seen = beside(rows, times)
        if len(rows):  # what lies nearer to a break than that is there
            near = rows.ravel()[np.argmin(np.abs(rows.ravel() - seen[:, None]), axis=1)]
            seen = np.where(np.abs(seen - near) <= ON_THE_GRID * np.min(np.diff(times)), near, seen)
            seen = beside(rows, seen)
        ends = np.union1d(seen, rows)
        return Ends(ends, np.searchsorted(ends, seen), np.isin(ends[:-1], rows[rows[:, 0] < rows[:, 1], 0]), np.isin(ends, rows[:, 1]))

    @property
    def rows(self) -> np.ndarray:
        """The breaks (B, 2), s."""
        return self.breaks.rows

    def __call__(self, times: np.ndarray, q: np.ndarray, qd: np.ndarray) -> dict[int, Jump]:
        """The jumps by the number of the instant just before, from all instants (K,), s, at which steps end, and q and q̇ there (K, n)."""
        found = {}
        for row in self.breaks.moved.tolist():
            before, after = self.rows[row]
            k = int(np.searchsorted(times, before))
            if k == len(times) or not (times[k] == before or (k == 0 and times[0] <= after)):
                continue
            jump = self._jump(row, float(times[max(k - 1, 0)]), q[k], qd[k])
            if jump is not None and times[k] == before and k + 1 < len(times):
                found[k] = jump
        return found

    def _jump(self, row: int, begun: float, q: np.ndarray, qd: np.ndarray) -> Jump | None:
        """The jump in a row, before which a step began at a time (s); None where nothing jumps."""
        (t, after), rates, kernels, sizes = self.rows[row].tolist(), self.breaks.rates[row], self.kernels, self.kernels.column_sizes
        sides = [self._present(min(begun, t), t, q), self._present(after, after, q)]
        speeds = [kernels.nu(q, each, p) / kernels.row_sizes for each, p in sides]
        if np.max(np.abs(speeds[0] - speeds[1]), initial=0.0) > NO_JUMP * max(1.0, float(np.max(np.abs(speeds), initial=0.0))):
            return self._lost(Jump(0 * q, rates), rates != 0.0, f"moves the time at which a driver's velocity jumps (t = {t:.6g} s)")
        accelerations = [accelerations_by("lagrange").motion(kernels, q, qd, each, p, {}).qdd for each, p in sides]
        change = accelerations[0] - accelerations[1]
        if np.max(np.abs(change) / sizes, initial=0.0) <= NO_JUMP * float(np.max(np.abs(accelerations) / sizes, initial=0.0)):
            return None
        why = (
            f"moves a jump of a law at t = {t:.6g} s, where another one jumps that does not move with it, the law's argument only touches "
            "its zero, or the motion begins or ends"
        )
        return self._lost(Jump(change, rates), np.isnan(rates), why)

    def _present(self, begun: float, t: float, q: np.ndarray) -> tuple[float, np.ndarray]:
        """The time, and parameters there with the inputs of a step that began at another one."""
        p = self.signals.begun_at(begun)(t, self.p) if self.signals else self.p
        return t, refresh_branches(self.kernels, q, p)

    def _lost(self, jump: Jump, parameters: np.ndarray, why: str) -> Jump:
        """The same without rates for parameters (n_p,), a mask."""
        self.reasons.update(dict.fromkeys(np.flatnonzero(parameters).tolist(), why))
        return replace(jump, rates=np.where(parameters, np.nan, jump.rates))

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

    def check_second(self, times: np.ndarray, q: np.ndarray, qd: np.ndarray) -> None:
        """Raise ModelError where second derivatives are not those of the steps: a first derivative jumps at a break that parameters move.
        Arguments as of a call."""
        if not len(self.breaks.moving):
            return
        looks = np.unique(np.linspace(0, len(times) - 1, LOOKS).round().astype(int)).tolist()
        seen = [self._slopes(q[k], qd[k], *self._present(float(times[k]), float(times[k]), q[k])) for k in looks]
        sizes = [max(float(np.max(np.abs(a), initial=0.0)) for a in arrays) for arrays in zip(*seen, strict=True)]
        for row in self.breaks.moving.tolist():
            before, after = self.rows[row]
            k = int(np.searchsorted(times, before))
            if k + 1 >= len(times) or times[k] != before:
                continue
            present = self._present(float(times[max(k - 1, 0)]), before, q[k]), self._present(after, after, q[k])
            sides = [self._slopes(q[k], qd[k], *each) for each in present]
            if any(np.any(np.abs(a - b) > NO_JUMP * size) for a, b, size in zip(*sides, sizes, strict=True)):
                names = shortened(", ".join(self.kernels.parameters[j] for j in self.breaks.movers), SHOWN)
                raise ModelError(
                    f"{self.kernels.name}: there are no second derivatives, since {names} may move the corner or jump of a law at "
                    f"t = {before:.6g} s; take differences of gradient, or make it a number"
                )

    def _slopes(self, q: np.ndarray, qd: np.ndarray, t: float, p: np.ndarray) -> list[np.ndarray]:
        """Derivatives by parameters of the equations on one side of a break."""
        now = accelerations_by("lagrange").motion(self.kernels, q, qd, t, p, {})
        given = {"t": t, "q": q, "qd": qd, "qdd": now.qdd, "lam": now.lam, "p": p}
        return [now.qdd, *(self.kernels.dense_tangent(name, **given) for name in SECOND)]
