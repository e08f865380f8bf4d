"""What is found in the position that a model describes, in which most runs begin: kept in the cache for later processes."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

import numpy as np

from ncgen.mechanism.kernels import Kernels
from ncgen.mechanism.recall import derived

Found = TypeVar("Found")


def is_described(kernels: Kernels, q: np.ndarray, t: float, p: np.ndarray) -> bool:
    """True where a position is the one that the model describes."""
    return t == 0.0 and np.array_equal(q, kernels.q0) and np.array_equal(p, kernels.p0)


def found_in_described(kernels: Kernels, name: str, find: Callable[[], Found]) -> Found:
    """What JSON can say of a mechanism's described position, from the cache or found now by its kernels.

    name: tells it from whatever else is found of a mechanism
    """
    return derived(kernels.programs, f"{name} by {kernels.computed_by}", find)
