"""Events as users of other programs write them in manuals and report them as missed, by closed forms and independent solutions."""

from __future__ import annotations

import math

import numpy as np
import pytest
import sympy as sp
from scipy.optimize import brentq
from scipy.special import ellipk
from sliding import sliding_block

import ncgen


def test_three_roots_of_a_cubic():
    """y' = 3 x² + 12 x − 4 has the roots −6, −2 and 2; the manual's call found the first one only (scipy issue 9228)."""
    m, s = sliding_block("cubic")
    m.torque(s, 6 * (m.time - 8) + 12)
    m.event("root", when=s - 120, direction="either")
    run = ncgen.simulate(ncgen.compile(m), 12.0, qd0={"s": 3 * 64 - 12 * 8 - 4.0}, points=2)
    assert [each.t - 8 for each in run.events] == pytest.approx([-6.0, -2.0, 2.0], abs=1e-11)


@pytest.mark.parametrize("step", [1e-3, 5e-4, 1e-4])
def test_crossings_at_the_ends_of_steps(step):
    """u' = 1 passes 0.001 and 0.002 where steps end (DifferentialEquations.jl issue 258)."""
    m, s = sliding_block("ramp")
    m.event("event1", when=s - 0.001, direction="rising")
    m.event("event2", when=s - 0.002, direction="rising")
    run = ncgen.simulate(ncgen.compile(m), 0.05, qd0={"s": 1.0}, max_step=step)
    assert [(each.name, pytest.approx(each.t, rel=1e-12)) for each in run.events] == [("event1", 0.001), ("event2", 0.002)]


def test_a_bounce_that_turns_gravity_off():
    """The floor reverses the velocity, which passes zero by that, and this ends gravity (DifferentialEquations.jl issue 516)."""
    m, s = sliding_block("ball")
    weight = m.input("weight")
    m.torque(s, -weight)
    m.event("floor", when=s + 50, direction="falling", do={"rate(s)": -s.rate})
    m.event("turns", when=s.rate, direction="rising", do={"weight": 0.0})
    run = ncgen.simulate(ncgen.compile(m), 15.0, inputs={"weight": 9.8}, points=2)
    hit = math.sqrt(2 * 50 / 9.8)
    assert [(each.name, each.search) for each in run.events] == [("floor", "polynomial"), ("turns", "action")]
    assert run.events[0].t == pytest.approx(hit, rel=1e-12) and run["s"][-1] + 50 == pytest.approx(9.8 * hit * (15 - hit), rel=1e-11)


def test_the_ball_of_the_manuals():
    """Thrown up at 20 m/s and bouncing with 0.9: ballode of Matlab, ex40 of PETSc, ballode of R's deSolve."""
    m, s = sliding_block("ballode")
    m.torque(s, -9.8)
    m.event("ground", when=s, direction="falling", do=ncgen.impact(restitution=0.9))
    run = ncgen.simulate(ncgen.compile(m), 32.0, qd0={"s": 20.0}, points=2)
    times = np.cumsum(2 * 20 / 9.8 * 0.9 ** np.arange(20))
    hits = [each.t for each in run.events if each.t > 0]
    assert hits == pytest.approx(times[times < 32.0], rel=1e-11) and hits[0] == pytest.approx(4.081632653061225, rel=1e-12)


def test_a_ball_with_drag():
    """It falls h in acosh(exp(k h))/√(g k) (ex44 of PETSc has this drag)."""
    m, s = sliding_block("drag")
    k, h = 0.3, 4.0
    m.torque(s, -9.8 - k * s.rate * sp.Abs(s.rate))
    m.event("ground", when=s + h, direction="falling", do="stop")
    run = ncgen.simulate(ncgen.compile(m), 5.0, rtol=1e-11)
    assert run.events[0].t == pytest.approx(math.acosh(math.exp(k * h)) / math.sqrt(9.8 * k), rel=1e-9)


def test_a_ball_that_others_let_fall_through_the_floor():
    """Fritzson's BouncingBall: radius 0.1, 0.9 of the velocity; bounces end at t₁ (1 + e)/(1 − e), and the ball stays there."""
    m, s = sliding_block("BouncingBall")
    m.torque(s, -9.81)
    m.event("floor", when=s + 1 - 0.1, do=ncgen.impact(restitution=0.9))
    run = ncgen.simulate(ncgen.compile(m), 20.0, points=2)
    rests = next(each for each in run.events if each.limit is not None)
    assert rests.limit == pytest.approx(math.sqrt(2 * 0.9 / 9.81) * 1.9 / 0.1, rel=1e-6)
    assert run["s"][-1] == pytest.approx(-0.9, abs=1e-12)


def stairs(seconds: float) -> list[tuple[float, float, float]]:
    """(t, x, height) of the bounces on stairs that go down at every whole x, each of which leaves 0.9 of the velocity."""
    t, x, y, vx, vy, level, bounces = 0.0, 0.0, 6.0, 1.0, 0.0, 5.0, []
    while True:
        hit = (vy + math.sqrt(vy * vy + 2 * 9.8 * (y - level))) / 9.8
        edge = (math.floor(x + 1e-9) + 1 - x) / vx if level > 0 else math.inf
        step = min(hit, edge)
        if t + step > seconds:
            return bounces
        t, x, y, vy = t + step, x + vx * step, y + vy * step - 9.8 * step**2 / 2, vy - 9.8 * step
        if step == edge:
            level -= 1
        else:
            bounces.append((t, x, level))
            y, vx, vy = level, 0.9 * vx, -0.9 * vy


def test_a_ball_on_stairs():
    """SimulateABouncingBall of Wolfram's manual, with two kinds of events."""
    m = ncgen.Model("stairs")
    P = m.point("P", (0, 6))
    m.body("ball", [P], mass=1.0)
    m.gravity((0, -9.8))
    level, edge = m.input("level"), m.input("edge")
    m.event("edge", when=P.x - edge, direction="rising", do={"level": sp.Max(level - 1, 0), "edge": edge + 1})
    vx, vy = P.x.rate, P.y.rate
    m.event("step", when=P.y - level, direction="falling", do={"rate(P.x)": 0.9 * vx, "rate(P.y)": -0.9 * vy})
    run = ncgen.simulate(ncgen.compile(m), 8.0, inputs={"level": 5.0, "edge": 1.0}, qd0={"P.x": 1.0}, points=2, rtol=1e-10)
    found = [(each.t, each.q[0], each.q[1]) for each in run.events if each.name == "step"]
    assert np.array(found) == pytest.approx(np.array(stairs(8.0)), rel=1e-9, abs=1e-9) and len(found) > 5


def hill(x):
    return np.sin(x) + 0.2 * np.cos(4 * x) + 3


def bounces_on_hills(count: int) -> list[tuple[float, float]]:
    """(t, x) of bounces with 0.99 of the velocity along the normal: parabolas, and the first root of the gap on a fine grid."""
    t, x, y, vx, vy, found = 0.0, 2.0, 4.5, 0.0, 0.0, []
    while len(found) < count:

        def gap(s, x=x, y=y, vx=vx, vy=vy):
            return y + vy * s - 9.81 * s * s / 2 - hill(x + vx * s)

        grid = np.linspace(1e-6, 3.0, 300_001)
        below = np.flatnonzero(gap(grid) < 0)[0]
        s = brentq(gap, grid[below - 1], grid[below], xtol=1e-15, rtol=1e-15)
        t, x, y, vy = t + s, x + vx * s, y + vy * s - 9.81 * s * s / 2, vy - 9.81 * s
        normal = np.array([-(np.cos(x) - 0.8 * np.sin(4 * x)), 1.0])
        normal /= np.linalg.norm(normal)
        vx, vy = np.array([vx, vy]) - 1.99 * normal * (normal @ [vx, vy])
        found.append((t, x))
    return found


def test_a_ball_on_hills():
    """After Maple's manual (Ball Bouncing on Hilly Terrain): the gap to a curve of sines, which no polynomial is."""
    m = ncgen.Model("hills")
    P = m.point("P", (2, 4.5))
    m.body("ball", [P], mass=1.0)
    m.gravity((0, -9.81))
    m.event("hill", when=P.y - sp.sin(P.x) - sp.cos(4 * P.x) / 5 - 3, do=ncgen.impact(restitution=0.99))
    run = ncgen.simulate(ncgen.compile(m), 6.0, points=2, rtol=1e-11)
    expected = bounces_on_hills(6)
    assert np.array([(each.t, each.q[0]) for each in run.events[:6]]) == pytest.approx(np.array(expected), rel=1e-7)
    assert {each.search for each in run.events} == {"interval"} and run.energy_drift < 1e-10


def test_two_crossings_within_microseconds():
    """heyoka's manual: a pendulum from 0.05 rad with the conditions v = 0 and v² = 10⁻¹², one of them on either side of the other."""
    m = ncgen.Model("pendulum")
    x, z = m.vector("x", (1, 0, 0), fixed=True), m.vector("z", (0, 0, 1), fixed=True)
    O, A = m.point("O", (0, 0), fixed=True), m.point("A", (1, 0))
    m.body("rod", [O, A], mass=1.0, com=(1, 0), inertia=0.0)
    psi = m.angle("psi", x, A - O, z)
    m.gravity((9.8, 0))
    m.event("turns", when=psi.rate, direction="either")
    m.event("nearly", when=psi.rate**2 - 1e-12, direction="either")
    start = {"psi": -0.05, "A.x": math.cos(0.05), "A.y": -math.sin(0.05)}
    run = ncgen.simulate(ncgen.compile(m), 5.0, q0=start, rtol=1e-12, atol=1e-14, points=2)
    period = 4 * ellipk(math.sin(0.025) ** 2) / math.sqrt(9.8)
    seen = [(each.name, each.t) for each in run.events if each.t > 1e-3]
    assert [name for name, _ in seen] == ["nearly", "turns", "nearly"] * 4
    half = 1e-6 / (9.8 * math.sin(0.05))
    expected = [k * period / 2 + side * half for k in range(1, 5) for side in (-1, 0, 1)]
    assert [t for _, t in seen] == pytest.approx(expected, abs=1e-9)


def test_a_spool_between_its_stops():
    """A valve with dry friction, two stops and a pulsating pressure, whose events a state machine missed (DiffEqBase.jl issue 634). It
    begins to move where the pressure exceeds preload and friction."""
    mass, stiffness, preload, area, stroke = 0.0003361185937456267, 1488.578099595049, 8.54503372291542, 7.373657906574696e-5, 0.001016
    m = ncgen.Model("spool")
    axis = m.vector("axis", (1, 0, 0), fixed=True)
    O, A = m.point("O", (0, 0), fixed=True), m.point("A", (0, 0), fixed="y")
    s = m.slide("s", O, A, axis)
    m.body("spool", [A], mass=mass)
    pressure = 6895 * (18 + 4 * sp.sin(2 * sp.pi * 250 * m.time))
    m.torque(s, area * pressure - preload - stiffness * s)
    m.friction(s, coulomb=1.0)
    m.stop(s, lower=0.0, upper=stroke, restitution=0.3)
    run = ncgen.simulate(ncgen.compile(m), 0.02, rtol=1e-11, points=401)
    slips = next(each for each in run.events if each.transition == "slips")
    assert slips.t == pytest.approx(math.asin(((preload + 1.0) / area / 6895 - 18) / 4) / (2 * math.pi * 250), rel=1e-9)
    assert np.min(run["s"]) > -1e-12 and np.max(run["s"]) < stroke + 1e-12
    assert sum(each.transition == "sticks" for each in run.events) > 3 and run.energy_drift < 1e-9
