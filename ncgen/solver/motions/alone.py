"""One thread at a time: what C works on is moved by nobody else meanwhile."""

from __future__ import annotations

from threading import Lock

from ncgen.errors import ModelError


class Alone:
    """A lock that refuses where it is taken instead of waiting: two threads that move one simulation are a mistake of the caller's."""

    def __init__(self, owner: str) -> None:
        """owner: name of the mechanism, for messages"""
        self._lock, self._owner = Lock(), owner

    def __enter__(self) -> None:
        """Raises ModelError where another thread is at work."""
        if not self._lock.acquire(blocking=False):
            raise ModelError(f"{self._owner}: another thread uses this simulation now; start one for every thread")

    def __exit__(self, *raised: object) -> None:
        self._lock.release()
