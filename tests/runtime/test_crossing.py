"""The first change of sign of a polynomial: every one is found, in C and in the reference, against roots that were chosen."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from cffi import FFI

from ncgen.mechanism.conditions_in_c import LINEAR, QUADRATIC, basis
from ncgen.solver.runs.crossing import SAMPLES, first_crossing

NOISE = 1000 * float(np.finfo(float).eps)

NOISES = {LINEAR: NOISE, QUADRATIC: 20 * NOISE}

DECLARED = """
typedef struct ncgen_basis { int degree; const double *nodes, *inverse; } ncgen_basis;
int ncgen_first_crossing(const ncgen_basis *basis, const double *values, int stride, double noise, int direction, int *sign, double *low,
                         double *high);
"""


@pytest.fixture(scope="module")
def in_c():
    from ncgen.emit.runtime_files import HEADERS, RUNTIME_HEADERS, runtime_files
    from ncgen.toolchain.cache import build
    from ncgen.toolchain.compilers import find_compiler

    ffi = FFI()
    ffi.cdef(DECLARED)
    names = (*RUNTIME_HEADERS, *HEADERS, "ncgen_space.h", "ncgen_vectors.h", "ncgen_crossing.h", "ncgen_crossing.c")
    library = ffi.dlopen(str(build(runtime_files(*names), find_compiler()).library))

    def call(values, noise, direction, sign=0):
        ends, last, (nodes, inverse) = ffi.new("double[2]"), ffi.new("int *", sign), basis(len(values) - 1)
        arrays = [ffi.from_buffer("double[]", a) for a in (nodes, inverse, values)]
        found = library.ncgen_first_crossing(
            ffi.new("ncgen_basis *", (len(values) - 1, *arrays[:2])), arrays[2], 1, noise, direction, last, ends, ends + 1
        )
        return (ends[0], ends[1]) if found else None

    return call


def polynomials(seed, count, degree=LINEAR):
    """(values at the samples, crossings [(root, direction)], how clearly the sign is seen between and beside them, relative to NOISE).

    Roots in (0, 1), half of them in pairs 1e-6 to 1e-2 apart, some double, a factor without roots; exact fractions.
    """
    random = np.random.default_rng(seed)
    for _ in range(count):
        roots: list[float] = []
        while len(roots) < random.integers(0, degree - 1):
            root = float(random.uniform(0, 1))
            roots += [root] if random.random() < 0.5 else [root, min(root + 10.0 ** float(random.uniform(-6, -2)), 1.0)]
        roots = sorted(roots[: degree - 2])  # and two more
        scale, lift = Fraction(float(random.choice([-1, 1]) * 10.0 ** random.uniform(-3, 3))), Fraction(float(random.uniform(0.01, 1)))
        middle = Fraction(float(random.uniform(-0.5, 1.5)))
        exact = [Fraction(root) for root in roots]

        def value(s, scale=scale, lift=lift, middle=middle, exact=exact):
            product = scale * (lift + (s - middle) ** 2)
            for root in exact:
                product *= s - root
            return product

        values = np.array([float(value(Fraction(s))) for s in basis(degree)[0].tolist()])
        places = [Fraction(0), *exact, Fraction(1)]
        between = [float(value((a + b) / 2)) for a, b in zip(places[:-1], places[1:], strict=True)]
        clear = min(abs(v) for v in between) / float(np.max(np.abs(values)))
        crossings = [(root, int(np.sign(after))) for root, after in zip(roots, between[1:], strict=True)]
        yield values, crossings, clear / NOISES[degree]


def compare(find, seed, count, degree=LINEAR):
    """How many were compared, and how many of these have a pair of roots; the others are nearer to each other than rounding tells."""
    compared = pairs = 0
    for values, crossings, clear in polynomials(seed, count, degree):
        if clear < 4:
            continue
        compared += 1
        pairs += any(b[0] - a[0] < 1e-3 for a, b in zip(crossings, crossings[1:], strict=False))
        noise = NOISES[degree] * float(np.max(np.abs(values)))
        for direction in (-1, 0, 1):
            expected = next((root for root, way in crossings if way * direction >= 0), None)
            found = find(values, noise, direction)
            assert (found is None) == (expected is None), (values, crossings)
            if expected is not None:
                low, high = found
                inside = [root for root, _ in crossings if low < root < high]
                assert inside == [expected], (values, crossings, found)
    return compared, pairs


def test_every_crossing_is_found(in_c):
    compared, pairs = compare(in_c, 1, 3000)
    assert compared > 2000 and pairs > 300


def test_every_crossing_of_products_is_found(in_c):
    """Of quadratic conditions: degree 14, half of whose polynomials have pairs that no double can tell."""
    compared, pairs = compare(in_c, 5, 7000, QUADRATIC)
    assert compared > 2000 and pairs > 200


@pytest.mark.slow
def test_every_crossing_of_many_is_found(in_c):
    compared, pairs = compare(in_c, 2, 100_000)
    assert compare(in_c, 6, 100_000, QUADRATIC)[0] > 30_000
    print(f"{compared} polynomials, {pairs} with roots less than 1e-3 apart: none missed, none false")
    assert compared > 70_000 and pairs > 10_000


def test_the_reference_finds_the_same(in_c):
    """Python and C walk through the same parts; only rounding is different, at the edge of the noise."""
    assert compare(first_crossing, 3, 200)[0] > 100
    for values, _, clear in polynomials(4, 200):
        if clear > 4:
            noise = NOISE * float(np.max(np.abs(values)))
            assert first_crossing(values, noise, 0) == in_c(values, noise, 0)


@pytest.mark.parametrize(
    ("law", "direction", "expected"),
    [
        pytest.param(lambda s: s - 1, 0, 1.0, id="ends at zero"),
        pytest.param(lambda s: s - 1, -1, None, id="ends at zero the other way"),
        pytest.param(lambda s: -s, 0, None, id="starts at zero"),
        pytest.param(lambda s: s * (s - 0.625), 1, 0.625, id="starts at zero and comes back"),
        pytest.param(lambda s: (s - 0.5) * 1.0, 1, 0.5, id="at the middle, where parts meet"),
        pytest.param(lambda s: (s - 0.25) * (s - 0.75), 1, 0.75, id="the second of two, both where parts meet"),
        pytest.param(lambda s: (s - 0.5) ** 2, 0, None, id="touches"),
        pytest.param(lambda s: 0.0 * s, 0, None, id="is zero"),
        pytest.param(lambda s: 1e-20 * (s - 0.3), 1, 0.3, id="is noise, but for its ends"),
    ],
)
def test_at_the_edges(in_c, law, direction, expected):
    values = np.array([law(s) for s in SAMPLES.tolist()])
    for find in (in_c, first_crossing):
        found = find(values, 1e-13, direction)
        assert found is None if expected is None else found is not None and found[0] < expected <= found[1]
