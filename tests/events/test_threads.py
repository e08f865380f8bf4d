"""A square thread, unwrapped: a nut on a slope of tan λ = 0.05 with the friction 0.1 of its own load."""

from __future__ import annotations

import math

import pytest

import ncgen

G, SLOPE, FRICTION = 9.81, 0.05, 0.1
LIFTING = 0.331666666666667
"""Efficiency of lifting, tan λ / tan(λ + φ)."""
LOWERING = math.tan(math.atan(FRICTION) - math.atan(SLOPE))
"""Push over weight that lowers it."""


@pytest.fixture(scope="module")
def nut() -> ncgen.Kernels:
    """1 kg, pushed horizontally, as a torque turns a screw."""
    m = ncgen.Model("nut")
    angle = math.atan(SLOPE)
    n = m.vector("n", (-math.sin(angle), math.cos(angle)), fixed=True)
    O, P = m.point("O", (0, 0), fixed=True), m.point("P", (0, 0))
    body = m.body("nut", [P], mass=1.0)
    m.gravity((0, -G))
    m.force(P, (m.parameter("push", 0.0), 0))
    m.contact("thread", body, P, m.ground, O, normal=n, friction=FRICTION)
    return ncgen.compile(m)


@pytest.mark.parametrize(
    ("push", "moves"),
    [
        (0.0, 0),
        (SLOPE / LIFTING * (1 - 1e-9), 0),
        (SLOPE / LIFTING * (1 + 1e-9), 1),
        (-LOWERING * (1 - 1e-9), 0),
        (-LOWERING * (1 + 1e-9), -1),
    ],
)
def test_it_locks_itself(nut, push, moves):
    """At rest it stays without a push, and until one exceeds that of lifting or lowering, by 1e-9 of it."""
    run = ncgen.simulate(nut, 1.0, p={"push": push * G}, points=2)
    held = [event.transition for event in run.events]
    assert ("slips" in held or "sticks" not in held) == bool(moves) and run["P.x"][-1] * moves >= 0
    assert moves or abs(run["P.x"][-1]) < 1e-12


@pytest.mark.parametrize(("push", "speed"), [(SLOPE / LIFTING, 1.0), (-LOWERING, -1.0)])
def test_it_moves_steadily(nut, push, speed):
    """Under these pushes its velocity does not change."""
    run = ncgen.simulate(nut, 2.0, rtol=1e-11, p={"push": push * G}, qd0={"P.x": speed, "P.y": speed * SLOPE}, points=3)
    assert run["rate(P.x)"] == pytest.approx([speed] * 3, rel=1e-12)
