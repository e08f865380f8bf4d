"""What is made once in a process, also where several threads ask for it at the same time."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from functools import cache, wraps
from threading import RLock
from typing import TypeVar

Result = TypeVar("Result")


def once(function: Callable[..., Result]) -> Callable[..., Result]:
    """`functools.cache` under a lock, without which two threads that are the first to ask would make two, and mix them."""
    lock, cached = RLock(), cache(function)

    @wraps(function)
    def made(*given: Hashable) -> Result:
        with lock:
            return cached(*given)

    return made
