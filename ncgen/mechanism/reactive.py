"""Forces that follow from loads of constraints, such as friction of contacts that slide: compiled functions among a model's callbacks."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from ncgen.mechanism.kernels import Kernels
    from ncgen.mechanism.program_functions import CompiledFunctions, ProgramFunctions
    from ncgen.program.ir.blocks import Program


@dataclass(frozen=True, eq=False, kw_only=True)
class ReactiveForce:
    """Generalised forces (n,) of a state and of parameters.

    name: of the function; key: a word that tells it from others of a mechanism; programs: makes its program and its derivatives, by names
    tangents: makes the functions that have `friction_tangent`
    """

    functions: CompiledFunctions
    name: str
    key: str
    programs: Callable[[], Mapping[str, Program]]
    tangents: Callable[[], ProgramFunctions]

    def __call__(self, t: float, q: np.ndarray, qd: np.ndarray, kernels: Kernels) -> np.ndarray:
        """As callbacks are called: with the parameters' defaults."""
        return self.at(t, q, qd, kernels.p0)

    def at(self, t: float, q: np.ndarray, qd: np.ndarray, p: np.ndarray) -> np.ndarray:
        """p (n_p,): with the values of inputs at t"""
        return self.functions(self.name, t, q, qd, p)

    def jacobian(self, t: float, q: np.ndarray, qd: np.ndarray, p: np.ndarray) -> np.ndarray:
        """(n, 2 n + n_p), by q, q̇ and p."""
        tangents = self.tangents()
        return np.array([tangents("friction_tangent", t, q, qd, p, seed) for seed in np.eye(2 * len(q) + len(p))]).T

    @staticmethod
    def only(callbacks: Sequence[Callable[..., object]]) -> ReactiveForce | None:
        """The only one of a model's callbacks; None where there is none, or others."""
        return callbacks[0] if len(callbacks) == 1 and isinstance(callbacks[0], ReactiveForce) else None

    @property
    def address(self) -> int:
        """Where the function is in C."""
        return self.functions.address(self.name)
