"""The time that generating and compiling take within a run, so that a run can report it apart from its own."""

from __future__ import annotations

import threading
import time
from contextlib import ContextDecorator


class _Clock(threading.local):
    """Seconds of preparation in this thread, and since when it is preparing (None while it is not)."""

    seconds: float = 0.0
    since: float | None = None


_clock = _Clock()


class preparing(ContextDecorator):
    """Count the time within as preparation; what is within another one is counted once."""

    def _recreate_cm(self) -> preparing:
        """One of its own for every call of a function."""
        return preparing()

    def __enter__(self) -> None:
        self._is_outer = _clock.since is None
        if self._is_outer:
            _clock.since = time.perf_counter()

    def __exit__(self, *raised: object) -> None:
        if self._is_outer and _clock.since is not None:
            _clock.seconds += time.perf_counter() - _clock.since
            _clock.since = None


def preparation_seconds() -> float:
    """Return the seconds that preparations of this thread have taken so far."""
    return _clock.seconds
