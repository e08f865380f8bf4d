"""The events of an exported mechanism: programs of their conditions, and what they do as rows of a table (`ncgen_events.h`)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ncgen.errors import ModelError
from ncgen.mechanism.conditions_in_c import basis
from ncgen.mechanism.kernels import Kernels
from ncgen.model import Model
from ncgen.model.actions import Change, Impact, Stop
from ncgen.model.elements import coordinate_of
from ncgen.model.events import Event
from ncgen.model.values import Scalar
from ncgen.program.ir.blocks import Program
from ncgen.program.ir.evaluate import evaluate
from ncgen.program.motions.event_programs import assemble_conditions
from ncgen.solver.events.conditions import VALUE_ROUNDING, most_degree
from ncgen.solver.name_lists import listed_names
from ncgen.solver.runs.stop import DIRECTIONS
from ncgen.symbolic.numbering import Terms

LAWS = {"": "NCGEN_NO_LAW", "simultaneous": "NCGEN_SIMULTANEOUS", "in turn": "NCGEN_IN_TURN"}
"""Laws of several impacts, in C."""


@dataclass(frozen=True)
class ActionRow:
    """One action, with the members of `ncgen_action`."""

    event: int
    kind: str
    place: int = 0
    value: int = 0


@dataclass(frozen=True, eq=False)
class EventTable:
    """kernels: of the mechanism; equations: those that programs are assembled from"""

    kernels: Kernels
    equations: Terms

    @cached_property
    def events(self) -> tuple[Event, ...]:
        return tuple(self.kernels.model.events.values())

    @cached_property
    def _filled(self) -> tuple[list[ActionRow], list[tuple[str, Scalar]]]:
        """The rows in the order of the events, and what their values are, each with the words that messages call it by."""
        rows: list[ActionRow] = []
        values: list[tuple[str, Scalar]] = []

        def value(where: str, expression: Scalar) -> int:
            values.append((where, expression))
            return len(values) - 1

        for k, event in enumerate(self.events):
            where = f"event {event.name}"
            changes = {name: value for action in event.do if isinstance(action, Change) for name, value in action.values.items()}
            velocities = {name for name in changes if name not in self.kernels.parameters}
            impacts = [action for action in event.do if isinstance(action, Impact)]
            rows += [ActionRow(k, "NCGEN_IMPACT", int(a.rest == "end"), value(where, a.restitution)) for a in impacts]  # type: ignore[arg-type]
            for name in sorted(changes, key=lambda name: name in velocities):
                place = self.kernels.index[coordinate_of(name)] if name in velocities else self.kernels.parameters.index(name)
                kind = "NCGEN_SET_VELOCITY" if name in velocities else "NCGEN_SET"
                rows.append(ActionRow(k, kind, place, value(f"{where}, {name}", changes[name])))
            rows += [ActionRow(k, "NCGEN_STOP") for action in event.do if isinstance(action, Stop)]
        return rows, values

    @cached_property
    def changed(self) -> frozenset[str]:
        """Names of the parameters and inputs that events change."""
        return frozenset(self.kernels.parameters[row.place] for row in self._filled[0] if row.kind == "NCGEN_SET")

    @cached_property
    def programs(self) -> list[Program]:
        """Of conditions, their slopes and rates, and of what actions set."""
        conditions = [(f"event {event.name}", event.when) for event in self.events]
        return list(assemble_conditions(self.equations, conditions, self._filled[1], [], []).values())

    @cached_property
    def described(self) -> dict[str, object]:
        """What templates are filled with."""
        rows, values = self._filled
        degree = most_degree(self.kernels)
        nodes, inverse = basis(degree)
        set_velocities = [row.event for row in rows if row.kind == "NCGEN_SET_VELOCITY"]
        count = len(self.events)
        return {
            "names": [event.name for event in self.events],
            "count": count,
            "most": max(count, *(set_velocities.count(k) for k in range(count))),
            "law": LAWS[self._law],
            "directions": [int(DIRECTIONS[event.direction]) for event in self.events],
            "rows": rows,
            "values": len(values),
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
    if others := [*model.ratchets, *model.locks, *(name for name in model.beginnings if name in model.parameters)]:
        return f"locks and ratchets are not exported yet ({listed_names(others)}); use ncgen.simulate"
    if model.frictions:
        names = listed_names(list(model.frictions))
        return f"joints that stick are not exported yet ({names}); take a law that is smooth, or ncgen.simulate"
    if model.contacts:
        return f"friction of contacts is not exported yet ({listed_names(list(model.contacts))}); leave it out, or use ncgen.simulate"
    if called := [event.name for event in model.events.values() if event.is_called]:
        return f"event {called[0]} calls a Python function; write what it does as expressions"
    known = (Change, Impact, Stop)
    if unknown := [event.name for event in model.events.values() if not all(isinstance(action, known) for action in event.do)]:
        return f"what event {unknown[0]} does is not exported yet; use ncgen.simulate"
    return None


def refusal_of_pressed(kernels: Kernels, q: np.ndarray) -> str | None:
    """Why a motion that begins at q (n,) cannot be exported: exports begin with compliant gaps open. In words, or None."""
    model = kernels.model
    gaps = [(name, event.when) for name, event in model.events.items() if f"{name}.touches" in model.beginnings]
    if not gaps:
        return None
    program = assemble_conditions(kernels.programs.equations, [], [], gaps, [])["element_values"]
    values = evaluate(program, {"t": 0.0, "q": q, "qd": np.zeros_like(q), "p": kernels.p0})
    pressed = [f"{name} by {-value:.6g}" for (name, _), value in zip(gaps, values, strict=True) if value < 0]
    if not pressed:
        return None
    return f"exports begin with no compliant stop pressed, and the start presses {listed_names(pressed)}; change it, or use ncgen.simulate"
