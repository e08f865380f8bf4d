"""What a run with events meets on its way, and which runs can have events."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from ncgen.errors import ModelError
from ncgen.mechanism.kernel_data import Drive
from ncgen.mechanism.kernels import Kernels
from ncgen.methods.method import Method
from ncgen.solver.events.state import Occurrence, State
from ncgen.solver.runs.run import Run
from ncgen.solver.trajectories.happening import Happening

if TYPE_CHECKING:
    from ncgen.solver.events.modes import Mode


@dataclass(eq=False, kw_only=True)
class Passage:
    """What a run has met.

    happened: in the order of time; changes: (t, p) of all instants at which parameters changed, p (n_p,) from then on; rests: in words, why
    the run ended at a gap in which bounces accumulate; modes: what was held from when on; instants: in order; begun: state at the start
    """

    happened: list[Happening] = field(default_factory=list)
    changes: list[tuple[float, np.ndarray]] = field(default_factory=list)
    rests: str = ""
    modes: list[Mode] = field(default_factory=list)
    instants: list[Occurrence] = field(default_factory=list)
    begun: State | None = None

    def driving(self, kernels: Kernels, p: np.ndarray) -> Kernels:
        """Kernels with the parameters that held at the time that they are called with; p (n_p,): those of the start."""
        if not self.changes:
            return kernels
        times = np.array([t for t, _ in self.changes])
        return kernels.driven_by(Changed(times, np.array([p, *(each for _, each in self.changes)]), kernels.present))


@dataclass(frozen=True, eq=False)
class Changed:
    """Parameters that events changed at times (K,): values (K + 1, n_p); signals: what drives inputs besides."""

    times: np.ndarray
    values: np.ndarray
    signals: Drive

    def __call__(self, t: float, p: np.ndarray) -> np.ndarray:
        """Those of a time (s), whatever p is."""
        return self.signals(t, self.values[int(np.searchsorted(self.times, t, side="right"))])


def check_events(kernels: Kernels, method: Method, run: Run) -> None:
    """Raise ModelError where a run cannot have the events of its model."""
    where = f"{kernels.name}: events"
    if not method.is_constrained or method.is_stepper or not method.integrator.in_c or not method.formalism.in_c:
        raise ModelError(
            f"{where} need a formalism over all coordinates and an integrator in C that takes ordinary steps, not {method}; leave both out"
        )
    if run.settings.engine == "python" or run.settings.number != "double":
        raise ModelError(f"{where} need the C engine in double precision; leave engine and number out")
    if kernels.model.branches:
        raise ModelError(f"{where} need smooth angles; the paper's sine-or-cosine constraints change between steps")
