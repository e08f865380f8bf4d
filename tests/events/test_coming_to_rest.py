"""Sliding in space that ends: friction has no direction at rest, and the direction turns infinitely fast on the way there.

On an incline the sliding velocity w obeys w' = −a w/|w| + g in its plane, a being the deceleration by friction and g that part of gravity.
Then a |w| + g·w falls at the rate a² − g², so that rest comes at (a |w₀| + g·w₀)/(a² − g²). A sphere has a = 7/2 μ g cos α.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp

import ncgen

G = 9.81
RADIUS = 0.1


def inclined(friction: float, slope: float, is_sphere: bool) -> ncgen.Model:
    """A sphere or a particle on an incline that falls towards −x."""
    m = ncgen.Model("incline")
    height = RADIUS if is_sphere else 0.0
    up, O, C = m.vector("up", (0, 0, 1), fixed=True), m.point("O", (0, 0, 0), fixed=True), m.point("C", (0, 0, height))
    if is_sphere:
        body = m.body("ball", [C], [m.vector("u", (1, 0, 0)), m.vector("v", (0, 1, 0))], mass=1.0, inertia=[0.4 * RADIUS**2] * 3)
    else:
        body = m.body("block", [C], mass=2.0)
    m.gravity((-G * math.sin(slope), 0, -G * math.cos(slope)))
    m.contact("floor", body, C, m.ground, O, radius=height, normal=up, friction=friction)
    return m


def time_of_rest(a: float, g: float, w: np.ndarray) -> float:
    """When sliding that begins with w ends."""
    return float((a * np.hypot(*w) - g * w[0]) / (a**2 - g**2))


@pytest.mark.parametrize(("friction", "slope", "speed"), [(0.2, 0.1, 5.0), (0.2, 0.3, 1.0), (0.5, 0.3, 1.0)])
def test_a_sphere_rolls_from_the_closed_time_on_whatever_the_tolerance(friction, slope, speed):
    """Its velocity is v₀ + 2/7 (w − w₀) + 5/7 g t, sliding or not."""
    kernels = ncgen.compile(inclined(friction, slope, True))
    w = speed * np.array([1.0, 0.3])
    g = np.array([-G * math.sin(slope), 0.0])
    expected = time_of_rest(3.5 * friction * G * math.cos(slope), -g[0], w)
    for rtol in (1e-4, 1e-6, 1e-8, 1e-9, 1e-10, 1e-11, 1e-12):
        run = ncgen.simulate(kernels, 2.0, qd0={"C.x": w[0], "C.y": w[1], "C.z": 0.0, "u.z": 0.0, "v.z": 0.0}, rtol=rtol, points=3)
        assert [each.transition for each in run.events] == ["rests", "sticks"]
        assert run.events[1].t == pytest.approx(expected, rel=max(100 * rtol, 3e-10))
        assert run.qd[-1, :2] == pytest.approx(5 / 7 * (w + 2.0 * g), rel=max(10 * rtol, 1e-10))


@pytest.mark.parametrize("integrator", ["dop853", "dopri5", "radau"])
@pytest.mark.parametrize(("friction", "slope"), [(0.2, 0.1), (0.5, 0.3)])
def test_a_particle_stops_where_the_hodograph_says(friction, slope, integrator):
    """With the angle φ from gravity to w, |w| is proportional to tan(φ/2)^(a/g)/sin φ."""
    a, g, angle = friction * G * math.cos(slope), G * math.sin(slope), 1.1
    w = np.array([-math.cos(angle), math.sin(angle)])

    def squared(phi: float) -> float:
        return (math.sin(angle) / math.sin(phi) * (math.tan(phi / 2) / math.tan(angle / 2)) ** (a / g)) ** 2 / g

    place = [-quad(lambda phi: squared(phi) / math.tan(phi), 0, angle)[0], quad(squared, 0, angle)[0]]
    kernels = ncgen.compile(inclined(friction, slope, False))
    for rtol in (1e-5, 1e-8, 1e-11):
        run = ncgen.simulate(kernels, 2.0, qd0={"C.x": w[0], "C.y": w[1], "C.z": 0.0}, rtol=rtol, integrator=integrator, points=3)
        assert [each.transition for each in run.events] == ["rests", "sticks"]
        assert run.events[1].t == pytest.approx(time_of_rest(a, g, w), rel=max(100 * rtol, 1e-9))
        assert run.q[-1, :2] == pytest.approx(place, rel=max(10 * rtol, 1e-8)) and np.max(np.abs(run.qd[-1])) < 1e-15


def test_a_particle_stops_with_a_fixed_step():
    """To the first order of the step, in which it comes to rest."""
    w, a, g = np.array([1.0, 0.5]), 0.5 * G * math.cos(0.3), G * math.sin(0.3)
    kernels = ncgen.compile(inclined(0.5, 0.3, False))
    run = ncgen.simulate(kernels, 1.0, qd0={"C.x": w[0], "C.y": w[1], "C.z": 0.0}, integrator="rk4", max_step=1e-3, points=3)
    assert run.events[-1].transition == "sticks" and run.events[-1].t == pytest.approx(time_of_rest(a, g, w), abs=3e-3)


def test_a_push_that_comes_and_goes():
    """Across an incline: it begins where the cone of friction says, and ends where an integration of the plane motion does."""
    friction, slope, push = 0.5, 0.3, 40.0
    m = inclined(friction, slope, False)
    m.force(m.elements["C"], (0, push * m.time * (1 - m.time), 0))
    a, g = friction * G * math.cos(slope), G * math.sin(slope)
    run = ncgen.simulate(ncgen.compile(m), 1.1, rtol=1e-11, points=3)
    slips, sticks = (each for each in run.events if each.t > 0)
    begins = 0.5 - math.sqrt(0.25 - 2.0 * math.sqrt(a**2 - g**2) / push)
    assert [slips.transition, sticks.transition] == ["slips", "sticks"] and slips.t == pytest.approx(begins, rel=1e-9)

    def rates(t: float, y: np.ndarray) -> np.ndarray:
        return np.array([*y[2:], *(np.array([-g, push * t * (1 - t) / 2.0]) - a * y[2:] / np.hypot(*y[2:]))])

    def slow(t: float, y: np.ndarray) -> float:
        return float(np.hypot(*y[2:]) - 1e-8)

    slow.terminal, slow.direction = True, -1
    first = 1e-5  # how long after the beginning; the velocity is then some 1e-9 along the force
    pull = np.array([-g, math.sqrt(a**2 - g**2)])
    rises = push * (1 - 2 * begins) / 2.0 * pull[1] / a  # rate of the force along itself
    start = [0.0, 0.0, *(rises * first**2 / 2 * pull / a)]
    other = solve_ivp(rates, (begins + first, 1.2), start, "DOP853", events=slow, rtol=1e-12, atol=1e-14)
    (at,), (there,) = other.t_events[0], other.y_events[0]
    assert sticks.t == pytest.approx(at, abs=1e-7) and run.q[-1, :2] == pytest.approx(there[:2], abs=1e-8)
