"""The events of an exported mechanism: programs of their conditions, and what they do as rows of a table (`ncgen_events.h`)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ncgen.mechanism.conditions_in_c import basis, formula_arrays
from ncgen.mechanism.kernels import Kernels
from ncgen.model.actions import Locking
from ncgen.model.contacts import Contact
from ncgen.model.events import Event
from ncgen.model.values import Scalar, as_sympy
from ncgen.program.ir.blocks import Program
from ncgen.program.motions.condition_formulas import FormulaTable, assemble_formulas
from ncgen.program.motions.event_programs import assemble_conditions
from ncgen.solver.events.action_rows import ActionRow, Actions
from ncgen.solver.events.conditions import conditions_of, degree_within_step, directions_of, mentions_inputs
from ncgen.solver.events.held_mechanism import HeldMechanism, held_mechanism, switched
from ncgen.solver.events.holdables import Holdable, friction_of
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


@dataclass(frozen=True, kw_only=True)
class RubbingRow:
    """A contact with friction, with the members of `ncgen_rubbing`."""

    event: int
    condition: int
    turn: int
    directions: int
    first: int
    slip: tuple[int, int]
    value: int
    poisson: int
    gap: int
    stick: int

    @property
    def members(self) -> tuple[int, ...]:
        """In their order."""
        numbers = (self.event, self.condition, self.turn, self.directions, self.first)
        return (*numbers, *self.slip, self.value, self.poisson, self.gap, self.stick)


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
        return switched(self.kernels.model)

    @cached_property
    def names(self) -> list[str]:
        """Of all conditions but the last ones, which are not named: events, joints with friction, friction of contacts, ratchets."""
        model = self.kernels.model
        return [*model.events, *model.frictions, *map(friction_of, model.contacts.values()), *model.ratchets]

    @property
    def condition_names(self) -> list[str]:
        """Of all conditions."""
        return [*self.names, *(f"{each.name}.turn" for each in self.turning)]

    @cached_property
    def contacts(self) -> tuple[Contact, ...]:
        """Contacts with friction."""
        return tuple(self.kernels.model.contacts.values())

    @cached_property
    def turning(self) -> list[Contact]:
        """Those whose direction of sliding may turn: the last conditions watch these."""
        return [each for each in self.contacts if len(each.sliding) > 1]

    @cached_property
    def conditions(self) -> list[tuple[str, Scalar]]:
        """(words, expression) of all conditions."""
        return conditions_of(self.kernels.model)

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
        model, holds, first = self.kernels.model, [each.words for each in self.holdables], len(self._filled.values)
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
        return [*self._filled.values, *beginnings, *positions, *self._of_contacts]

    @property
    def _of_contacts(self) -> list[tuple[str, Scalar]]:
        """(words, value) of friction and tangential restitution of contacts, one after the other."""
        pairs = [(each, word) for each in self.contacts for word in ("friction", "tangential")]
        return [(f"contact {each.name}, {word}", as_sympy(getattr(each, word))) for each, word in pairs]

    @property
    def sliding(self) -> list[tuple[str, Scalar]]:
        """(words, expression) of the velocities at which contacts slide."""
        return [(f"contact {each.name}", velocity) for each in self.contacts for velocity in each.sliding]

    @cached_property
    def rubbing_rows(self) -> list[RubbingRow]:
        """Contacts with friction."""
        parameters, rows, first = self.kernels.parameters, list[RubbingRow](), 0
        holds = {(each.contact.name, each.sticks): k for k, each in enumerate(self.holdables) if each.contact}
        events, conditions = [event.name for event in self.events], len(self.events) + len(self.kernels.model.frictions)
        turns = {each.name: len(self.names) + k for k, each in enumerate(self.turning)}
        value = len(self.values) - 2 * len(self.contacts)
        for k, each in enumerate(self.contacts):
            slip = [parameters.index(name) for name in each.slip]
            rows.append(RubbingRow(
                event=events.index(each.name), condition=conditions + k, turn=turns.get(each.name, -1),
                directions=len(slip), first=first, slip=(slip[0], slip[-1]), value=value + 2 * k, poisson=int(each.law == "poisson"),
                gap=holds.get((each.name, False), -1), stick=holds.get((each.name, True), -1),
            ))  # fmt: skip
            first += len(slip)
        return rows

    @cached_property
    def hold_rows(self) -> list[HoldRow]:
        """What may be held."""
        parameters, rows, load = self.kernels.parameters, list[HoldRow](), 0
        first = len(self._filled.values) + len(self.kernels.model.beginnings)
        for each in self.holdables:
            indices = [parameters.index(name) if name else -1 for name in (each.switch, each.held, each.slip)]
            rows.append(HoldRow(
                kind=each.kind, condition=each.number, on=indices[0], held=indices[1], value=first if each.held else -1, slip=indices[2],
                load=load,
            ))  # fmt: skip
            first += bool(each.held)
            load += len(each.loads)
        return rows

    @cached_property
    def loads(self) -> list[str]:
        """What conditions of loads are of; a joint has two, for each side; all loads that friction follows have one together."""
        determined = ["friction of loads"] if self.rubs else []
        return [*(words for each in self.holdables for words in each.loads), *determined]

    @cached_property
    def own(self) -> tuple[str, ...]:
        """Names of the parameters and inputs that say what is held, and how joints slip: the motion keeps them."""
        return tuple(name for each in self.holdables for name in each.own)

    @cached_property
    def changed(self) -> frozenset[str]:
        """Names of the parameters and inputs that events change."""
        beginnings = (name for name in self.kernels.model.beginnings if name in self.kernels.parameters)
        return self._filled.changed(self.kernels).union(self.own, beginnings)

    @cached_property
    def programs(self) -> list[Program]:
        """Of conditions, their slopes and rates, and of what actions set."""
        conditions = assemble_conditions(self.equations, self.conditions, self.values, [], self.sliding).values()
        return [*conditions, *(self.held.programs if self.held else ())]

    @property
    def follows_loads(self) -> bool:
        """Whether friction of joints follows loads."""
        return any(friction.load is not None for friction in self.kernels.model.frictions.values())

    @property
    def rubs(self) -> bool:
        """Whether friction of joints or contacts does."""
        return self.follows_loads or any(each.sticks for each in self.holdables)

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
            "rubs": self.rubs,
            "rubbings": [row.members for row in self.rubbing_rows],
            "sliding": len(self.sliding),
            "most": max(count, actions.most),
            "law": actions.law,
            "directions": directions_of(self.kernels.model),
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
