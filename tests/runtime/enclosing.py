"""The arithmetic of `ncgen_enclosure.c` in Python, on functions of x on [-1, 1]."""

from __future__ import annotations

from functools import cache
from math import cos, pi

import numpy as np
from cffi import FFI

from ncgen.program.motions.condition_formulas import KINDS

DECLARED = """
typedef struct ncgen_enclosure { double c[15]; double error; } ncgen_enclosure;
typedef struct ncgen_enclosing { int degree; const double *cosines; double rounding; } ncgen_enclosing;
void ncgen_enclose_number(const ncgen_enclosing *with, double x, ncgen_enclosure *w);
void ncgen_enclose(const ncgen_enclosing *with, int operation, const ncgen_enclosure *u, const ncgen_enclosure *v, const double *pieces,
                   ncgen_enclosure *w);
"""


class Enclosing:
    """Of one degree."""

    def __init__(self, degree: int) -> None:
        self.ffi, self.library = _library()
        self.degree = degree
        self._cosines = np.array([cos(pi * k / degree) for k in range(2 * degree)])
        pointer = self.ffi.from_buffer("double[]", self._cosines)
        self.struct = self.ffi.new("ncgen_enclosing *", (degree, pointer, 2 * (degree + 1) * float(np.finfo(float).eps)))

    def polynomial(self, coefficients):
        """From coefficients in Chebyshev's basis."""
        return self.ffi.new("ncgen_enclosure *", ([*coefficients, *[0.0] * (15 - len(coefficients))], 0.0))

    def __call__(self, name, u, v=None, pieces=None):
        w = self.ffi.new("ncgen_enclosure *")
        table = self.ffi.new("double[]", pieces) if pieces else self.ffi.NULL
        self.library.ncgen_enclose(self.struct, KINDS.index(name), u, v or self.ffi.NULL, table, w)
        return w


@cache
def _library():
    from ncgen.emit.runtime_files import needed_by, runtime_files
    from ncgen.toolchain.cache import build
    from ncgen.toolchain.compilers import find_compiler

    ffi = FFI()
    ffi.cdef(DECLARED)
    files = runtime_files(*needed_by("ncgen_enclosure.c"))
    return ffi, ffi.dlopen(str(build(files, find_compiler()).library))
