"""Modes of a mechanism: variants in which gaps at rest and joints that stick are ordinary constraints.

Each set of held constraints is compiled once, when a run first needs it, and kept with the kernels and in the cache; so a run in a mode is
as fast as that of a plain model. A constraint is left by the sign, or the size, of its own load.
"""

from __future__ import annotations

import copy
from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from typing import TYPE_CHECKING

import numpy as np

from ncgen.errors import ModelError
from ncgen.mechanism.kernels import Kernels
from ncgen.mechanism.library import STATUS
from ncgen.model.values import Scalar
from ncgen.solver.formalisms import accelerations_by
from ncgen.solver.positions.rank import freedom_at
from ncgen.toolchain.abi import InC, Interface, runtime_abi

if TYPE_CHECKING:
    from ncgen.solver.events.conditions import EventFunctions
    from ncgen.solver.events.state import State


DOMAIN = STATUS.index("domain")


@dataclass(frozen=True, eq=False)
class Held:
    """A constraint that a mode can have. number: of the condition that it belongs to; row: an expression that stays zero in the mode"""

    number: int
    name: str
    row: Scalar


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
    model.events, model.frictions, model.chosen_independent = {}, {}, ()
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


class LoadConditions:
    """Conditions of C, those of the mechanism's functions and behind them others on loads, called through Python.

    left: a function from the loads of the held constraints to pairs (value, size), each of which is positive as long as they hold
    raised: what went wrong in a call, or None
    """

    def __init__(
        self, functions: EventFunctions, kernels: Kernels, count: int, left: Callable[[np.ndarray, np.ndarray], list[tuple[float, float]]]
    ) -> None:
        ffi: Interface = runtime_abi("double")
        self.raised: BaseException | None = None
        n, n_p, conditions = kernels.n, len(kernels.p0), functions.count
        plain, own = kernels.driven_by(None), functions.raw("conditions")

        def evaluate(t: float, q: InC, qd: InC, p: InC, out: InC) -> int:
            own(t, q, qd, p, out)
            state = [np.array(ffi.unpack(a, size) if size else [], dtype=float) for a, size in ((q, n), (qd, n), (p, n_p))]
            lam = accelerations_by("lagrange").motion(plain, state[0], state[1], t, state[2], {}).lam
            for k, (value, size) in enumerate(left(-lam[kernels.m - count :], state[2])):
                out[2 * (conditions + k)], out[2 * (conditions + k) + 1] = value, size
            return 0

        def failed(kind: type[BaseException], raised: BaseException, traceback: object) -> None:
            self.raised = raised

        self._callback = ffi.callback("ncgen_velocity_kernel", evaluate, error=DOMAIN, onerror=failed)
        self.address = int(ffi.cast("uintptr_t", self._callback))
