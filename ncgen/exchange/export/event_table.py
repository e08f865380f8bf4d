"""The events of an exported mechanism: programs of their conditions, and what they do as rows of a table (`ncgen_events.h`)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ncgen.mechanism.conditions_in_c import basis
from ncgen.mechanism.kernels import Kernels
from ncgen.model import Model
from ncgen.model.actions import Change, Impact, Stop
from ncgen.model.events import Event
from ncgen.program.ir.blocks import Program
from ncgen.program.ir.evaluate import evaluate
from ncgen.program.motions.event_programs import assemble_conditions
from ncgen.solver.events.action_rows import Actions
from ncgen.solver.name_lists import listed_names
from ncgen.symbolic.numbering import Terms


@dataclass(frozen=True, eq=False)
class EventTable:
    """kernels: of the mechanism; equations: those that programs are assembled from"""

    kernels: Kernels
    equations: Terms

    @cached_property
    def events(self) -> tuple[Event, ...]:
        return tuple(self.kernels.model.events.values())

    @cached_property
    def _filled(self) -> Actions:
        return Actions.of(self.kernels)

    @cached_property
    def changed(self) -> frozenset[str]:
        """Names of the parameters and inputs that events change."""
        return self._filled.changed(self.kernels)

    @cached_property
    def programs(self) -> list[Program]:
        """Of conditions, their slopes and rates, and of what actions set."""
        conditions = [(f"event {event.name}", event.when) for event in self.events]
        return list(assemble_conditions(self.equations, conditions, self._filled.values, [], []).values())

    @cached_property
    def described(self) -> dict[str, object]:
        """What templates are filled with."""
        actions = self._filled
        nodes, inverse = basis(actions.degree)
        return {
            "names": [event.name for event in self.events],
            "count": len(self.events),
            "most": actions.most,
            "law": actions.law,
            "directions": actions.directions,
            "rows": actions.rows,
            "values": len(actions.values),
            "degree": actions.degree,
            "nodes": nodes.tolist(),
            "inverse": np.ravel(inverse).tolist(),
            "noise": actions.noise,
            "ends": any(event.is_last for event in self.events),
        }


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
