"""Events in simulations that are moved step by step: each against one run, and against closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest
from bouncing import G, ball
from sliding import sliding_block
from sympy import Piecewise

import ncgen
from ncgen.solver.events.loop import EventLoop
from ncgen.solver.events.steps import Steps


def belt() -> ncgen.Model:
    """1 kg on a spring of 1 N/m over a belt of 3 m/s, in the frame of the belt."""
    m, u = sliding_block("belt")
    m.torque(u, -(u + 3 * m.time))
    m.friction(u, coulomb=3.0, static=5.0, name="belt")
    return m


def stepped(sim, count: int, h: float):
    for _ in range(count):
        sim.step(h)
    return sim


def test_steps_go_over_bounces():
    """The state after each step is that of one run."""
    kernels = ncgen.compile(ball())
    sim, run = ncgen.start(kernels), ncgen.simulate(kernels, 1.3, points=131)
    for k in range(1, 131):
        sim.step(run.t[k] - run.t[k - 1])
        assert sim.q == pytest.approx(run.q[k], abs=1e-12) and sim.qd == pytest.approx(run.qd[k], abs=1e-12)
    assert [each.t for each in sim.events] == pytest.approx([each.t for each in run.events], abs=1e-12)
    assert sim.work == pytest.approx(run.work[-1], abs=1e-12)
    assert sim.events[1].t == pytest.approx(0.9030472819714618, rel=1e-13)


def test_an_event_at_the_end_of_a_step_happens_once():
    """Steps of the time of the fall end at the floor, or beside it by rounding."""
    sim, fall = ncgen.start(ncgen.compile(ball())), math.sqrt(2 / G)
    for count in (1, 2):
        sim.step(fall)
        assert sum(each.t < sim.t + 1e-12 for each in sim.events) == len(sim.events) <= count
    sim.step(0.1)
    assert [each.t for each in sim.events] == pytest.approx([fall, 2 * fall], rel=1e-12)


def test_a_block_on_a_belt():
    """Slip 2π − 2 atan(2/3), stick 4/3 s, in steps as in one run."""
    kernels = ncgen.compile(belt())
    start = dict(q0={"s": 1.0, "A.x": 1.0}, rtol=1e-13)
    sim, run = ncgen.start(kernels, **start), ncgen.simulate(kernels, 14.0, points=141, **start)
    stepped(sim, 140, 0.1)
    slip = 2 * math.pi - 2 * math.atan(2 / 3)
    seen = [each for each in sim.events if each.t > 0]
    assert [each.t for each in seen] == pytest.approx(np.cumsum([4 / 3, slip] * 3)[: len(seen)], rel=1e-10) and len(seen) == 4
    assert [each.transition for each in sim.events] == [each.transition for each in run.events]
    assert sim.q == pytest.approx(run.q[-1], abs=1e-11) and sim.qd == pytest.approx(run.qd[-1], abs=1e-11)
    assert sim.qdd == pytest.approx(run.qdd[-1], abs=1e-10)


def test_an_oscillator_rests():
    m, s = sliding_block("oscillator")
    m.torque(s, -s)
    m.friction(s, coulomb=1.0)
    sim = ncgen.start(ncgen.compile(m), rtol=1e-11, q0={"s": 12.0, "A.x": 12.0}, qd0={"s": 6.0})
    stepped(sim, 100, 0.5)
    assert sim.events[-1].transition == "sticks" and sim.events[-1].t == pytest.approx(22.42355635069909, rel=1e-9)
    assert sim["s"] == pytest.approx(1 - (math.sqrt(205) - 14), abs=1e-10)


def pushed() -> ncgen.Model:
    m, s = sliding_block("pushed")
    m.torque(s, m.input("push"))
    m.friction(s, coulomb=1.0, static=2.0)
    return m


def test_a_push_that_changes_between_steps():
    """It sticks below static friction, slips from the step on in which the push is more, and sticks again."""
    sim = ncgen.start(ncgen.compile(pushed()))
    sim.step(1.0, push=1.9)
    assert abs(sim["s"]) < 1e-25 and abs(sim["rate(s)"]) < 1e-25
    sim.step(1.0, push=2.5)
    assert sim.events[-1].transition == "slips" and sim.events[-1].t == 1.0
    assert [sim["s"], sim["rate(s)"]] == pytest.approx([0.75, 1.5], rel=1e-12)
    sim.step(3.0, push=0.0)
    assert sim.events[-1].transition == "sticks" and sim.events[-1].t == pytest.approx(3.5, rel=1e-12)
    assert sim["s"] == pytest.approx(0.75 + 1.125, rel=1e-12) and sim["rate(s)"] == 0.0


def test_a_condition_of_an_input():
    """What a step is given may carry a condition to the other side at its beginning."""
    m, s = sliding_block("switched")
    u, count = m.input("u"), m.parameter("count", 0.0)
    m.torque(s, u)
    m.event("on", when=u - 1, direction="rising", do={"count": count + 1})
    sim = ncgen.start(ncgen.compile(m))
    sim.step(0.1, u=0.5).step(0.1, u=2.0).step(0.1).step(0.1, u=0.0).step(0.1, u=3.0)
    assert [(each.name, round(each.t, 12)) for each in sim.events] == [("on", 0.1), ("on", 0.4)]
    assert sim.p[sim.kernels.parameters.index("count")] == 2.0


def test_back_to_a_state():
    """The same steps give the same bits, also out of a mode in which the block sticks, and the same events."""
    sim = ncgen.start(ncgen.compile(belt()), q0={"s": 1.0, "A.x": 1.0})
    stepped(sim, 10, 0.1)
    kept = sim.state
    first = stepped(sim, 40, 0.1).state
    again = stepped(sim.reset(kept), 40, 0.1).state
    assert np.array_equal(first.q, again.q) and np.array_equal(first.qd, again.qd) and first.work == again.work
    assert [each.t for each in first.past.happened] == [each.t for each in again.past.happened]
    assert len(kept.past.happened) < len(first.past.happened)


def test_a_state_that_is_written_begins_anew():
    """A ball that is put up again falls again, and one put below its floor is refused; then nothing has moved."""
    sim = ncgen.start(ncgen.compile(ball()))
    stepped(sim, 20, 0.1)
    sim.q[:], sim.qd[:] = 1.0, 0.0
    sim.step(0.5)
    assert sim.events[-1].t == pytest.approx(2.0 + math.sqrt(2 / G), rel=1e-12)
    sim.q[:] = -0.1
    with pytest.raises(ncgen.ModelError, match="event floor: the gap is -0.1"):
        sim.step(0.1)
    assert sim.q[0] == -0.1 and sim.t == pytest.approx(2.5)


def test_an_event_that_ends_the_motion_ends_the_step():
    m, s = sliding_block("ended")
    m.event("half", when=s - 0.5, direction="rising", do="stop")
    sim = ncgen.start(ncgen.compile(m), qd0={"s": 1.0})
    kept = sim.state
    sim.step(1.0)
    assert sim.stopped and sim.t == pytest.approx(0.5, rel=1e-13) and sim["s"] == pytest.approx(0.5, rel=1e-13)
    with pytest.raises(ncgen.ModelError, match="ended: an event has ended the motion at t = 0.5 s"):
        sim.step(1.0)
    assert not sim.reset(kept).stopped and sim.step(0.25)["s"] == pytest.approx(0.25)


def test_a_jump_of_a_driver_and_a_stop():
    """A driver whose velocity jumps at 0.5 s carries a block to an event of its own time."""
    m, s = sliding_block("driven")
    m.drive(s, abs(m.time - 0.5))
    m.event("up", when=s - 0.25, direction="either")
    kernels = ncgen.compile(m)
    start = {"q0": {"s": 0.5, "A.x": 0.5}}
    run, sim = ncgen.simulate(kernels, 1.0, **start), stepped(ncgen.start(kernels, **start), 8, 0.125)
    assert [each.t for each in sim.events] == pytest.approx([0.25, 0.75], rel=1e-12)
    assert [each.t for each in run.events] == pytest.approx([0.25, 0.75], rel=1e-12)
    assert sim.q == pytest.approx(run.q[-1], abs=1e-12) and sim.work == pytest.approx(run.work[-1], abs=1e-12)


def test_a_lock_that_opens():
    """A pushed block is locked from the start and freed at 0.45 s, inside a step; from there on it accelerates."""
    m, s = sliding_block("locked")
    m.torque(s, 2.0)
    m.lock(s, until=0.45 - m.time)
    kernels = ncgen.compile(m)
    run, sim = ncgen.simulate(kernels, 1.0), ncgen.start(kernels)
    stepped(sim, 4, 0.1)
    assert abs(sim["s"]) < 1e-14 and abs(sim.qdd[0]) < 1e-12
    stepped(sim, 6, 0.1)
    assert sim["s"] == pytest.approx(0.55**2, rel=1e-12) and sim.q == pytest.approx(run.q[-1], abs=1e-12)
    assert [each.t for each in sim.events] == pytest.approx([each.t for each in run.events], abs=1e-12)


def test_a_sphere_slides_and_rolls():
    """T3: from 5 m/s it rolls at 2 v₀/(7 μ g) with 5/7 of the velocity; friction of a contact acts in steps as well."""
    m = ncgen.Model("sphere")
    up = m.vector("up", (0, 1), fixed=True)
    O, C = m.point("O", (0, 0), fixed=True), m.point("C", (0, 0.1))
    body = m.body("ball", [C, m.point("D", (0.1, 0.1))], mass=1.0, com=(0, 0.1), inertia=0.4 * 0.1**2)
    m.gravity((0, -G))
    m.contact("floor", body, C, m.ground, O, radius=0.1, normal=up, friction=0.2)
    sim = ncgen.start(ncgen.compile(m), rtol=1e-11, qd0={"C.x": 5.0, "C.y": 0.0, "D.x": 5.0, "D.y": 0.0})
    stepped(sim, 10, 0.1)
    assert [each.transition for each in sim.events] == ["rests", "sticks"] and sim.events[1].t == pytest.approx(0.72811999417504, rel=1e-9)
    assert sim["rate(C.x)"] == pytest.approx(25 / 7, rel=1e-9)
    assert sim["C.x"] == pytest.approx(3.120514260750172 + (1 - 0.72811999417504) * 25 / 7, rel=1e-9)


def test_steps_with_what_is_held_are_calls_of_c(monkeypatch):
    """A block that sticks, alone and in a batch, until the push exceeds its friction: then it slips from that step on."""
    m, s = sliding_block("held")
    m.torque(s, m.input("push"))
    m.friction(s, coulomb=1.0)
    kernels = ncgen.compile(m)
    sim, sims = ncgen.start(kernels), ncgen.start(kernels, 2)
    sim.step(0.1, push=0.9), sims.step(0.1, push=[0.9, -0.9])
    with monkeypatch.context() as patched:
        patched.setattr(Steps, "_run", lambda *given: pytest.fail("a step went through Python"))
        for _ in range(3):
            sim.step(0.1), sims.step(0.1)
    assert abs(sim["s"]) < 1e-25 and np.max(np.abs(sims["s"])) < 1e-25
    sim.step(1.0, push=2.0), sims.step(1.0, push=[2.0, -3.0])
    assert sim["s"] == pytest.approx(0.5, rel=1e-12) and sims["s"] == pytest.approx([0.5, -1.0], rel=1e-12)
    assert [each[-1].transition for each in (sim.events, *sims.events)] == ["slips"] * 3


def test_inputs_that_no_condition_reads_change_nothing_else(monkeypatch):
    """A ball that is pushed by another force in every step falls as the forces say, and hits the floor as ever."""
    m = ball()
    m.force(m.elements["P"], (0, m.input("F")))
    sims = ncgen.start(ncgen.compile(m), 2)
    random, height, velocity = np.random.default_rng(7), np.ones(2), np.zeros(2)
    with monkeypatch.context() as patched:
        patched.setattr(EventLoop, "change", lambda *given: pytest.fail("inputs went through an instant of events"))
        for _ in range(20):
            F = random.uniform(-1, 1, 2)
            sims.step(0.01, F=F)
            height, velocity = height + 0.01 * velocity + 0.01**2 * (F - G) / 2, velocity + 0.01 * (F - G)
    assert sims["P.y"] == pytest.approx(height, rel=1e-12) and sims["rate(P.y)"] == pytest.approx(velocity, rel=1e-12)
    sims.step(0.5, F=0.0)
    hits = (velocity + np.sqrt(velocity**2 + 2 * G * height)) / G
    assert [each[0].t for each in sims.events] == pytest.approx((0.2 + hits).tolist(), rel=1e-11)


def test_an_input_that_a_condition_reads_brings_about_its_event():
    m = ball()
    m.event("asked", when=m.input("level") - 0.5, direction="rising", do="stop")
    sims = ncgen.start(ncgen.compile(m), 2).step(0.1)
    sims.step(0.1, level=[0.0, 1.0])
    assert sims.stopped.tolist() == [False, True] and sims.events[1][-1].name == "asked" and sims.t == pytest.approx([0.2, 0.1])


@pytest.mark.parametrize("h", [0.01, 0.05, 0.1, 0.15, 0.3])
def test_an_event_at_the_end_of_a_step_where_a_law_changes(h):
    """Two discs, J 2 and 3: a torque doubles where the clutch closes; 2 · 10.15 is shared then, and 2 N m turn both for the rest."""
    m = ncgen.Model("drive")
    O, x, z = m.point("O", (0, 0), fixed=True), m.vector("x", (1, 0, 0), fixed=True), m.vector("z", (0, 0, 1), fixed=True)
    angles = []
    for name, inertia in (("motor", 2.0), ("wheel", 3.0)):
        P = m.point(f"{name}.P", (1, 0))
        m.body(name, [O, P], mass=1.0, com=(0, 0), inertia=inertia)
        angles.append(m.angle(f"{name}.angle", x, P - O, z))
    m.torque(angles[0], Piecewise((1.0, m.time < 0.3), (2.0, True)))
    m.clutch(*angles, when=0.3 - m.time, name="clutch")
    sim = ncgen.start(ncgen.compile(m), qd0={"motor.angle": 10.0, "wheel.angle": 0.0}, rtol=1e-10)
    for _ in range(round(0.3 / h)):
        sim.step(h)
    assert [each.t for each in sim.events] in ([], [pytest.approx(0.3, rel=1e-12)])  # the sum of steps may be below 0.3 by rounding
    if sim.events:
        assert sim["rate(wheel.angle)"] == pytest.approx(2 * 10.15 / 5, rel=1e-10)
    for _ in range(round(0.3 / h)):
        sim.step(h)
    (closes,) = sim.events
    assert closes.energy_lost == pytest.approx(6 / 5 * 10.15**2 / 2, rel=1e-9)
    assert sim["rate(wheel.angle)"] == pytest.approx((2 * 10.15 + 0.6) / 5, rel=1e-9)


def test_an_input_that_stops_the_motion_ends_its_step_at_once():
    """The step does not raise, later ones do, and no other input starts the motion again; a new state does."""
    m, s = sliding_block("switched")
    switch = m.input("switch")
    m.event("off", when=switch - 0.5, direction="rising", do="stop")
    m.friction(s, coulomb=1.0)
    sim = ncgen.start(ncgen.compile(m), qd0={"s": 1.0})
    sim.step(0.25)
    sim.step(0.25, switch=1.0)
    assert sim.stopped and sim.t == 0.25 and sim.events[-1].name == "off" and sim["s"] == pytest.approx(0.25 - 0.25**2 / 2, rel=1e-9)
    for switch in (1.0, 0.0):
        with pytest.raises(ncgen.ModelError, match="switched: an event has ended the motion at t = 0.25 s"):
            sim.step(0.25, switch=switch)
    sim.qd[:] = 1.0
    sim.step(0.25, switch=0.0)
    assert not sim.stopped and sim.t == 0.5
