"""What a hard case is: a mechanism on which methods are known to break, with an independent solution to be measured against.

Errors are the largest difference (m, rad) of named coordinates over the instants of the run, unless a case says otherwise.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import cast

from scipy.optimize import brentq

from ncgen.model import Model
from ncgen.solver.trajectories.trajectory import Trajectory

GRAVITY = 9.81
"""m/s²."""


@dataclass(frozen=True, kw_only=True)
class Case:
    """One hard case.

    breaks: what is hard about it; build: the model; error: of a run against an independent solution, which `against` names
    step: of methods with a fixed step (s); rtol: of the others, atol being a hundredth of it times the length
    options: for every run, such as initial velocities
    violated: the start is moved by this share of the mechanism's size
    """

    name: str
    breaks: str
    build: Callable[[], Model]
    duration: float
    error: Callable[[Trajectory], float]
    against: str
    step: float = 1e-3
    rtol: float = 1e-10
    points: int = 21
    options: dict = field(default_factory=dict)
    violated: float = 0.0


def root(function: Callable[[float], float], low: float, high: float, xtol: float = 2e-12) -> float:
    """Where a function is zero."""
    return cast(float, brentq(function, low, high, xtol=xtol))  # it gives more than a number only where it is asked to
