"""What is made once in a process, also where several threads ask for it at the same time."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from functools import cache, update_wrapper
from threading import RLock
from typing import Generic, TypeVar

Result = TypeVar("Result")


class once(Generic[Result]):
    """`functools.cache` under a lock, without which two threads that are the first to ask would make two, and mix them."""

    def __init__(self, function: Callable[..., Result]) -> None:
        self._lock, self._cached = RLock(), cache(function)
        self.cache_clear = self._cached.cache_clear
        update_wrapper(self, function)

    def __call__(self, *arguments: Hashable) -> Result:
        with self._lock:
            return self._cached(*arguments)
