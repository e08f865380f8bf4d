"""Functions between bounds: every operation's bounds hold, against 30 digits, and are as narrow as those of a polynomial of that degree."""

from __future__ import annotations

import re

import mpmath
import numpy as np
import pytest
from enclosing import Enclosing

from ncgen.emit.runtime_files import runtime_text
from ncgen.program.motions.condition_formulas import KINDS

TWO = ("add", "sub", "mul", "div", "atan2")

EXACT = {
    "add": lambda u, v: u + v,
    "sub": lambda u, v: u - v,
    "mul": lambda u, v: u * v,
    "div": lambda u, v: u / v,
    "neg": lambda u: -u,
    "sqrt": mpmath.sqrt,
    "sin": mpmath.sin,
    "cos": mpmath.cos,
    "exp": mpmath.exp,
    "log": mpmath.log,
    "atan2": mpmath.atan2,
    "abs": abs,
    "sign": mpmath.sign,
}


def polynomial_at(c, x):
    """A sum of Chebyshev polynomials, with 30 digits, by Clenshaw's recurrence."""
    first = second = mpmath.mpf(0)
    constant, *others = map(float, c)
    for a in reversed(others):
        first, second = a + 2 * x * first - second, first
    return constant + x * first - second


def test_sums_of_polynomials():
    """The recurrence is the sum of mpmath's own polynomials."""
    random = np.random.default_rng(1)
    with mpmath.workdps(30):
        for degree in (1, 2, 8, 14):
            c, x = random.uniform(-1, 1, degree), mpmath.mpf(random.uniform(-1, 1))
            expected = mpmath.fsum(a * mpmath.chebyt(k, x) for k, a in enumerate(c.tolist()))
            assert abs(polynomial_at(c, x) - expected) < 1e-27


def arguments(name, random, degree):
    """Random polynomials of size 0.01 to 10 that vary by 1e-4 to 1 of what they are; positive for roots and logarithms."""
    for _ in range(2 if name in TWO else 1):
        varies, size = 10.0 ** random.uniform(-4, 0), 10.0 ** random.uniform(-2, 1)
        c = random.uniform(-1, 1, degree) * varies * 0.5 ** np.arange(degree)
        c[0] = float(random.choice([-1, 1])) * (1.0 if name in ("sqrt", "log", "div", "atan2") else random.uniform(0, 1))
        c *= size
        if name in ("sqrt", "log"):
            c[0] = abs(c[0])
            c[1:] *= 0.7 * c[0] / max(np.sum(np.abs(c[1:])), c[0])
        yield c


def test_operations_in_c():
    """Kinds of operations have the same numbers in C."""
    text = runtime_text("ncgen_runtime.h")
    names = re.findall(r"NCGEN_FORMULA_(\w+)", text[text.index("enum {\n    NCGEN_FORMULA_") :].split("};")[0])
    other = {"number": "const", "time": "t", "parameter": "p", "subtract": "sub", "multiply": "mul", "divide": "div", "negate": "neg"}
    assert tuple(other.get(name.lower(), name.lower()) for name in names) == tuple({"pieces": "lookup"}.get(k, k) for k in KINDS)


@pytest.mark.parametrize("degree", [8, 14])
@pytest.mark.parametrize("name", EXACT)
def test_bounds_hold(name, degree):
    random, enclosing = np.random.default_rng([degree, *name.encode()]), Enclosing(degree)
    narrow = total = 0
    with mpmath.workdps(30):
        for _ in range(60):
            given = list(arguments(name, random, degree))
            w = enclosing(name, *(enclosing.polynomial(c) for c in given))
            if not w.error < 1e30:
                continue
            for x in (*random.uniform(-1, 1, 8), -1.0, 1.0):
                exact = EXACT[name](*(polynomial_at(c, mpmath.mpf(float(x))) for c in given))
                assert abs(exact - polynomial_at(w.c, mpmath.mpf(float(x)))) <= w.error, (name, given, x)
            total, narrow = total + 1, narrow + (w.error < 1e-3)
    assert total > 30 and narrow > total / 3 - 20 * (name in ("abs", "sign"))
