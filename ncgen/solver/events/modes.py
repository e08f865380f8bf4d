"""Modes of a mechanism: variants in which gaps at rest and joints that stick are ordinary constraints.

Each set of held constraints is compiled once, when a run first needs it, and kept with the kernels and in the cache; so a run in a mode is
as fast as that of a plain model. A constraint is left by the sign, or the size, of its own load.
"""

from __future__ import annotations

import copy
import hashlib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from importlib import import_module
from typing import TYPE_CHECKING

import numpy as np

from ncgen.errors import ModelError
from ncgen.mechanism.functions import CompiledFunctions
from ncgen.mechanism.functions import functions as functions_of
from ncgen.mechanism.kernels import Kernels
from ncgen.mechanism.library import STATUS
from ncgen.model.values import Scalar, Value
from ncgen.program.motions.conditions import INPUTS, assemble_mode_conditions
from ncgen.solver.events.state import State
from ncgen.solver.formalisms import accelerations_by
from ncgen.solver.loads.constraint_loads import motion_sizes, refusal_of_multipliers
from ncgen.solver.positions.rank import freedom_at
from ncgen.toolchain.abi import InC, Interface, runtime_abi

if TYPE_CHECKING:
    from ncgen.solver.events.conditions import EventFunctions


DOMAIN = STATUS.index("domain")


@dataclass(frozen=True, eq=False)
class Held:
    """A constraint that a mode can have. number: of the condition that it belongs to; row: an expression that stays zero in the mode;
    static: the friction that holds it, None for a gap"""

    number: int
    name: str
    row: Scalar
    static: Value | None = None


@dataclass(frozen=True, eq=False)
class Mode:
    """From t (s) on: names of what is held, and the kernels with these constraints, the last of theirs."""

    t: float
    held: tuple[str, ...]
    kernels: Kernels


def variant(kernels: Kernels, held: tuple[Held, ...]) -> Kernels:
    """The kernels of a mechanism with more constraints, which have the coordinates and parameters of the mechanism itself."""
    if not held:
        return kernels
    key = tuple(each.name for each in held)
    return kernels.remember("modes", key, lambda: _made(kernels, held)).driven_by(kernels._drive)


def _made(kernels: Kernels, held: tuple[Held, ...]) -> Kernels:
    model = copy.deepcopy(kernels.model)
    model.events, model.frictions, model.ratchets, model.locks, model.chosen_independent = {}, {}, {}, {}, ()
    for each in held:
        model.constrain(each.row, f"{each.name}, held")  # type: ignore[arg-type]
    made = import_module("ncgen.compiler").compile(model, backend="c")
    if made.coordinates != kernels.coordinates or made.parameters != kernels.parameters:
        raise ModelError(
            f"{kernels.name}: {', '.join(each.name for each in held)} cannot be held; their constraints change the coordinates"
        )
    return made


def loads_of(kernels: Kernels, count: int, at: State) -> tuple[np.ndarray, float]:
    """The generalised forces (count,) of the last constraints of a variant: N along the gap or coordinate of each, N m about an angle.

    And the largest multiplier of all constraints, with which they are compared.
    """
    found = accelerations_by("lagrange").motion(kernels, at.q, at.qd, at.t, kernels.present(at.t, at.p), {})
    return -found.lam[kernels.m - count :], float(np.max(np.abs(found.lam)))


def rank_of(kernels: Kernels, at: State) -> int:
    """Of Φ_q of a variant, found once for every parameters."""
    return kernels.remember("rank in a mode", at.p.tobytes(), lambda: freedom_at(kernels, at.q, at.t, at.p).rank, 64)


@dataclass(frozen=True, eq=False)
class LoadConditions:
    """The conditions of a mechanism, and behind them those of the loads of what a mode holds, which are positive as long as it holds.

    address: of the function, as `Conditions` has it; count: how many there are of loads
    """

    address: int
    count: int
    owner: object

    @property
    def raised(self) -> BaseException | None:
        """What went wrong in a call of Python."""
        return self.owner.raised if isinstance(self.owner, _InPython) else None


def count_of(held: Iterable[Held]) -> int:
    """How many conditions loads have: one of a gap, two of a joint."""
    return sum(1 if each.static is None else 2 for each in held)


def load_conditions(functions: EventFunctions, kernels: Kernels, held: tuple[Held, ...]) -> LoadConditions:
    """Those of a mode: compiled, but for models that call Python functions or have more unknowns than are emitted. kernels: of the mode"""
    count = count_of(held)
    if refusal_of_multipliers(kernels):
        called = _InPython(functions, kernels.driven_by(None), held)
        return LoadConditions(called.address, count, called)
    made = kernels.remember("load conditions", tuple(each.name for each in held), lambda: _compiled(functions, kernels, held, count))
    return LoadConditions(made.address("conditions"), count, made)


def _compiled(functions: EventFunctions, kernels: Kernels, held: tuple[Held, ...], count: int) -> CompiledFunctions:
    conditions, loads = functions.conditions, [(each.name, each.static) for each in held]
    told = hashlib.sha256(repr([(where, str(e)) for where, e in (*conditions, *loads)]).encode()).hexdigest()[:16]
    counts = {"q": kernels.n, "qd": kernels.n, "p": len(kernels.p0)}
    made = functions_of(
        kernels, f"mode_{told}", {"conditions": INPUTS["conditions"]}, {"conditions": 2 * (len(conditions) + count)}, counts,
        lambda: assemble_mode_conditions(kernels.programs.equations, conditions, loads, motion_sizes(kernels)),
    )  # fmt: skip
    assert isinstance(made, CompiledFunctions), "events need compiled kernels"
    return made


def margins(held: tuple[Held, ...], loads: np.ndarray, statics: Sequence[float]) -> list[tuple[float, float]]:
    """(how far a load may still go, size) of every condition of the loads (H,) of what is held."""
    found: list[tuple[float, float]] = []
    for each, load, most in zip(held, loads.tolist(), statics, strict=True):
        size = most + abs(load)
        found += [(load, abs(load))] if each.static is None else [(most - load, size), (most + load, size)]
    return found


class _InPython:
    """A function of C that calls Python. raised: what went wrong in a call, or None"""

    def __init__(self, functions: EventFunctions, kernels: Kernels, held: tuple[Held, ...]) -> None:
        ffi: Interface = runtime_abi("double")
        self.raised: BaseException | None = None
        n, n_p, conditions = kernels.n, len(kernels.p0), functions.count
        own = functions.raw("conditions")

        def evaluate(t: float, q: InC, qd: InC, p: InC, out: InC) -> int:
            own(t, q, qd, p, out)
            state = [np.array(ffi.unpack(a, size) if size else [], dtype=float) for a, size in ((q, n), (qd, n), (p, n_p))]
            lam = accelerations_by("lagrange").motion(kernels, state[0], state[1], t, state[2], {}).lam
            at = State(t, *state)
            statics = [0.0 if each.static is None else functions.static(each.number, at) for each in held]
            for k, (value, size) in enumerate(margins(held, -lam[kernels.m - len(held) :], statics)):
                out[2 * (conditions + k)], out[2 * (conditions + k) + 1] = value, size
            return 0

        def failed(kind: type[BaseException], raised: BaseException, traceback: object) -> None:
            self.raised = raised

        self._callback = ffi.callback("ncgen_velocity_kernel", evaluate, error=DOMAIN, onerror=failed)
        self.address = int(ffi.cast("uintptr_t", self._callback))
