"""All methods of the registries, how each is told its accuracy, and a limit to their time."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TypedDict

from ncgen.methods.table import FORMALISMS, INTEGRATORS

FIXED = tuple(name for name, entry in INTEGRATORS.items() if entry.has_fixed_step)
"""Integrators with a fixed step."""

ONE = "dop853"
"""Every formalism is tried with this one, since there the integrator is not what differs."""


class Tolerances(TypedDict):
    """How an integrator that chooses its steps is told its accuracy: arguments of `simulate`."""

    rtol: float
    atol: float


AGAIN = 1.0
"""Seconds after which it is said again: what a foreign library calls back into may keep an exception to itself."""


class TimeIsUp(Exception):
    """Raised when a run has used up its time."""


def methods() -> list[tuple[str, str]]:
    """Coordinate partitioning with every integrator, every formalism with one, and all that step the constrained equations."""
    ordinary = [("coordinate-partitioning", entry.name) for entry in INTEGRATORS.values() if entry.is_ordinary]
    formalisms = [(entry.name, ONE) for entry in FORMALISMS.values() if entry.is_ordinary]
    steppers = [(formalism, entry.name) for entry in INTEGRATORS.values() for formalism in entry.steps]
    return list(dict.fromkeys([*ordinary, *formalisms, *steppers]))


@contextmanager
def limited(seconds: float) -> Iterator[None]:
    """Raise TimeIsUp in the middle of whatever Python does; a run in C ends at the last step that it has made."""

    def stop(*_: object) -> None:
        raise TimeIsUp(f"stopped after {seconds:g} s")

    if not (hasattr(signal, "setitimer") and seconds < float("inf")):
        yield
        return
    before = signal.signal(signal.SIGALRM, stop)
    signal.setitimer(signal.ITIMER_REAL, seconds, AGAIN)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)
