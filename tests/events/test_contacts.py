"""Contacts: gaps that close between surfaces of bodies, which slide with friction, stick, roll and bounce."""

from __future__ import annotations

import math

import numpy as np
import pytest

import ncgen
from examples.contacts import OMEGA, RADIUS, TUBE, G, tube, turntable


def disc(height: float, friction: object = 0.2, flat: bool = True, **options: object) -> ncgen.Model:
    """A homogeneous sphere of 1 kg and 0.1 m above the ground, in the plane or in space."""
    m = ncgen.Model("ball")
    zero = (0,) * (1 if flat else 2)
    up = m.vector("up", (*zero, 1), fixed=True)
    O, C = m.point("O", (*zero, 0), fixed=True), m.point("C", (*zero, height))
    if flat:
        ball = m.body("ball", [C, m.point("D", (RADIUS, height))], mass=1.0, com=(0, height), inertia=0.4 * RADIUS**2)
    else:
        ball = m.body("ball", [C], [m.vector("u", (1, 0, 0)), m.vector("v", (0, 1, 0))], mass=1.0, inertia=[0.4 * RADIUS**2] * 3)
    m.gravity((*zero, -G))
    m.contact("floor", ball, C, m.ground, O, radius=RADIUS, normal=up, friction=friction, **options)
    return m


def velocity(speed: float, spin: float) -> dict[str, float]:
    """Of the flat sphere along x, turning counterclockwise (rad/s)."""
    return {"C.x": speed, "C.y": 0.0, "D.x": speed, "D.y": RADIUS * spin}


def spin(q: np.ndarray, qd: np.ndarray) -> float:
    """Of the flat sphere, C.x, C.y, D.x, D.y being the coordinates."""
    (x, y), (u, v) = q[2:] - q[:2], qd[2:] - qd[:2]
    return (x * v - y * u) / RADIUS**2


def test_a_sphere_slides_and_rolls():
    """From 5 m/s it rolls at 2 v₀/(7 μ g) with 5/7 of the velocity, after 3.12 m."""
    kernels = ncgen.compile(disc(RADIUS))
    run = ncgen.simulate(kernels, 2.0, qd0=velocity(5.0, 0.0), rtol=1e-11)
    rests, sticks = run.events
    assert [rests.transition, sticks.transition] == ["rests", "sticks"] and sticks.search == "polynomial"
    assert sticks.t == pytest.approx(0.72811999417504, rel=1e-10)
    assert sticks.q[kernels.index["C.x"]] == pytest.approx(3.120514260750172, rel=1e-9)
    assert [run["rate(C.x)"][-1], spin(run.q[-1], run.qd[-1])] == pytest.approx([25 / 7, -250 / 7], rel=1e-9)
    assert run["C.x"][-1] == pytest.approx(3.120514260750172 + (2 - 0.72811999417504) * 25 / 7, rel=1e-9)
    assert run.energy_drift < 1e-10 and np.max(np.abs(run["C.y"] - RADIUS)) < 1e-12


def test_a_spinning_sphere_drops():
    """Spin 50 rad/s: the impact's friction cannot stop it, it slides and rolls later (generalised-alpha paper, nme.6801, example 10.1)."""
    kernels = ncgen.compile(disc(1.0))
    run = ncgen.simulate(kernels, 1.0, qd0=velocity(0.0, 50.0), rtol=1e-11)
    hit, rests, sticks = run.events
    assert [hit.transition, rests.transition, sticks.transition] == ["", "rests", "sticks"]
    assert hit.t == rests.t == pytest.approx(0.4283529368781193, rel=1e-10)
    assert [hit.after[0], spin(hit.q, hit.after)] == pytest.approx([-0.8404284621548701, 28.98928844612825], rel=1e-9)
    assert sticks.t == pytest.approx(0.72811999417504, rel=1e-10)
    assert sticks.q[0] == pytest.approx(-0.3400857101250286, rel=1e-9)
    assert [run.qd[-1, 0], spin(run.q[-1], run.qd[-1])] == pytest.approx([-10 / 7, 100 / 7], rel=1e-9)
    assert run.energy_drift < 1e-10


def test_a_slowly_spinning_sphere_rolls_at_once():
    kernels = ncgen.compile(disc(1.0))
    run = ncgen.simulate(kernels, 1.0, qd0=velocity(0.0, 10.0), rtol=1e-11)
    assert [each.transition for each in run.events] == ["", "rests", "sticks"] and len({each.t for each in run.events}) == 1
    assert [run.qd[-1, 0], spin(run.q[-1], run.qd[-1])] == pytest.approx([-2 / 7, 20 / 7], rel=1e-9)


@pytest.mark.parametrize("turned", [0.0, 0.7])
def test_a_sphere_in_space_slides_and_rolls(turned):
    """The same along any direction of the plane."""
    kernels = ncgen.compile(disc(RADIUS, flat=False))
    along = np.array([math.cos(turned), math.sin(turned)])
    run = ncgen.simulate(kernels, 2.0, qd0={"C.x": 5 * along[0], "C.y": 5 * along[1], "C.z": 0.0}, rtol=1e-11)
    assert [each.transition for each in run.events] == ["rests", "sticks"]
    assert run.events[1].t == pytest.approx(0.72811999417504, rel=1e-10)
    assert run.events[1].q[:2] == pytest.approx(3.120514260750172 * along, rel=1e-9)
    assert run.qd[-1, :2] == pytest.approx(25 / 7 * along, rel=1e-9)


def rod(friction: float, angle: float, tail: float = 0.0) -> ncgen.Model:
    """A rod of 1 m and 1 kg whose lower end touches the ground; its upper end is to the left, so that the end that slides to the right
    drives it into the ground."""
    m = ncgen.Model("rod")
    up = m.vector("up", (0, 1), fixed=True)
    O, A = m.point("O", (0, 0), fixed=True), m.point("A", (0, 0))
    body = m.body("rod", [A, m.point("B", (-math.cos(angle), math.sin(angle)))], mass=1.0, inertia="rod")
    m.gravity((0, -G))
    m.contact("tip", body, A, m.ground, O, normal=up, friction=friction)
    return m


@pytest.mark.parametrize("degrees", [45.0, 60.0, math.degrees(math.atan(2))])
def test_a_rod_slides_below_the_friction_of_painleve(degrees):
    """The load of a sliding end is determined for μ < (1 + 3 cos² θ)/(3 sin θ cos θ): 5/3 at 45°, and at least 4/3, at tan θ = 2."""
    angle = math.radians(degrees)
    limit = (1 + 3 * math.cos(angle) ** 2) / (3 * math.sin(angle) * math.cos(angle))
    start = {"A.x": 1.0, "A.y": 0.0, "B.x": 1.0, "B.y": 0.0}
    below = ncgen.simulate(ncgen.compile(rod(0.999 * limit, angle)), 1e-3, qd0=start)
    assert below.events[0].transition == "rests"
    with pytest.raises(
        ncgen.ConvergenceError, match=r"rod: at t = 0 s the load of contact tip with friction .* at \(0, 0, 0\) m is not det"
    ):
        ncgen.simulate(ncgen.compile(rod(1.001 * limit, angle)), 1e-3, qd0=start)


def test_a_rod_that_slides_the_other_way_may_have_any_friction():
    start = {"A.x": -1.0, "A.y": 0.0, "B.x": -1.0, "B.y": 0.0}
    run = ncgen.simulate(ncgen.compile(rod(5.0, math.radians(45))), 1e-3, qd0=start)
    assert run.events[0].transition == "rests"


@pytest.mark.parametrize(("place", "speed"), [((0.5, 0.0), (0.3, 0.1)), ((-0.2, 0.4), (0.0, -0.5))])
def test_a_sphere_on_a_turntable_rolls_in_a_circle(place, speed):
    """Of 2/7 of the angular velocity of the table, for every start."""
    m, rates = turntable(place, speed)
    kernels, period = ncgen.compile(m), 2 * math.pi / (2 * OMEGA / 7)
    run = ncgen.simulate(kernels, period, points=[0.0, period / 4, period], qd0=rates, rtol=1e-11)
    assert period == pytest.approx(7.33038285837618) and [each.transition for each in run.events] == ["rests", "sticks"]
    start = np.array(place)
    quarter = start + np.array([speed[0] - speed[1], speed[0] + speed[1]]) / (2 * OMEGA / 7)
    centre = [[run[f"C.{axis}"][k] for axis in "xy"] for k in (1, 2)]
    assert centre[0] == pytest.approx(quarter, abs=1e-9) and centre[1] == pytest.approx(start, abs=1e-9)


@pytest.mark.parametrize(("inertia", "share"), [(0.5, 1 / 3), (0.4, 2 / 7)])
def test_what_rolls_on_a_plank_that_is_pulled(inertia, share):
    """A cylinder takes 1/3 of its acceleration, a sphere 2/7."""
    pull = 2.0
    m = ncgen.Model("plank")
    up, x = m.vector("up", (0, 1), fixed=True), m.vector("x", (1, 0), fixed=True)
    O, P = m.point("O", (0, 0), fixed=True), m.point("P", (0, 0), fixed="y")
    plank = m.body("plank", [P], [up])
    m.drive(m.slide("s", O, P, x), pull * m.time**2 / 2)
    C = m.point("C", (0, RADIUS))
    body = m.body("roller", [C, m.point("D", (RADIUS, RADIUS))], mass=1.0, com=(0, RADIUS), inertia=inertia * RADIUS**2)
    m.gravity((0, -G))
    m.contact("plank", body, C, plank, P, radius=RADIUS, normal=up, friction=0.5)
    run = ncgen.simulate(ncgen.compile(m), 2.0, rtol=1e-11)
    assert [each.transition for each in run.events] == ["rests", "sticks"]
    assert run["C.x"][-1] == pytest.approx(share * pull * 2.0, rel=1e-9)


def test_a_ball_in_a_tube_comes_up_again():
    """Its height has √(2/7) of the frequency of its revolutions: z = −(5/2)(g/Ω²)(1 − cos(√(2/7) Ω t)) from a start without spin about the
    radius."""
    m, rates = tube(speed := 3.0)
    omega = speed / (TUBE - RADIUS)
    period = 2 * math.pi / (math.sqrt(2 / 7) * omega)
    times = [0.0, period / 4, period / 2, period]
    run = ncgen.simulate(ncgen.compile(m), period, points=times, qd0=rates, rtol=1e-11)
    assert [each.transition for each in run.events] == ["rests", "sticks"]
    assert run["C.z"] == pytest.approx([-2.5 * G / omega**2 * (1 - math.cos(2 * math.pi * t / period)) for t in times], abs=1e-9)


@pytest.mark.parametrize("share", [0.5, 1.0, 1.5, 2.0, 5.0])
def test_a_block_that_is_pushed_across_a_slope(share):
    """Friction is against a velocity that turns downhill: share |v| + v_down changes by g sin α (1 − share²) a second, for μ = share tan α,
    and above 1 the block comes to rest when it vanishes."""
    alpha, speed = 0.3, 2.0
    m = ncgen.Model("slope")
    n, O, P = m.vector("n", (0, 0, 1), fixed=True), m.point("O", (0, 0, 0), fixed=True), m.point("P", (0, 0, 0))
    body = m.body("block", [P], mass=1.0)
    m.gravity((G * math.sin(alpha), 0, -G * math.cos(alpha)))
    m.contact("slope", body, P, m.ground, O, normal=n, friction=m.parameter("mu", share * math.tan(alpha)))
    rate = G * math.sin(alpha) * (1 - share**2)
    end = -share * speed / rate if share > 1 else 1.0
    run = ncgen.simulate(ncgen.compile(m), 1.1 * end, qd0={"P.x": 0.0, "P.y": speed, "P.z": 0.0}, rtol=1e-11)
    total = share * np.hypot(run["rate(P.x)"], run["rate(P.y)"]) + run["rate(P.x)"]
    assert np.max(np.abs(total - np.maximum(share * speed + rate * run.t, 0.0))) < 1e-9
    if share > 1:
        assert [each.transition for each in run.events] == ["rests", "sticks"] and run.events[1].t == pytest.approx(end, rel=1e-9)
        assert not np.any(run.qd[-1])
