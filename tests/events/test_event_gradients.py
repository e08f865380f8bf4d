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
    assert [back.derivatives[name] for name in expected] == pytest.approx(list(expected.values()), rel=1e-9)


def test_the_period_of_a_block_on_a_belt():
    """Seen from the belt: slip 2π − 2 atan((F_s − F_c)/v) and stick 2 (F_s − F_c)/v for m = k = 1, from slip to slip."""
    m, u = sliding_block("belt")
    v, static = m.parameter("v", 3.0), m.parameter("static", 5.0)
    m.torque(u, -(u + v * m.time))
    m.friction(u, coulomb=3.0, static=static, name="belt")
    found = ncgen.sensitivities(ncgen.compile(m), 7.8, 1000, by=["v", "static"], q0={"s": 1.0, "A.x": 1.0})
    slips = [each for each in found.events if each.transition == "slips"]
    assert slips[1].t - slips[0].t == pytest.approx(6.440513433417785, rel=1e-10)
    assert slips[1].t_by - slips[0].t_by == pytest.approx([-0.1367521367521368, 0.2051282051282051], rel=1e-9)


def stopped_fourbar(limit=-1.0):
    """The four-bar, whose crank hits a stop."""
    m = ncgen.load("fourbar")
    stop, restitution = m.parameter("limit", limit), m.parameter("e", 0.4)
    m.stop(m.elements["psi"], lower=stop, restitution=restitution, name="stop")
    return ncgen.compile(m)


def energies(psi):
    """Half the reduced inertia (J s²) and the potential energy (J) of the four-bar at the crank angle psi, which may be complex."""
    D, bars = np.array([0.4, 0.0]), []
    B, C0 = 0.1 * np.array([np.cos(psi), np.sin(psi)]), np.array([0.35, 0.3])
    b, c = math.dist((0.1, 0.0), C0), math.dist(C0, D)
    d = D - B
    square = d @ d
    along = (square + b**2 - c**2) / (2 * square)
    C = B + along * d + np.sqrt(b**2 / square - along**2) * np.array([-d[1], d[0]])
    dB = np.array([-B[1], B[0]])
    dC = np.linalg.solve(np.array([C - B, C - D]), np.array([(C - B) @ dB, 0 * psi]))
    still = 0 * B
    for mass, ends, rates in ((0.2, (still, B), (still, dB)), (0.8, (B, C), (dB, dC)), (0.6, (C, D), (dC, still))):
        u, v = rates
        bars.append((mass / 6 * (u @ u + u @ v + v @ v), mass * G * (ends[0][1] + ends[1][1]) / 2))
    return sum(each[0] for each in bars), sum(each[1] for each in bars)


def impact(limit, speed):
    """When the crank comes from 0 with a speed to the stop, and how fast, by the energy and a quadrature."""
    inertia, height = energies(0.0)
    total = inertia * speed**2 + height

    def rate(psi):
        own, potential = energies(psi)
        return -np.sqrt((total - potential) / own)

    nodes, weights = np.polynomial.legendre.leggauss(40)
    return sum(w * limit / 2 / rate(limit / 2 * (1 + x)) for x, w in zip(nodes, weights, strict=True)), rate(limit)


def test_a_four_bar_hits_its_stop():
    """Time and velocities of the impact by a complex step of the closed form."""
    kernels, speed = stopped_fourbar(), -3.0
    names = ["limit", "e", "rate(psi)"]
    found = ncgen.sensitivities(kernels, 0.3, 30, by=names, zd0={"psi": speed}, integrator="dop853", rtol=1e-11)
    (stop,) = found.events
    t, v = impact(-1.0, speed)
    step = 1e-30
    by_limit, by_speed = (np.imag(impact(*point)) / step for point in ((-1.0 + 1j * step, speed), (-1.0, speed + 1j * step)))
    psi = kernels.index["psi"]
    assert stop.t == pytest.approx(t, rel=1e-9)
    assert stop.t_by == pytest.approx([by_limit[0], 0.0, by_speed[0]], rel=1e-9, abs=1e-11)
    assert stop.before_by[psi] == pytest.approx([by_limit[1], 0.0, by_speed[1]], rel=1e-8, abs=1e-9)
    assert stop.after_by[psi] == pytest.approx([-0.4 * by_limit[1], -v, -0.4 * by_speed[1]], rel=1e-8, abs=1e-9)
    assert stop.q_by[psi] == pytest.approx([1.0, 0.0, 0.0], abs=1e-10)


def test_differences_of_runs_and_the_reverse_sweep():
    """All coordinates and velocities after the bounce, by differences of ncgen's own runs; the gradient of a sum of them all."""
    kernels, at = stopped_fourbar(), {"limit": -1.0, "e": 0.4, "rate(psi)": -3.0}
    given = {"integrator": "dop853", "rtol": 1e-11}
    found = ncgen.sensitivities(kernels, 0.4, 8, by=list(at), zd0={"psi": -3.0}, **given)

    def end(values):
        p = {name: values[name] for name in ("limit", "e")}
        run = ncgen.simulate(kernels, 0.4, rtol=1e-12, p=p, zd0={"psi": values["rate(psi)"]})
        return np.concatenate([run.q[-1], run.qd[-1]])

    step = 1e-4
    for k, name in enumerate(at):
        ends = [end(at | {name: at[name] + way * step}) for way in (1, -1, 2, -2)]
        slope = (8 * (ends[0] - ends[1]) - (ends[2] - ends[3])) / (12 * step)
        assert np.concatenate([found.q_by[-1, :, k], found.qd_by[-1, :, k]]) == pytest.approx(slope, rel=1e-7, abs=1e-7)

    def total(q, qd):
        return np.sum(q) + np.sum(qd), np.ones_like(q), np.ones_like(qd)

    back = ncgen.gradient(kernels, 0.4, 8, total, by=list(at), zd0={"psi": -3.0}, **given)
    forward = np.sum(found.q_by, axis=(0, 1)) + np.sum(found.qd_by, axis=(0, 1))
    assert [back.derivatives[name] for name in at] == pytest.approx(forward, rel=1e-11)


def test_changes_of_inputs_and_velocities():
    """A mass pushed by F until x = a, then by F/2 with its velocity tripled; closed form."""
    m, s = sliding_block("push")
    a, b = m.parameter("a", 0.5), m.parameter("b", 3.0)
    F = m.parameter("F", 2.0)
    m.torque(s, F)
    m.event("there", when=s - a, direction="rising", do={"F": F / 2, "rate(s)": b * s.rate})
    kernels = ncgen.compile(m)
    names, T = ["a", "b", "F"], 1.0
    found = ncgen.sensitivities(kernels, T, 10, by=names)

    def place(a, b, F):
        t = np.sqrt(2 * a / F)
        return a + b * F * t * (T - t) + F / 4 * (T - t) ** 2

    def slopes(of):
        point, step = np.array([0.5, 3.0, 2.0]), 1e-30
        return [np.imag(of(*(point + 1j * step * row))) / step for row in np.eye(3)]

    column = kernels.index["s"]
    assert found.q[-1, column] == pytest.approx(place(0.5, 3.0, 2.0), rel=1e-11)
    assert found.q_by[-1, column] == pytest.approx(slopes(place), rel=1e-9)
    assert found.events[0].t_by == pytest.approx(slopes(lambda a, b, F: np.sqrt(2 * a / F)), rel=1e-9, abs=1e-11)


def test_what_has_no_derivative():
    """One line with names and time, and no number."""
    m, s = sliding_block("both")
    k = m.parameter("k", 0.0)
    m.event("one", when=0.5 - s, do={"k": 1.0})
    m.event("two", when=0.25 - m.time, do={"k": 2.0})
    m.torque(s, k)
    kernels = ncgen.compile(m)
    with pytest.raises(ncgen.ModelError, match="through the event one, two, which at t = 0.25 s happen at one instant"):
        ncgen.sensitivities(kernels, 1.0, 4, qd0={"s": 2.0})
    with pytest.raises(ncgen.ModelError, match=r"both: hessian does not support events yet \(one, two\)"):
        ncgen.hessian(kernels, 1.0, 4, lambda q, qd: (0.0, None, None, None))
    m, s = sliding_block("touches")
    m.event("one", when=(0.25 - m.time) ** 3, do={"rate(s)": 1.0})
    with pytest.raises(ncgen.ModelError, match="the event one, which at t = 0.25[0-9]* s only touches its condition"):
        ncgen.sensitivities(ncgen.compile(m), 1.0, 4, qd0={"s": 2.0})
    m, s = sliding_block("called")
    m.event("one", when=0.5 - s, do=lambda at, kernels: None)
    with pytest.raises(ncgen.ModelError, match="the event one, which at t = 0.25 s calls a Python function"):
        ncgen.sensitivities(ncgen.compile(m), 1.0, 4, qd0={"s": 2.0})
    m, s = sliding_block("ends")
    m.event("one", when=0.5 - s, do="stop")
    with pytest.raises(ncgen.ModelError, match="the event one ends the motion at t = 0.25 s; take a shorter motion"):
        ncgen.sensitivities(ncgen.compile(m), 1.0, 4, qd0={"s": 2.0})


def test_gaps_that_come_to_rest():
    """After infinitely many bounces nothing is left of what the ball began with; pulled up from t = 1.5 s on it leaves when p t = g."""
    m = bouncing()
    pull = m.parameter("pull", 4.0)
    m.force(m.elements["P"], (0, pull * m.time))
    kernels = ncgen.compile(m)
    found = ncgen.sensitivities(kernels, 2.8, 28, by=["h", "e", "pull"])
    assert found.events[-1].transition == "leaves" and found.events[-1].t == pytest.approx(G / 4, rel=1e-10)
    assert found.events[-1].t_by == pytest.approx([0.0, 0.0, -G / 16], abs=1e-9)
    T = 2.8 - G / 4
    assert found.q_by[-1, 0] == pytest.approx([0.0, 0.0, T**3 / 6 + T**2 / 2 * G / 4], abs=1e-8)
    assert found.q[-1, 0] == pytest.approx(4 * T**3 / 6, rel=1e-9)


def test_events_that_a_joint_has_at_the_start():
    """A push p t that grows: it sticks until p t = F_s, then slips; both ways."""
    m, s = sliding_block("push")
    p, static = m.parameter("p", 1.0), m.parameter("static", 2.0)
    m.torque(s, p * m.time)
    m.friction(s, coulomb=1.0, static=static)
    kernels = ncgen.compile(m)
    names, column = ["p", "static", "s"], kernels.index["s"]
    found = ncgen.sensitivities(kernels, 3.0, 12, by=names)

    def place(p, static, s):
        t = static / p
        return s + p * (27 - t**3) / 6 - p * t**2 / 2 * (3 - t) - (3 - t) ** 2 / 2

    step = 1e-30
    expected = [np.imag(place(*(np.array([1.0, 2.0, 0.0]) + 1j * step * row))) / step for row in np.eye(3)]
    assert found.q[-1, column] == pytest.approx(place(1.0, 2.0, 0.0), rel=1e-10)
    assert found.q_by[-1, column] == pytest.approx(expected, rel=1e-9)
    assert found.events[-1].t_by == pytest.approx([-2.0, 1.0, 0.0], rel=1e-9, abs=1e-12)

    def last(q, qd):
        weight = np.zeros_like(q)
        weight[-1, column] = 1.0
        return q[-1, column], weight, None

    back = ncgen.gradient(kernels, 3.0, 12, last, by=names)
    assert [back.derivatives[name] for name in names] == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("order", ["in turn", "simultaneous"])
def test_several_impacts_at_one_instant(order):
    """Of three balls the last two touch; both laws, in closed form by a complex step: m₁ hits 2 kg, which hits or takes along 0.7 kg."""
    m = ncgen.Model("balls")
    heavy, e = m.parameter("heavy", 1.0), m.parameter("e", 0.8)
    A, B, C = (m.point(name, (x, 0), fixed="y") for name, x in (("A", 1.0), ("B", 2.0), ("C", 2.5)))
    for point, mass in ((A, heavy), (B, 2.0), (C, 0.7)):
        m.body(f"ball.{point.name}", [point], mass=mass)
    for name, first, second in (("AB", A, B), ("BC", B, C)):
        m.event(name, when=second.x - first.x - 0.5, do=ncgen.impact(restitution=e, order=order))
    names = ["heavy", "e", "rate(A.x)"]
    found = ncgen.sensitivities(ncgen.compile(m), 1.5, 6, by=names, zd0={"A.x": 1.0})

    def after(heavy, e, speed):
        struck = 2.0 if order == "in turn" else 2.7
        a, b = speed * (heavy - e * struck) / (heavy + struck), speed * heavy * (1 + e) / (heavy + struck)
        return np.array([a, b, b] if order == "simultaneous" else [a, b * (2 - 0.7 * e) / 2.7, b * 2 * (1 + e) / 2.7])

    step, at = 1e-30, np.array([1.0, 0.8, 1.0])
    slopes = np.array([np.imag(after(*(at + 1j * step * row))) / step for row in np.eye(3)]).T
    assert found.qd[-1] == pytest.approx(after(*at), rel=1e-12) and found.qd_by[-1] == pytest.approx(slopes, rel=1e-10, abs=1e-12)
    assert found.events[0].t_by == pytest.approx([0.0, 0.0, -0.5], rel=1e-12, abs=1e-12)


def test_inputs_over_time():
    """By every value of a table that drives an input, with a bounce on the way; differences of runs."""
    m = ncgen.Model("lifted")
    P = m.point("P", (0, 1), fixed="x")
    m.body("ball", [P], mass=1.0)
    m.gravity((0, -G))
    m.force(P, (0, m.input("lift")))
    m.event("floor", when=P.y, do=ncgen.impact(restitution=0.5))
    kernels, times, values = ncgen.compile(m), np.linspace(0, 0.7, 5), np.array([0.0, 2.0, 3.0, 1.0, 2.0])

    def last(q, qd):
        weight = np.zeros_like(q)
        weight[-1, 0] = 1.0
        return q[-1, 0], weight, None

    found = ncgen.gradient(kernels, 0.7, 28, last, inputs={"lift": (times, values, "linear")})

    def end(values):
        return ncgen.simulate(kernels, 0.7, rtol=1e-12, inputs={"lift": (times, values, "linear")})["P.y"][-1]

    step = 1e-3
    slopes = [(end(values + step * row) - end(values - step * row)) / (2 * step) for row in np.eye(5)]
    assert found.by_inputs["lift"] == pytest.approx(slopes, abs=1e-7)
    assert found.derivatives["lift"] == pytest.approx(np.sum(slopes), abs=1e-7)


@pytest.mark.slow
def test_a_double_pendulum_with_a_stop_and_friction():
    """It sticks, slips, hits its stop and turns; all event times, and the end, by differences of runs. The mode in which it sticks is as
    regular as the mechanism."""
    m = ncgen.Model("pendulum")
    mu, limit, e = m.parameter("mu", 0.6), m.parameter("limit", -1.2), m.parameter("e", 0.3)
    A, B, C = m.point("A", (0, 0), fixed=True), m.point("B", (1, 0)), m.point("C", (1, 0.8))
    x, z = m.vector("x", (1, 0, 0), fixed=True), m.vector("z", (0, 0, 1), fixed=True)
    m.body("upper", points=[A, B], mass=1.0, inertia=1 / 12)
    m.body("lower", points=[B, C], mass=0.5, inertia=0.5 * 0.64 / 12)
    upper, lower = m.angle("upper.angle", start=x, end=B - A, axis=z), m.angle("lower.angle", start=x, end=C - B, axis=z)
    m.gravity((0, -G, 0))
    m.stop(upper, lower=limit, restitution=e)
    m.friction(lower, coulomb=mu, static=1.5 * mu, name="joint")
    kernels, at, given = ncgen.compile(m), {"mu": 0.6, "limit": -1.2, "e": 0.3}, {"integrator": "dop853", "rtol": 1e-11}
    found = ncgen.sensitivities(kernels, 1.3, 13, by=list(at), **given)
    assert [each.transition or each.name for each in found.events[:5]] == ["sticks", "slips", "upper.angle.stop.lower", "turns"] + [
        "upper.angle.stop.lower"
    ]

    def everything(p):
        run = ncgen.simulate(kernels, 1.3, rtol=1e-13, p=p)
        return np.concatenate([run.q[-1], run.qd[-1], [each.t for each in run.events]])

    step = 1e-4
    for k, name in enumerate(at):
        ends = [everything(at | {name: at[name] + way * step}) for way in (1, -1, 2, -2)]
        slope = (8 * (ends[0] - ends[1]) - (ends[2] - ends[3])) / (12 * step)
        mine = np.concatenate([found.q_by[-1, :, k], found.qd_by[-1, :, k], [each.t_by[k] for each in found.events]])
        assert mine == pytest.approx(slope, rel=1e-6, abs=1e-6)
    back = ncgen.gradient(kernels, 1.3, 13, lambda q, qd: (np.sum(q), np.ones_like(q), None), by=list(at), **given)
    assert [back.derivatives[name] for name in at] == pytest.approx(np.sum(found.q_by, axis=(0, 1)), rel=1e-9)


def test_feet_that_share_their_impulse():
    """A carriage that can only rise falls on three feet: whatever each of them takes, it rises with e √(2 g h)."""
    m = ncgen.Model("carriage")
    h, e = m.parameter("h", 1.0), m.parameter("e", 0.5)
    P = m.point("P", (0, 0), fixed="x")
    m.body("carriage", [P], mass=2.0)
    m.gravity((0, -G))
    for name in ("left", "middle", "right"):
        m.event(name, when=P.y + h, do=ncgen.impact(restitution=e, order="simultaneous"))
    kernels = ncgen.compile(m)
    found = ncgen.sensitivities(kernels, 0.6, 6, by=["h", "e"])
    v, place = math.sqrt(2 * G), kernels.index["P.y"]
    assert found.events[0].after_by[place] == pytest.approx([0.5 * v / 2, v], rel=1e-9)
    assert found.events[0].t_by == pytest.approx([1 / v, 0.0], rel=1e-9, abs=1e-12)
