"""Kernels called many times from C, one after the other, so that the clock measures them and not the way into C."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cache

import numpy as np
from cffi import FFI

from ncgen.build.cache import build
from ncgen.build.compilers import FLAGS, find_compiler
from ncgen.build.library import _abi
from ncgen.emit.environment import verbatim

SCALAR = (*FLAGS, "-fno-tree-vectorize", "-fno-tree-slp-vectorize")
"""The arithmetic rate is that of single numbers, as in straight-line code."""

OPERATIONS = 24
"""Multiplications and additions in one turn of the loop of `ncgen_arithmetic`."""

@cache
def _repeater():
    ffi = FFI()
    ffi.include(_abi())
    ffi.cdef(verbatim("c/timing.c").split("/* begin functions */")[1].split("/* end functions */")[0])
    files = {name: verbatim(f"c/{name}") for name in ("timing.c", "ncgen.h")}
    return ffi, ffi.dlopen(str(build(files, find_compiler(), SCALAR).library))


@dataclass
class Call:
    """A kernel's function in C and how many numbers it writes; owner: the library, which must live as long."""

    function: object
    size: int
    owner: object
    out: np.ndarray = field(init=False)

    def __post_init__(self):
        self.out = np.empty(self.size)


def runner(t: float, q, v, p, positions: list[Call], velocity: Call | None = None):
    """A function run(times) that calls up to two kernels of the position and one of the velocity; it fills their `out`."""
    ffi, library = _repeater()
    inputs = [np.ascontiguousarray(a, dtype=float) for a in (q, v, p)]
    first, second, *_ = [*positions, None, None]
    arguments = []
    for call in (first, second, velocity):
        arguments += [ffi.NULL, ffi.NULL] if call is None else [call.function, ffi.cast("double *", call.out.ctypes.data)]
    pointers = [ffi.cast("double *", a.ctypes.data) for a in inputs]

    def run(times: int) -> None:
        library.ncgen_repeat(times, t, *pointers, *arguments)

    run.buffers = inputs, positions, velocity  # the pointers live as long as the buffers do
    return run


def arithmetic():
    """A function run(times): plain multiplications and additions, OPERATIONS of them each time."""
    _, library = _repeater()
    return lambda times: library.ncgen_arithmetic(times, 0.5, 0.25)
