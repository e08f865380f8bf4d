"""Sine and cosine of all angles at once, against 50 digits."""

from __future__ import annotations

import mpmath
import numpy as np
import pytest
from cffi import FFI

SOURCE = """
#include "ncgen_math.h"
void at_once(int n, const ncgen_real *x, ncgen_real *sine, ncgen_real *cosine);
void at_once(int n, const ncgen_real *x, ncgen_real *sine, ncgen_real *cosine) { ncgen_sincos(n, x, sine, cosine); }
"""

CLAIMED = 0.8
"""Units in the last place, as ncgen_math.h says."""


@pytest.fixture(scope="module")
def at_once():
    from ncgen.emit.runtime_files import runtime_files
    from ncgen.toolchain.cache import build
    from ncgen.toolchain.compilers import find_compiler

    files = {"at_once.c": SOURCE} | runtime_files("ncgen.h", "ncgen_math.h")
    ffi = FFI()
    ffi.cdef("void at_once(int n, const double *x, double *sine, double *cosine);")
    library = ffi.dlopen(str(build(files, find_compiler()).library))

    def call(x):
        x = np.ascontiguousarray(x)
        sine, cosine = np.empty_like(x), np.empty_like(x)
        library.at_once(len(x), *(ffi.cast("double *", a.ctypes.data) for a in (x, sine, cosine)))
        return sine, cosine

    return call


def worst(x, found, function) -> float:
    """The largest error in units in the last place."""
    with mpmath.workdps(50):
        exact = [function(mpmath.mpf(v)) for v in x.tolist()]
        errors = [abs(e - mpmath.mpf(v)) / mpmath.mpf(float(np.spacing(abs(float(e))))) for e, v in zip(exact, found.tolist(), strict=True)]
    return float(max(errors))


def multiples():
    """Neighbours of multiples of a quarter turn, where all leading digits cancel."""
    x = np.arange(-600_000, 600_000, 1201) * (np.pi / 2)
    return np.concatenate([x, np.nextafter(x, np.inf), np.nextafter(x, -np.inf)])


@pytest.mark.parametrize(
    "x",
    [
        pytest.param(np.random.default_rng(1).uniform(-10, 10, 4000), id="some turns"),
        pytest.param(np.random.default_rng(2).uniform(-1e6, 1e6, 4000), id="many turns"),
        pytest.param(np.random.default_rng(3).uniform(1e6, 1e15, 500), id="beyond"),
        pytest.param(10.0 ** np.random.default_rng(4).uniform(-300, 0, 1000), id="small"),
        pytest.param(multiples(), id="quarter turns"),
    ],
)
def test_error(at_once, x):
    sine, cosine = at_once(x)
    assert worst(x, sine, mpmath.sin) <= CLAIMED
    assert worst(x, cosine, mpmath.cos) <= CLAIMED


def test_no_number_no_result(at_once):
    """Infinity and nan have no sine; zero keeps its sine, whatever stands beside it."""
    sine, cosine = at_once(np.array([np.nan, 0.0, np.inf, -np.inf]))
    assert np.array_equal(np.isnan(sine), [True, False, True, True])
    assert np.array_equal(np.isnan(cosine), [True, False, True, True])
    assert sine[1] == 0.0 and cosine[1] == 1.0


def test_a_place_does_not_matter(at_once):
    """An angle gives the same bits alone, in a group, and at its end: lanes are not told apart."""
    x = np.random.default_rng(5).uniform(-100, 100, 37)
    alone = [at_once(x[i : i + 1]) for i in range(len(x))]
    assert np.array_equal(at_once(x), np.concatenate(alone, axis=1))
