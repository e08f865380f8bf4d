"""The table of elementary functions, beside sympy's own."""

from __future__ import annotations

import pytest
import sympy

from ncgen.program.ir.functions import FUNCTIONS

PLACES = (-0.7, 0.0, 0.4, 0.9)


@pytest.mark.parametrize("name", FUNCTIONS)
def test_functions_on_floats_are_those_of_sympy(name):
    """Wherever sympy has a finite, real value; there are some such places for each."""
    function, told = FUNCTIONS[name], 0
    for place in [(x,) for x in PLACES] if function.arity == 1 else [(x, y) for x in PLACES for y in PLACES]:
        expected = sympy.N(getattr(sympy, function.sympy)(*(sympy.Rational(str(x)) for x in place)), 30)
        if expected.is_real and expected.is_finite:
            assert function.python(*place) == pytest.approx(float(expected), rel=1e-15, abs=1e-16), place
            told += 1
    assert told >= 2
