"""What an exported mechanism holds: gaps that are closed, joints that stick, ratchets and locks, in one more mechanism.

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
from ncgen.model.displacements import Displacement
from ncgen.model.values import Scalar, evaluate, symbol_of
from ncgen.program.ir.blocks import Program
from ncgen.program.motions.event_programs import HeldLoad, assemble_mode_conditions
from ncgen.program.motions.sliding import assemble_friction
from ncgen.solver.events import on_demand
from ncgen.solver.events.modes import sliding_of
from ncgen.solver.events.rubbing import SHARED
from ncgen.solver.loads.constraint_loads import motion_sizes, refusal_of_multipliers
from ncgen.solver.positions.rank import null_space, scaled_jacobian
from ncgen.solver.trajectories.output_values import uses_loads

GAP, JOINT, RATCHET, LOCK = "NCGEN_HOLDS_GAP", "NCGEN_HOLDS_JOINT", "NCGEN_HOLDS_RATCHET", "NCGEN_HOLDS_LOCK"
"""Kinds of what is held, in C."""

LOADS = {GAP: 1, JOINT: 2, RATCHET: 1, LOCK: 0}
"""How many conditions of its load each has."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Holdable:
    """What may be held. condition: number of its condition, −1 of a lock; row: the expression that stays zero; switch: its parameter

    held: name of the parameter that says where it is held, "" of a gap; position, initial: where it is, now and in the initial position
    slip: name of the input that says in which direction it slips, "" of all but joints; static: friction that holds it, times the load of
    the constraints `pressed` where there are some
    """

    kind: str
    name: str
    condition: int
    row: Scalar
    switch: str
    held: str = ""
    position: Scalar = 0.0
    initial: Scalar = 0.0
    slip: str = ""
    static: Scalar | None = None
    pressed: tuple[int, ...] = ()


@dataclass(frozen=True, eq=False)
class HeldMechanism:
    """sources, kernels: of the mechanism with all that may be held as constraints; programs: its conditions with those of loads, and the
    friction that follows loads, where there is some"""

    sources: Sources
    kernels: Kernels
    programs: tuple[Program, ...]


def holdables(model: Model) -> tuple[Holdable, ...]:
    """What a mechanism with switches may hold, gaps first; conditions are numbered in the order events, frictions, ratchets."""
    return tuple(each for each in _holdables(model) if each.switch in model.parameters)


def _holdables(model: Model) -> Iterator[Holdable]:
    first = len(model.events)
    for k, event in enumerate(model.events.values()):
        if event.impact and event.impact.rest == "hold":
            yield Holdable(kind=GAP, name=event.name, condition=k, row=event.when, switch=f"{event.name}.on")
    for k, friction in enumerate(model.frictions.values(), first):
        joint = _where_it_is(JOINT, friction.name, k, friction.along, friction.held, friction.slip, friction.static)
        yield replace(joint, pressed=friction.pressed)
    for k, ratchet in enumerate(model.ratchets.values(), first + len(model.frictions)):
        yield _where_it_is(RATCHET, ratchet.name, k, ratchet.along, ratchet.held)
    for lock in model.locks.values():
        yield _where_it_is(LOCK, lock.name, -1, lock.along, lock.held)


def _where_it_is(
    kind: str, name: str, condition: int, along: Displacement, held: str, slip: str = "", static: Scalar | None = None
) -> Holdable:
    return Holdable(
        kind=kind, name=name, condition=condition, row=along.position - symbol_of(held), switch=f"{name}.on", held=held,
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
        other.constrain(symbol_of(each.switch) * each.row, f"{each.name}, held")  # type: ignore[arg-type]
    sources = on_demand.generated(other)
    kernels = on_demand.compiled(sources, backend="numpy")
    loads = [
        HeldLoad(words=each.name, row=kernels.m - len(some) + i, static=each.static, pressed=each.pressed)
        for i, each in enumerate(some)
        if each.kind != LOCK
    ]
    sliding, sizes, equations = sliding_of(kernels, (), model.frictions.values()), motion_sizes(kernels), sources.programs.equations
    made = assemble_mode_conditions(equations, conditions, loads, sliding, sizes, kernels.row_sizes)["conditions"]
    friction = assemble_friction(equations, sizes, sliding).values() if sliding else ()
    return HeldMechanism(sources, kernels, (replace(made, name="held_conditions"), *friction))


def refusal_of_shared(kernels: Kernels, q: np.ndarray) -> str | None:
    """Why friction cannot follow the loads of a mechanism that begins at q (n,), in words, or None: redundant constraints share them."""
    cancelling = null_space(scaled_jacobian(kernels, q).T)
    for friction in kernels.model.frictions.values():
        for row in friction.pressed:
            if cancelling.size and np.max(np.abs(cancelling[row])) > SHARED:
                return f"the load of friction {friction.name} is shared with redundant constraints; leave these out"
    return None
