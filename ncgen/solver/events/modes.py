"""Modes of a mechanism: variants in which gaps at rest and joints that stick are ordinary constraints.

Each set of held constraints is compiled once, when a run first needs it, and kept with the kernels and in the cache; so a run in a mode is
as fast as that of a plain model. A constraint is left by the sign, or the size, of its own load.
"""

from __future__ import annotations

import hashlib
from abc import ABC, abstractmethod
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial
from typing import TYPE_CHECKING

import numpy as np

from ncgen.errors import ModelError
from ncgen.mechanism.active_in_c import sides_of
from ncgen.mechanism.kernels import Kernels
from ncgen.mechanism.listening import called
from ncgen.mechanism.program_functions import CompiledFunctions, ProgramFunctions
from ncgen.mechanism.program_functions import functions as functions_of
from ncgen.mechanism.reactive import ReactiveForce
from ncgen.model.frictions import Friction
from ncgen.model.values import as_sympy, evaluate
from ncgen.program.ir.blocks import Program
from ncgen.program.ir.evaluate import evaluate as interpreted
from ncgen.program.motions.event_programs import INPUTS, HeldLoad, assemble_load_margins, assemble_mode_conditions
from ncgen.program.motions.multipliers import STATE
from ncgen.program.motions.sliding import Sliding, assemble_friction
from ncgen.program.motions.sliding_derivatives import assemble_friction_derivatives
from ncgen.solver.events import on_demand
from ncgen.solver.events.holdables import LOCK, Holdable
from ncgen.solver.events.state import State
from ncgen.solver.formalisms import accelerations_by
from ncgen.solver.loads.constraint_loads import motion_sizes, refusal_of_multipliers
from ncgen.solver.positions.rank import freedom_at
from ncgen.toolchain.abi import InC, Interface, runtime_abi

if TYPE_CHECKING:
    from ncgen.solver.events.conditions import EventFunctions


@dataclass(frozen=True, eq=False)
class Mode:
    """From t (s) on: names of what is held, and the kernels with these constraints, the last of theirs."""

    t: float
    held: tuple[str, ...]
    kernels: Kernels


def variant(kernels: Kernels, held: tuple[Holdable, ...]) -> Kernels:
    """The kernels of a mechanism with more constraints, which have the coordinates and parameters of the mechanism itself."""
    if not held and not any(each.load is not None for each in kernels.model.frictions.values()):
        return kernels
    key = tuple(each.key for each in held)
    return kernels.remember("modes", key, lambda: _made(kernels, held)).driven_by(kernels._drive)


def _made(kernels: Kernels, held: tuple[Holdable, ...]) -> Kernels:
    model = on_demand.without_events(kernels.model)
    for each in held:
        if each.held:  # so that positions around the start, in which accelerations are seen, are those of the mechanism
            default = evaluate(each.initial, model.numbers, each.name)
            model.parameters[each.held] = replace(model.parameters[each.held], default=default)
        for row in each.rows:
            hold = model.constrain_velocity if each.sticks else model.constrain
            hold(row, f"{each.name}, held")  # type: ignore[arg-type]
    made = on_demand.compiled(model, backend="c", effort=kernels.effort)
    if made.coordinates != kernels.coordinates or made.parameters != kernels.parameters:
        raise ModelError(
            f"{kernels.name}: {', '.join(each.name for each in held)} cannot be held; their constraints change the coordinates"
        )
    if sliding := sliding_of(made, held, kernels.model.frictions.values()):
        made.model.callbacks.append(_friction(made, sliding))
    return made


def sliding_of(
    kernels: Kernels, held: tuple[Holdable, ...], frictions: Iterable[Friction], by_switches: bool = False
) -> tuple[Sliding, ...]:
    """What slides in a mode with friction that follows loads: the contacts whose gap is held while they do not stick, and joints that do
    not. kernels: of the mode; frictions: of the mechanism; by_switches: as of exports, where what is held may slide as well"""
    sticking = () if by_switches else held
    names = {each.name for each in sticking if each.sticks}
    contacts = (
        Sliding(name=c.name, row=row, friction=as_sympy(c.friction), velocity=c.sliding, slip=c.slip, may_rest=by_switches)
        for each, row in zip(held, first_rows(kernels, held), strict=True)
        if (c := each.contact) and not each.sticks and c.name not in names
    )
    joints = (
        Sliding(
            name=each.name, row=each.load, friction=as_sympy(each.static), velocity=(each.along.rate,), slip=(each.slip,), is_joint=True,
            across=each.across,
        )
        for each in frictions
        if each.load is not None and not _stick(each, sticking)
    )  # fmt: skip
    return (*contacts, *joints)


def _stick(friction: Friction, held: Iterable[Holdable]) -> bool:
    """Whether a joint's friction holds it."""
    return any(each.static is not None and each.name == friction.name for each in held)


def first_rows(kernels: Kernels, held: Sequence[Holdable]) -> list[int]:
    """The numbers of the first constraints of what is held, which are the last ones of a mode."""
    if not held:
        return []
    ends = np.cumsum([len(each.rows) for each in held])
    return [int(kernels.m - ends[-1] + end - len(each.rows)) for each, end in zip(held, ends, strict=True)]


def _friction(kernels: Kernels, sliding: tuple[Sliding, ...]) -> ReactiveForce:
    """The friction of contacts and joints that slide. Raises ModelError where it cannot be compiled."""
    names = ", ".join(each.words for each in sliding)
    if why := refusal_of_multipliers(kernels):
        raise ModelError(f"{kernels.name}: {names} cannot slide: {why}; leave the friction out")
    if len(sliding) > 1 and any(each.across is not None for each in sliding):
        raise ModelError(
            f"{kernels.name}: {names} slide together, and friction with across must be the only friction of loads; leave across out"
        )
    parts = [(s.words, s.row, s.across, str(s.friction), str(s.velocity), s.slip) for s in sliding]
    digest = hashlib.sha256(repr(parts).encode()).hexdigest()[:16]
    equations, sizes = kernels.programs.equations, motion_sizes(kernels)
    made = functions_of(
        kernels, f"friction_{digest}", {"friction_forces": STATE}, {"friction_forces": kernels.n},
        {"q": kernels.n, "qd": kernels.n, "p": len(kernels.p0)}, lambda: assemble_friction(equations, sizes, sliding),
    )  # fmt: skip
    assert isinstance(made, CompiledFunctions), "events need compiled kernels"

    def programs() -> dict[str, Program]:
        return assemble_friction(equations, sizes, sliding) | assemble_friction_derivatives(equations, sizes, sliding)

    @cache
    def tangents() -> ProgramFunctions:
        counts = {"q": kernels.n, "qd": kernels.n, "p": len(kernels.p0), "seed": 2 * kernels.n + len(kernels.p0)}
        name, inputs = "friction_tangent", (*STATE, "seed")
        return functions_of(
            kernels, f"{name}_{digest}", {name: inputs}, {name: kernels.n}, counts,
            lambda: {name: assemble_friction_derivatives(equations, sizes, sliding)[name]},
        )  # fmt: skip

    return ReactiveForce(functions=made, name="friction_forces", key=f"friction {digest}", programs=programs, tangents=tangents)


def forces_of(mode: Kernels, held: tuple[Holdable, ...], number: int, at: State) -> np.ndarray:
    """The forces of one constraint of what a mode holds, by its number in that: one for each of its rows (N)."""
    row = first_rows(mode, held)[number]
    lam = accelerations_by("lagrange").motion(mode, at.q, at.qd, at.t, mode.present(at.t, at.p), {}).lam
    return -lam[row : row + len(held[number].rows)]


def rank_of(kernels: Kernels, mode: Kernels, at: State) -> int:
    """Of Φ_q of a mode, found once for all parameters that the constraints of the mechanism read."""
    return mode.remember("rank in a mode", kernels.of_rows(at.p).tobytes(), lambda: freedom_at(mode, at.q, at.t, at.p).rank, 64)


def count_of(held: Iterable[Holdable]) -> int:
    """How many conditions the loads of what is held have, besides the one of all that slides with friction that follows loads."""
    return sum(len(sides_of(each.kind)) for each in held)


class LoadConditions(ABC):
    """The conditions of a mechanism, and behind them those of the loads of what a mode holds, which are positive as long as it holds.

    A gap has one, its load; a joint two, static friction less and plus its load; a contact that sticks one, friction less its force, both
    squared; all that slides with friction of loads one together, which is positive as long as these are determined. Sizes are by
    energy: of what brings loads about, or of all loads together where forces of Python functions do.

    address: of the function, as `Conditions` has it; count: how many there are of loads; calls_python: whether it does; raised: what went
    wrong in such a call
    """

    address: int
    count: int
    raised: BaseException | None = None
    calls_python = False

    @abstractmethod
    def at(self, at: State) -> tuple[np.ndarray, np.ndarray]:
        """Values and sizes of those of loads, (count,) each; p of the state has the values of inputs."""


def load_conditions(functions: EventFunctions, mode: Kernels, held: tuple[Holdable, ...]) -> LoadConditions:
    """Those of a mode: compiled, but for models that call Python functions or have more unknowns than are emitted."""
    kind = _InPython if refusal_of_multipliers(mode) else _Compiled
    made = mode.remember("load conditions", tuple(each.key for each in held), lambda: kind(functions.read_inputs, mode, held))
    made.raised = None
    return made


def held_loads(kernels: Kernels, held: tuple[Holdable, ...], shows_force: bool = False) -> list[HeldLoad]:
    """What holds each constraint of a mode but locks; kernels: of the mode; shows_force: as of `HeldLoad`, of contacts that stick."""
    loads, gaps = list[HeldLoad](), dict[str, int]()
    for each, row in zip(held, first_rows(kernels, held), strict=True):
        if each.contact and each.sticks:
            grip = gaps[each.name], as_sympy(each.contact.friction)
            loads.append(HeldLoad(words=each.words, row=row, grip=grip, directions=len(each.rows), shows_force=shows_force))
        elif each.kind != LOCK:
            static = None if each.static is None else as_sympy(each.static)
            loads.append(HeldLoad(words=each.name, row=row, static=static, pressed=each.pressed))
        if each.contact and not each.sticks:
            gaps[each.name] = row
    return loads


class _Compiled(LoadConditions):
    """In one program with those of the mechanism."""

    def __init__(self, functions: EventFunctions, mode: Kernels, held: tuple[Holdable, ...]) -> None:
        frictions = functions.kernels.model.frictions.values()
        conditions, loads, sliding = functions.conditions, held_loads(mode, held), sliding_of(mode, held, frictions)
        words = [str((e.words, e.row, e.static, e.grip, e.directions, e.pressed)) for e in loads]
        words += [*(str((s.words, s.row, s.across, s.velocity, s.friction)) for s in sliding), *(str(pair) for pair in conditions)]
        digest = hashlib.sha256(repr(words).encode()).hexdigest()[:16]
        counts = {"q": mode.n, "qd": mode.n, "p": len(mode.p0)}
        self.count = count_of(held) + bool(sliding)
        made = functions_of(
            mode, f"mode_{digest}", {"conditions": INPUTS["conditions"]}, {"conditions": 2 * (len(conditions) + self.count)}, counts,
            lambda: assemble_mode_conditions(mode.programs.equations, conditions, loads, sliding, motion_sizes(mode), mode.row_sizes),
        )  # fmt: skip
        assert isinstance(made, CompiledFunctions), "events need compiled kernels"
        self._function, self.address, self._first = made, made.address("conditions"), 2 * len(conditions)

    def at(self, at: State) -> tuple[np.ndarray, np.ndarray]:
        pairs = self._function.at_state("conditions", at.t, (at.q, at.qd, at.p))[self._first :]
        return pairs[::2], pairs[1::2]


class _InPython(LoadConditions):
    """A function of C that calls Python."""

    calls_python = True

    def __init__(self, functions: EventFunctions, mode: Kernels, held: tuple[Holdable, ...]) -> None:
        ffi: Interface = runtime_abi("double")
        self._mode, self.count = mode.driven_by(None), count_of(held)
        self._margins = assemble_load_margins(mode.programs.equations, held_loads(mode, held), mode.row_sizes)
        n, n_p, first = mode.n, len(mode.p0), 2 * functions.count
        raw_conditions = functions.raw("conditions")

        def evaluate(t: float, q: InC, qd: InC, p: InC, out: InC) -> int:
            raw_conditions(t, q, qd, p, out)
            state = [np.array(ffi.unpack(a, size) if size else [], dtype=float) for a, size in ((q, n), (qd, n), (p, n_p))]
            for k, number in enumerate(np.column_stack(self.at(State(t=t, q=state[0], qd=state[1], p=state[2]))).ravel().tolist()):
                out[first + k] = number
            return 0

        self._callback = called(ffi, "ncgen_velocity_kernel", evaluate, partial(setattr, self, "raised"))
        self.address = int(ffi.cast("uintptr_t", self._callback))

    def at(self, at: State) -> tuple[np.ndarray, np.ndarray]:
        lam = accelerations_by("lagrange").motion(self._mode, at.q, at.qd, at.t, at.p, {}).lam
        state = {"t": at.t, "q": at.q.tolist(), "qd": at.qd.tolist(), "p": at.p.tolist(), "lam": lam.tolist()}
        pairs = np.array(interpreted(self._margins, state))
        return pairs[::2], pairs[1::2]
