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
from ncgen.mechanism.kernels import Kernels
from ncgen.model.actions import Call
from ncgen.model.elements import coordinate_of
from ncgen.model.values import is_number
from ncgen.solver.events.condition_jacobians import EventTangents
from ncgen.solver.events.conditions import EventFunctions, changes_of
from ncgen.solver.events.modes import Held, count_of, load_conditions, variant
from ncgen.solver.events.state import Done, Occurrence, State
from ncgen.solver.formalisms import accelerations_by
from ncgen.solver.formalisms.instant import scaled_mass
from ncgen.solver.formalisms.kkt import KKT
from ncgen.solver.name_lists import listed_names
from ncgen.solver.positions.rank import scaled_jacobian

RATE_ROUNDING, MIN_RELATIVE_RATE = 1e-9, 1e-6
"""A condition touches zero where its rate is below these fractions of the sizes of the rate's terms, and of the condition's own size over
the motion's length: rounding of the condition, 1e-13 of its size, then says nothing about when it is zero."""


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
        self._refuse()
        self.rows = {row.number: row for row in self.functions.rows}
        self.n = kernels.n

    def __call__(self, o: Occurrence) -> EventJacobian:
        """Raises ModelError naming events and the time where there is no derivative."""
        flow = self._flow(o.before, o.held_before)
        time = self._time(o, flow)
        before = np.eye(len(time)) + np.outer(flow, time)
        change = before
        for done in o.done:
            change = self._impact(done, time, change) if done.is_impact else self._act(done, time, change)
        through = self._mode(o, time, change) - np.outer(following := self._flow(o.after, o.held), time)
        if o.held:
            through = self._onto(o, through)
        return EventJacobian(time, before, through + np.outer(following, time), through)

    def _refuse(self) -> None:
        """Raise ModelError naming elements whose events have no derivatives yet."""
        model = self.kernels.model
        pressed = [each.name for each in model.frictions.values() if each.load is not None]
        if elements := [*model.contacts, *pressed, *model.locks, *model.ratchets]:
            names = listed_names(elements)
            raise ModelError(
                f"{model.name}: derivatives through friction of contacts and of loads, locks and ratchets ({names}) are not supported yet; "
                "take differences of runs, or leave them out"
            )

    def mode(self, held: tuple[int, ...]) -> Kernels:
        """The kernels of a mode."""
        return variant(self.kernels, self._held(held))

    def _held(self, held: tuple[int, ...]) -> tuple[Held, ...]:
        return tuple(self.rows[k] for k in held)

    def _flow(self, at: State, held: tuple[int, ...]) -> np.ndarray:
        """[q̇; q̈; 0] (N,) of a mode."""
        p = self.kernels.present(at.t, at.p)
        qdd = accelerations_by("lagrange").motion(self.mode(held).driven_by(None), at.q, at.qd, at.t, p, {}).qdd
        return np.concatenate([at.qd, qdd, np.zeros(len(p))])

    # -- when ----------------------------------------------------------------------------------

    def _time(self, o: Occurrence, flow: np.ndarray) -> np.ndarray:
        """How the instant moves (N,); 0 at the start of the run."""
        where = f"at t = {o.before.t:.9g} s"
        crossed: list[int] = list(o.crossed)
        if not crossed:
            if any(done.is_impact for done in o.done):
                raise self._none(o.names, f"{where} happens where the motion begins", "begin before it")
            return np.zeros(len(flow))
        if len(crossed) > 1:
            names = ", ".join(self._name(k, o.held_before) for k in crossed)
            raise self._none(names, f"{where} happen at one instant, where the order of events changes", "move one of them")
        k = crossed[0]
        name = self._name(k, o.held_before)
        if k > self.functions.count + count_of(self._held(o.held_before)) - 1:
            raise self._none("stop", f"{where} ends the motion", "leave it out")
        slopes = self.tangents.conditions(self.mode(o.held_before), self._held(o.held_before), o.before)[k]
        by_time, by_state = slopes[0], slopes[1:]
        if np.any(by_state[2 * self.n :][self.driven]):
            raise self._none(name, f"{where} depends on an input that changes with time", "write that input as an expression of m.time")
        rate, size = by_time + by_state @ flow, abs(by_time) + np.abs(by_state) @ np.abs(flow)
        if not abs(rate) > max(RATE_ROUNDING * size, MIN_RELATIVE_RATE * self._scale(k, o) / self.length):
            raise self._none(name, f"{where} only touches its condition", "move it")
        return -by_state / rate

    def _scale(self, k: int, o: Occurrence) -> float:
        """The size of a condition."""
        if k < self.functions.count:
            return float(self.functions.weighed(o.before)[1][k])
        held, at = self._held(o.held_before), replace(o.before, p=self.kernels.present(o.before.t, o.before.p))
        return float(load_conditions(self.functions, self.mode(o.held_before), held).at(at)[1][k - self.functions.count])

    def _name(self, k: int, held: tuple[int, ...]) -> str:
        """What a condition belongs to."""
        if k < self.functions.count:
            return self.functions.events[k].name if k < len(self.functions.events) else self.functions.frictions[k].name
        owners = [each.name for each in self._held(held) for _ in range(count_of([each]))]
        return owners[min(k - self.functions.count, len(owners) - 1)]

    def _none(self, names: str, why: str, remedy: str) -> ModelError:
        return ModelError(f"{self.kernels.name}: there is no derivative through the event {names}, which {why}; {remedy}")

    # -- actions -------------------------------------------------------------------------------

    def _along(self, columns: np.ndarray, time: np.ndarray, change: np.ndarray) -> np.ndarray:
        """How something with a Jacobian (…, 1 + N) by t, q, q̇ and p changes, (…, N)."""
        return columns @ np.vstack([time, change])

    def _act(self, done: Done, time: np.ndarray, change: np.ndarray) -> np.ndarray:
        """Other parameters, inputs and velocities."""
        kernels, n = self.kernels, self.n
        (k,) = done.events
        if any(isinstance(action, Call) for action in self.functions.events[k].do):
            name = self.functions.events[k].name
            raise self._none(name, f"at t = {done.before.t:.9g} s calls a Python function", "write what it does as an expression")
        values = self._along(self.tangents.values(done.before), time, change)
        after, rates = change.copy(), {}
        for number, (event, name, _) in enumerate(changes_of(self.functions.events)):
            if event == k and name in kernels.parameters:
                after[2 * n + kernels.parameters.index(name)] = values[number]
            elif event == k:
                rates[kernels.index[coordinate_of(name)]] = values[number]
        if rates:
            at, rows = replace(done.before, p=done.after.p), np.eye(n)[list(rates)]  # on the constraints with their new parameters
            mu, _ = self._impulses(at, done.after.qd, rows)
            balance, constraints, *_ = (self._along(a, time, after) for a in self.tangents.impact(at, done.after.qd, mu, {}))
            x, _ = solved(kernels, at, rows, -balance, np.vstack([-constraints, np.array(list(rates.values()))]))
            after[n : 2 * n] = x
        return after

    def _impact(self, done: Done, time: np.ndarray, change: np.ndarray) -> np.ndarray:
        """Velocities after gaps were hit: u⁺ = −e u⁻ of each."""
        functions, n, at = self.functions, self.n, done.before
        slopes, drift = functions.slopes(at)
        rows = slopes[list(done.events)]
        mu, impulses = self._impulses(at, done.after.qd, rows)
        push = dict(zip(done.events, (-impulses).tolist(), strict=True))
        jacobians = self.tangents.impact(at, done.after.qd, mu, push)
        balance, constraints, before, after = (self._along(a, time, change) for a in jacobians)
        values = self._along(self.tangents.values(at), time, change)
        gaps = []
        for k, row in zip(done.events, rows, strict=True):
            place, value = self.tangents.gaps.index(k), functions.restitution(k, at)
            by_restitution = self._restitution(k, values) * (row @ at.qd + drift[k])
            gaps.append(-after[place] - value * before[place] - by_restitution)
        x, _ = solved(self.kernels, at, rows, -balance, np.vstack([-constraints, *gaps]))
        return np.vstack([change[:n], x, change[2 * n :]])

    def _restitution(self, k: int, values: np.ndarray) -> np.ndarray | float:
        """How the restitution of an event changes, (N,), of those of all values."""
        event = self.functions.events[k]
        if event.impact is None or is_number(event.impact.restitution):
            return 0.0
        return self._element(f"event {event.name}", values)

    def _element(self, words: str, values: np.ndarray) -> np.ndarray:
        """How the value of an element changes, (N,), of those of all values."""
        first = len(changes_of(self.functions.events))
        names = [where for where, _ in self.functions.named_values[first:]]
        return values[first + names.index(words)]

    def _impulses(self, at: State, qd: np.ndarray, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Those of the constraints (m,), and along other rows (k, n), that change velocities to qd (n,)."""
        kernels, jump = self.kernels, qd - at.qd
        right = np.concatenate([kernels.jacobian(at.q, at.t, at.p) @ jump, rows @ jump])[:, None]
        _, y = solved(kernels, at, rows, np.zeros((self.n, 1)), right)
        return y[: kernels.m, 0], y[kernels.m :, 0]

    # -- modes ---------------------------------------------------------------------------------

    def begun(self, at: State) -> np.ndarray:
        """How the state and parameters with which events begin, at the start of a run, change with those that are given, (N, N)."""
        change, names = np.eye(2 * self.n + len(at.p)), self.kernels.parameters
        values = self._along(self.tangents.values(at), np.zeros(len(change)), change)
        for name, value in self.kernels.model.beginnings.items():
            change[2 * self.n + names.index(name)] = 0.0 if is_number(value) else self._element(name, values)
        return change

    def _mode(self, o: Occurrence, time: np.ndarray, change: np.ndarray) -> np.ndarray:
        """Directions of slip are given, and what begins to stick sticks where it is."""
        after, first, names = change.copy(), 2 * self.n, self.kernels.parameters
        values = self._along(self.tangents.values(o.after), time, change)
        for k, friction in self.functions.frictions.items():
            after[first + names.index(friction.slip)] = 0.0
            if k in o.held and k not in o.held_before:
                after[first + names.index(friction.held)] = self._element(f"{friction.name}, place", values)
        return after

    def _onto(self, o: Occurrence, change: np.ndarray) -> np.ndarray:
        """What the constraints of the mode allow of a change: that of a gap that comes to rest by bounces vanishes."""
        kernels, n, at = self.mode(o.held), self.n, o.after
        dq, dqd, dp = np.split(change, [n, 2 * n])
        none, still = np.zeros((0, n)), np.zeros_like(dq)
        given = {"t": at.t, "q": at.q, "qd": at.qd, "qdd": np.zeros(n), "lam": np.zeros(kernels.m), "p": at.p}
        dq = (
            dq
            + solved(kernels, at, none, still, -(kernels.jacobian(at.q, at.t, at.p) @ dq + kernels.dense_tangent("phi_p", **given) @ dp))[0]
        )
        rate = 0.5 * kernels.dense_tangent("phidd_qd", **given) @ dq + kernels.dense_tangent("phid_p", **given) @ dp
        dqd = dqd + solved(kernels, at, none, still, -(kernels.jacobian(at.q, at.t, at.p) @ dqd + rate))[0]
        return np.vstack([dq, dqd, dp])


def solved(kernels: Kernels, at: State, rows: np.ndarray, force: np.ndarray, right: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """x (n, c) and y (m + k, c) of M x + Aᵀ y = force, A x = right, where A has the constraints and rows (k, n); redundant ones do no
    harm."""
    columns = kernels.column_sizes[:, None]
    norms = np.max(np.abs(rows) * columns.T, axis=1, initial=0.0)
    sizes = np.concatenate([kernels.row_sizes, norms])[:, None]
    mass, unit = scaled_mass(kernels, at.q, at.t, at.p)
    scaled = np.vstack([scaled_jacobian(kernels, at.q, at.t, at.p), rows * columns.T / norms[:, None]])
    x, y = KKT(mass, scaled, kernels).solve(columns * force / unit, right / sizes)
    return columns * x, unit * y / sizes
