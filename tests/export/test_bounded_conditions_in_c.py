"""Conditions that are no polynomials in exported C: they are bounded there as in ncgen's own runs."""

from __future__ import annotations

import math

import pytest
import sympy as sp
from eventful import G
from test_events_of_exports import STRICT, run_in_c

import ncgen


def hills() -> ncgen.Model:
    m = ncgen.Model("hills")
    P = m.point("P", (2, 4.5))
    m.body("ball", [P], mass=1.0)
    m.gravity((0, -9.81))
    m.event("hill", when=P.y - sp.sin(P.x) - sp.cos(4 * P.x) / 5 - 3, do=ncgen.impact(restitution=0.99))
    m.event("near", when=sp.atan2(P.y - 3.5, P.x) - 0.3, direction="rising")
    return m


@pytest.mark.parametrize("flags", [f"-O1 {STRICT}", "-O1 -fsanitize=address,undefined"])
def test_a_ball_on_hills(tmp_path, flags):
    events, last, counts, _, said = run_in_c(hills(), tmp_path, 4.0, flags=flags)
    own = ncgen.simulate(ncgen.compile(hills()), 4.0, rtol=1e-12, atol=1e-12)
    assert said == "ok" and sum(counts) == len(own.events) > 4
    assert [row[0] for row in events] == pytest.approx([each.t for each in own.events], rel=1e-8)


def test_a_crossing_inside_one_step(tmp_path):
    """A ball at its apex for 9 µs, by the sine of its height: its step is longer than a second."""
    m = ncgen.Model("thrown")
    P = m.point("P", (0, 0))
    m.body("ball", [P], mass=1.0)
    m.gravity((0, -G))
    m.event("seen", when=sp.sin(P.y) - math.sin(1.0 - 1e-10), direction="either")
    m.simulation(duration=1.0, qd0={"P.x": 1.0, "P.y": math.sqrt(2 * G)})
    events, *_ = run_in_c(m, tmp_path, 1.0, tolerance=1e-9)
    apex, half = math.sqrt(2 / G), math.sqrt(2e-10 / G)
    assert [row[0] for row in events] == pytest.approx([apex - half, apex + half], abs=1e-10)
