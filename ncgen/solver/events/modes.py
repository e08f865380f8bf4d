"""Modes of a mechanism: variants in which gaps at rest and joints that stick are ordinary constraints.

Each set of held constraints is compiled once, when a run first needs it, and kept with the kernels and in the cache; so a run in a mode is
as fast as that of a plain model. A constraint is left by the sign, or the size, of its own load.
"""

from __future__ import annotations

import copy
import hashlib
from abc import ABC, abstractmethod
from collections.abc import Iterable
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


def rank_of(kernels: Kernels, mode: Kernels, at: State) -> int:
    """Of Φ_q of a mode, found once for all parameters that the constraints of the mechanism read."""
    return mode.remember("rank in a mode", kernels.of_rows(at.p).tobytes(), lambda: freedom_at(mode, at.q, at.t, at.p).rank, 64)


def count_of(held: Iterable[Held]) -> int:
    """How many conditions loads have: one of a gap, two of a joint."""
    return sum(1 if each.static is None else 2 for each in held)


class LoadConditions(ABC):
    """The conditions of a mechanism, and behind them those of the loads of what a mode holds, which are positive as long as it holds.

    A gap has one, its load; a joint two, static friction less and plus its load. Their sizes are those of all loads together, by energy.

    address: of the function, as `Conditions` has it; count: how many there are of loads; raised: what went wrong in a call of Python
    """

    address: int
    count: int
    raised: BaseException | None = None

    @abstractmethod
    def at(self, at: State) -> tuple[np.ndarray, np.ndarray]:
        """Values and sizes of those of loads, (count,) each; p of the state has the values of inputs."""


def load_conditions(functions: EventFunctions, mode: Kernels, held: tuple[Held, ...]) -> LoadConditions:
    """Those of a mode: compiled, but for models that call Python functions or have more unknowns than are emitted."""
    kind = _InPython if refusal_of_multipliers(mode) else _Compiled
    made = mode.remember("load conditions", tuple(each.name for each in held), lambda: kind(functions.read_inputs, mode, held))
    made.raised = None
    return made


class _Compiled(LoadConditions):
    """In one program with those of the mechanism."""

    def __init__(self, functions: EventFunctions, mode: Kernels, held: tuple[Held, ...]) -> None:
        conditions, loads = functions.conditions, [(each.name, each.static) for each in held]
        told = hashlib.sha256(repr([(where, str(e)) for where, e in (*conditions, *loads)]).encode()).hexdigest()[:16]
        counts = {"q": mode.n, "qd": mode.n, "p": len(mode.p0)}
        self.count = count_of(held)
        made = functions_of(
            mode, f"mode_{told}", {"conditions": INPUTS["conditions"]}, {"conditions": 2 * (len(conditions) + self.count)}, counts,
            lambda: assemble_mode_conditions(mode.programs.equations, conditions, loads, motion_sizes(mode), mode.row_sizes),
        )  # fmt: skip
        assert isinstance(made, CompiledFunctions), "events need compiled kernels"
        self._function, self.address, self._first = made, made.address("conditions"), 2 * len(conditions)

    def at(self, at: State) -> tuple[np.ndarray, np.ndarray]:
        found = self._function("conditions", at.t, at.q, at.qd, at.p)[self._first :]
        return found[::2], found[1::2]


class _InPython(LoadConditions):
    """A function of C that calls Python."""

    def __init__(self, functions: EventFunctions, mode: Kernels, held: tuple[Held, ...]) -> None:
        ffi: Interface = runtime_abi("double")
        self._functions, self._mode, self._held, self.count = functions, mode.driven_by(None), held, count_of(held)
        n, n_p, first = mode.n, len(mode.p0), 2 * functions.count
        own = functions.raw("conditions")

        def evaluate(t: float, q: InC, qd: InC, p: InC, out: InC) -> int:
            own(t, q, qd, p, out)
            state = [np.array(ffi.unpack(a, size) if size else [], dtype=float) for a, size in ((q, n), (qd, n), (p, n_p))]
            for k, number in enumerate(np.column_stack(self.at(State(t, *state))).ravel().tolist()):
                out[first + k] = number
            return 0

        def failed(kind: type[BaseException], raised: BaseException, traceback: object) -> None:
            self.raised = raised

        self._callback = ffi.callback("ncgen_velocity_kernel", evaluate, error=DOMAIN, onerror=failed)
        self.address = int(ffi.cast("uintptr_t", self._callback))

    def at(self, at: State) -> tuple[np.ndarray, np.ndarray]:
        rows = self._mode.row_sizes
        lam = accelerations_by("lagrange").motion(self._mode, at.q, at.qd, at.t, at.p, {}).lam
        found, total = [], float(np.sum(rows * np.abs(lam)))
        for k, each in enumerate(self._held, self._mode.m - len(self._held)):
            if each.static is None:
                found.append((-lam[k], total / rows[k]))
                continue
            most = self._functions.static(each.number, at)
            found += [(most + side * lam[k], most + total / rows[k]) for side in (1, -1)]
        values, sizes = np.array(found).T
        return values, sizes
