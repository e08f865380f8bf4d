"""What happens at one instant: the actions of events that are due; C has the chain of those that these bring about (`chain_in_c`)."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import count

import numpy as np

from ncgen.errors import ConvergenceError, ModelError, shown
from ncgen.mechanism.active_in_c import is_missed, is_still
from ncgen.mechanism.chain_in_c import Chain, is_zero
from ncgen.mechanism.impacts_in_c import set_rates
from ncgen.mechanism.kernels import Kernels
from ncgen.model.actions import Call, Locking, Stop
from ncgen.model.elements import coordinate_of
from ncgen.solver.events.conditions import EventFunctions
from ncgen.solver.events.impacts import Gap, Hit, are_coupled, hit_gaps
from ncgen.solver.events.mobility import is_blocked, response
from ncgen.solver.events.state import Done, State
from ncgen.solver.formalisms.projection import project_velocity
from ncgen.solver.parameter_checks import refused_parameters
from ncgen.solver.trajectories.happening import LOCKS, Happening, Search

JUMP = 1e-8
"""A constraint with other parameters is satisfied where it misses less than this share of its size: rounding, which a run projects away."""


@dataclass(eq=False, kw_only=True)
class Instant:
    """What happens at one instant. at: the state so far; happened, done: in order; stops: True where the run ends here

    turning, held: numbers of what only just turns, and of what was held before
    stuck: numbers of contacts that impacts leave sticking; changes_constraints: whether parameters of constraints were set
    """

    functions: EventFunctions
    at: State
    turning: Collection[int] = ()
    held: Collection[int] = ()
    happened: list[Happening] = field(default_factory=list)
    done: list[Done] = field(default_factory=list)
    stops: bool = False
    stuck: list[int] = field(default_factory=list)
    changes_constraints: bool = False

    def __post_init__(self) -> None:
        self.before = self.at

    @property
    def kernels(self) -> Kernels:
        return self.functions.kernels

    @cached_property
    def chain(self) -> Chain:
        """The chain of events, as C has it."""
        return Chain(self.functions.directions[: len(self.functions.events)], lambda: self.functions.weighed(self.at))

    def happen(self, due: Mapping[int, Search]) -> None:
        """Carry out the events of these positions, each with how it was found, and those that follow at the same instant.

        Raises ConvergenceError naming events that bring about each other without end, ModelError for what an action cannot do.
        """
        if not (due or self.done or self.functions.ratchets):
            return
        events, chain, rounds, p, acted = self.functions.events, self.chain, count(), self.at.p, list[str]()

        def act(numbers: tuple[int, ...]) -> None:
            first = next(rounds) == 0
            acted.extend(events[k].name for k in numbers)
            searches: dict[int, Search] = {k: due[k] if first else "action" for k in numbers}
            due_impacts = [k for k in numbers if events[k].impact]
            for k in (*(due_impacts if self._hit(due_impacts, searches) else ()), *(k for k in numbers if not events[k].impact)):
                if not events[k].impact or len(events[k].do) > 1:  # an impact may do more
                    self._act(k, searches[k])
            self._hit((), {})
            self._stop_others()

        if not chain.follow(due, act):
            names = ", ".join(events[k].name for k in np.flatnonzero(chain.due))
            raise ConvergenceError(
                f"{self.kernels.name}: events {names} bring about each other without end at t = {self.at.t:.6g} s; change their conditions"
            )

        if off := self._off(self.functions.mode(self.at)):
            changed = [f"{name} = {new:.6g}" for name, old, new in zip(self.kernels.parameters, p, self.at.p, strict=True) if old != new]
            raise ModelError(
                f"event {', '.join(dict.fromkeys(acted))} at t = {self.at.t:.6g} s: with {', '.join(changed)} positions would jump, "
                f"{off}; change it over time, by an expression of m.time"
            )
        self._keep_constraints()

    def _off(self, mode: Kernels) -> str:
        """Which constraint other parameters leave unsatisfied, in words; nothing where there is none."""
        if not self.changes_constraints:
            return ""
        off = np.abs(mode.phi(self.at.q, self.at.t, self.at.p)) / mode.row_sizes
        worst = int(np.argmax(off))
        return f"constraint {mode.rows[worst].label} is off by {off[worst]:.3g} of its size" if off[worst] > JUMP else ""

    def _keep_constraints(self) -> None:
        """Velocities that constraints with other parameters allow, by their impulses; none as long as other events are to change more."""
        mode, at = self.functions.mode(self.at), self.at
        if not self.changes_constraints or self._off(mode):
            return
        qd = project_velocity(mode, at.q, at.qd, at.t, at.p)
        if qd is not at.qd:
            self.at = replace(at, qd=qd)
        self.done.append(Done(events=(), is_impact=False, before=at, after=self.at))

    def lock(self, names: Sequence[str]) -> None:
        """Close locks where they are, with the impulses of their constraints. Raises ModelError where others contradict them."""
        functions, at, p = self.functions, self.at, self.at.p.copy()
        if not (new := [name for name in names if name not in at.locked]):
            return
        for name in new:
            lock = self.kernels.model.locks[name]
            p[self.kernels.parameters.index(lock.held)] = functions.place(lock, at)
        start, locked = at, tuple(name for name in functions.locks if name in (*at.locked, *new))
        self.at = at = replace(at, p=p, locked=locked)
        mode = functions.mode(at)
        qd = project_velocity(mode, at.q, at.qd, at.t, at.p)
        sizes = self.kernels.column_sizes
        if is_missed(mode.phi_q(at.q, at.t, at.p), mode.nu(at.q, at.t, at.p), sizes, start.speed(sizes), qd):
            raise ModelError(
                f"{self.kernels.name}: {', '.join(new)} cannot be locked at t = {at.t:.6g} s, since drivers or other locks move it; "
                "free these first"
            )
        self.at = replace(at, qd=qd)
        self.done.append(Done(events=(), is_impact=False, before=start, after=self.at, locks=tuple(new)))

    def free(self, name: str) -> None:
        """Open a lock."""
        self.at = replace(self.at, locked=tuple(each for each in self.at.locked if each != name))

    def begin(self) -> None:
        """Close the locks that are closed from the start on."""
        for name, lock in self.kernels.model.locks.items():
            if lock.closed:
                start = self.at
                self.lock([name])
                self._note(name, "start", start, LOCKS[0])

    def _act(self, k: int, search: Search) -> None:
        event, start, transition = self.functions.events[k], self.at, ""
        for action in event.do:
            if isinstance(action, Stop):
                self.stops = True
            elif isinstance(action, Locking):
                self.lock([action.lock]) if action.closes else self.free(action.lock)
                transition = LOCKS[0 if action.closes else 1]
            elif isinstance(action, Call):
                changes = action.function(self.at, self.kernels)
                if changes is not None and not isinstance(changes, Mapping):
                    raise ModelError(f"event {event.name}: its function returned {shown(changes)}; return {{name: value}} or None")
                self._set(changes or {}, event.name)
        before = self.at
        self._set(self.functions.numbers(before).get(k, {}), event.name)
        self.done.append(Done(events=(k,), is_impact=False, before=before, after=self.at))
        self._keep_constraints()
        self._note(event.name, search, start, transition)

    def _set(self, values: Mapping[str, float], where: str) -> None:
        """Other inputs, parameters and velocities; those of other coordinates follow with the least kinetic energy of the change."""
        kernels, at = self.kernels, self.at
        p, held = at.p.copy(), {}
        for name, value in values.items():
            inner = coordinate_of(name)
            if not np.isfinite(value):
                raise ModelError(f"event {where} at t = {at.t:.6g} s: {name} becomes {value}, not a finite number; correct the expression")
            if name in kernels.parameters:
                p[kernels.parameters.index(name)] = value
            elif inner != name and inner in kernels.index:
                held[kernels.index[inner]] = value
            else:
                raise ModelError(f"event {where}: {shown(name)} cannot be changed; name an input, a parameter or a velocity, rate(psi)")
        if not np.array_equal(p, at.p) and (refused := refused_parameters(kernels, p[None])):
            raise ModelError(f"event {where} at t = {at.t:.6g} s: {refused[0]}")
        self.at = replace(at, p=p)
        of_rows = self.kernels.of_rows(np.arange(len(p)))
        self.changes_constraints |= any(name in values for name in (self.kernels.parameters[i] for i in of_rows))
        if held:
            self.at = replace(self.at, qd=_with_rates(self.functions.mode(self.at), self.at, held))

    def _hit(self, due: Collection[int], searches: Mapping[int, Search]) -> bool:
        """Impacts of gaps that are due, and of closed ones that close. Returns whether something was hit.

        What closes is hit, with restitution, together with what is closed and does not open, and with ratchets that do not run forward.
        What opened or ran forward before, and would not after that, is then stopped (`_stop_others`).
        """
        functions, closed = self.functions, self._closed(due)
        if not any(k in due for k in closed) and not self._backward(closed):
            return False
        orders = {functions.events[k].impact.order for k in closed} - {""}  # type: ignore[union-attr]
        if len(orders) != 1 and not are_coupled(functions.mode(self.at), self.at, gaps_of(functions, self.at, closed)):
            orders = {"simultaneous"}  # ratchets have no other law
        gaps = [k for k in closed if orders != {"simultaneous"} or not self._moves(k, 1)]
        ratchets = self._movable([k for k in functions.ratchets if not self._moves(k, 1)])
        if not self._push([*gaps, *ratchets], orders, searches):
            return False
        self._stop_others()
        return True

    def _stop_others(self) -> None:
        """Stop closed gaps that close, and ratchets that run backward, without restitution; all that touches takes part.

        Impulses only push, so none is left that does so.
        """
        closed, ratchets = self._closed(), self.functions.ratchets
        if self._backward([*closed, *self._movable([k for k in ratchets if k not in self.turning])]):
            self._push([*closed, *self._movable(list(ratchets))], {"simultaneous"}, {}, restores=False)

    def _push(self, numbers: Sequence[int], orders: set[str], searches: Mapping[int, Search], restores: bool = True) -> bool:
        """The impact of these gaps and ratchets, searches being of what is due. Returns whether something was hit."""
        functions, start = self.functions, self.at
        gaps = gaps_of(functions, start, numbers, restores)
        if not numbers or not (hit := hit_gaps(functions.mode(start), start, gaps, orders)):
            return False
        self.at = replace(start, qd=hit.qd)
        self._note_turns(hit, numbers, start, restores)
        slides = {gap: number for number, gap in functions.gaps.items()}
        self.stuck += [slides[k] for k, sticks in zip(numbers, hit.sticks, strict=True) if sticks]
        due_searches: dict[str, Search] = {functions.events[k].name: search for k, search in searches.items() if k < len(functions.events)}
        self._note_impulses(gaps, due_searches, hit, start)
        return True

    def _closed(self, due: Collection[int] = ()) -> list[int]:
        """Of all gaps, those that are due or closed, and can move."""
        if not (gaps := [k for k, event in enumerate(self.functions.events) if event.impact]):
            return []
        values, scales = self.functions.weighed(self.at)
        return self._movable([k for k in gaps if k in due or is_zero(values[k], scales[k])])

    def _movable(self, numbers: list[int]) -> list[int]:
        """Those of some gaps and ratchets that locks which are closed let move."""
        if not self.at.locked or not numbers:
            return numbers
        still = is_blocked(self.functions.mode(self.at), self.kernels, self.at, self._velocities(numbers)[0])
        return [k for k, is_fixed in zip(numbers, still, strict=True) if not is_fixed]

    def _velocities(self, numbers: Sequence[int]) -> tuple[np.ndarray, np.ndarray]:
        """Of gaps and ratchets: gradients by q̇ (k, n), and velocities (k,)."""
        functions, at = self.functions, self.at
        (slopes, drift), rates, ratchets = functions.slopes(at), functions.rate_slopes(at), functions.ratchets
        W = np.array([rates[k] if k in ratchets else slopes[k] for k in numbers]).reshape(-1, self.kernels.n)
        return W, W @ at.qd + [0.0 if k in ratchets else drift[k] for k in numbers]

    def _moves(self, k: int, side: int) -> bool:
        """Whether a gap or ratchet moves to a side, by more than rounding."""
        sizes, (W, u) = self.kernels.column_sizes, self._velocities([k])
        speed = max(self.at.speed(sizes), self.before.speed(sizes))
        return bool(u[0] * side > 0) and not is_still(u[0], np.abs(W[0]) @ sizes * speed)

    def _backward(self, numbers: Sequence[int]) -> bool:
        """Whether one of some gaps and ratchets moves to the side that is forbidden; unless velocities have changed here, gaps close at
        their own time, and what is held moves by rounding."""
        if np.array_equal(self.before.qd, self.at.qd):
            numbers = [k for k in numbers if k in self.functions.ratchets and k not in self.held]
        return any(self._moves(k, -1) for k in numbers)

    def _note_turns(self, hit: Hit, hitting: Sequence[int], start: State, restores: bool) -> None:
        """Note what hits did, of gaps with these numbers of conditions."""
        for turn, velocities in hit.turns:
            after, events = replace(start, qd=velocities), tuple(hitting[number] for number in turn)
            self.done.append(Done(events=events, is_impact=True, before=start, after=after, restores=restores))
            start = after

    def _note(self, name: str, search: Search, start: State, transition: str) -> None:
        lost = float(np.sum(self._energy(start) - self._energy(self.at)))
        self.happened.append(
            Happening(
                t=start.t,
                name=name,
                search=search,
                q=start.q,
                before=start.qd,
                after=self.at.qd,
                impulse=0.0,
                energy_lost=lost,
                transition=transition,
            )
        )

    def _note_impulses(self, gaps: Sequence[Gap], searches: Mapping[str, Search], hit: Hit, start: State) -> None:
        """Of every gap that was hit."""
        for gap, impulse, lost in zip(gaps, hit.impulses.tolist(), hit.lost.tolist(), strict=True):
            if impulse > 0:
                search = searches.get(gap.name, "action")
                self.happened.append(
                    Happening(
                        t=start.t, name=gap.name, search=search, q=start.q, before=start.qd, after=hit.qd, impulse=impulse, energy_lost=lost
                    )
                )

    def _energy(self, at: State) -> np.ndarray:
        """Kinetic and potential energy (J)."""
        return self.kernels.energy(at.q, at.qd, at.t, at.p)[:2]


def gaps_of(functions: EventFunctions, at: State, taking: Sequence[int], restores: bool = True) -> list[Gap]:
    """The gaps that take part in impacts, with their friction, and ratchets, by the numbers of their conditions.

    restores: False for impacts without restitution
    """
    nothing = np.zeros((0, functions.kernels.n))
    gradients, drift = functions.slopes(at)
    sliding, gaps = functions.sliding(at), []
    slides = {gap: number for number, gap in functions.gaps.items()}
    for k in taking:
        if k in functions.ratchets:
            gaps.append(
                Gap(name=functions.ratchets[k].name, gradient=functions.rate_slopes(at)[k], drift=0.0, restitution=0.0, rubs=nothing)
            )
            continue
        gap = Gap(
            name=functions.events[k].name,
            gradient=gradients[k],
            drift=float(drift[k]),
            restitution=functions.restitution(k, at) if restores else 0.0,
            rubs=nothing,
        )
        if k in slides:
            number = slides[k]
            gap = replace(
                gap, rubs=sliding[number][1], friction=functions.friction(number, at),
                tangential=functions.tangential(number, at) if restores else 0.0, is_poisson=functions.contacts[number].law == "poisson",
            )  # fmt: skip
        gaps.append(gap)
    return gaps


def _with_rates(kernels: Kernels, at: State, held: Mapping[int, float]) -> np.ndarray:
    """Velocities (n,) that the constraints allow, some of them given, nearest to those there in the sense of kinetic energy.

    Raises ModelError naming a velocity that the constraints do not allow.
    """
    indices, wanted = list(held), np.array(list(held.values()))
    qd = project_velocity(kernels, at.q, at.qd, at.t, at.p)
    responses = response(kernels, at, np.eye(kernels.n)[indices])
    qd, failed = set_rates(responses, indices, wanted, qd, kernels.column_sizes)
    if failed >= 0:
        name = kernels.coordinates[indices[failed]]
        raise ModelError(f"rate({name}) cannot become {wanted[failed]:.6g} at t = {at.t:.6g} s: the constraints do not allow it")
    return qd
