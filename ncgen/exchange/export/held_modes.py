"""The modes of an exported mechanism: sets of gaps that are held closed, each a mechanism of its own (`ncgen_mode`)."""

from __future__ import annotations

import copy
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

from ncgen.compiler import compile, generate
from ncgen.emit.sources import Sources
from ncgen.mechanism.kernels import Kernels
from ncgen.model import Model
from ncgen.model.events import Event
from ncgen.program.ir.blocks import Program
from ncgen.program.motions.event_programs import HeldLoad, assemble_mode_conditions
from ncgen.solver.loads.constraint_loads import motion_sizes, refusal_of_multipliers
from ncgen.solver.trajectories.output_values import uses_loads

MAX_MODES = 15
"""Modes of one mechanism: all sets of four gaps; of more the small sets come first, and the motion ends where another one is needed."""


@dataclass(frozen=True, eq=False)
class HeldMode:
    """held: numbers of the events whose gaps are closed; sources, kernels: of the mechanism with them as constraints; conditions: those of
    the mechanism and of the loads"""

    held: tuple[int, ...]
    sources: Sources
    kernels: Kernels
    conditions: Program


def held_modes(kernels: Kernels, model: Model) -> tuple[HeldMode, ...]:
    """The modes of a mechanism; () where it holds no gap, or its loads are not compiled or looked at by outputs."""
    if refusal_of_multipliers(kernels) or uses_loads(model):
        return ()
    modes = []
    for number, held in enumerate(_sets(list(model.events.values())), 1):
        if number > MAX_MODES:
            break
        modes.append(_made(model, held, number))
    return tuple(modes)


def _sets(events: Sequence[Event]) -> Iterator[tuple[int, ...]]:
    gaps = [k for k, event in enumerate(events) if event.impact and event.impact.rest == "hold"]
    for size in range(1, len(gaps) + 1):
        yield from combinations(gaps, size)


def _made(model: Model, held: tuple[int, ...], number: int) -> HeldMode:
    events = list(model.events.values())
    other = copy.deepcopy(model)
    other.name, other.events, other.outputs, other.chosen_independent = f"{model.name}_held_{number}", {}, {}, ()
    for k in held:
        other.constrain(events[k].when, f"{events[k].name}, held")  # type: ignore[arg-type]
    sources = generate(other)
    kernels = compile(sources, backend="numpy")
    loads = [HeldLoad(words=events[k].name, row=kernels.m - len(held) + i) for i, k in enumerate(held)]
    conditions = [(f"event {event.name}", event.when) for event in events]
    programs = assemble_mode_conditions(sources.programs.equations, conditions, loads, (), motion_sizes(kernels), kernels.row_sizes)
    return HeldMode(held, sources, kernels, replace(programs["conditions"], name=f"conditions_held_{number}"))
