"""Which gaps stay closed and which joints stick after an instant: constraints are held as long as their loads allow.

All that may be held is, then what a load of the wrong sign, or beyond static friction, says is released, the worst one first.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from ncgen.errors import ConvergenceError
from ncgen.mechanism.conditions import OFF
from ncgen.solver.events.actions import CLOSED
from ncgen.solver.events.conditions import EventFunctions
from ncgen.solver.events.modes import load_conditions
from ncgen.solver.events.state import State
from ncgen.solver.formalisms.projection import project_position, project_velocity
from ncgen.solver.trajectories.happening import GAPS, JOINTS, RATCHETS, Happening, Search

SLACK = 1e-10
"""A load on the wrong side by less than this share of the largest is held."""

CLEAR = 1e-6
"""The same where velocities are those before a projection, which moves them by a rounding."""

STANDSTILL = 1e-9
"""A gap opens, or a joint slips, if its velocity is above this share of what it adds up."""


@dataclass(frozen=True, eq=False)
class Settled:
    """The state, the numbers of what is held in it, and what happened."""

    at: State
    held: tuple[int, ...]
    happened: list[Happening] = field(default_factory=list)


class Settling:
    """rows: {number of a condition: what holds it}. left: numbers of what was released at this instant; speed: the largest velocity at it,
    in natural sizes per second"""

    def __init__(self, functions: EventFunctions) -> None:
        self.functions, self.kernels = functions, functions.kernels
        self.rows = {row.number: row for row in functions.rows}
        self.left: dict[int, float] = {}
        self.speed = 0.0

    # -- what C watches ------------------------------------------------------------------------

    def directions(self, held: tuple[int, ...], p: np.ndarray) -> np.ndarray:
        """Of the mechanism's conditions (C,): a held gap is not watched, nor the velocity of what sticks."""
        ways = self.functions.directions.copy()
        for k, friction in self.functions.frictions.items():
            ways[k] = -int(p[self._place(friction.slip)]) or OFF
        ways[list(held)] = OFF
        return ways

    def release(self, held: tuple[int, ...], crossed: list[int]) -> None:
        """Note which constraints the load conditions of these numbers release, and to which side.

        Where joints slip, gaps stay: what a joint bore may push them closed.
        """
        left, number = {}, 0
        for k in held:
            both = (1, -1) if k in self.functions.frictions else (1,)
            for side in both:
                if number in crossed:
                    left[k] = float(-side)
                number += 1
        slips = {k: side for k, side in left.items() if k in self.functions.frictions}
        self.left = slips or left

    # -- modes ---------------------------------------------------------------------------------

    def begin(self, at: State) -> State:
        """The state at the start, slip directions being those of the velocities."""
        values, p, self.speed = self.functions.values(at)[0], at.p.copy(), self._speed(at)
        for name, number in self.functions.beginnings(at).items():
            p[self._place(name)] = number
        for k, friction in self.functions.frictions.items():
            p[self._place(friction.slip)] = 0.0 if self._is_still(k, at) else np.sign(values[k])
        return replace(at, p=p)

    def settle(self, before: State, at: State, held: tuple[int, ...], due: dict[int, Search], resting: list[int]) -> Settled:
        """The mode after an instant; before, at: the states before and after its actions. Raises ConvergenceError where none is found."""
        self.speed = max(self._speed(before), self._speed(at))
        functions, start, released = self.functions, at, dict(self.left)
        still = [*resting, *held] if np.array_equal(before.qd, at.qd) else resting
        wanted = [k for k in self.rows if k in still or self._may_hold(k, at, held, due)]
        wanted = [k for k in wanted if k not in released]
        p = at.p.copy()
        for k in wanted:
            if k in functions.moving and k not in held:
                p[self._place(functions.moving[k].held)] = functions.place(functions.moving[k], at)
        at = replace(at, p=p)
        for _ in range(len(self.rows) + 1):
            at = self._slipping(at, start, wanted, released, due)
            at, worst = self._tried(at, start, tuple(wanted), held)
            if worst is None:
                break
            released[worst[0]] = worst[1]
            wanted.remove(worst[0])
        else:
            raise ConvergenceError(
                f"{self.kernels.name}: at t = {at.t:.6g} s no set of contacts and joints that stick agrees with its loads"
            )
        self.left = released
        return Settled(at, tuple(wanted), self._happened(start, at, held, tuple(wanted), due))

    def _slipping(self, at: State, start: State, wanted: list[int], released: dict[int, float], due: dict[int, Search]) -> State:
        """A state with the directions in which joints slip: that in which they were released, or that of their velocity at the start."""
        p, values = at.p.copy(), self.functions.values(start)[0]
        for k, friction in self.functions.frictions.items():
            place = self._place(friction.slip)
            if k in wanted:
                p[place] = 0.0
            elif k in released:
                p[place] = released[k]
            elif p[place] == 0.0 or k in due or not self._is_still(k, start):
                p[place] = np.sign(values[k])
        return replace(at, p=p)

    def _may_hold(self, k: int, at: State, held: tuple[int, ...], due: dict[int, Search]) -> bool:
        """Whether a gap is closed and does not open, or a joint does not move."""
        if k in self.functions.moving:
            return k in due or self._is_still(k, at)
        values, scales = self.functions.weighed(at)
        return bool(abs(values[k]) <= CLOSED * scales[k]) and self._is_still(k, at) and (k in held or k not in due)

    def _is_still(self, k: int, at: State) -> bool:
        """Whether a gap does not change, or a joint does not move, but for rounding."""
        if k in self.functions.moving:
            size = float(np.abs(self.functions.rate_slopes(at)[k]) @ self.kernels.column_sizes)
            return abs(self.functions.values(at)[0][k]) <= STANDSTILL * size * self.speed
        slopes, drift = self.functions.slopes(at)
        size = np.abs(slopes[k]) @ self.kernels.column_sizes
        return bool(abs(slopes[k] @ at.qd + drift[k]) <= STANDSTILL * (size * self.speed + abs(drift[k])))

    def _speed(self, at: State) -> float:
        return float(np.max(np.abs(at.qd) / self.kernels.column_sizes, initial=0.0))

    def _tried(self, at: State, start: State, held: tuple[int, ...], before: tuple[int, ...]) -> tuple[State, tuple[int, float] | None]:
        """The state on the constraints of a mode, and the one that must be released with its side, or None. before: what was held; a gap
        that was not is held only if it is pushed."""
        if not held:
            return replace(at, q=start.q, qd=start.qd), None
        rows = tuple(self.rows[k] for k in held)
        kernels = self.functions.mode(at, rows)
        loads, p, worst = load_conditions(self.functions, kernels, rows), self.kernels.present(at.t, at.p), None
        if all(k in self.functions.frictions for k in held):  # joints that stand still: their loads there say it without projecting
            worst = self._worst(loads.at(replace(start, p=p)), held, before, CLEAR)
        if worst is None:
            q, _ = project_position(kernels, start.q, at.t, at.p)
            at = replace(at, q=q, qd=project_velocity(kernels, q, start.qd, at.t, at.p))
            worst = self._worst(loads.at(replace(at, p=p)), held, before, SLACK)
        return at, worst

    def _worst(
        self, loads: tuple[np.ndarray, np.ndarray], held: tuple[int, ...], before: tuple[int, ...], slack: float
    ) -> tuple[int, float] | None:
        """Of conditions of loads, values and sizes, the constraint that is violated most, and its side."""
        margins = iter([value / size if size else 0.0 for value, size in zip(*(each.tolist() for each in loads), strict=True)])
        worst, excess = None, slack
        for k in held:
            is_joint = k in self.functions.frictions
            for side in (-1.0, 1.0) if is_joint else (1.0,):
                over = (0.0 if is_joint or k in before else 2 * SLACK) - next(margins)
                if over > excess:
                    worst, excess = (k, side), over
        return worst

    def _happened(
        self, start: State, at: State, before: tuple[int, ...], after: tuple[int, ...], due: dict[int, Search]
    ) -> list[Happening]:
        """What became held, or free; a joint whose slip only turns round has done both."""
        found = []
        for k, row in self.rows.items():
            is_joint = k in self.functions.frictions
            words = JOINTS if is_joint else RATCHETS if k in self.functions.ratchets else GAPS
            change = words[0] if k in after and k not in before else words[1] if k in before and k not in after else ""
            if is_joint and not change and k in due and k not in after:
                change = JOINTS[2]
            if change:
                search: Search = due.get(k, "sampled" if k in before else "action")
                found.append(Happening(at.t, row.name, search, at.q, start.qd, at.qd, what=change))
        return found

    def _place(self, name: str) -> int:
        return self.kernels.parameters.index(name)
