"""Integrators of another language: what their callbacks raise is kept until they have returned; their own interpolation."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Any, cast

import numpy as np
from scipy.integrate import DenseOutput, OdeSolver

from ncgen.solver.integrators.ode import Derivative, Slope


class Caught:
    """Keeps the first exception of what is called through it. Exceptions must not pass through C or Fortran, which would go on calling.

    What raised gives nan, so that the library's step fails; what follows from that says less and is forgotten.
    """

    def __init__(self) -> None:
        self._problem: Exception | None = None

    def call(self, function: Callable[[float, np.ndarray], np.ndarray], t: float, y: np.ndarray) -> np.ndarray | float:
        try:
            return function(t, y.copy())
        except Exception as problem:
            self._problem = self._problem or problem
            return np.nan

    def raise_caught(self) -> None:
        """Raise what was kept, once."""
        problem, self._problem = self._problem, None
        if problem is not None:
            raise problem


class ForeignSolver(OdeSolver, ABC):
    """Steps of a library, whose solver children make of options and begin at the present state (`_begun`)."""

    def __init__(
        self,
        fun: Derivative,
        t0: float,
        y0: np.ndarray,
        t_bound: float,
        rtol: float = 1e-3,
        atol: float | np.ndarray = 1e-6,
        max_step: float = np.inf,
        vectorized: bool = False,
        first_step: float | None = None,
        jac: Slope | None = None,
        **extra: object,
    ) -> None:
        super().__init__(fun, t0, y0, t_bound, vectorized)
        self._caught = Caught()
        self._engine = self._begun(
            jac, rtol=rtol, atol=atol, first_step=first_step or 0.0, max_step=0.0 if np.isinf(max_step) else max_step
        )

    @abstractmethod
    def _begun(self, jac: Slope | None, **options: float | np.ndarray) -> Any:
        """The library's solver at the present state."""


class Asked(DenseOutput):
    """What a library itself says of instants of its last step."""

    def __init__(self, solver: OdeSolver, ask: Callable[[float], np.ndarray]) -> None:
        super().__init__(cast(float, solver.t_old), solver.t)  # SciPy asks after a step only, when there is a time before it
        self._ask = ask

    def _call_impl(self, t: float) -> np.ndarray:
        return self._ask(t).copy()
