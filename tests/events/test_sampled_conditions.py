"""Loads and conditions with inputs that vary faster than the motion: no crossing is missed in steps that are long for them."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.optimize import brentq

import ncgen

LIMIT, PUSH = 2.943, 3.0


def block(push=None, event=None):
    """A block of 1 kg with dry friction, pushed by an input. push: Model → force; event: (Model, slide) → condition"""
    m = ncgen.Model("block")
    axis = m.vector("axis", (1, 0, 0), fixed=True)
    O, A = m.point("O", (0, 0), fixed=True), m.point("A", (1, 0), fixed="y")
    s = m.slide("s", O, A, axis)
    m.body("block", [A], mass=1.0)
    if event:
        m.event("seen", when=event(m, s), direction="either")
        return m
    m.torque(s, push(m) if push else m.input("F"))
    m.friction(s, coulomb=LIMIT)
    return m


def crossings(f, end, count):
    """Times at which a function passes zero, from values at `count` equal distances."""
    t = np.linspace(0, end, count)
    values = np.array([f(x) for x in t])
    return [brentq(f, t[k], t[k + 1], xtol=1e-15, rtol=1e-15) for k in np.flatnonzero(values[:-1] * values[1:] < 0)]


def slips_and_sticks(frequency, half_periods):
    """By the closed form: it slips where the push exceeds the limit, and sticks where ∫ (F − limit) dt is zero again."""
    w, expected = 2 * math.pi * frequency, []
    begins = math.asin(LIMIT / PUSH) / w

    def velocity(t):
        return PUSH / w * (math.cos(w * begins) - math.cos(w * t)) - LIMIT * (t - begins)

    ends = brentq(velocity, begins + 0.01 / frequency, 0.5 / frequency, xtol=1e-16, rtol=1e-15)
    for k in range(half_periods):
        expected += [("slips", begins + k / 2 / frequency), ("sticks", ends + k / 2 / frequency)]
    return expected


@pytest.mark.parametrize("frequency", [1.0, 20.0])
def test_a_pushed_block_slips_in_every_half_period(frequency):
    kernels, w = ncgen.compile(block()), 2 * math.pi * frequency
    run = ncgen.simulate(kernels, 3.0 / frequency, inputs={"F": lambda t: PUSH * math.sin(w * t)}, rtol=1e-12, atol=1e-14)
    expected = [("sticks", 0.0), *slips_and_sticks(frequency, 6)]
    assert [(each.transition, pytest.approx(each.t, abs=1e-10)) for each in run.events] == expected


@pytest.mark.filterwarnings("ignore:block. the energy changes")
def test_many_oscillations_in_a_step():
    """At rest for 35 s and 708 oscillations, with more than 20 in a step, until a peak exceeds the limit."""

    def push(t):
        return 2.5 * (1 + 0.005 * t) * math.sin(40 * math.pi * t)

    kernels = ncgen.compile(block())
    first = min(crossings(lambda t: abs(push(t)) - LIMIT, 36.0, 400_001))
    resting = ncgen.simulate(kernels, first - 0.01, points=2, inputs={"F": push})
    assert [each.transition for each in resting.events] == ["sticks"] and 20 * resting.statistics.steps < 20 * first
    run = ncgen.simulate(kernels, 36.0, points=2, inputs={"F": push})
    assert [each.transition for each in run.events[:2]] == ["sticks", "slips"] and run.events[1].t == pytest.approx(first, abs=1e-10)


def test_a_condition_of_a_state_and_an_input():
    """Of a block with 1 m/s: (1 + t) sin(30 t) = 2, of which the first peak beyond is at 1.1 s."""
    kernels = ncgen.compile(block(event=lambda m, s: s * m.input("wave") - 2))
    run = ncgen.simulate(kernels, 3.0, points=2, qd0={"s": 1.0}, inputs={"wave": lambda t: math.sin(30 * t)})
    expected = crossings(lambda t: (1 + t) * math.sin(30 * t) - 2, 3.0, 100_001)
    assert len(expected) > 15 and run.statistics.steps < 2 * len(expected) + 10
    assert [each.t for each in run.events] == pytest.approx(expected, abs=1e-10)
    assert {each.search for each in run.events} == {"sampled"}


def test_a_smooth_load_takes_three_values_more_than_nodes():
    """Of a step at rest: 12 stages, 8 nodes and 3 places between them; 520 at most are asked besides, for the checks of the run."""
    asked = []
    kernels = ncgen.compile(block())
    run = ncgen.simulate(kernels, 3.0, points=2, inputs={"F": lambda t: asked.append(t) or math.exp(-t)})
    assert [each.transition for each in run.events] == ["sticks"]
    assert len(set(asked)) <= (12 + 8 + 3) * run.statistics.steps + 520


def test_a_push_that_jumps_below_the_limit_moves_nothing():
    """No polynomial follows ± 2.9 N; at the narrowest part of a step values count, of which none is beyond 2.943 N."""
    run = ncgen.simulate(ncgen.compile(block()), 3.0, points=2, inputs={"F": lambda t: math.copysign(2.9, math.sin(7 * t))})
    assert [each.transition for each in run.events] == ["sticks"] and run["s"][-1] == 1.0
