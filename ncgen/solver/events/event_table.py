"""The events of an exported mechanism: programs of their conditions, and what they do as rows of a table (`ncgen_events.h`)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ncgen.mechanism.conditions_in_c import basis, formula_arrays
from ncgen.mechanism.kernels import Kernels
from ncgen.model.actions import Locking
from ncgen.model.events import Event
from ncgen.model.values import Scalar, as_sympy
from ncgen.program.ir.blocks import Program
from ncgen.program.motions.condition_formulas import FormulaTable, assemble_formulas
from ncgen.program.motions.event_programs import assemble_conditions
from ncgen.solver.events.action_rows import ActionRow, Actions
from ncgen.solver.events.conditions import degree_within_step, mentions_inputs
from ncgen.solver.events.held_mechanism import LOADS, HeldMechanism, Holdable, held_mechanism, holdables
from ncgen.symbolic.numbering import Terms

START = -1
"""The event of what is done where a motion begins."""


@dataclass(frozen=True, kw_only=True)
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
    def _filled(self) -> Actions:
        return Actions.of(self.kernels)

    @cached_property
    def rows(self) -> list[ActionRow]:
        """What events do, and what is done where a motion begins."""
        model, holds, first = self.kernels.model, [each.name for each in self.holdables], len(self._filled.values)
        rows = [ActionRow(START, "NCGEN_SET", self.kernels.parameters.index(name), first + k) for k, name in enumerate(model.beginnings)]
        rows += [ActionRow(START, "NCGEN_LOCK", holds.index(lock.name)) for lock in model.locks.values() if lock.closed]
        locking = [(k, action) for k, event in enumerate(self.events) for action in event.do if isinstance(action, Locking)]
        rows += [ActionRow(k, "NCGEN_LOCK" if action.closes else "NCGEN_FREE", holds.index(action.lock)) for k, action in locking]
        return [*self._filled.rows, *rows]

    @cached_property
    def values(self) -> list[tuple[str, Scalar]]:
        """(words, value) of what actions set, of what holds where a motion begins, and of where things are."""
        beginnings = [(name, as_sympy(value)) for name, value in self.kernels.model.beginnings.items()]
        positions = [(f"{each.name}, place", each.position) for each in self.holdables if each.held]
        return [*self._filled.values, *beginnings, *positions]

    @cached_property
    def hold_rows(self) -> list[HoldRow]:
        """What may be held."""
        parameters, rows, load = self.kernels.parameters, list[HoldRow](), 0
        first = len(self._filled.values) + len(self.kernels.model.beginnings)
        for each in self.holdables:
            indices = [parameters.index(name) if name else -1 for name in (each.switch, each.held, each.slip)]
            rows.append(HoldRow(
                kind=each.kind, condition=each.condition, on=indices[0], held=indices[1], value=first if each.held else -1, slip=indices[2],
                load=load,
            ))  # fmt: skip
            first += bool(each.held)
            load += LOADS[each.kind]
        return rows

    @cached_property
    def loads(self) -> list[str]:
        """What conditions of loads are of; a joint has two, for each side; all loads that friction follows have one together."""
        sides = {2: (" down", " up"), 1: ("",), 0: ()}
        determined = ["friction of loads"] if self.follows_loads else []
        return [*(f"{each.name}{side}" for each in self.holdables for side in sides[LOADS[each.kind]]), *determined]

    @cached_property
    def own(self) -> tuple[str, ...]:
        """Names of the parameters and inputs that say what is held, and how joints slip: the motion keeps them."""
        return tuple(name for each in self.holdables for name in (each.switch, each.held, each.slip) if name)

    @cached_property
    def changed(self) -> frozenset[str]:
        """Names of the parameters and inputs that events change."""
        beginnings = (name for name in self.kernels.model.beginnings if name in self.kernels.parameters)
        return self._filled.changed(self.kernels).union(self.own, beginnings)

    @cached_property
    def programs(self) -> list[Program]:
        """Of conditions, their slopes and rates, and of what actions set."""
        conditions = assemble_conditions(self.equations, self.conditions, self.values, [], []).values()
        return [*conditions, *(self.held.programs if self.held else ())]

    @property
    def follows_loads(self) -> bool:
        """Whether friction of joints follows loads."""
        return any(friction.load is not None for friction in self.kernels.model.frictions.values())

    @cached_property
    def _polynomial(self) -> list[bool]:
        """Of every condition: True where it is a polynomial in time within a step."""
        return [degree_within_step(when, self.kernels) is not None for _, when in self.conditions]

    @cached_property
    def _table(self) -> FormulaTable | None:
        """Formulas that bound conditions which are no polynomials; None where there are none."""
        pairs = zip(self.conditions, self._polynomial, strict=True)
        bounded = [None if is_known or mentions_inputs(each[1], self.kernels) else each for each, is_known in pairs]
        table = assemble_formulas(self.equations, bounded) if any(bounded) else None
        return table if table and any(table.formulas) else None

    @property
    def _sampled(self) -> list[int]:
        """Of every condition: 1 where it is no polynomial and has no formula."""
        formulas = self._table.formulas if self._table else [()] * len(self.conditions)
        return [int(not is_known and not formula) for is_known, formula in zip(self._polynomial, formulas, strict=True)]

    @cached_property
    def _formulas(self) -> dict[str, object] | None:
        """Tables of these formulas, and sizes."""
        if not (table := self._table):
            return None
        integers, numbers, sizes = formula_arrays(table, len(self.conditions) + len(self.loads), self._filled.degree)
        return {"integers": integers, "numbers": numbers, "sizes": sizes, "inputs": len(table.inputs)}

    @cached_property
    def described(self) -> dict[str, object]:
        """What templates are filled with."""
        actions, count = self._filled, len(self.conditions)
        nodes, inverse = basis(actions.degree)
        return {
            "names": self.names,
            "count": count,
            "events": len(self.events),
            "holds": self.hold_rows,
            "own": [self.kernels.parameters.index(name) for name in self.own],
            "loads": len(self.loads),
            "follows_loads": self.follows_loads,
            "most": max(count, actions.most),
            "law": actions.law,
            "directions": [*actions.directions, *[-1] * (count - len(self.events))],
            "rows": self.rows,
            "values": len(self.values),
            "degree": actions.degree,
            "nodes": nodes.tolist(),
            "inverse": np.ravel(inverse).tolist(),
            "noise": actions.noise,
            "formulas": self._formulas,
            "sampled": self._sampled,
            "unknown": [int(not is_known) for is_known in self._polynomial],
            "ends": any(event.is_last for event in self.events),
        }
