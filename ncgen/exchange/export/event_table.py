"""The events of an exported mechanism: programs of their conditions, and what they do as rows of a table (`ncgen_events.h`)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ncgen.errors import ModelError
from ncgen.exchange.export.held_mechanism import LOADS, HeldMechanism, Holdable, held_mechanism, holdables
from ncgen.mechanism.conditions_in_c import basis
from ncgen.mechanism.kernels import Kernels
from ncgen.model import Model
from ncgen.model.actions import Change, Impact, Locking, Stop
from ncgen.model.elements import coordinate_of
from ncgen.model.events import Event
from ncgen.model.values import Scalar, as_sympy
from ncgen.program.ir.blocks import Program
from ncgen.program.motions.event_programs import assemble_conditions
from ncgen.solver.events.conditions import VALUE_ROUNDING, most_degree
from ncgen.solver.name_lists import listed_names
from ncgen.solver.runs.stop import DIRECTIONS
from ncgen.symbolic.numbering import Terms

LAWS = {"": "NCGEN_NO_LAW", "simultaneous": "NCGEN_SIMULTANEOUS", "in turn": "NCGEN_IN_TURN"}
"""Laws of several impacts, in C."""

START = -1
"""The event of what is done where a motion begins."""


@dataclass(frozen=True)
class ActionRow:
    """One action, with the members of `ncgen_action`."""

    event: int
    kind: str
    place: int = 0
    value: int = 0


@dataclass(frozen=True)
class HoldRow:
    """What may be held, with the members of `ncgen_hold`."""

    kind: str
    condition: int
    on: int
    held: int = -1
    value: int = -1
    slip: int = -1
    load: int = 0


@dataclass(frozen=True, eq=False)
class EventTable:
    """kernels: of the mechanism; equations: those that programs are assembled from"""

    kernels: Kernels
    equations: Terms

    @cached_property
    def events(self) -> tuple[Event, ...]:
        return tuple(self.kernels.model.events.values())

    @cached_property
    def holdables(self) -> tuple[Holdable, ...]:
        """What may be held."""
        return holdables(self.kernels.model)

    @cached_property
    def names(self) -> list[str]:
        """Of all conditions: events, joints with friction, ratchets."""
        model = self.kernels.model
        return [*model.events, *model.frictions, *model.ratchets]

    @cached_property
    def conditions(self) -> list[tuple[str, Scalar]]:
        """(words, expression) of all conditions."""
        model = self.kernels.model
        rates = [(f"friction {each.name}", each.along.rate) for each in model.frictions.values()]
        teeth = [(f"ratchet {each.name}", each.along.rate) for each in model.ratchets.values()]
        return [*((f"event {event.name}", event.when) for event in self.events), *rates, *teeth]

    @cached_property
    def held(self) -> HeldMechanism | None:
        """The mechanism in which things are held; None where nothing may be."""
        return held_mechanism(self.kernels.model, self.conditions)

    @cached_property
    def _filled(self) -> tuple[list[ActionRow], list[tuple[str, Scalar]]]:
        """The rows in the order of the events, and what their values are, each with the words that messages call it by."""
        rows: list[ActionRow] = []
        values: list[tuple[str, Scalar]] = []
        model, holds = self.kernels.model, [each.name for each in self.holdables]

        def value(where: str, expression: Scalar) -> int:
            values.append((where, expression))
            return len(values) - 1

        for name, beginning in model.beginnings.items():
            rows.append(ActionRow(START, "NCGEN_SET", self.kernels.parameters.index(name), value(name, as_sympy(beginning))))
        rows += [ActionRow(START, "NCGEN_LOCK", holds.index(lock.name)) for lock in model.locks.values() if lock.closed]
        for k, event in enumerate(self.events):
            where = f"event {event.name}"
            changes = {name: value for action in event.do if isinstance(action, Change) for name, value in action.values.items()}
            velocities = {name for name in changes if name not in self.kernels.parameters}
            impacts = [action for action in event.do if isinstance(action, Impact)]
            rows += [ActionRow(k, "NCGEN_IMPACT", int(a.rest == "end"), value(where, a.restitution)) for a in impacts]  # type: ignore[arg-type]
            locking = [action for action in event.do if isinstance(action, Locking)]
            rows += [ActionRow(k, "NCGEN_LOCK" if a.closes else "NCGEN_FREE", holds.index(a.lock)) for a in locking]
            for name in sorted(changes, key=lambda name: name in velocities):
                place = self.kernels.index[coordinate_of(name)] if name in velocities else self.kernels.parameters.index(name)
                kind = "NCGEN_SET_VELOCITY" if name in velocities else "NCGEN_SET"
                rows.append(ActionRow(k, kind, place, value(f"{where}, {name}", changes[name])))
            rows += [ActionRow(k, "NCGEN_STOP") for action in event.do if isinstance(action, Stop)]
        return rows, values

    @cached_property
    def hold_rows(self) -> list[HoldRow]:
        """What may be held."""
        parameters, rows, load = self.kernels.parameters, list[HoldRow](), 0
        first = len(self._filled[1])  # behind the numbers that actions set: where things are
        for each in self.holdables:
            places = [parameters.index(name) if name else -1 for name in (each.switch, each.held, each.slip)]
            rows.append(HoldRow(each.kind, each.condition, places[0], places[1], first if each.held else -1, places[2], load))
            first += bool(each.held)
            load += LOADS[each.kind]
        return rows

    @cached_property
    def loads(self) -> list[str]:
        """What conditions of loads are of; a joint has two, for each side."""
        sides = {2: (" down", " up"), 1: ("",), 0: ()}
        return [f"{each.name}{side}" for each in self.holdables for side in sides[LOADS[each.kind]]]

    @cached_property
    def own(self) -> tuple[str, ...]:
        """Names of the parameters and inputs that say what is held, and how joints slip: the motion keeps them."""
        return tuple(name for each in self.holdables for name in (each.switch, each.held, each.slip) if name)

    @cached_property
    def changed(self) -> frozenset[str]:
        """Names of the parameters and inputs that events change."""
        return frozenset((*self.own, *(self.kernels.parameters[row.place] for row in self._filled[0] if row.kind == "NCGEN_SET")))

    @cached_property
    def programs(self) -> list[Program]:
        """Of conditions, their slopes and rates, and of what actions set."""
        places = [(f"{each.name}, place", each.position) for each in self.holdables if each.held]
        own = assemble_conditions(self.equations, self.conditions, [*self._filled[1], *places], [], []).values()
        return [*own, *([self.held.conditions] if self.held else [])]

    @cached_property
    def described(self) -> dict[str, object]:
        """What templates are filled with."""
        rows, values = self._filled
        degree = most_degree(self.kernels)
        nodes, inverse = basis(degree)
        set_velocities = [row.event for row in rows if row.kind == "NCGEN_SET_VELOCITY"]
        count, holds = len(self.conditions), self.hold_rows
        return {
            "names": self.names,
            "count": count,
            "events": len(self.events),
            "holds": holds,
            "own": [self.kernels.parameters.index(name) for name in self.own],
            "loads": len(self.loads),
            "most": max(count, *(set_velocities.count(k) for k in range(count))),
            "law": LAWS[self._law],
            "directions": [*(int(DIRECTIONS[event.direction]) for event in self.events), *[-1] * (count - len(self.events))],
            "rows": rows,
            "values": len(values) + sum(row.held >= 0 for row in holds),
            "degree": degree,
            "nodes": nodes.tolist(),
            "inverse": np.ravel(inverse).tolist(),
            "noise": VALUE_ROUNDING[degree],
            "ends": any(event.is_last for event in self.events),
        }

    @property
    def _law(self) -> str:
        """Of several impacts at one instant. Raises ModelError where events name different ones."""
        named = {event.name: event.impact.order for event in self.events if event.impact and event.impact.order}
        if len(laws := set(named.values())) > 1:
            raise ModelError(
                f"{self.kernels.name}: impacts of {listed_names(list(named))} have different orders; an export needs the same one for all"
            )
        return laws.pop() if laws else ""


def refusal_of_events(model: Model) -> str | None:
    """Why the events of a model cannot be exported, in words, or None."""
    if loaded := [name for name, friction in model.frictions.items() if friction.load is not None]:
        return f"friction of loads is not exported yet ({listed_names(loaded)}); give coulomb, or use ncgen.simulate"
    if model.contacts:
        return f"friction of contacts is not exported yet ({listed_names(list(model.contacts))}); leave it out, or use ncgen.simulate"
    if called := [event.name for event in model.events.values() if event.is_called]:
        return f"event {called[0]} calls a Python function; write what it does as expressions"
    known = (Change, Impact, Locking, Stop)
    if unknown := [event.name for event in model.events.values() if not all(isinstance(action, known) for action in event.do)]:
        return f"what event {unknown[0]} does is not exported yet; use ncgen.simulate"
    return None
