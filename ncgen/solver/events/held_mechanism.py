"""What an exported mechanism holds: gaps that are closed, joints and contacts that stick, ratchets and locks, in one more mechanism.

Modes cannot be compiled on demand there. So everything that may be held is a constraint of one mechanism, times a parameter, its switch,
that is 1 while it is held. The row of what is not held is zero, and with it its multiplier.
"""

from __future__ import annotations

import copy
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ncgen.emit.sources import Sources
from ncgen.mechanism.kernels import Kernels
from ncgen.model import Model
from ncgen.model.contacts import Contact
from ncgen.model.displacements import Displacement
from ncgen.model.values import Scalar, as_sympy, evaluate, symbol_of
from ncgen.program.ir.blocks import Program
from ncgen.program.motions.event_programs import HeldLoad, assemble_mode_conditions
from ncgen.program.motions.sliding import Sliding, assemble_friction
from ncgen.solver.events import on_demand
from ncgen.solver.events.modes import sliding_of
from ncgen.solver.events.rubbing import SHARED
from ncgen.solver.loads.constraint_loads import motion_sizes, refusal_of_multipliers
from ncgen.solver.positions.rank import null_space, scaled_jacobian
from ncgen.solver.trajectories.output_values import uses_loads

GAP, JOINT, RATCHET, LOCK = "NCGEN_HOLDS_GAP", "NCGEN_HOLDS_JOINT", "NCGEN_HOLDS_RATCHET", "NCGEN_HOLDS_LOCK"
RUBBING_GAP, CONTACT = "NCGEN_HOLDS_RUBBING_GAP", "NCGEN_HOLDS_CONTACT"
"""Kinds of what is held, in C."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Holdable:
    """What may be held. condition: number of its condition, −1 of a lock; rows: expressions that stay zero; switch: its parameter

    held: name of the parameter that says where it is held, "" of gaps and contacts; position, initial: where it is, now and in the initial
    position; slip: name of the input that says in which direction it slips, "" of all but joints; static: friction that holds it, times the
    load of the constraints `pressed` where there are some; contact: whose gap it is, or that sticks
    """

    kind: str
    name: str
    condition: int
    rows: tuple[Scalar, ...]
    switch: str
    held: str = ""
    position: Scalar = 0.0
    initial: Scalar = 0.0
    slip: str = ""
    static: Scalar | None = None
    pressed: tuple[int, ...] = ()
    contact: Contact | None = None

    @property
    def sticks(self) -> bool:
        """Whether it is a contact that sticks, whose rows are velocities."""
        return self.kind == CONTACT

    @property
    def loads(self) -> tuple[str, ...]:
        """What the conditions of its load are called; of a contact that sticks its force stands behind them."""
        if self.contact and self.sticks:
            marks = [""] if len(self.rows) == 1 else [f" {k}" for k in range(1, len(self.rows) + 1)]
            return (self.name, *(f"{self.name} force{mark}" for mark in marks))
        return () if self.kind == LOCK else (f"{self.name} down", f"{self.name} up") if self.kind == JOINT else (self.name,)

    @property
    def own(self) -> tuple[str, ...]:
        """Names of the parameters and inputs that say whether and where it is held, and how it slips."""
        slip = self.contact.slip if self.contact and self.sticks else (self.slip,)
        return tuple(name for name in (self.switch, self.held, *slip) if name)


@dataclass(frozen=True, eq=False)
class HeldMechanism:
    """sources, kernels: of the mechanism with all that may be held as constraints; programs: its conditions with those of loads, and the
    friction that follows loads, where there is some"""

    sources: Sources
    kernels: Kernels
    programs: tuple[Program, ...]


def holdables(model: Model) -> tuple[Holdable, ...]:
    """What a mechanism with switches may hold, gaps first; conditions are numbered in the order events, frictions, contacts, ratchets."""
    return tuple(each for each in _holdables(model) if each.switch in model.parameters)


def _holdables(model: Model) -> Iterator[Holdable]:
    first = len(model.events)
    for k, event in enumerate(model.events.values()):
        if event.impact and event.impact.rest == "hold":
            contact = model.contacts.get(event.name)
            kind = RUBBING_GAP if contact else GAP
            yield Holdable(kind=kind, name=event.name, condition=k, rows=(event.when,), switch=f"{event.name}.on", contact=contact)
    for k, friction in enumerate(model.frictions.values(), first):
        joint = _where_it_is(JOINT, friction.name, k, friction.along, friction.held, friction.slip, friction.static)
        yield replace(joint, pressed=friction.pressed)
    for k, contact in enumerate(model.contacts.values(), first := first + len(model.frictions)):
        event = model.events[contact.name]
        if event.impact and event.impact.rest == "hold":
            name = friction_of(contact)
            yield Holdable(kind=CONTACT, name=name, condition=k, rows=contact.sliding, switch=f"{contact.name}.sticks", contact=contact)
    for k, ratchet in enumerate(model.ratchets.values(), first + len(model.contacts)):
        yield _where_it_is(RATCHET, ratchet.name, k, ratchet.along, ratchet.held)
    for lock in model.locks.values():
        yield _where_it_is(LOCK, lock.name, -1, lock.along, lock.held)


def friction_of(contact: Contact) -> str:
    """What the friction of a contact is called where its gap has a name of its own."""
    return f"{contact.name}.friction"


def _where_it_is(
    kind: str, name: str, condition: int, along: Displacement, held: str, slip: str = "", static: Scalar | None = None
) -> Holdable:
    return Holdable(
        kind=kind, name=name, condition=condition, rows=(along.position - symbol_of(held),), switch=f"{name}.on", held=held,
        position=along.position, initial=along.initial, slip=slip, static=static,
    )  # fmt: skip


def with_switches(model: Model) -> Model:
    """A model with the switches of what it may hold, all off; the model itself where it holds nothing."""
    some = list(_holdables(model))
    if not some:
        return model
    other = copy.deepcopy(model)
    for each in some:
        other.parameter(each.switch, 0.0)
    return other


def refusal_of_loads(kernels: Kernels) -> str:
    """Why nothing can be held in a mechanism, in words, or nothing."""
    if not holdables(kernels.model):
        return ""
    if uses_loads(kernels.model):
        return "its outputs are loads of joints, which are not known by themselves then"
    return refusal_of_multipliers(kernels)


def refusal_of_frictions(model: Model) -> str:
    """Why frictions of a model are not in one mechanism with each other, in words, or nothing."""
    held = [each for each in model.contacts.values() if (impact := model.events[each.name].impact) and impact.rest == "hold"]
    for contact in model.contacts.values():
        if friction_of(contact) in [*model.events, *model.frictions, *model.ratchets]:
            return f"friction of contact {contact.name} and another element are both called {friction_of(contact)}; give that another name"
    across = next((each.name for each in model.frictions.values() if each.across is not None), "")
    if held and across:
        return f"friction {across} with across must be the only friction of loads, and contact {held[0].name} has some; leave across out"
    return ""


def held_mechanism(model: Model, conditions: Sequence[tuple[str, Scalar]]) -> HeldMechanism | None:
    """The mechanism in which things are held, of a model with switches; None where nothing is.

    conditions: (words, expression) of those of the mechanism
    """
    some = holdables(model)
    if not some:
        return None
    other = on_demand.without_events(model)
    other.name, other.outputs = f"{model.name}_held", {}
    for each in some:  # sizes are those of the rows as they are held
        other.parameters[each.switch] = replace(other.parameters[each.switch], default=1.0)
        if each.held:
            other.parameters[each.held] = replace(other.parameters[each.held], default=evaluate(each.initial, other.numbers, each.name))
        hold = other.constrain_velocity if each.sticks else other.constrain
        for row in each.rows:
            hold(symbol_of(each.switch) * row, f"{each.name}, held")  # type: ignore[arg-type]
    sources = on_demand.generated(other)
    kernels = on_demand.compiled(sources, backend="numpy")
    loads, contacts = _loads(kernels, some)
    sliding = (*contacts, *sliding_of(kernels, (), model.frictions.values()))
    sizes, equations = motion_sizes(kernels), sources.programs.equations
    made = assemble_mode_conditions(equations, conditions, loads, sliding, sizes, kernels.row_sizes)["conditions"]
    friction = assemble_friction(equations, sizes, sliding).values() if sliding else ()
    return HeldMechanism(sources, kernels, (replace(made, name="held_conditions"), *friction))


def _loads(kernels: Kernels, some: Sequence[Holdable]) -> tuple[list[HeldLoad], list[Sliding]]:
    """What holds each constraint of a mechanism with these as its last ones, and the contacts that may slide in it."""
    row, gaps = kernels.m - sum(len(each.rows) for each in some), dict[str, int]()
    loads, sliding = list[HeldLoad](), list[Sliding]()
    for each in some:
        if each.contact and each.sticks:
            grip = gaps[each.contact.name], as_sympy(each.contact.friction)
            loads.append(HeldLoad(words=each.name, row=row, grip=grip, directions=len(each.rows), shows_force=True))
            velocity, slip = each.contact.sliding, each.contact.slip
            sliding.append(Sliding(name=each.contact.name, row=grip[0], friction=grip[1], velocity=velocity, slip=slip, may_rest=True))
        elif each.kind != LOCK:
            loads.append(HeldLoad(words=each.name, row=row, static=each.static, pressed=each.pressed))
        if each.contact and not each.sticks:
            gaps[each.contact.name] = row
        row += len(each.rows)
    return loads, sliding


def refusal_of_shared(kernels: Kernels, q: np.ndarray) -> str | None:
    """Why friction cannot follow the loads of a mechanism that begins at q (n,), in words, or None: redundant constraints share them."""
    cancelling = null_space(scaled_jacobian(kernels, q).T)
    for friction in kernels.model.frictions.values():
        for row in friction.pressed:
            if cancelling.size and np.max(np.abs(cancelling[row])) > SHARED:
                return f"the load of friction {friction.name} is shared with redundant constraints; leave these out"
    return None
