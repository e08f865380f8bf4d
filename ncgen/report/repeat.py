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

DECLARATIONS = """
int ncgen_repeat(int times, ncgen_real t, const ncgen_real *q, const ncgen_real *v, const ncgen_real *p,
                 ncgen_position_kernel *first, ncgen_real *first_out, ncgen_position_kernel *second, ncgen_real *second_out,
                 ncgen_velocity_kernel *third, ncgen_real *third_out);
ncgen_real ncgen_arithmetic(int times, ncgen_real a, ncgen_real b);
"""

SOURCE = """
#include "ncgen.h"
%s
int ncgen_repeat(int times, ncgen_real t, const ncgen_real *q, const ncgen_real *v, const ncgen_real *p,
                 ncgen_position_kernel *first, ncgen_real *first_out, ncgen_position_kernel *second, ncgen_real *second_out,
                 ncgen_velocity_kernel *third, ncgen_real *third_out)
{
    int status = NCGEN_OK;
    for (int i = 0; i < times; ++i) {
        if (first)
            status |= first(t, q, p, first_out);
        if (second)
            status |= second(t, q, p, second_out);
        if (third)
            status |= third(t, q, v, p, third_out);
    }
    return status;
}

ncgen_real ncgen_arithmetic(int times, ncgen_real a, ncgen_real b)
{
    /* twelve chains that differ, so that none is computed once for all */
    ncgen_real c = b, d = 2 * b, e = 3 * b, f = 4 * b, g = 5 * b, h = 6 * b;
    ncgen_real i = 7 * b, j = 8 * b, k = 9 * b, l = 10 * b, m = 11 * b, n = 12 * b;
    for (int r = 0; r < times; ++r) {
        c = c * a + b; d = d * a + b; e = e * a + b; f = f * a + b; g = g * a + b; h = h * a + b;
        i = i * a + b; j = j * a + b; k = k * a + b; l = l * a + b; m = m * a + b; n = n * a + b;
    }
    return c + d + e + f + g + h + i + j + k + l + m + n;
}
""" % DECLARATIONS


@cache
def _repeater():
    ffi = FFI()
    ffi.include(_abi())
    ffi.cdef(DECLARATIONS)
    files = {"repeat.c": SOURCE, "ncgen.h": verbatim("c/ncgen.h")}
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
