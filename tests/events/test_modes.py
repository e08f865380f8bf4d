"""Modes: gaps at rest, ropes and joints that stick are constraints, held exactly and left by their own load."""

from __future__ import annotations

import math

import numpy as np
import pytest
from sliding import sliding_block

import ncgen
from examples.impacts import LIFT, SPEED, buffered, follower
from ncgen.exchange.toml_writer import to_toml
from ncgen.solver.events import modes

G = 9.81


def test_a_ball_comes_to_rest():
    m = ncgen.Model("ball")
    P = m.point("P", (0, 1), fixed="x")
    m.body("ball", [P], mass=1.0)
    lift = m.input("lift")
    m.gravity((0, -G))
    m.force(P, (0, lift))
    m.event("floor", when=P.y, do=ncgen.impact(restitution=0.5))
    kernels = ncgen.compile(m)
    run = ncgen.simulate(kernels, 4.0, inputs={"lift": lambda t: 4 * t})
    rests, leaves = [each for each in run.events if each.transition]
    assert (rests.transition, leaves.transition) == ("rests", "leaves")
    assert leaves.t == pytest.approx(G / 4, rel=1e-10) and run["P.y"][-1] == pytest.approx(2 * (4.0 - G / 4) ** 3 / 3, rel=1e-9)
    at_rest = (run.t > 2.2) & (run.t < G / 4)
    assert np.max(np.abs(run["P.y"][at_rest])) < 1e-14 and np.max(np.abs(run["rate(rate(P.y))"][at_rest])) < 1e-12


def test_a_block_sticks_and_slips_on_a_belt():
    """In the belt's frame. Slip 2π − 2 atan(2/3), stick 4/3 s; x from 5 to 1."""
    m, u = sliding_block("belt")
    x = u + 3 * m.time
    m.torque(u, -x)
    m.friction(u, coulomb=3.0, static=5.0, name="belt")
    run = ncgen.simulate(ncgen.compile(m), 20.0, rtol=1e-11, q0={"s": 1.0, "A.x": 1.0})
    slip = 2 * math.pi - 2 * math.atan(2 / 3)
    expected = np.cumsum([4 / 3, slip] * 3)
    seen = [each for each in run.events if each.t > 0]
    assert [each.transition for each in seen] == ["slips", "sticks"] * 3
    assert [each.t for each in seen] == pytest.approx(expected, rel=1e-10)
    places = [each.q[0] + 3 * each.t for each in seen]
    assert places == pytest.approx([5.0, 1.0] * 3, rel=1e-9)


def test_an_oscillator_rests():
    """Mass 1, spring 1, Coulomb 1, from 12 with 6: rests at 1 − (√205 − 14) for ever."""
    m, s = sliding_block("oscillator")
    m.torque(s, -s)
    m.friction(s, coulomb=1.0)
    kernels = ncgen.compile(m)
    run = ncgen.simulate(kernels, 100.0, rtol=1e-12, q0={"s": 12.0, "A.x": 12.0}, qd0={"s": 6.0})
    assert [each.transition for each in run.events] == ["turns"] * (len(run.events) - 1) + ["sticks"]
    assert run.events[-1].t == pytest.approx(22.42355635069909, rel=1e-10)
    assert run["s"][-1] == pytest.approx(1 - (math.sqrt(205) - 14), abs=1e-10)
    assert run["s"][-1] == run["s"][60] and run.energy_drift < 1e-8


def test_a_joint_that_stops_within_its_friction_sticks_at_once():
    """From 0 with 0.5 it stops where s²/2 + s = 1/8, with a spring force that is less than the friction, which turns round."""
    m, s = sliding_block("oscillator")
    m.torque(s, -s)
    m.friction(s, coulomb=1.0)
    run = ncgen.simulate(ncgen.compile(m), 2.0, rtol=1e-11, qd0={"s": 0.5})
    (sticks,) = run.events
    assert sticks.transition == "sticks" and sticks.t == pytest.approx(math.atan(0.5), rel=1e-10)
    assert run["s"][-1] == pytest.approx(math.sqrt(1.25) - 1, rel=1e-10)


@pytest.mark.parametrize("calls_python", [False, True])
def test_loads_in_c_and_in_python(monkeypatch, calls_python):
    """A block slips where the push t exceeds static friction; C calls Python only where the model does."""
    called = []
    evaluate = modes._InPython.at
    monkeypatch.setattr(modes._InPython, "at", lambda *given: called.append(given) or evaluate(*given))
    m, s = sliding_block("push")
    m.torque(s, m.time)
    if calls_python:
        m.callback(lambda t, q, qd, kernels: np.zeros(kernels.n))
    most = m.parameter("most", 2.0)
    m.friction(s, coulomb=1.0, static=most)
    kernels = ncgen.compile(m)
    for number in (2.0, 2.5):
        run = ncgen.simulate(kernels, 3.0, rtol=1e-11, p={"most": number})
        seen = [each for each in run.events if each.t > 0]
        assert [each.transition for each in seen] == ["slips"] and seen[0].t == pytest.approx(number, rel=1e-12)
    assert bool(called) == calls_python


def test_a_rope_becomes_slack_and_taut():
    """v₀² = 3.5 g L at the bottom: slack 30° above horizontal, taut again at the bottom."""
    m = ncgen.Model("rope")
    O, P = m.point("O", (0, 0), fixed=True), m.point("P", (0, -1))
    m.body("bob", [P], mass=1.0)
    m.gravity((0, -G))
    m.rope(O, P, 1.0, name="rope")
    run = ncgen.simulate(ncgen.compile(m), 1.3, rtol=1e-12, qd0={"P.x": math.sqrt(3.5 * G), "P.y": 0.0})
    slack, taut = (each for each in run.events if each.t > 0 and each.transition != "rests")
    assert slack.transition == "leaves" and slack.t == pytest.approx(0.4819942834614219, rel=1e-10)
    assert math.hypot(*slack.before) == pytest.approx(2.21472345903501, rel=1e-9)
    assert taut.t - slack.t == pytest.approx(0.782061887005775, rel=1e-10) and taut.q == pytest.approx([0.0, -1.0], abs=1e-9)
    assert taut.before == pytest.approx([-1.107361729517505, -5.75402033364499], rel=1e-9)
    assert taut.after == pytest.approx([-1.107361729517505, 0.0], abs=1e-9)
    assert run.energy_drift < 1e-9


def test_a_hunt_crossley_stop():
    kernels = ncgen.compile(buffered()[0])
    run = ncgen.simulate(kernels, 0.8, rtol=1e-11, qd0={"s": 1.0}, points=2001)
    touched, left = run.events
    assert touched.t == pytest.approx(0.5, rel=1e-12) and -left.after[0] == pytest.approx(0.7484349315974342, rel=1e-9)
    deepest = ncgen.simulate(kernels, 0.8, rtol=1e-11, qd0={"s": 1.0}, stop={"rate(s)": (0.0, "falling")})
    assert deepest["s"][-1] - 0.5 == pytest.approx(0.0245604801430143, rel=1e-9)


def test_rigid_stops():
    m, s = sliding_block("stop")
    m.stop(s, lower=-0.5, upper=0.5, restitution=0.5)
    run = ncgen.simulate(ncgen.compile(m), 4.0, qd0={"s": 1.0})
    assert [each.name for each in run.events] == ["s.stop.upper", "s.stop.lower"]
    assert [each.t for each in run.events] == pytest.approx([0.5, 2.5], rel=1e-13) and run["rate(s)"][-1] == pytest.approx(0.25)


def test_a_block_pushed_against_its_stop_rests_there():
    """The push turns at 2 s, and the block leaves at once."""
    m, s = sliding_block("stop")
    m.torque(s, 2 - m.time)
    m.stop(s, upper=0.5)
    run = ncgen.simulate(ncgen.compile(m), 3.0, rtol=1e-11)
    assert [each.transition for each in run.events] == ["", "rests", "leaves"]
    assert run.events[2].t == pytest.approx(2.0, rel=1e-10) and run["s"][-1] == pytest.approx(0.5 - 1 / 6, rel=1e-9)


def test_a_mechanism_that_begins_at_rest_on_friction():
    """A push that grows: it sticks until the push exceeds static friction, and slips with sliding friction."""
    m, s = sliding_block("push")
    m.torque(s, m.time)
    m.friction(s, coulomb=1.0, static=2.0)
    run = ncgen.simulate(ncgen.compile(m), 3.0, rtol=1e-11)
    seen = [each for each in run.events if each.t > 0]
    assert [(each.transition, round(each.t, 10)) for each in seen] == [("slips", 2.0)]
    assert run["s"][-1] == pytest.approx(1 / 6 + 1 / 2, rel=1e-9)


def test_an_archive_keeps_events(tmp_path):
    """A run that is read again has the events, the accelerations of its modes, and no joint reactions."""
    m, s = sliding_block("kept")
    m.torque(s, 2 - m.time)
    m.stop(s, upper=0.5)
    run = ncgen.simulate(ncgen.compile(m), 3.0)
    again = ncgen.read(run.to_npz(tmp_path / "trajectory.npz"), run.kernels)
    assert [repr(each) for each in again.events] == [repr(each) for each in run.events]
    assert np.array_equal(again.qdd, run.qdd) and np.max(np.abs(run["rate(rate(s))"][50:60])) < 1e-12
    for each in (run, again):
        with pytest.raises(ncgen.ModelError, match="kept: joint reactions need a motion of one mechanism"):
            each.reactions()
    path = tmp_path / "trajectory.npz"
    with np.load(path) as archive:
        older = dict(archive)
    older["about"] = np.array(str(older["about"]).replace('"transition"', '"what"'))
    np.savez(path, **older)
    assert [each.transition for each in ncgen.read(path, run.kernels).events] == [each.transition for each in run.events]


def test_files_say_elements():
    m, s = sliding_block("all")
    m.stop(s, upper=0.5, restitution=0.2)
    m.friction(s, coulomb=1.0)
    text = to_toml(m)
    assert "[[stop]]" in text and "[[friction]]" in text and "[[event]]" not in text


def test_a_follower_leaves_its_cam():
    """A cam of 5 mm lifts a follower that its weight holds down; above ω = √(g/A) it leaves, here at 1.2 times that, and lands again."""
    run = ncgen.simulate(ncgen.compile(follower()), 0.11, rtol=1e-12)
    leaves, lands = (each for each in run.events if each.t > 0 and each.transition != "rests")
    assert (leaves.transition, lands.transition) == ("leaves", "")
    assert [leaves.t, lands.t] == pytest.approx([0.0439942783575529, 0.1076599719173969], rel=1e-10)
    assert lands.before[0] - LIFT * SPEED * math.sin(SPEED * lands.t) == pytest.approx(-0.2920006281060264, rel=1e-9)


@pytest.mark.parametrize("speed", [0.0, 2.0])
def test_friction_of_zero_changes_nothing(speed):
    m = ncgen.Model("free")
    O, P = m.point("O", (0, 0), fixed=True), m.point("P", (0.5, 0), fixed="y")
    m.body("block", [P], mass=1.0)
    m.friction(m.length("x", O, P), 0.0)
    run = ncgen.simulate(ncgen.compile(m), 0.1, qd0={"P.x": speed})
    assert run["P.x"][-1] == pytest.approx(0.5 + 0.1 * speed, abs=1e-12)


@pytest.mark.parametrize("coulomb", [0.25, 0.5, 1.0])
def test_friction_and_a_stop_hold_one_coordinate(coulomb):
    """A push that turns brings the block to its upper stop, where it bounces until both hold it: it is at the stop, and stays there."""
    m, s = sliding_block("pushed")
    m.torque(s, 3 * m.time - 2.0)
    m.friction(s, coulomb=coulomb)
    m.stop(s, lower=-0.5, upper=1.0, restitution=0.4)
    run = ncgen.simulate(ncgen.compile(m), 3.0, rtol=1e-10)
    assert run["s"][-1] == pytest.approx(1.0, abs=1e-12) and run["rate(s)"][-1] == pytest.approx(0.0, abs=1e-12)
    rests = [each for each in run.events if each.transition == "rests"][-1]
    assert rests.name == "s.stop.upper" and run.events[-1].t == rests.t


def test_a_strut_pushes_until_it_would_pull():
    """A mass that leaves the top of a circle with 1 m/s is no longer pushed where cos θ = (2 + v²/(g L))/3; then it flies freely."""
    m = ncgen.Model("strut")
    O, P = m.point("O", (0, 0), fixed=True), m.point("P", (0, 1))
    m.body("mass", [P], mass=2.0)
    m.gravity((0, -9.81))
    m.strut(O, P, 1.0, name="strut")
    run = ncgen.simulate(ncgen.compile(m), 1.0, qd0={"P.x": 1.0}, rtol=1e-11)
    leaves = run.events[-1]
    assert leaves.name == "strut" and leaves.transition == "leaves"
    assert leaves.q[1] == pytest.approx((2 + 1 / 9.81) / 3, rel=1e-9)
    flown = run.t[-1] - leaves.t
    assert run.q[-1] == pytest.approx(leaves.q + leaves.after * flown + np.array([0, -9.81 / 2 * flown**2]), rel=1e-9)
