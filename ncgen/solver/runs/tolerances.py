"""What an integrator with error control may be wrong by, for every engine in its own form."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from ncgen.solver.runs.run import Run
from ncgen.solver.runs.settings import CACHED, Settings

SHARED = 20.0
"""Steps that may each take the whole tolerance where rtol is promised for the whole run; more of them share it."""

NEAR_ZERO = 0.01
"""atol over rtol, in natural sizes, where atol is not given."""

MIN_ROUNDINGS = 10.0
"""Roundings that a relative tolerance is at least."""


@dataclass(frozen=True)
class Tolerances:
    """The error of a step in a component x may be min(1, max(h, mean step) / span) (atol s + rtol |x|).

    natural: s is the natural size of the component, else 1; span: s; 0 where every step may have the whole
    """

    rtol: float
    atol: float
    natural: bool
    span: float

    @classmethod
    def of(cls, run: Run, length: float, rounding: float) -> Tolerances:
        """Those of a run in a mechanism of a length (m); what a number type cannot keep is raised to its rounding."""
        return _of(run.settings, run.duration, length, rounding)

    @classmethod
    def promised(cls, rtol: float, duration: float) -> Tolerances:
        """Those of a run in doubles for which rtol is promised as a whole, as where the method is ncgen's choice."""
        rounding = float(np.finfo(float).eps)
        return cls(max(rtol, MIN_ROUNDINGS * rounding), max(NEAR_ZERO * rtol, rounding), True, duration / SHARED)

    @property
    def errors(self) -> tuple[float, float, float]:
        """Those of a step in C."""
        return self.rtol, self.atol, self.span

    def in_c(self, velocities: np.ndarray, positions: np.ndarray) -> dict[str, Any]:
        """Arguments of a run in C whose velocities and positions have these natural sizes."""
        return {"rtol": self.rtol, "atol": self.atol, "span": self.span, "sizes": _state(velocities, positions) if self.natural else None}

    def for_scipy(self, velocities: np.ndarray, positions: np.ndarray) -> dict[str, Any]:
        """Arguments of SciPy's solvers for a state of velocities and positions of these natural sizes, and the work."""
        return {"rtol": self.rtol, "atol": self.atol * _state(velocities, positions) if self.natural else self.atol}


@lru_cache(maxsize=CACHED)
def _of(settings: Settings, duration: float, length: float, rounding: float) -> Tolerances:
    natural = settings.atol is None
    atol = NEAR_ZERO * settings.rtol if settings.atol is None else settings.atol
    least = rounding * (1.0 if natural else length)
    span = duration / SHARED if settings.integrator is None else 0.0  # rtol is then promised for the end of the run, not for every step
    return Tolerances(max(settings.rtol, MIN_ROUNDINGS * rounding), max(atol, least), natural, span)


def _state(velocities: np.ndarray, positions: np.ndarray) -> np.ndarray:
    """Sizes of a state: velocities, positions, and the work, which has none of its own."""
    return np.concatenate([velocities, positions, [1.0]])
