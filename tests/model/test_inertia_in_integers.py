"""The inertia of a body over its basis, computed in integers, beside the formula in sympy's rational numbers."""

import random
from fractions import Fraction

import pytest
import sympy

from ncgen.symbolic.integer_inertia import standard_in_integers


def by_formula(mass, offset, tensor, axes):
    """S = [m, m aᵀ; m a, Z] with a = X⁻¹ d, Z = X⁻¹ (½ tr(I) 1 − I + m d dᵀ) X⁻ᵀ."""
    X = sympy.Matrix(3, 3, [sympy.Rational(axes[column][row]) for row in range(3) for column in range(3)])
    d, inertia, m = sympy.Matrix([*map(sympy.Rational, offset)]), sympy.Matrix(3, 3, [*map(sympy.Rational, tensor)]), sympy.Rational(mass)
    inverse = X.inv()
    a = inverse * d
    Z = inverse * (inertia.trace() / 2 * sympy.eye(3) - inertia + m * d * d.T) * inverse.T
    return sympy.Matrix([[m, *(m * a)], *([m * a[k], *Z.row(k)] for k in range(3))])


@pytest.mark.parametrize("seed", range(12))
def test_entries_are_exact(seed):
    """For lengths from micrometres to kilometres, in bases of either hand."""
    draw = random.Random(seed)
    size, mass = 10.0 ** draw.randint(-6, 3), Fraction(10.0 ** draw.uniform(-3, 3))
    axes = [[Fraction(size * draw.uniform(-1, 1)) for _ in range(3)] for _ in range(3)]
    offset = [Fraction(size * draw.uniform(-1, 1)) for _ in range(3)]
    half = [[size**2 * draw.uniform(0, 1) for _ in range(3)] for _ in range(3)]
    tensor = [Fraction(half[i][j] + half[j][i]) for i in range(3) for j in range(3)]
    exact = standard_in_integers(mass, offset, tensor, axes, rounding=0.0)
    assert sympy.Matrix(4, 4, [sympy.Rational(x) for row in exact for x in row]) == by_formula(mass, offset, tensor, axes)


def test_what_is_rounding_counts_as_zero():
    """A centre of mass that misses the first axis by rounding."""
    axes = [[Fraction(float(i == k)) for i in range(3)] for k in range(3)]
    offset = [Fraction(0.5), Fraction(1e-17), Fraction(0)]
    exact = standard_in_integers(Fraction(2), offset, [Fraction(float(k % 4 == 0)) for k in range(9)], axes, rounding=1e-14)
    assert exact[0] == (2, 1, 0, 0)
    assert exact[2][2] == Fraction(1, 2)
