"""Which gaps stay closed and what sticks after an instant: constraints are held as long as their loads allow.

All that may be held is, then what a load of the wrong sign, or beyond friction, says is released, the worst one first.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from ncgen.errors import ConvergenceError
from ncgen.mechanism.chain_in_c import is_zero
from ncgen.mechanism.conditions_in_c import UNWATCHED
from ncgen.mechanism.kernels import Kernels
from ncgen.solver.events.conditions import EventFunctions
from ncgen.solver.events.mobility import is_blocked
from ncgen.solver.events.modes import forces_of, load_conditions, sliding_of
from ncgen.solver.events.rubbing import check_determined, is_prevented, undetermined
from ncgen.solver.events.state import State
from ncgen.solver.formalisms.projection import project_position, project_velocity
from ncgen.solver.trajectories.happening import GAPS, JOINTS, RATCHETS, Happening, Search

LOAD_TOLERANCE = 1e-10
"""A load on the wrong side by less than this share of the largest is held."""

PROJECTED_TOLERANCE = 1e-6
"""The same where velocities are those before a projection, which moves them by a rounding."""

VELOCITY_TOLERANCE = 1e-9
"""A gap opens, or a joint or a contact slips, if its velocity is above this share of what it adds up."""

FRICTION_RESERVE = 1e-8
"""Where a contact begins to slide, so do others whose friction has no more than this share left."""

TURNING = 1e-9
"""A contact in space whose sliding velocity has turned by 90° did not come to rest if it is above this share of what it was before."""


@dataclass(frozen=True, eq=False)
class ActiveSet:
    """The state, the numbers of what is held in it, and what happened."""

    at: State
    held: tuple[int, ...]
    happened: list[Happening] = field(default_factory=list)


class ActiveConstraints:
    """rows: {number of a condition: what holds it}. left: {number of what was released at this instant: the direction in which it slips}"""

    def __init__(self, functions: EventFunctions) -> None:
        self.functions, self.kernels = functions, functions.kernels
        self.rows = {row.number: row for row in functions.rows}
        self.left: dict[int, np.ndarray] = {}
        self.blocked: list[int] = []
        self._prevented: set[int] = set()
        self._reserve = 0.0  # that contacts must have which go on sticking
        self._before = 0.0  # greatest velocity before the instant, with which what is left of others is compared

    # -- what C watches ------------------------------------------------------------------------

    def directions(self, held: tuple[int, ...], p: np.ndarray) -> np.ndarray:
        """Of the mechanism's conditions (C,): a held gap is not watched, nor the velocity of what sticks or does not touch."""
        ways = self.functions.directions.copy()
        for k, friction in self.functions.frictions.items():
            ways[k] = -int(p[self._place(friction.slip)]) or UNWATCHED
        for k, gap in self.functions.gaps.items():
            ways[k] = -1 if gap in held and k not in held and k not in self._prevented else UNWATCHED
        for number, k in self.functions.turns.items():
            ways[number] = ways[k]
        ways[[*held, *self.blocked]] = UNWATCHED
        return ways

    def look(self, at: State, held: tuple[int, ...]) -> None:
        """Note which gaps that are closed, and which joints at rest, cannot move while others are held: they are not watched."""
        functions, self.blocked = self.functions, []
        others = [k for k in self.rows if k not in held and k not in functions.contacts] if held or at.locked else []
        candidates = [k for k in others if self.is_still(k, at) and (k in functions.moving or self._is_closed(k, at))]
        if candidates:
            slopes, rates = functions.slopes(at)[0], functions.rate_slopes(at)
            W = np.array([rates[k] if k in functions.moving else slopes[k] for k in candidates])
            still = is_blocked(functions.mode(at, [self.rows[k] for k in held]), self.kernels, at, W)
            self.blocked = [k for k, fixed in zip(candidates, still, strict=True) if fixed]

    def release(self, held: tuple[int, ...], crossed: list[int], mode: Kernels, at: State) -> None:
        """Note what the load conditions of these numbers release, and in which direction. Raises ConvergenceError where the loads of
        contacts that slide are no longer determined."""
        self.left, number = {}, 0
        rows = tuple(self.rows[k] for k in held)
        for k in held:
            for side in (1, -1) if k in self.functions.frictions else (1,):
                if number in crossed:
                    self.left[k] = np.array([-side])
                number += 1
        if any(k in self.functions.frictions for k in self.left):  # what a joint bore may push a gap closed
            self.left = {k: side for k, side in self.left.items() if k in self.functions.frictions or self.rows[k].rubs}
        if number in crossed and (sliding := sliding_of(mode, rows, self.functions.loaded)):
            raise undetermined(self.functions, sliding, at)
        self.left |= {k: self._onwards(mode, held, k, at) for k in self.left if self.rows[k].sticks}

    # -- modes ---------------------------------------------------------------------------------

    def begin(self, at: State) -> State:
        """The state at the start, slip directions being those of the velocities."""
        values, p = self.functions.values(at)[0], at.p.copy()
        for name, number in self.functions.beginnings(at).items():
            p[self._place(name)] = number
        for k, friction in self.functions.frictions.items():
            p[self._place(friction.slip)] = 0.0 if self.is_still(k, at) else np.sign(values[k])
        return replace(at, p=p)

    def find(self, at: State, held: tuple[int, ...], due: dict[int, Search], resting: Sequence[int], before: np.ndarray) -> ActiveSet:
        """The mode after an instant.

        resting: gaps whose bounces end, contacts that an impact leaves sticking, and those that nothing has hit; before (n,): velocities
        Raises ConvergenceError where no mode is found.
        """
        if self.left and held and np.array_equal(before, at.qd):  # what begins to move begins with no velocity, not with one of rounding
            mode = self.functions.mode(at, [self.rows[k] for k in held])
            at = replace(at, qd=project_velocity(mode, at.q, at.qd, at.t, at.p))
        functions, start, released = self.functions, at, dict(self.left)
        self._before = self._speed(before)
        self._reserve = FRICTION_RESERVE if any(self.rows[k].sticks for k in self.left) else 0.0
        may = [k for k in self.rows if self._may_hold(k, at, held, due, resting)]
        if any(self.rows[k].sticks and k not in held and k not in released for k in may):  # that can take over: loads are shared anew
            released = {k: side for k, side in released.items() if not self.rows[k].sticks}
        wanted = [k for k in may if k not in released]
        self._drop_what_is_open(wanted)
        p = at.p.copy()
        for k in wanted:
            if k in functions.moving and k not in held:
                p[self._place(functions.moving[k].held)] = functions.place(functions.moving[k], at)
        at = replace(at, p=p)
        for _ in range(len(self.rows) + 1):
            at = replace(at, p=self._slipping(replace(start, p=at.p), wanted, released, due))
            at, worst = self._tried(at, start, tuple(wanted), held)
            if worst is None:
                break
            released[worst[0]] = worst[1]
            wanted.remove(worst[0])
            self._drop_what_is_open(wanted)
        else:
            raise ConvergenceError(
                f"{self.kernels.name}: at t = {at.t:.6g} s no set of contacts and joints that stick agrees with its loads"
            )
        self.left, self._prevented = released, self._held_by_others(wanted, at)
        return ActiveSet(at, tuple(wanted), self._happened(start, at, held, tuple(wanted), due))

    def _slipping(self, at: State, wanted: Sequence[int], released: Mapping[int, np.ndarray], due: Mapping[int, Search]) -> np.ndarray:
        """Parameters (n_p,) in which what is held does not slip, what was released does to its side, and others slip as they move."""
        functions, p, values = self.functions, at.p.copy(), self.functions.values(at)[0]
        for k, friction in functions.frictions.items():
            place = self._place(friction.slip)
            if k in wanted or k in released:
                p[place] = 0.0 if k in wanted else released[k][0]
            elif p[place] == 0.0 or k in due or not self.is_still(k, at):
                p[place] = np.sign(values[k])
        sliding = functions.sliding(at)
        for k, contact in functions.contacts.items():
            places, velocity = [self._place(name) for name in contact.slip], sliding[k][0]
            if k in wanted or functions.gaps[k] not in wanted:
                p[places] = 0.0
            elif k in released:
                p[places] = released[k]
            elif np.any(velocity):
                p[places] = velocity if len(velocity) > 1 else np.sign(velocity)
        return p

    def _held_by_others(self, wanted: Sequence[int], at: State) -> set[int]:
        """Contacts that do not stick themselves and cannot slide: their velocities are rounding, which is not watched."""
        rows, functions = tuple(self.rows[k] for k in wanted), self.functions
        if not any(row.sticks for row in rows):
            return set()
        mode = functions.mode(at, rows)
        return {k for k, gap in functions.gaps.items() if gap in wanted and k not in wanted and is_prevented(functions, mode, k, at)}

    def _drop_what_is_open(self, wanted: list[int]) -> None:
        """A contact that is open does not stick."""
        wanted[:] = [k for k in wanted if self.functions.gaps.get(k, wanted[0]) in wanted]

    def _may_hold(self, k: int, at: State, held: tuple[int, ...], due: dict[int, Search], resting: Sequence[int]) -> bool:
        """Whether a gap is closed and does not open, or a joint or a contact does not move."""
        if k in resting:
            return True
        if k in self.functions.moving:
            return k in due or self.is_still(k, at)
        if k in self.functions.contacts:
            return self.is_still(k, at) or (k in due and self._stops(k, at))
        return self._is_closed(k, at) and self.is_still(k, at) and (k in held or k not in due)

    def _is_closed(self, k: int, at: State) -> bool:
        values, scales = self.functions.weighed(at)
        return is_zero(values[k], scales[k])

    def is_still(self, k: int, at: State) -> bool:
        """Whether a gap does not change, or a joint or a contact does not move, but for rounding."""
        sizes = self.kernels.column_sizes
        speed = max(self._speed(at.qd), self._before)
        if k in self.functions.moving:
            return abs(self.functions.values(at)[0][k]) <= VELOCITY_TOLERANCE * (np.abs(self.functions.rate_slopes(at)[k]) @ sizes) * speed
        if k in self.functions.contacts:
            velocity, slopes = self.functions.sliding(at)[k]
            return bool(np.all(np.abs(velocity) <= VELOCITY_TOLERANCE * np.max(np.abs(slopes) @ sizes) * speed))
        slopes, drift = self.functions.slopes(at)
        return bool(abs(slopes[k] @ at.qd + drift[k]) <= VELOCITY_TOLERANCE * (np.abs(slopes[k]) @ sizes * speed + abs(drift[k])))

    def _speed(self, qd: np.ndarray) -> float:
        """The greatest velocity (1/s) in natural sizes."""
        return float(np.max(np.abs(qd) / self.kernels.column_sizes, initial=0.0))

    def _stops(self, k: int, at: State) -> bool:
        """Whether a contact whose sliding velocity passed zero along its direction came to rest; in space it may have turned by 90°."""
        before = at.p[[self._place(name) for name in self.functions.contacts[k].slip]]
        return len(before) == 1 or bool(np.linalg.norm(self.functions.sliding(at)[k][0]) <= TURNING * np.linalg.norm(before))

    def _tried(
        self, at: State, start: State, held: tuple[int, ...], before: tuple[int, ...]
    ) -> tuple[State, tuple[int, np.ndarray] | None]:
        """The state on the constraints of a mode, and what must be released with the direction in which it slips, or None.

        before: what was held; a gap that was not is held only if it is pushed
        """
        rows = tuple(self.rows[k] for k in held)
        if not held:
            check_determined(self.functions, self.functions.mode(at), rows, at)
            return replace(at, q=start.q, qd=start.qd), None
        kernels = self.functions.mode(at, rows)
        loads, p, worst = load_conditions(self.functions, kernels, rows), self.kernels.present(at.t, at.p), None
        if all(k in self.functions.frictions for k in held):  # joints that stand still: their loads there say it without projecting
            worst = self._worst(loads.at(replace(start, p=p)), held, before, PROJECTED_TOLERANCE)
        if worst is None:
            q, _ = project_position(kernels, start.q, at.t, at.p)
            at = replace(at, q=q, qd=project_velocity(kernels, q, start.qd, at.t, at.p))
            check_determined(self.functions, kernels, rows, at)
            worst = self._worst(loads.at(replace(at, p=p)), held, before, LOAD_TOLERANCE)
        if worst and self.rows[worst[0]].sticks:
            worst = worst[0], self._onwards(kernels, held, worst[0], at)
        return at, worst

    def _onwards(self, mode: Kernels, held: tuple[int, ...], k: int, at: State) -> np.ndarray:
        """The direction in which a contact begins to slide that its friction cannot hold."""
        force = forces_of(mode, tuple(self.rows[each] for each in held), held.index(k), at)
        size = float(np.linalg.norm(force))
        return -force / size if size else force

    def _worst(
        self, loads: tuple[np.ndarray, np.ndarray], held: tuple[int, ...], before: tuple[int, ...], slack: float
    ) -> tuple[int, np.ndarray] | None:
        """Of conditions of loads, values and sizes, the constraint that is violated most, and its side."""
        margins = iter([value / size if size else 0.0 for value, size in zip(*(each.tolist() for each in loads), strict=True)])
        worst, excess = None, slack
        for k in held:
            is_joint = k in self.functions.frictions
            for side in (-1.0, 1.0) if is_joint else (1.0,):
                reserve = self._reserve if self.rows[k].sticks else 0.0 if is_joint or k in before else 2 * LOAD_TOLERANCE
                over = reserve - next(margins)
                if over > excess:
                    worst, excess = (k, np.array([side])), over
        return worst

    def _happened(
        self, start: State, at: State, before: tuple[int, ...], after: tuple[int, ...], due: dict[int, Search]
    ) -> list[Happening]:
        """What became held, or free; a joint or contact whose slip only turns round has done both."""
        happened = []
        for k, row in self.rows.items():
            slips = k in self.functions.frictions or row.sticks
            words = JOINTS if slips else RATCHETS if k in self.functions.ratchets else GAPS
            change = words[0] if k in after and k not in before else words[1] if k in before and k not in after else ""
            if row.sticks and change == JOINTS[1] and self.functions.gaps[k] not in after:
                change = ""  # it leaves
            if slips and not change and k in due and k not in after and len(row.rows) == 1:
                change = JOINTS[2]
            if change:
                search: Search = due.get(k, "sampled" if k in before else "action")
                happened.append(Happening(t=at.t, name=row.name, search=search, q=at.q, before=start.qd, after=at.qd, what=change))
        return happened

    def _place(self, name: str) -> int:
        return self.kernels.parameters.index(name)
