"""What an exported mechanism holds: gaps that are closed, joints and contacts that stick, ratchets and locks, in one more mechanism.

Modes cannot be compiled on demand there. So everything that may be held is a constraint of one mechanism, times a parameter, its switch,
that is 1 while it is held. The row of what is not held is zero, and with it its multiplier.
"""

from __future__ import annotations

import copy
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ncgen.emit.sources import Sources
from ncgen.mechanism.kernels import Kernels
from ncgen.model import Model
from ncgen.model.values import Scalar, evaluate, symbol_of
from ncgen.program.ir.blocks import Program
from ncgen.program.motions.event_programs import assemble_mode_conditions
from ncgen.program.motions.sliding import assemble_friction
from ncgen.solver.events import on_demand
from ncgen.solver.events.holdables import Holdable, friction_of, holdables
from ncgen.solver.events.modes import held_loads, sliding_of
from ncgen.solver.events.rubbing import SHARED
from ncgen.solver.loads.constraint_loads import motion_sizes, refusal_of_multipliers
from ncgen.solver.positions.rank import null_space, scaled_jacobian
from ncgen.solver.trajectories.output_values import uses_loads


@dataclass(frozen=True, eq=False)
class HeldMechanism:
    """sources, kernels: of the mechanism with all that may be held as constraints; programs: its conditions with those of loads, and the
    friction that follows loads, where there is some"""

    sources: Sources
    kernels: Kernels
    programs: tuple[Program, ...]


def switched(model: Model) -> tuple[Holdable, ...]:
    """What a mechanism with switches may hold."""
    return tuple(each for each in holdables(model) if each.switch in model.parameters)


def with_switches(model: Model) -> Model:
    """A model with the switches of what it may hold, all off; the model itself where it holds nothing."""
    some = list(holdables(model))
    if not some:
        return model
    other = copy.deepcopy(model)
    for each in some:
        other.parameter(each.switch, 0.0)
    return other


def refusal_of_loads(kernels: Kernels) -> str:
    """Why nothing can be held in a mechanism, in words, or nothing."""
    if not switched(kernels.model):
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
    some = switched(model)
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
            hold(symbol_of(each.switch) * row, f"{each.words}, held")  # type: ignore[arg-type]
    sources = on_demand.generated(other)
    kernels = on_demand.compiled(sources, backend="numpy")
    loads = held_loads(kernels, some, shows_force=True)
    sliding = sliding_of(kernels, some, model.frictions.values(), by_switches=True)
    sizes, equations = motion_sizes(kernels), sources.programs.equations
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
