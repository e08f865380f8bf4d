"""How an instant of an event, and the state after it, change with the state before it and with parameters.

A condition g(t, q, q̇, p) that passes zero at the time τ moves by dτ = −(g_q dq + g_q̇ dq̇ + g_p dp) / ġ, where ġ is its rate along the motion
f⁻ before it. At the instant itself the state changes by dx + f⁻ dτ. The actions take it to x⁺, and at a fixed time after it the change is
that of x⁺ less f⁺ dτ (the saltation matrix: di Bernardo et al., Piecewise-smooth Dynamical Systems, 2008, section 2.5).

Changes are those of [q; q̇; p], N = 2 n + n_p numbers, since actions change parameters, too.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ncgen.errors import ModelError
from ncgen.mechanism.active_in_c import sides_of
from ncgen.mechanism.kernels import Kernels
from ncgen.model.actions import Call
from ncgen.model.elements import coordinate_of
from ncgen.model.values import is_number
from ncgen.solver.derivatives.event_equations import along, impulses_to, no_derivative, solved
from ncgen.solver.derivatives.impact_jacobians import ImpactJacobians
from ncgen.solver.events.condition_jacobians import EventTangents
from ncgen.solver.events.conditions import EventFunctions, changes_of
from ncgen.solver.events.holdables import Holdable
from ncgen.solver.events.modes import count_of, load_conditions
from ncgen.solver.events.state import Done, Occurrence, State
from ncgen.solver.formalisms import accelerations_by

RATE_ROUNDING, MIN_RELATIVE_RATE = 1e-9, 1e-6
"""A condition touches zero where its rate is below these fractions of the sizes of the rate's terms, and of the condition's own size over
the motion's length: rounding of the condition, 1e-13 of its size, then says nothing about when it is zero."""


CONSISTENT = 1e-7
"""Changes of positions satisfy constraints that an event has changed if they miss less than this share of the terms."""

SAME_TIME = 1e-9
"""Events that happen together do so at all parameters if their times change alike to this share, such as of two feet of one body."""


@dataclass(frozen=True, eq=False)
class EventJacobian:
    """Of an instant, by the state and parameters just before it at a fixed time, N numbers.

    time (N,): of the instant; before, after (N, N): of the states before and after it at the moving instant; through (N, N): of that after
    it at a fixed time
    """

    time: np.ndarray
    before: np.ndarray
    after: np.ndarray
    through: np.ndarray


class EventJacobians:
    """Those of a run. driven: numbers of the parameters that are inputs which change with time; length: of the motion (s)"""

    def __init__(self, kernels: Kernels, driven: Sequence[int], length: float) -> None:
        self.kernels, self.functions, self.driven, self.length = kernels, EventFunctions(kernels), list(driven), length
        self.tangents = EventTangents(self.functions)
        self.impacts = ImpactJacobians(self.tangents)
        self.rows = {row.number: row for row in self.functions.rows}
        self.n = kernels.n

    def __call__(self, o: Occurrence, approach: Sequence[State] = ()) -> EventJacobian:
        """Raises ModelError naming events and the time where there is no derivative. approach: two states before an instant at which the
        direction of friction ends, the nearer one behind"""
        self._check_in_space(o)
        flow = self._limit(o, *approach) if approach else self._flow(o.before, o.held_before)
        time = self._time(self._last_direction(o, approach[-1]) if approach else o, flow)
        before = np.eye(len(time)) + np.outer(flow, time)
        change = before
        for done in o.done:
            if done.is_impact:
                change = np.vstack([change[: self.n], self.impacts(done, time, change), change[2 * self.n :]])
            elif done.locks:
                change = self._lock(done, time, change)
            else:
                change = self._act(done, time, change) if done.events else self._keep(o, done, time, change)
        after = self._mode(o, time, change)
        if o.held or o.after.locked:
            left = o.done[-1].after.qd if o.done else o.after.qd
            after = self._onto(self.mode(o.after, o.held), replace(o.after, qd=left), after, time, o.after.qd)
        return EventJacobian(time, before, after, after - np.outer(self._flow(o.after, o.held), time))

    def mode(self, at: State, held: tuple[int, ...]) -> Kernels:
        """The kernels of the mode of a state in which these are held."""
        return self.functions.mode(at, self._held(held))

    def _held(self, held: tuple[int, ...]) -> tuple[Holdable, ...]:
        return tuple(self.rows[k] for k in held)

    def _flow(self, at: State, held: tuple[int, ...]) -> np.ndarray:
        """[q̇; q̈; 0] (N,) of a mode."""
        p = self.kernels.present(at.t, at.p)
        qdd = accelerations_by("lagrange").motion(self.mode(at, held).driven_by(None), at.q, at.qd, at.t, p, {}).qdd
        return np.concatenate([at.qd, qdd, np.zeros(len(p))])

    def _limit(self, o: Occurrence, first: State, second: State) -> np.ndarray:
        """That before an instant, as a straight line from two states before it."""
        far, near = (o.before.t - at.t for at in (first, second))
        flows = [self._flow(at, o.held_before) for at in (first, second)]
        flow = (far * flows[1] - near * flows[0]) / (far - near)
        flow[: self.n] = o.before.qd
        return flow

    # -- when ----------------------------------------------------------------------------------

    def _time(self, o: Occurrence, flow: np.ndarray) -> np.ndarray:
        """How the instant moves (N,); 0 at the start of the run."""
        where = f"at t = {o.before.t:.9g} s"
        crossed = [] if self._only_turns(o) else list(o.crossed)
        if not crossed:
            if any(done.is_impact and min(done.events) < len(self.functions.events) for done in o.done):
                raise self._none(o.names, f"{where} happens where the motion begins", "begin before it")
            return np.zeros(len(flow))
        times = np.array([self._time_of(k, o, flow, where) for k in crossed])
        if len(times) > 1:  # of what the constraints allow
            times = times @ self._onto(self.mode(o.before, o.held_before), o.before, np.eye(len(flow)))
        if np.max(np.abs(times - times[0])) > SAME_TIME * np.max(np.abs(times)):
            names = ", ".join(self._name(k, o.held_before) for k in crossed)
            raise self._none(names, f"{where} happen at one instant, where the order of events changes", "move one of them")
        return times[0]

    def _time_of(self, k: int, o: Occurrence, flow: np.ndarray, where: str) -> np.ndarray:
        """How the instant of one condition moves (N,)."""
        name = self._name(k, o.held_before)
        if k >= self.functions.count + count_of(self._held(o.held_before)):
            raise self._none("stop", f"{where} ends the motion", "leave it out")
        derivatives = self.tangents.conditions(self.mode(o.before, o.held_before), self._held(o.held_before), o.before)[k]
        by_time, by_state = derivatives[0], derivatives[1:]
        if np.any(by_state[2 * self.n :][self.driven]):
            raise self._none(name, f"{where} depends on an input that changes with time", "write that input as an expression of m.time")
        rate, size = by_time + by_state @ flow, abs(by_time) + np.abs(by_state) @ np.abs(flow)
        if not abs(rate) > max(RATE_ROUNDING * size, MIN_RELATIVE_RATE * self._scale(k, o) / self.length):
            raise self._none(name, f"{where} only touches its condition", "move it")
        return -by_state / rate

    def _only_turns(self, o: Occurrence) -> bool:
        """Whether only the direction of contacts in space was set anew, with which nothing changes."""
        turning = {*self.functions.turns, *self.functions.turns.values()}
        return not o.done and o.held == o.held_before and turning.issuperset(o.crossed)

    def resting_in_space(self, o: Occurrence) -> list[int]:
        """The contacts in space whose sliding ends."""
        gaps = self.functions.gaps
        begun = [k for k in self.functions.turns.values() if k in o.held and k not in o.held_before]
        return [k for k in begun if gaps[k] in o.held_before and o.crossed]

    def _last_direction(self, o: Occurrence, near: State) -> Occurrence:
        """The instant at which contacts in space come to rest along the direction in which they slide near it."""
        functions, p, sliding = self.functions, o.before.p.copy(), self.functions.sliding(near)
        rests, turning = self.resting_in_space(o), {*functions.turns, *functions.turns.values()}
        for k in rests:
            p[[self.kernels.parameters.index(name) for name in functions.contacts[k].slip]] = sliding[k][0]
        crossed = (*rests, *(k for k in o.crossed if k not in turning))
        return replace(o, before=replace(o.before, p=p), crossed=crossed)

    def _check_in_space(self, o: Occurrence) -> None:
        """Raise ModelError where a contact in space begins to slide."""
        functions = self.functions
        for k in functions.turns.values():
            if k in o.held_before and k not in o.held and functions.gaps[k] in o.held:
                why = f"at t = {o.before.t:.9g} s begins to slide in space, where friction has no direction"
                raise self._none(functions.contacts[k].name, why, "end the motion before, or take differences of runs")

    def _scale(self, k: int, o: Occurrence) -> float:
        """The size of a condition."""
        if k < self.functions.count:
            return float(self.functions.weighed(o.before)[1][k])
        held, at = self._held(o.held_before), replace(o.before, p=self.kernels.present(o.before.t, o.before.p))
        return float(load_conditions(self.functions, self.mode(o.before, o.held_before), held).at(at)[1][k - self.functions.count])

    def _name(self, k: int, held: tuple[int, ...]) -> str:
        """What a condition belongs to."""
        if k < self.functions.count:
            return self.functions.conditions[k][0].split(maxsplit=1)[1]
        owners = [each.name for each in self._held(held) for _ in sides_of(each.kind)]
        return owners[min(k - self.functions.count, len(owners) - 1)]

    def _none(self, names: str, why: str, remedy: str) -> ModelError:
        return no_derivative(self.kernels, names, why, remedy)

    # -- actions -------------------------------------------------------------------------------

    def _act(self, done: Done, time: np.ndarray, change: np.ndarray) -> np.ndarray:
        """Other parameters, inputs and velocities."""
        kernels, n = self.kernels, self.n
        (k,) = done.events
        if any(isinstance(action, Call) for action in self.functions.events[k].do):
            name = self.functions.events[k].name
            raise self._none(name, f"at t = {done.before.t:.9g} s calls a Python function", "write what it does as an expression")
        values = along(self.tangents.values(done.before), time, change)
        after, rates = change.copy(), {}
        for number, (event, name, _) in enumerate(changes_of(self.functions.events)):
            if event == k and name in kernels.parameters:
                after[2 * n + kernels.parameters.index(name)] = values[number]
            elif event == k:
                rates[kernels.index[coordinate_of(name)]] = values[number]
        if rates:
            at, rows = replace(done.before, p=done.after.p), np.eye(n)[list(rates)]  # on the constraints with their new parameters
            mode = self.functions.mode(at)
            mu, _ = impulses_to(mode, at, done.after.qd, rows)
            balance, constraints, *_ = (along(a, time, after) for a in self.tangents.impact(mode, at, done.after.qd, mu))
            x, _ = solved(mode, at, rows, -balance, np.vstack([-constraints, np.array(list(rates.values()))]))
            after[n : 2 * n] = x
        return after

    def _keep(self, o: Occurrence, done: Done, time: np.ndarray, change: np.ndarray) -> np.ndarray:
        """Constraints with other parameters, which positions satisfy. Raises ModelError where they would not after any change."""
        mode, at, n = self.functions.mode(done.before), done.before, self.n
        allowed = self._onto(self.mode(o.before, o.held_before), o.before, np.eye(len(time)))
        rows, arguments = mode.holonomic, {"t": at.t, "q": at.q, "qd": 0 * at.qd, "qdd": 0 * at.qd, "lam": np.zeros(mode.m), "p": at.p}
        J, by_p = mode.jacobian(at.q, at.t, at.p)[rows], mode.dense_tangent("phi_p", **arguments)[rows]
        moved, time_by = change @ allowed, (time @ allowed)[None]
        factors = [(J, moved[:n]), (-mode.nu(at.q, at.t, at.p)[rows, None], time_by), (by_p, moved[2 * n :])]
        off, sizes = np.abs(sum(a @ b for a, b in factors)), sum(np.abs(a) @ np.abs(b) for a, b in factors)
        if np.any(off > CONSISTENT * np.max(sizes, initial=0.0)):
            why = f"at t = {at.t:.9g} s would make positions jump at other parameters or initial values"
            raise self._none(o.names, why, "change constraints over time, by an expression of m.time")
        after = change.copy()
        after[n : 2 * n] = self._projected(mode, at, done.after.qd, time, change)
        return after

    def _lock(self, done: Done, time: np.ndarray, change: np.ndarray) -> np.ndarray:
        """Locks that close where they are, by impulses."""
        functions, n, after = self.functions, self.n, change.copy()
        values = along(self.tangents.values(done.before), time, change)
        for name in done.locks:
            index = self.kernels.parameters.index(self.kernels.model.locks[name].held)
            after[2 * n + index] = self.impacts.element(f"{name}, place", values)
        at = replace(done.after, qd=done.before.qd)
        after[n : 2 * n] = self._projected(functions.mode(at), at, done.after.qd, time, after)
        return after

    def _projected(self, mode: Kernels, at: State, qd: np.ndarray, time: np.ndarray, change: np.ndarray) -> np.ndarray:
        """How velocities qd (n,) change to which a mode's constraints take those of a state."""
        balance, constraints, *_ = self.tangents.impact(mode, at, qd, impulses_to(mode, at, qd, np.zeros((0, self.n)))[0])
        return solved(mode, at, np.zeros((0, self.n)), -along(balance, time, change), -along(constraints, time, change))[0]

    # -- modes ---------------------------------------------------------------------------------

    def begun(self, at: State) -> np.ndarray:
        """How the state and parameters with which events begin, at the start of a run, change with those that are given, (N, N)."""
        change, names = np.eye(2 * self.n + len(at.p)), self.kernels.parameters
        values = along(self.tangents.values(at), np.zeros(len(change)), change)
        for name, value in self.kernels.model.beginnings.items():
            change[2 * self.n + names.index(name)] = 0.0 if is_number(value) else self.impacts.element(name, values)
        return change

    def _mode(self, o: Occurrence, time: np.ndarray, change: np.ndarray) -> np.ndarray:
        """Directions of slip are given, and what begins to stick sticks where it is."""
        functions, after, first, names = self.functions, change.copy(), 2 * self.n, self.kernels.parameters
        values = along(self.tangents.values(o.after), time, change)
        slips = [friction.slip for friction in functions.frictions.values()]
        slips += [name for contact in functions.contacts.values() for name in contact.slip]
        after[[first + names.index(name) for name in slips]] = 0.0
        for k, each in functions.moving.items():
            if k in o.held and k not in o.held_before:
                after[first + names.index(each.held)] = self.impacts.element(f"{each.name}, place", values)
        return after

    def _onto(
        self, kernels: Kernels, at: State, change: np.ndarray, time: np.ndarray | None = None, qd: np.ndarray | None = None
    ) -> np.ndarray:
        """What the constraints of a mode allow of a change: that of a gap that comes to rest by bounces vanishes.

        time: how the instant moves (none: not at all); qd: velocities to which the constraints take those of the state (none: these)
        """
        n, time = self.n, np.zeros(change.shape[1]) if time is None else time
        dq, dqd, dp = np.split(change, [n, 2 * n])
        arguments = {"t": at.t, "q": at.q, "qd": 0 * at.qd, "qdd": np.zeros(n), "lam": np.zeros(kernels.m), "p": at.p}
        moved = kernels.jacobian(at.q, at.t, at.p) @ dq - np.outer(kernels.nu(at.q, at.t, at.p), time)
        missing, holonomic = moved + kernels.dense_tangent("phi_p", **arguments) @ dp, kernels.holonomic
        dq = dq + solved(kernels, at, np.zeros((0, n)), np.zeros_like(dq), -missing[holonomic], holonomic)[0]
        dqd = self._projected(kernels, at, at.qd if qd is None else qd, time, np.vstack([dq, dqd, dp]))
        return np.vstack([dq, dqd, dp])
