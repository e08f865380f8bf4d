"""What happens at one instant: the actions of all events that are due, and of those that these bring about, to a fixed point."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np
import scipy.sparse

from ncgen.errors import ConvergenceError, ModelError, shown
from ncgen.mechanism.kernels import Kernels
from ncgen.model.actions import Call, Stop
from ncgen.model.elements import coordinate_of
from ncgen.solver.events.conditions import EventFunctions
from ncgen.solver.events.impacts import Gaps
from ncgen.solver.events.state import State
from ncgen.solver.formalisms.projection import least_energy
from ncgen.solver.parameter_checks import refused_parameters
from ncgen.solver.trajectories.happening import Happening, Search

MOST_ROUNDS = 1000
"""Rounds of events that bring about others at one instant."""

CLOSED = 1e-10
"""A gap is closed where it is smaller than this share of its scale."""


@dataclass(eq=False)
class Instant:
    """What happens at one instant. at: the state so far; happened: in order; stops: True where the run ends here"""

    functions: EventFunctions
    at: State
    happened: list[Happening] = field(default_factory=list)
    stops: bool = False

    @property
    def kernels(self) -> Kernels:
        return self.functions.kernels

    def happen(self, due: Mapping[int, Search]) -> None:
        """Carry out the events of these positions, each with how it was found, and those that follow at the same instant.

        Raises ConvergenceError naming events that bring about each other without end, ModelError for what an action cannot do.
        """
        events, done = self.functions.events, 0
        while due:
            if (done := done + 1) > MOST_ROUNDS:
                names = ", ".join(events[k].name for k in due)
                raise ConvergenceError(
                    f"{self.kernels.name}: events {names} bring about each other without end at t = {self.at.t:.6g} s; "
                    "change their conditions"
                )
            before, _ = self.functions.values(self.at)
            self._impacts([k for k in due if events[k].impact], due)
            for k in due:
                if not events[k].impact:
                    self._act(k, due[k])
            due = self.turned(before, due)

    def turned(self, before: np.ndarray, done: Iterable[int]) -> dict[int, Search]:
        """Events, but for those done, whose conditions the last changes carried to the other side; before (C,): their values then."""
        after, _ = self.functions.values(self.at)
        small, ways = CLOSED * self.functions.scales(self.at), self.functions.directions
        turned = (before * after < 0) & (np.abs(before) > small) & (np.abs(after) > small) & (np.sign(after) * ways >= 0)
        return {k: "action" for k in np.flatnonzero(turned).tolist() if k not in done}

    def _act(self, k: int, search: Search) -> None:
        event, start = self.functions.events[k], self.at
        for action in event.do:
            if isinstance(action, Stop):
                self.stops = True
            elif isinstance(action, Call):
                told = action.function(self.at, self.kernels)
                if told is not None and not isinstance(told, Mapping):
                    raise ModelError(f"event {event.name}: its function returned {shown(told)}; return {{name: value}} or None")
                self._set(told or {}, event.name)
        self._set(self.functions.numbers(self.at).get(k, {}), event.name)
        self._note(k, search, start)

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
        if held:
            self.at = replace(self.at, qd=_with_rates(kernels, self.at, held))

    def _impacts(self, due: list[int], searches: Mapping[int, Search]) -> None:
        """The impacts of the events that are due, with the gaps that are closed already taking part where several can."""
        if not due:
            return
        kernels, functions, start = self.kernels, self.functions, self.at
        all_impacts = [k for k, event in enumerate(functions.events) if event.impact]
        values, scales = functions.values(start)[0], functions.scales(start)
        taking = [k for k in all_impacts if k in due or abs(values[k]) <= CLOSED * scales[k]]
        gradients, drift = functions.slopes(start)
        gaps = Gaps(
            kernels, start, gradients[taking], drift[taking], np.array([functions.restitution(k, start) for k in taking]),
            tuple(functions.events[k].name for k in taking),
        )  # fmt: skip
        closing = gaps.closing(start.qd)
        if not np.any(closing):
            return
        order = self._order([k for k, closes in zip(taking, closing, strict=True) if closes], taking, gaps)
        where = f"{kernels.name} at t = {start.t:.6g} s"
        hit = gaps.in_turn(start.qd, where) if order == "in turn" else gaps.all_at_once(start.qd)
        self.at = replace(start, qd=hit.qd)
        for number, k in enumerate(taking):
            if hit.impulses[number] > 0:
                search = searches.get(k, "action")
                self.happened.append(
                    Happening(
                        start.t, functions.events[k].name, search, start.q, start.qd, hit.qd, float(hit.impulses[number]),
                        float(hit.lost[number]),
                    )
                )  # fmt: skip
        for k in due:  # what else they do
            if len(functions.events[k].do) > 1:
                self._act(k, searches[k])

    def _order(self, closing: list[int], taking: list[int], gaps: Gaps) -> str:
        """The law of several impacts. Raises ModelError where it is not said and matters."""
        events = self.functions.events
        orders = {events[k].impact.order for k in taking if events[k].impact} - {""}  # type: ignore[union-attr]
        if len(orders) > 1:
            raise ModelError(
                f"{self.kernels.name}: impacts of {', '.join(gaps.names)} at one instant, t = {self.at.t:.6g} s, have different orders; "
                "give all the same one"
            )
        coupled = np.abs(gaps.G - np.diag(np.diag(gaps.G))) > 1e-12 * np.sqrt(np.outer(np.diag(gaps.G), np.diag(gaps.G)))
        if not orders and np.any(coupled):
            raise ModelError(
                f"{self.kernels.name}: several impacts at one instant, of {', '.join(gaps.names)} at t = {self.at.t:.6g} s, "
                'where laws differ; say which holds, ncgen.impact(…, order="simultaneous") or order="in turn"'
            )
        return next(iter(orders), "simultaneous")

    def _note(self, k: int, search: Search, start: State) -> None:
        lost = float(np.sum(self._energy(start) - self._energy(self.at)))
        self.happened.append(Happening(start.t, self.functions.events[k].name, search, start.q, start.qd, self.at.qd, 0.0, lost))

    def _energy(self, at: State) -> np.ndarray:
        """Kinetic and potential energy (J)."""
        return self.kernels.energy(at.q, at.qd, at.t, at.p)[:2]


def _with_rates(kernels: Kernels, at: State, held: Mapping[int, float]) -> np.ndarray:
    """Velocities (n,) that the constraints allow, some of them given, nearest to those there in the sense of kinetic energy.

    Raises ModelError naming a velocity that the constraints do not allow.
    """
    sizes, where = kernels.column_sizes, np.array(list(held))
    rows = scipy.sparse.csr_array((np.ones(len(where)), (np.arange(len(where)), where)), (len(where), kernels.n))
    wanted = np.array(list(held.values()))
    rest = (kernels.nu(at.q, at.t, at.p) - kernels.phi_q(at.q, at.t, at.p) @ at.qd) / kernels.row_sizes
    right = np.concatenate([rest, (wanted - at.qd[where]) / sizes[where]])
    qd = at.qd + sizes * least_energy(kernels, at.q, at.t, at.p, rows).solve(np.zeros(kernels.n), right)[0]
    off = np.abs(qd[where] - wanted) / sizes[where]
    if np.max(off) > 1e-9 * np.max(np.abs(qd / sizes), initial=np.max(np.abs(wanted / sizes[where]))):
        name = kernels.coordinates[where[int(np.argmax(off))]]
        raise ModelError(f"rate({name}) cannot become {held[kernels.index[name]]:.6g} at t = {at.t:.6g} s: the constraints do not allow it")
    return qd
