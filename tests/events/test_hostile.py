"""Scenes that break solvers of events: several things at one instant, at the start, at limits. Right, or one line with names."""

from __future__ import annotations

import math

import numpy as np
import pytest
import sympy
from scipy.optimize import brentq
from sliding import sliding_block

import ncgen

G = 9.81


@pytest.mark.parametrize("side", [-1, 1])
def test_a_stop_and_friction_on_one_coordinate(side):
    """v² falls by 2 F x, is reversed at the stop, and falls again until the block sticks."""
    m, s = sliding_block("both")
    m.stop(s, -0.5, 0.5, restitution=0.8)
    m.friction(s, 1.0)
    kernels = ncgen.compile(m)
    run = ncgen.simulate(kernels, 3.0, rtol=1e-11, qd0={"s": 2.0 * side})
    hit, sticks = (event for event in run.events if event.t > 0)
    before = math.sqrt(4.0 - 1.0)
    back = 0.8 * before
    assert hit.name == f"s.stop.{'upper' if side > 0 else 'lower'}" and sticks.transition == "sticks"
    assert hit.before[kernels.index["s"]] == pytest.approx(side * before, rel=1e-10)
    assert sticks.t - hit.t == pytest.approx(back, rel=1e-10)
    assert run["s"][-1] == pytest.approx(side * (0.5 - back**2 / 2), rel=1e-9) and run.energy_drift < 1e-9


@pytest.mark.parametrize(("push", "rests"), [(3.0, True), (2.0, True), (-0.5, True), (-2.0, False)])
def test_a_block_that_comes_to_rest_at_its_stop_with_friction(push, rests):
    """Without restitution: pushed on, it rests; pulled back by less than friction, it stays as well."""
    m, s = sliding_block("both")
    m.torque(s, push)
    m.stop(s, upper=0.5)
    m.friction(s, 1.0)
    run = ncgen.simulate(ncgen.compile(m), 3.0, rtol=1e-11, qd0={"s": 5.0}, points=31)
    (hit,) = (event for event in run.events if event.name == "s.stop.upper" and not event.transition)
    after = run.t > hit.t
    if rests:
        assert np.ptp(run["s"][after]) < 1e-13
    else:
        assert run["s"][-1] == pytest.approx(0.5 - (2.0 - 1.0) * (3.0 - hit.t) ** 2 / 2, rel=1e-9)


@pytest.mark.parametrize(("pull", "slips"), [(-0.5, False), (0.5, False), (3.0, False), (-3.0, True)])
def test_a_start_at_a_stop_with_friction(pull, slips):
    """Stop and friction share the load of one coordinate; what the other one holds is not watched, and so does not chatter."""
    m, s = sliding_block("both")
    m.torque(s, pull)
    m.stop(s, upper=0.5)
    m.friction(s, 1.0)
    run = ncgen.simulate(ncgen.compile(m), 1.0, rtol=1e-11, q0={"s": 0.5, "A.x": 0.5}, points=3)
    assert len(run.events) <= 2
    assert run["s"][-1] == pytest.approx(0.5 - 1.0 if slips else 0.5, rel=1e-10)


@pytest.mark.parametrize("excess", [1e-3, 1e-9, 1e-12])
def test_a_push_that_only_just_exceeds_friction(excess):
    """It slips once and moves by excess t²/2, without chattering at the velocities of rounding."""
    m, s = sliding_block("pushed")
    m.torque(s, 1.0 + excess)
    m.friction(s, 1.0)
    run = ncgen.simulate(ncgen.compile(m), 2.0, rtol=1e-9, points=3)
    assert len(run.events) <= 2 and run["s"][-1] == pytest.approx(2 * excess, rel=1e-3, abs=1e-10)


def test_accelerations_from_the_start_have_friction():
    m, s = sliding_block("start")
    m.friction(s, 1.5)
    run = ncgen.simulate(ncgen.compile(m), 1.0, qd0={"s": -5.0}, points=3)
    assert run["rate(rate(s))"] == pytest.approx([1.5] * 3, rel=1e-12)


@pytest.mark.parametrize("depth", [0.1, 1e-6])
def test_a_compliant_stop_that_is_pressed_at_the_start(depth):
    """Half a period of the spring later it has left with all its energy."""
    m, s = sliding_block("pressed")
    m.stop(s, upper=0.0, stiffness=100.0)
    run = ncgen.simulate(ncgen.compile(m), 1.0, rtol=1e-11, atol=1e-18, q0={"s": depth, "A.x": depth})
    (left,) = run.events
    assert left.name == "s.stop.upper.left" and left.t == pytest.approx(math.pi / 20, rel=1e-9)
    assert run["rate(s)"][-1] == pytest.approx(-10 * depth, rel=1e-8)


def test_two_stops_at_once():
    """Of two blocks that do not touch each other, no law is needed; of two stops of one block the events are one instant."""
    m, s = sliding_block("two")
    P = m.point("P", (0, 1), fixed="y")
    m.body("other", [P], mass=2.0)
    m.stop(s, upper=0.5, restitution=0.5)
    m.stop(P.x, upper=0.5, restitution=1.0)
    run = ncgen.simulate(ncgen.compile(m), 1.0, qd0={"s": 1.0, "P.x": 1.0}, points=2)
    assert [event.name for event in run.events] == ["s.stop.upper", "P.x.stop.upper"] and len({event.t for event in run.events}) == 1
    assert [run["rate(s)"][-1], run["rate(P.x)"][-1]] == pytest.approx([-0.5, -1.0], rel=1e-12)


def test_two_stops_of_one_block_at_once():
    m, s = sliding_block("twice")
    m.stop(s, upper=0.5, restitution=0.5, name="near")
    m.stop("A.x", upper=0.5, restitution=0.5, name="far")
    with pytest.raises(ncgen.ModelError, match="several impacts at one instant, of near.upper, far.upper at t = 0.5 s.*of the element"):
        ncgen.simulate(ncgen.compile(m), 1.0, qd0={"s": 1.0})


def test_friction_without_limit():
    """What no force moves does not move, but for the square of rounding; what moves stops at once, but for a time of rounding."""
    m, s = sliding_block("welded")
    m.torque(s, 1e6)
    m.friction(s, 1e90)
    run = ncgen.simulate(ncgen.compile(m), 1.0)
    assert np.max(np.abs(run["s"])) < 1e-25
    with pytest.raises(ncgen.ModelError, match="inf is not a finite number"):
        m.friction(s, math.inf, name="endless")


def test_an_event_at_the_start_that_locks():
    m, s = sliding_block("start")
    m.event("grip", when=s, do=ncgen.lock(s))
    run = ncgen.simulate(ncgen.compile(m), 1.0, qd0={"s": -1.0}, points=3)
    assert [(event.t, event.transition, event.search) for event in run.events] == [(0.0, "locks", "start")] and np.all(run["s"] == 0.0)


def test_a_lock_and_a_stop_at_one_instant():
    m, s = sliding_block("both")
    m.stop(s, upper=0.5, restitution=1.0)
    m.lock(s, when=0.5 - s)
    run = ncgen.simulate(ncgen.compile(m), 1.0, qd0={"s": 1.0}, points=3)
    assert sorted(event.name for event in run.events if event.t > 0) == ["s.lock", "s.stop.upper"]
    assert run["s"][1:] == pytest.approx([0.5, 0.5], abs=1e-13)


def test_a_brake_without_force():
    """A negative pull counts as none."""
    m, s = sliding_block("loose")
    pull = m.input("pull")
    m.friction(s, coulomb=pull)
    run = ncgen.simulate(ncgen.compile(m), 1.0, qd0={"s": 1.0}, inputs={"pull": lambda t: -5.0})
    assert run["s"][-1] == pytest.approx(1.0, rel=1e-12)


@pytest.mark.parametrize("excess", [1e-3, 3e-4])
@pytest.mark.filterwarnings("error")
def test_a_slight_slip_between_rests_raises_no_alarm(excess):
    """(1 + ε) sin πt against friction of 1: v = (1 + ε) (cos πa − cos πt)/π − (t − a) from sin πa = 1/(1 + ε) until it vanishes at b; the
    energy that moves is less than what tolerances leave of the work."""
    m, s = sliding_block("slight")
    m.torque(s, (1 + excess) * sympy.sin(math.pi * m.time))
    m.friction(s, 1.0)
    kernels, a = ncgen.compile(m), math.asin(1 / (1 + excess)) / math.pi

    def velocity(t: float) -> float:
        return (1 + excess) * (math.cos(math.pi * a) - math.cos(math.pi * t)) / math.pi - (t - a)

    b = brentq(velocity, 1 - a, 1.0, xtol=1e-15)
    way = (1 + excess) / math.pi * (math.cos(math.pi * a) * (b - a) - (math.sin(math.pi * b) - math.sin(math.pi * a)) / math.pi)
    way -= (b - a) ** 2 / 2
    for rtol in (1e-4, 1e-6, 1e-9, 1e-11):
        run = ncgen.simulate(kernels, 1.2, rtol=rtol, points=3)
        assert [each.transition for each in run.events if each.t > 0] == ["slips", "sticks"]
        assert run["s"][-1] == pytest.approx(way, abs=1e-9 * max(rtol / 1e-9, 1e-2))
    assert run.events[-1].t == pytest.approx(b, rel=1e-9)
