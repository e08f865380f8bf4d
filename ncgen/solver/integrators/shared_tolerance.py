"""SciPy's explicit solvers with steps that share a tolerance, as those in C do."""

from __future__ import annotations

from typing import TYPE_CHECKING, cast

import numpy as np
from scipy.integrate import RK45, OdeSolver

if TYPE_CHECKING:

    class _Explicit(OdeSolver):
        """SciPy's class of explicit methods, which it does not show."""

        def _step_impl(self) -> tuple[bool, str | None]: ...

        def _estimate_error_norm(self, K: np.ndarray, h: float, scale: np.ndarray) -> float: ...


MIN_STEP_FRACTION = 2e-15
"""Steps below this share of the run are too short to get anywhere: ten roundings."""


def sharing(solver: type[OdeSolver], span: float, before: tuple[float, int] = (0.0, 0)) -> type[OdeSolver]:
    """An explicit SciPy solver whose steps share the tolerance; others as they are.

    span: as of `Tolerances`; before: when the run began (s) and its steps up to here, if there were any
    """
    if not issubclass(solver, RK45.__mro__[1]):
        return solver
    explicit = cast("type[_Explicit]", solver)

    class Sharing(explicit):
        begun, taken = before

        def _step_impl(self) -> tuple[bool, str | None]:
            self.begun = self.begun if self.taken else self.t
            self.taken += 1
            try:
                return super()._step_impl()
            except _TooShort:
                return False, self.TOO_SMALL_STEP

        def _estimate_error_norm(self, K: np.ndarray, h: float, scale: np.ndarray) -> float:
            """Steps that are shorter than the mean count as that, as in C: rounding does not fall with them."""
            mean = (self.t - self.begun) / self.taken
            error = super()._estimate_error_norm(K, h, scale) * max(1.0, span / max(abs(h), mean))
            if not error < 1 and abs(h) < MIN_STEP_FRACTION * abs(self.t_bound - self.begun):
                raise _TooShort
            return error

    return Sharing


class _TooShort(Exception):
    """A step that is tiny compared with the run is refused. SciPy compares it with the spacing of numbers, which at 0 is 5e-324."""
