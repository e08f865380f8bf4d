"""Forces that follow from loads of constraints, such as friction of contacts that slide: compiled functions among a model's callbacks."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from ncgen.mechanism.kernels import Kernels
    from ncgen.mechanism.program_functions import CompiledFunctions


@dataclass(frozen=True, eq=False)
class ReactiveForce:
    """Generalised forces (n,) of a state and of parameters. name: of the function"""

    functions: CompiledFunctions
    name: str

    def __call__(self, t: float, q: np.ndarray, qd: np.ndarray, kernels: Kernels) -> np.ndarray:
        """As callbacks are called: with the parameters' defaults."""
        return self.at(t, q, qd, kernels.p0)

    def at(self, t: float, q: np.ndarray, qd: np.ndarray, p: np.ndarray) -> np.ndarray:
        """p (n_p,): with the values of inputs at t"""
        return self.functions(self.name, t, q, qd, p)

    @property
    def address(self) -> int:
        """Where the function is in C."""
        return self.functions.address(self.name)
