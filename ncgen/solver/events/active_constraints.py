"""Which gaps stay closed and what sticks after an instant: constraints are held as long as their loads allow.

C has the rules (`active_in_c`): all that may be held is, then what a load of the wrong sign, or beyond friction, says is released, the
worst one first. Here states are brought onto the constraints of modes, whose loads are compiled on demand.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from ncgen.errors import ConvergenceError
from ncgen.mechanism.active_in_c import Active, direction_of, is_still, sides_of
from ncgen.mechanism.chain_in_c import is_zero
from ncgen.mechanism.conditions_in_c import UNWATCHED
from ncgen.mechanism.kernels import Kernels
from ncgen.mechanism.sliding_in_c import SlidingContact
from ncgen.model.singular_values import pseudoinverse
from ncgen.solver.events.conditions import EventFunctions
from ncgen.solver.events.mobility import is_blocked, response
from ncgen.solver.events.modes import LoadConditions, forces_of, load_conditions, sliding_of
from ncgen.solver.events.rubbing import check_determined, undetermined
from ncgen.solver.events.state import State, greatest_speed
from ncgen.solver.formalisms.projection import project_position, project_velocity
from ncgen.solver.trajectories.happening import GAPS, JOINTS, RATCHETS, Happening, Search

HALT = 1e-6
"""Where no step is short enough, a contact in space comes to rest that slides with less than this share of its largest velocity."""


@dataclass(frozen=True, eq=False)
class ActiveSet:
    """The state, the numbers of what is held in it, and what happened."""

    at: State
    held: tuple[int, ...]
    happened: list[Happening] = field(default_factory=list)


class ActiveConstraints:
    """rows: {number of a condition: what holds it}. left: {number of what was released at this instant: the direction in which it slips, of
    a contact the force (N) that friction could not hold}

    unseen (n,): velocities that steps do not tell from none
    """

    def __init__(self, functions: EventFunctions) -> None:
        self.functions, self.kernels = functions, functions.kernels
        self.rows = {row.number: row for row in functions.rows}
        self.left: dict[int, np.ndarray] = {}
        self.blocked: list[int] = []
        self.unseen = np.zeros(self.kernels.n)
        self._prevented: set[int] = set()
        self._before = 0.0  # greatest velocity before the instant, with which what is left of others is compared

    # -- what C watches ------------------------------------------------------------------------

    def directions(self, held: tuple[int, ...], p: np.ndarray) -> np.ndarray:
        """Of the mechanism's conditions (C,): a held gap is not watched, nor the velocity of what sticks or does not touch."""
        functions, ways = self.functions, self.functions.directions.copy()
        for k, row in self.rows.items():
            slip = int(p[self.place(functions.frictions[k].slip)]) if k in functions.frictions else 0
            ways[k] = direction_of(row.kind, k in held, functions.gaps.get(k) in held, slip, int(ways[k]))
        ways[[*self.blocked, *self._prevented]] = UNWATCHED
        for number, k in functions.turns.items():
            ways[number] = ways[k]
        return ways

    def look(self, at: State, held: tuple[int, ...]) -> None:
        """Note which gaps that are closed, and which joints at rest, cannot move while others are held: they are not watched."""
        functions, self.blocked = self.functions, []
        others = [k for k in self.rows if k not in held and k not in functions.contacts] if held or at.locked else []
        candidates = [k for k in others if self.is_still(k, at) and (k in functions.moving or self.is_closed(k, at))]
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
            for side in sides_of(self.rows[k].kind):
                if number in crossed:
                    self.left[k] = np.array([side])
                number += 1
        if number in crossed and (sliding := sliding_of(mode, rows, self.functions.loaded)):
            raise undetermined(self.functions, sliding, at)
        self.left |= {k: -forces_of(mode, rows, held.index(k), at) for k in self.left if self.rows[k].sticks}

    # -- modes ---------------------------------------------------------------------------------

    def begin(self, at: State) -> State:
        """The state at the start, slip directions being those of the velocities."""
        values, p = self.functions.values(at)[0], at.p.copy()
        for name, number in self.functions.beginnings(at).items():
            p[self.place(name)] = number
        for k, friction in self.functions.frictions.items():
            p[self.place(friction.slip)] = 0.0 if self.is_still(k, at) else np.sign(values[k])
        return replace(at, p=p)

    def find(self, at: State, held: tuple[int, ...], due: dict[int, Search], resting: Sequence[int], before: np.ndarray) -> ActiveSet:
        """The mode after an instant.

        resting: gaps whose bounces end, contacts that an impact leaves sticking, and those that nothing has hit; before (n,): velocities
        Raises ConvergenceError where no mode is found.
        """
        if self.left and held and np.array_equal(before, at.qd):  # what begins to move begins with no velocity, not with one of rounding
            mode = self.functions.mode(at, [self.rows[k] for k in held])
            at = replace(at, qd=project_velocity(mode, at.q, at.qd, at.t, at.p))
        self._before = greatest_speed(before, self.kernels.column_sizes)
        choice = HeldChoice(self, at, held, due, resting)
        if not choice.active.choose(choice.find_loads):
            raise ConvergenceError(
                f"{self.kernels.name}: at t = {at.t:.6g} s no set of contacts and joints that stick agrees with its loads"
            )
        start, at, released, wanted = at, choice.at, choice.directions(), choice.wanted
        self.left, self._prevented = released, self._held_by_others(wanted, at)
        return ActiveSet(at, wanted, self._happened(start, choice, held, due))

    def _held_by_others(self, wanted: Sequence[int], at: State) -> set[int]:
        """Contacts that do not stick themselves and cannot slide: their velocities are rounding, which is not watched."""
        rows, functions = tuple(self.rows[k] for k in wanted), self.functions
        if not any(row.sticks for row in rows):
            return set()
        mode = functions.mode(at, rows)
        return {k for k, gap in functions.gaps.items() if gap in wanted and k not in wanted and self._is_prevented(mode, k, at)}

    def _is_prevented(self, mode: Kernels, k: int, at: State) -> bool:
        """Whether a contact cannot slide in a mode, whatever acts on it, since others stick."""
        return bool(np.all(is_blocked(mode, self.kernels, at, self.functions.sliding(at)[k][1])))

    def is_closed(self, k: int, at: State) -> bool:
        values, scales = self.functions.weighed(at)
        return is_zero(values[k], scales[k])

    def is_still(self, k: int, at: State) -> bool:
        """Whether a gap does not change, or a joint or a contact does not move, but for rounding."""
        sizes = self.kernels.column_sizes
        speed = max(at.speed(sizes), self._before)
        if k in self.functions.moving:
            return is_still(self.functions.values(at)[0][k], np.abs(self.functions.rate_slopes(at)[k]) @ sizes * speed)
        if k in self.functions.contacts:
            return self.slide(k, at).is_still(speed)
        slopes, drift = self.functions.slopes(at)
        return is_still(slopes[k] @ at.qd + drift[k], np.abs(slopes[k]) @ sizes * speed, drift[k])

    def slide(self, k: int, at: State) -> SlidingContact:
        """A contact at a state."""
        slip = at.p[[self.place(name) for name in self.functions.contacts[k].slip]]
        return SlidingContact(*self.functions.sliding(at)[k], slip, self.kernels.column_sizes, self.unseen)

    def is_opposed(self, k: int, at: State) -> bool:
        """Whether a contact that has not moved would begin to slide against others that were released: rigid bodies do not move so."""
        contacts = self.functions.contacts
        if k not in contacts or not (released := [j for j in self.left if j in contacts]):
            return False
        sliding = self.slide(k, at)
        change = response(self.kernels, at, sliding.gradients) @ sliding.slip
        return sum(self.slide(j, at).along(self.left[j], change) for j in released) < 0

    def resting(self, at: State) -> tuple[int, ...]:
        """Where no step is short enough, numbers of the turns of contacts in space that come to rest there, whose motion is not seen."""
        slides = {number: self.slide(k, at) for number, k in self.functions.turns.items()}
        return tuple(number for number, sliding in slides.items() if np.linalg.norm(sliding.velocity) < HALT * np.linalg.norm(sliding.slip))

    def _happened(self, start: State, choice: HeldChoice, before: tuple[int, ...], due: dict[int, Search]) -> list[Happening]:
        """What became held, or free, or slips to the other side."""
        happened, at = [], choice.at
        for number, (k, row) in enumerate(self.rows.items()):
            if (change := choice.active.change(number)) is None:
                continue
            slips = k in self.functions.frictions or row.sticks
            word = (JOINTS if slips else RATCHETS if k in self.functions.ratchets else GAPS)[change]
            search: Search = due.get(k, "sampled" if k in before else "action")
            happened.append(Happening(t=at.t, name=row.name, search=search, q=at.q, before=start.qd, after=at.qd, transition=word))
        return happened

    def place(self, name: str) -> int:
        return self.kernels.parameters.index(name)


class HeldChoice:
    """The choice of what is held after an instant, on its way: at, the state with what is wanted now.

    owner: whose rows are held; at: the state before; held, due, resting: as of `ActiveConstraints.find`
    """

    def __init__(
        self, owner: ActiveConstraints, at: State, held: tuple[int, ...], due: Mapping[int, Search], resting: Sequence[int]
    ) -> None:
        self.owner, self.at, self._start, self._held = owner, at, at, held
        self._numbers = list(owner.rows)
        functions, positions = owner.functions, {k: position for position, k in enumerate(self._numbers)}
        gaps = [positions.get(functions.gaps.get(k, -1), -1) for k in positions]
        self.active = active = Active([row.kind for row in owner.rows.values()], gaps)
        for k, position in positions.items():
            active.before[position], active.rests[position], active.released[position] = k in held, k in resting, k in owner.left
            turns = any(functions.turns.get(number) == k for number in due)
            active.still[position] = owner.is_still(k, at) or (turns and owner.slide(k, at).is_unseen)
            if active.still[position] and k not in held and owner.is_opposed(k, at):
                active.oppose(position)
            active.closed[position] = k not in functions.moving and k not in functions.contacts and owner.is_closed(k, at)
            active.happened[position] = k in due and k not in functions.turns.values()
        for k, side in owner.left.items():
            if k in functions.frictions:
                active.released[positions[k]] = int(side[0])
        self._directions, self._tried = dict(owner.left), None
        self._mode: tuple[Kernels, LoadConditions] | None = None

    @property
    def wanted(self) -> tuple[int, ...]:
        """Numbers of what is to be held."""
        return tuple(k for k, mark in zip(self._numbers, self.active.wanted, strict=True) if mark)

    def directions(self) -> dict[int, np.ndarray]:
        """{number of what is released: the direction in which it slips}."""
        marks = {k: int(mark) for k, mark in zip(self._numbers, self.active.released, strict=True) if mark}
        return {k: self._directions.get(k, np.array([float(mark)])) for k, mark in marks.items()}

    def find_loads(self, projected: bool) -> np.ndarray:
        """Conditions of the loads of what is wanted: values and sizes, one after the other."""
        owner, wanted, start = self.owner, self.wanted, self._start
        rows = tuple(owner.rows[k] for k in wanted)
        if wanted != self._tried or self._mode is None:
            self._release(wanted)
            self.at = replace(self.at, p=self._slipping())
            kernels = owner.functions.mode(self.at, rows)
            self._tried, self._mode = wanted, (kernels, load_conditions(owner.functions, kernels, rows))
        (kernels, loads), at = self._mode, self.at
        if not wanted:
            check_determined(owner.functions, kernels, rows, at)
            self.at = replace(at, q=start.q, qd=start.qd)
            return np.empty(0)
        p = owner.kernels.present(at.t, at.p)
        if not projected:
            return np.column_stack(loads.at(replace(start, p=p))).ravel()
        q, _ = project_position(kernels, start.q, at.t, at.p)
        self.at = at = replace(at, q=q, qd=project_velocity(kernels, q, start.qd, at.t, at.p))
        check_determined(owner.functions, kernels, rows, at)
        return np.column_stack(loads.at(replace(at, p=p))).ravel()

    def _release(self, wanted: tuple[int, ...]) -> None:
        """Note the directions in which contacts begin to slide that were released since the last try, and where what is new is held."""
        owner, functions, p = self.owner, self.owner.functions, self.at.p.copy()
        released = {k for k, mark in zip(self._numbers, self.active.released, strict=True) if mark}
        self._directions = {k: side for k, side in self._directions.items() if k in released}
        for k in released - set(self._directions):
            if owner.rows[k].sticks and self._mode and self._tried:
                held = tuple(owner.rows[each] for each in self._tried)
                self._directions[k] = -forces_of(self._mode[0], held, self._tried.index(k), self.at)
        new = [k for k in wanted if self._tried is None and k in functions.moving and k not in self._held]
        if new:
            there = self._closed(wanted)
            for k in new:
                p[owner.place(functions.moving[k].held)] = functions.place(functions.moving[k], there)
        self.at = replace(self.at, p=p)

    def _closed(self, wanted: tuple[int, ...]) -> State:
        """The state with the gaps that are wanted closed to rounding: else a joint would be held where a gap cannot be closed."""
        functions, at = self.owner.functions, self.at
        gaps = [k for k in wanted if k < len(functions.events)]
        if not gaps:
            return at
        slopes, values = functions.slopes(at)[0][gaps], functions.values(at)[0][gaps]
        change = response(self.owner.kernels, at, slopes)
        return replace(at, q=at.q + change @ pseudoinverse(slopes @ change, 1e-12) @ -values)

    def _slipping(self) -> np.ndarray:
        """Parameters (n_p,) in which what is held does not slip, what was released does to its side, and others slip as they move."""
        owner, functions, at, p = self.owner, self.owner.functions, self._start, self.at.p.copy()
        values, speed = functions.values(at)[0], at.speed(owner.kernels.column_sizes)
        numbers = {k: number for number, k in enumerate(self._numbers)}
        for k, friction in functions.frictions.items():
            index = owner.place(friction.slip)
            p[index] = self.active.slip(numbers[k], p[index], np.sign(values[k]))
        for k, contact in functions.contacts.items():
            sliding, indices = owner.slide(k, at), [owner.place(name) for name in contact.slip]
            way, mobility = self._directions.get(k, np.zeros(len(indices))), 0.0
            if len(way) > 1 and np.any(way):
                mobility = float(np.max(np.einsum("kn,nk->k", sliding.gradients, response(owner.kernels, at, sliding.gradients))))
            p[indices] = self.active.turn(numbers[k], p[indices], sliding, way, mobility, speed) if k in numbers else 0.0
        return p
