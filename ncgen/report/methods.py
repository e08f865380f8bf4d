"""All methods of the registries, how each is told its accuracy, and a limit to their time."""

from __future__ import annotations

import signal
from contextlib import contextmanager

from ncgen.solver.formalisms import FORMALISMS
from ncgen.solver.integrators import INTEGRATORS
from ncgen.solver.steppers import STEPPERS

FIXED = tuple(
    dict.fromkeys([name for name, method in INTEGRATORS.items() if hasattr(method, "has_fixed_step")] + [name for _, name in STEPPERS])
)
"""Integrators with a fixed step."""

ONE = "dop853"
"""Every formalism is tried with this one, since there the integrator is not what differs."""


AGAIN = 1.0
"""Seconds after which it is said again: what a foreign library calls back into may keep an exception to itself."""


class TimeIsUp(Exception):
    """Raised when a run has used up its time."""


def methods() -> list[tuple[str, str]]:
    """Coordinate partitioning with every integrator, every formalism with one, and all that step the constrained equations."""
    ordinary = [("coordinate-partitioning", integrator) for integrator in INTEGRATORS]
    formalisms = [(name, ONE) for name, formalism in FORMALISMS.items() if formalism.ordinary]
    return list(dict.fromkeys([*ordinary, *formalisms, *STEPPERS]))


@contextmanager
def limited(seconds: float):
    """Raise TimeIsUp in the middle of whatever Python does; a run in C, which ends by itself, is let go."""

    def stop(*_):
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
