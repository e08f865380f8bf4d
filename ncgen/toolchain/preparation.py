"""The time that generating and compiling take within a run, so that a run can report it apart from its own."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager


class _Clock(threading.local):
    """Seconds of preparation in this thread, and since when it is preparing (None while it is not)."""

    seconds: float = 0.0
    since: float | None = None


_clock = _Clock()


@contextmanager
def preparing() -> Iterator[None]:
    """Count the time within as preparation; what is within another one is counted once."""
    if _clock.since is not None:
        yield
        return
    _clock.since = time.perf_counter()
    try:
        yield
    finally:
        _clock.seconds += time.perf_counter() - _clock.since
        _clock.since = None


def preparation_seconds() -> float:
    """Return the seconds that preparations of this thread have taken so far."""
    return _clock.seconds
