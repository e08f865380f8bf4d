"""Every elementary function with variables and constants for arguments, in every number type, against mpmath.

Arguments are short binary fractions, exact in all types. Where mpmath finds a complex number, a real function has none: NaN.
"""

from __future__ import annotations

from functools import cache
from types import SimpleNamespace

import mpmath
import numpy as np
import pytest
import sympy
from cffi import FFI

import ncgen
from ncgen.mechanism.kernel_batch import LANES, CompiledBatch
from ncgen.mechanism.library import CompiledKernels
from ncgen.program.ir.functions import FUNCTIONS
from ncgen.program.ir.graph import Graph
from ncgen.toolchain.cache import build
from ncgen.toolchain.compilers import FLAGS, find_compiler

DIGITS = 40
IN_MPMATH = {name: getattr(mpmath, name) for name in FUNCTIONS if name not in ("abs", "pow")} | {"abs": mpmath.fabs, "pow": mpmath.power}

FIXED, LITERALS = 0.625, (2.0, 0.5, -1.5)
"""Constants: a component of a fixed point, and numbers in the expression."""

POINTS = [(0.375, 0.75), (-0.5, 0.3125), (0.8125, -1.25), (-0.25, -0.5), (2.5, 3.0), (-2.0, 3.0)]
RATES = (0.75, -1.25)


def cases() -> list[SimpleNamespace]:
    """One a row: the function's name, and its arguments, of which "u", "v" are coordinates, "f" the fixed one, others numbers."""
    found = []
    for name, function in FUNCTIONS.items():
        constants = ("f", *LITERALS)
        patterns = [("u",)] if function.arity == 1 else [("u", "v"), *(("u", c) for c in constants), *((c, "u") for c in constants)]
        found += [SimpleNamespace(name=name, arguments=arguments) for arguments in patterns if (name, arguments) != ("pow", (-1.5, "u"))]
    return found


CASES = cases()


@cache
def sources():
    """All cases as rows of one model, which need not make sense."""
    m = ncgen.Model("functions")
    B, A = m.point("B", (0.375, 0.75)), m.point("A", (FIXED, 0.0), fixed=True)
    symbols = {"u": B.x.symbol, "v": B.y.symbol, "f": A.x.symbol}
    for case in CASES:
        arguments = (symbols.get(a, a) for a in case.arguments)
        m.constrain(getattr(sympy, FUNCTIONS[case.name].sympy)(*map(sympy.sympify, arguments)), f"{case.name}{case.arguments}")
    return ncgen.generate(m)


BRIDGE = r"""
#include "functions.h"

/* A kernel in any number type from doubles to pairs of doubles. */
void bridge(int kernel, const double *q, const double *qd, int size, double *high, double *low)
{
    const ncgen_model *m = functions_model();
    ncgen_real position[2], velocity[2], out[1000];
    for (int i = 0; i < 2; ++i) {
        position[i] = (ncgen_real)q[i];
        velocity[i] = (ncgen_real)qd[i];
    }
    if (kernel == 2)
        m->gamma(0, position, velocity, (const ncgen_real *)0, out);
    else
        (kernel ? m->phi_q : m->phi)(0, position, (const ncgen_real *)0, out);
    for (int i = 0; i < size; ++i) {
        high[i] = (double)out[i];
        low[i] = (double)(out[i] - (ncgen_real)high[i]);
    }
}
"""

TYPES = {
    "float": (("-DNCGEN_SINGLE",), 2.0**-23),
    "double": ((), 2.0**-52),
    "long double": (("-DNCGEN_LONG_DOUBLE",), 2.0**-63),
    "__float128": (("-DNCGEN_QUAD",), 2.0**-106),
}
"""The flags of every number type, and its rounding, or that of the pairs of doubles by which it is handed over."""

KERNELS = ("phi", "phi_q", "gamma")


def in_type(number: str):
    """(kernel, q) -> numbers with all digits of a type."""
    flags, _ = TYPES[number]
    libraries = ("-lquadmath", "-lm") if number == "__float128" else ("-lm",)
    ffi = FFI()
    ffi.cdef("void bridge(int, const double *, const double *, int, double *, double *);")
    library = ffi.dlopen(str(build(sources().c | {"bridge.c": BRIDGE}, find_compiler(), (*FLAGS, *flags), libraries).library))

    def values(kernel, q):
        size = sources().programs.programs[kernel].size
        assert size <= 1000
        pairs = [np.empty(size), np.empty(size)]
        places = [ffi.from_buffer("double[]", a) for a in (np.array(q), np.array(RATES), *pairs)]
        library.bridge(KERNELS.index(kernel), *places[:2], size, *places[2:])
        with mpmath.workdps(DIGITS):
            return [mpmath.mpf(high) + (low if np.isfinite(high) else 0) for high, low in zip(*map(np.ndarray.tolist, pairs), strict=True)]

    return values


def in_numpy(kernel, q):
    kernels = ncgen.compile(sources(), "numpy")
    with np.errstate(invalid="ignore"):
        return [mpmath.mpf(x) for x in kernels.values(kernel, 0.0, np.array(q), np.array(RATES), None).tolist()]


def function(case):
    """A case as a function of u and v."""

    def value(u, v):
        at = {"u": u, "v": v, "f": mpmath.mpf(FIXED)}
        return IN_MPMATH[case.name](*(at.get(a, a) if isinstance(a, str) else mpmath.mpf(a) for a in case.arguments))

    return value


def real(x):
    """A number of mpmath as the real function has it."""
    x = mpmath.mpmathify(x)
    return mpmath.nan if abs(x.imag) > mpmath.mpf(10) ** -20 * abs(x) else x.real


@cache
def expected(kernel: str) -> list[list]:
    """What the numbers of a kernel are at all points."""
    with mpmath.workdps(DIGITS):
        return [[real(x) for x in _expected(kernel, *map(mpmath.mpf, q))] for q in POINTS]


def _expected(kernel, u, v):
    if kernel == "phi":
        return [function(case)(u, v) for case in CASES]
    if kernel == "phi_q":
        places = sources().programs.phi_q.positions()
        return [mpmath.diff(function(CASES[row]), (u, v), (1 - column, column)) for row, column in places]
    du, dv = map(mpmath.mpf, RATES)
    return [-mpmath.diff(lambda e, case=case: function(case)(u + e * du, v + e * dv), 0, 2) for case in CASES]


def assert_right(values, rounding: float):
    """All kernels at all points: functions to a few units in the last place, derivatives to rounding.

    Constants of derivatives such as log 2 are doubles in every type."""
    for kernel in KERNELS:
        few = 4 * rounding if kernel == "phi" else 64 * max(rounding, 2.0**-52)
        for q, wanted in zip(POINTS, expected(kernel), strict=True):
            found = values(kernel, q)
            assert len(found) == len(wanted)
            for i, (x, y) in enumerate(zip(found, wanted, strict=True)):
                row = list(sources().programs.phi_q.positions())[i][0] if kernel == "phi_q" else i
                with mpmath.workdps(DIGITS):
                    close = mpmath.isnan(x) if mpmath.isnan(y) else abs(x - y) <= few * abs(y)
                assert close, (kernel, q, CASES[row], mpmath.nstr(x, 36), mpmath.nstr(y, 36))


@pytest.mark.parametrize("number", TYPES)
def test_every_function_in_c(number):
    assert_right(in_type(number), TYPES[number][1])


def test_every_function_in_numpy():
    assert_right(in_numpy, 2.0**-52)


@pytest.mark.parametrize("lanes", [4, 8])
def test_every_function_in_lanes(lanes):
    """All points side by side, the last block not full."""
    kernels = ncgen.compile(sources(), "c")
    batch = CompiledBatch(kernels, (*LANES, f"-DNCGEN_LANES={lanes}"), least=0.0)
    q = np.array(POINTS)
    rows = {name: batch.values(name, 0.0, q, np.tile(RATES, (len(q), 1)), None) for name in KERNELS}
    assert all(batch.in_lanes(name) for name in KERNELS)
    assert_right(lambda kernel, at: [mpmath.mpf(x) for x in rows[kernel][POINTS.index(at)].tolist()], 2.0**-52)


@pytest.mark.parametrize("lanes", [4, 8])
def test_lanes_at_the_ends_of_the_numbers(lanes):
    """Zeros of both signs, infinities, NaN: the bits that one state has alone."""
    plain = (*FLAGS, "-ffp-contract=off")
    kernels = CompiledKernels(sources().programs, build(sources().c, find_compiler(), plain).library)
    batch = CompiledBatch(kernels, (*LANES, "-ffp-contract=off", f"-DNCGEN_LANES={lanes}"), least=0.0)
    ends = (0.0, -0.0, 1.0, -1.0, np.inf, -np.inf, np.nan)
    q = np.array([(u, v) for u in ends for v in ends])
    qd = np.tile(RATES, (len(q), 1))
    for name in KERNELS:
        together = batch.values(name, 0.0, q, qd, None)
        alone = np.array([kernels.values(name, 0.0, x, v, None) for x, v in zip(q, qd, strict=True)])
        assert np.array_equal(together, alone, equal_nan=True)
        number = ~np.isnan(alone)
        assert np.array_equal(np.signbit(together)[number], np.signbit(alone)[number])


def test_constants_alone():
    """A function of constants is a constant, whatever its arguments are."""
    graph = Graph()
    for name, function_ in FUNCTIONS.items():
        for arguments in [(0.625,), (0.25,)] if function_.arity == 1 else [(0.625, 2.0), (2.0, 0.625), (0.75, -1.5)]:
            value = graph.value(graph.call(name, *map(graph.const, arguments)))
            with mpmath.workdps(DIGITS):
                wanted = IN_MPMATH[name](*map(mpmath.mpf, arguments))
                assert abs(value - wanted) <= 2 * 2.0**-52 * abs(wanted), (name, arguments)
