"""All methods of the registries, and a limit to their time."""

from __future__ import annotations

import time
from collections.abc import Callable

from ncgen.methods.table import FORMALISMS, INTEGRATORS

FIXED = tuple(name for name, entry in INTEGRATORS.items() if entry.has_fixed_step)
"""Integrators with a fixed step."""

ONE = "dop853"
"""Every formalism is tried with this one, since there the integrator is not what differs."""


class TimeIsUp(Exception):
    """Raised when a run has used up its time."""


def methods() -> list[tuple[str, str]]:
    """Coordinate partitioning with every integrator, every formalism with one, and all that step the constrained equations."""
    ordinary = [("coordinate-partitioning", entry.name) for entry in INTEGRATORS.values() if entry.is_ordinary]
    formalisms = [(entry.name, ONE) for entry in FORMALISMS.values() if entry.is_ordinary]
    steppers = [(formalism, entry.name) for entry in INTEGRATORS.values() for formalism in entry.steps]
    return list(dict.fromkeys([*ordinary, *formalisms, *steppers]))


def time_limit(seconds: float) -> Callable[[float], None]:
    """The `progress` of a run that raises TimeIsUp as soon as so many seconds have passed from now.

    A run calls it while it computes, in C too, so that nothing is interrupted but the run: an alarm of the system would raise between
    any two instructions, in the middle of an import or while somebody holds a lock.
    """
    end = time.perf_counter() + seconds

    def check(t: float) -> None:
        if time.perf_counter() > end:
            raise TimeIsUp(f"stopped after {seconds:g} s")

    return check
