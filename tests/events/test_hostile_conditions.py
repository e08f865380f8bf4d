"""Conditions with every function, with kinks, jumps, poles and plateaus: a block moves at 1 m/s from 0, so that s is the time."""

from __future__ import annotations

import math

import numpy as np
import pytest
import sympy as sp
from scipy.interpolate import CubicSpline
from sliding import sliding_block

import ncgen


def times(when, seconds=4.0, direction="either") -> list[tuple[float, str]]:
    """When and how a condition of (s, model) is found."""
    m, s = sliding_block("clock")
    m.event("seen", when=when(s, m), direction=direction)
    run = ncgen.simulate(ncgen.compile(m), seconds, qd0={"s": 1.0}, points=2)
    return [(each.t, each.search) for each in run.events if each.search != "start"]


FUNCTIONS = {
    "tan": (lambda s, m: sp.tan(s / 4) - 0.5, [4 * math.atan(0.5)]),
    "asin": (lambda s, m: sp.asin(s / 5) - 0.5, [5 * math.sin(0.5)]),
    "acos": (lambda s, m: sp.acos(s / 5) - 1, [5 * math.cos(1)]),
    "atan": (lambda s, m: sp.atan(s - 2) - 1, [2 + math.tan(1)]),
    "atan2": (lambda s, m: sp.atan2(s - 2, s + 1) - 0.2, [(2 + math.tan(0.2)) / (1 - math.tan(0.2))]),
    "sinh": (lambda s, m: sp.sinh(s) - 3, [math.asinh(3)]),
    "cosh": (lambda s, m: sp.cosh(s - 2) - 2, [2 - math.acosh(2), 2 + math.acosh(2)]),
    "tanh": (lambda s, m: sp.tanh(s - 1) - 0.5, [1 + math.atanh(0.5)]),
    "exp": (lambda s, m: sp.exp(-s) - 0.1, [math.log(10)]),
    "log": (lambda s, m: sp.log(s + 1) - 1, [math.e - 1]),
    "a power": (lambda s, m: (s + 1) ** sp.Rational(7, 3) - 9, [9 ** (3 / 7) - 1]),
    "a variable power": (lambda s, m: (s + 1) ** (s / 2) - 2, None),
    "a law of time": (lambda s, m: sp.sin(20 * m.time) * sp.exp(-m.time) - 0.3, None),
    "a parameter": (lambda s, m: sp.sin(m.parameter("w", 3.0).symbol * s) - 0.5, None),
}


@pytest.mark.parametrize("name", FUNCTIONS)
def test_every_function(name):
    when, expected = FUNCTIONS[name]
    if expected is None:
        t = sp.Symbol("t", real=True)
        m, s = sliding_block("formula")
        formula = sp.sympify(when(s, m))
        formula = formula.subs({symbol: 3.0 if symbol.name == "w" else t for symbol in formula.free_symbols})
        value = sp.lambdify(t, formula)
        grid = np.linspace(0, 4, 40_001)
        changes = np.flatnonzero(np.diff(np.sign(value(grid))))
        expected = [float(sp.nsolve(formula, t, (grid[k], grid[k + 1]), solver="bisect", tol=1e-14)) for k in changes]
    found = times(when)
    assert [t for t, _ in found] == pytest.approx(expected, rel=1e-11) and len(found) > 0
    assert {search for _, search in found} == {"interval"}


def test_a_distance_that_passes_zero():
    """The root has a kink at the centre, which is no crossing; the circle around it is passed twice."""
    found = times(lambda s, m: sp.sqrt((s - 2) ** 2) - 0.25)
    assert [t for t, _ in found] == pytest.approx([1.75, 2.25], rel=1e-12) and {search for _, search in found} == {"interval"}
    assert times(lambda s, m: sp.sqrt((s - 2) ** 2)) == []


def test_kinks_at_zero():
    """|x| − x is 0 on one side, x + |x|/2 has a kink where it passes zero."""
    assert len(times(lambda s, m: sp.Abs(s - 2) - (s - 2), direction="rising")) == 0
    found = times(lambda s, m: (s - 2) + sp.Abs(s - 2) / 2)
    assert found == [(pytest.approx(2.0, rel=1e-12), "interval")]


def test_a_plateau_at_zero():
    """It is zero up to 2 s, by terms that cancel, and rises from there on: nothing crosses."""
    for when in (lambda s, m: sp.Max(s, 2) - 2, lambda s, m: sp.Abs(s - 2) + (s - 2), lambda s, m: sp.sin(sp.Abs(s - 2) + (s - 2))):
        assert times(when, 3.0, "rising") == [] and times(when, 3.0, "falling") == []


def test_poles_and_jumps():
    """A tangent rises through zero, and falls over it at its pole, where it has no bounds."""
    found = times(lambda s, m: sp.tan(s) - 1, direction="rising")
    assert [t for t, _ in found] == pytest.approx([math.pi / 4, 5 * math.pi / 4], rel=1e-11)
    found = times(lambda s, m: sp.sign(s - 2) * (1 + s), direction="rising")
    assert found == [(pytest.approx(2.0, rel=1e-9), "interval")]


@pytest.mark.parametrize("period", [0.0, 2.0])
def test_splines(period):
    """Against scipy's, whose polynomials are the same."""
    knots, values = np.linspace(0.0, 2.0, 9), [0.0, 1.0, -0.5, 0.7, 0.2, -1.0, 0.3, 0.9, 0.0]
    kind = "periodic" if period else "natural"
    curve = CubicSpline(knots, values, bc_type=kind)

    def when(s, m):
        return m.spline("curve", knots.tolist(), values, end=kind)(s) - 0.25

    found = times(when, 1.9 if not period else 3.9)
    roots = [t for t in curve.solve(0.25, extrapolate=False)]
    expected = [t for k in range(2 if period else 1) for t in np.add(roots, k * period) if t < (3.9 if period else 1.9)]
    assert [t for t, _ in found] == pytest.approx(expected, rel=1e-10) and {search for _, search in found} == {"interval"}


def test_a_very_long_condition_is_sampled():
    found = times(lambda s, m: sum(sp.sin(k * s / 50) for k in range(1, 200)) - 20, seconds=1.0)
    assert {search for _, search in found} == {"sampled"}
