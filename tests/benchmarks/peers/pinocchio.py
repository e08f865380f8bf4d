"""Pinocchio (https://github.com/stack-of-tasks/pinocchio) in C++: a tree closed by constraints with Baumgarte's terms, RK4.

Needs `pin` and, for the headers that it is compiled with, `cmeel-eigen`.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from cffi import FFI

from benchmarks.rivals.pinocchio import compiled_cpp, installed
from ncgen.mechanism.arguments import pointer

installed()

NAME = "Pinocchio C++, RK4, Baumgarte 20"
FREQUENCY = 20.0
"""ω (1/s) of Baumgarte's terms, critically damped."""

SOURCE = Path(__file__).with_name("pinocchio.cpp")

# Pinocchio's own definitions; no -march: the library is compiled without, and Eigen's alignment must be the same.
FLAGS = (
    "-x", "c++", "-std=c++17", "-O3", "-DNDEBUG", "-w", "-fPIC", "-shared", "-DBOOST_MPL_LIMIT_LIST_SIZE=30",
    "-DBOOST_MPL_CFG_NO_PREPROCESSED_HEADERS",
)  # fmt: skip


@cache
def _library() -> tuple[FFI, Any]:
    ffi = FFI()
    ffi.cdef("double four_bars(int, double, int, int, double, double *);")
    return ffi, ffi.dlopen(str(compiled_cpp(SOURCE, FLAGS).library))


def run(count: int, duration: float, intervals: int, steps: int) -> tuple[float, np.ndarray]:
    """(seconds, B0 (intervals + 1, 2)) of a run with `steps` steps in each of the intervals."""
    ffi, library = _library()
    xy = np.empty((intervals + 1, 2))
    return library.four_bars(count, duration, intervals, steps, FREQUENCY, pointer(ffi, xy, count=2 * (intervals + 1))), xy
