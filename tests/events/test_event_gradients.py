"""Derivatives through events, against closed forms, complex steps and differences of runs."""

from __future__ import annotations

import math

import numpy as np
import pytest
from sliding import sliding_block

import ncgen

G = 9.81


def bouncing():
    """A ball that falls from h with restitution e under gravity g."""
    m = ncgen.Model("ball")
    h, e, g = m.parameter("h", 1.0), m.parameter("e", 0.5), m.parameter("g", G)
    P = m.point("P", (0, h), fixed="x")
    m.body("ball", [P], mass=1.0)
    m.force(P, (0, -g))
    m.event("floor", when=P.y, do=ncgen.impact(restitution=e))
    return m


def test_one_bounce():
    """y(0.7) = e √(2 g h) (T − t₁) − g (T − t₁)²/2 with t₁ = √(2 h/g); both ways."""
    kernels = ncgen.compile(bouncing())
    expected = {"h": 0.3254596319867606, "e": 1.100612842649014, "g": -0.007950088482491275}
    found = ncgen.sensitivities(kernels, 0.7, 7, by=list(expected))
    assert found.q[-1] == pytest.approx([0.2474692639735212], rel=1e-12)
    assert found.q_by[-1, 0] == pytest.approx(list(expected.values()), rel=1e-9)
    (floor,) = found.events
    t, v = math.sqrt(2 / G), math.sqrt(2 * G)
    assert floor.t == pytest.approx(t, rel=1e-13) and floor.name == "floor"
    assert floor.t_by == pytest.approx([t / 2, 0.0, -t / 2 / G], rel=1e-10, abs=1e-12)
    assert floor.before_by[0] == pytest.approx([-v / 2, 0.0, -v / 2 / G], rel=1e-10, abs=1e-12)
    assert floor.after_by[0] == pytest.approx([v / 4, v, v / 4 / G], rel=1e-10, abs=1e-12)
    assert floor.q_by == pytest.approx(0.0, abs=1e-12)

    def height(q, qd):
        weight = np.zeros_like(q)
        weight[-1, 0] = 1.0
        return q[-1, 0], weight, None

    back = ncgen.gradient(kernels, 0.7, 7, height, by=list(expected))
    assert [back.slopes[name] for name in expected] == pytest.approx(list(expected.values()), rel=1e-9)


def test_the_period_of_a_block_on_a_belt():
    """Seen from the belt: slip 2π − 2 atan((F_s − F_c)/v) and stick 2 (F_s − F_c)/v for m = k = 1, from slip to slip."""
    m, u = sliding_block("belt")
    v, static = m.parameter("v", 3.0), m.parameter("static", 5.0)
    m.torque(u, -(u + v * m.time))
    m.friction(u, coulomb=3.0, static=static, name="belt")
    found = ncgen.sensitivities(ncgen.compile(m), 7.8, 1000, by=["v", "static"], q0={"s": 1.0, "A.x": 1.0})
    slips = [each for each in found.events if each.what == "slips"]
    assert slips[1].t - slips[0].t == pytest.approx(6.440513433417785, rel=1e-10)
    assert slips[1].t_by - slips[0].t_by == pytest.approx([-0.1367521367521368, 0.2051282051282051], rel=1e-9)


def stopped_fourbar(stop=0.6, restitution=0.4):
    """The four-bar, whose input angle hits a stop."""
    m = ncgen.load("fourbar")
    limit, e = m.parameter("limit", stop), m.parameter("e", restitution)
    psi = next(each for each in m.coordinates if each.name == "psi")
    m.stop(psi, lower=limit, restitution=e)
    return m
