"""Derivatives through contacts with friction and through friction of loads, against closed forms and differences of runs."""

from __future__ import annotations

import math

import numpy as np
import pytest
import sympy
from test_contacts import RADIUS, G, velocity
from test_lock_gradients import GIVEN, check_sweep, differences_of, slopes_of

import ncgen
from examples.contacts import woodpecker

TAN = 0.05


def ball(height, **options):
    """A homogeneous sphere of 1 kg above the ground in the plane, with parameters."""
    m = ncgen.Model("ball")
    up, O, C = m.vector("up", (0, 1), fixed=True), m.point("O", (0, 0), fixed=True), m.point("C", (0, height))
    mu, g = m.parameter("mu", 0.2), m.parameter("g", G)
    body = m.body("ball", [C, m.point("D", (RADIUS, height))], mass=1.0, com=(0, height), inertia=0.4 * RADIUS**2)
    m.gravity((0, -g))
    options = {name: m.parameter(name, value) if isinstance(value, float) else value for name, value in options.items()}
    m.contact("floor", body, C, m.ground, O, radius=RADIUS, normal=up, friction=mu, **options)
    return ncgen.compile(m)


def test_a_sphere_slides_and_rolls():
    """It rolls at 2 v/(7 μ g) with 5/7 of its velocity."""
    kernels, by, given = ball(RADIUS), ["mu", "g", "rate(C.x)"], GIVEN | {"rtol": 1e-13, "qd0": velocity(5.0, 0.0)}
    found = ncgen.sensitivities(kernels, 1.0, 10, by=by, **given)

    def end(mu, g, v):
        t = 2 * v / (7 * mu * g)
        return np.array([t, v * t - mu * g * t**2 / 2 + 5 / 7 * v * (1 - t), 5 / 7 * v])

    place = kernels.index["C.x"]
    mine = np.vstack([found.events[-1].t_by, found.q_by[-1, place], found.qd_by[-1, place]])
    assert found.events[-1].transition == "sticks"
    assert mine == pytest.approx(slopes_of(end, [0.2, G, 5.0]), rel=1e-9, abs=1e-9)
    check_sweep(kernels, 1.0, 10, found, by, **given)


def test_a_spinning_sphere_drops_and_slides():
    """Its impact cannot stop the spin (T2): ẋ = −μ √(2 g h), then it slides with −μ g until it rolls."""
    kernels, by, given = ball(1.0), ["mu", "g", "rate(D.y)"], GIVEN | {"qd0": velocity(0.0, 50.0)}
    found = ncgen.sensitivities(kernels, 1.0, 10, by=by, **given)

    def end(mu, g, u):
        t = np.sqrt(1.8 / g)
        x = -mu * g * t
        slip = x + u + x / 0.4
        rest = slip / (3.5 * mu * g)
        rolls = x - mu * g * rest
        return np.array([t, t + rest, x * rest - mu * g * rest**2 / 2 + rolls * (1 - t - rest), rolls])

    place = kernels.index["C.x"]
    hit, _, sticks = found.events
    mine = np.vstack([hit.t_by, sticks.t_by, found.q_by[-1, place], found.qd_by[-1, place]])
    assert mine == pytest.approx(slopes_of(end, [0.2, G, 5.0]), rel=1e-9, abs=1e-9)
    check_sweep(kernels, 1.0, 10, found, by, **given)


@pytest.mark.parametrize(
    ("law", "options", "spin"),
    [("newton", {"restitution": 0.6, "tangential": 0.3}, 5.0), ("newton", {"restitution": 0.6, "tangential": 0.3}, 50.0)]
    + [("poisson", {"restitution": 0.6}, 5.0), ("poisson", {"restitution": 0.6}, 32.0), ("poisson", {"restitution": 0.6}, 50.0)],
)
def test_impacts_that_stick_and_slide(law, options, spin):
    """Impulses by the laws of one contact: with Poisson's law it may slide and then stick in the compression or in the restitution."""
    kernels, by = ball(1.0, law=law, **options), ["mu", "rate(D.y)", *options]
    given = GIVEN | {"qd0": velocity(0.0, spin)}
    found = ncgen.sensitivities(kernels, 0.6, 6, by=by, **given)

    def after(mu, u, e, tangential=0.0):
        speed, slip = np.sqrt(1.8 * G), u + 0j
        if law == "newton":
            sticks = -(1 + tangential) * slip / 3.5
            push = sticks if abs(sticks) <= mu.real * (1 + e.real) * speed.real else -mu * (1 + e) * speed
            return np.array([e * speed, push])
        first = -slip / 3.5 if abs(slip / 3.5) <= mu.real * speed else -mu * speed
        slip = slip + 3.5 * first
        more = -slip / 3.5 if abs(slip / 3.5) <= mu.real * e.real * speed else -mu * e * speed
        return np.array([e * speed, first + more])

    expected = slopes_of(lambda *p: after(*map(np.complex128, p)), [0.2, spin * RADIUS, *options.values()])
    hit, places = found.events[0], [kernels.index[name] for name in ("C.y", "C.x")]
    assert hit.after_by[places] == pytest.approx(expected, rel=1e-9, abs=1e-9)
    check_sweep(kernels, 0.6, 6, found, by, **given)


def test_a_block_on_an_incline_that_steepens():
    """Two feet stick until tan (p t) = μ, both at once; then it slides with g (sin p t − μ cos p t), one foot like the other."""
    m = ncgen.Model("block")
    up, O = m.vector("up", (0, 1), fixed=True), m.point("O", (0, 0), fixed=True)
    A, B = m.point("A", (0, 0)), m.point("B", (1, 0))
    mu, p = m.parameter("mu", 0.3), m.parameter("p", 0.5)
    body = m.body("block", [A, B], mass=2.0, com=(0.5, 0.2), inertia=0.3)
    tilt = p * m.time
    for foot in (A, B):
        m.force(foot, (G * sympy.sin(tilt), -G * sympy.cos(tilt)))
        m.contact(foot.name + "foot", body, foot, m.ground, O, normal=up, friction=mu, order="simultaneous")
    kernels, by = ncgen.compile(m), ["mu", "p"]
    found = ncgen.sensitivities(kernels, 1.0, 10, by=by, **GIVEN)

    def end(mu, p):
        t = np.arctan(mu) / p

        def pulled(a):
            return G * (-np.sin(p * a) / p**2 + mu * np.cos(p * a) / p**2)

        rate = G * (-np.cos(p * t) / p - mu * np.sin(p * t) / p)
        return np.array([t, pulled(1.0) - pulled(t) - rate * (1.0 - t)])

    mine = np.vstack([found.events[-1].t_by, found.q_by[-1, kernels.index["A.x"]]])
    assert mine == pytest.approx(slopes_of(end, [0.3, 0.5]), rel=1e-9, abs=1e-9)


def test_two_feet_come_to_rest_together():
    """A block that slides to a stop: both feet at 2 v/(2 μ g), which is no coincidence."""
    m = ncgen.Model("block")
    up, O = m.vector("up", (0, 1), fixed=True), m.point("O", (0, 0), fixed=True)
    A, B = m.point("A", (0, 0)), m.point("B", (1, 0))
    mu = m.parameter("mu", 0.3)
    body = m.body("block", [A, B], mass=2.0, com=(0.5, 0.2), inertia=0.3)
    m.gravity((0, -G))
    for foot in (A, B):
        m.contact(foot.name + "foot", body, foot, m.ground, O, normal=up, friction=mu, order="simultaneous")
    kernels, by = ncgen.compile(m), ["mu", "rate(A.x)"]
    found = ncgen.sensitivities(kernels, 1.0, 10, by=by, qd0={"A.x": 1.0, "A.y": 0.0, "B.y": 0.0}, **GIVEN)
    mine = np.vstack([found.events[-1].t_by, found.q_by[-1, kernels.index["A.x"]]])
    expected = slopes_of(lambda mu, v: np.array([v / (mu * G), v**2 / (2 * mu * G)]), [0.3, 1.0])
    assert mine == pytest.approx(expected, rel=1e-9, abs=1e-9)


def test_what_has_no_derivative():
    """One line with names and time."""
    kernels = ball(1.0, restitution=0.5)
    limit = 3.5 * 0.2 * 1.5 * math.sqrt(1.8 * G)
    with pytest.raises(ncgen.ModelError, match=r"the event floor, which at t = 0.428352937 s is at the limit between sticking and sliding"):
        ncgen.sensitivities(kernels, 0.6, 6, by=["mu"], qd0=velocity(0.0, limit / RADIUS), **GIVEN)
    with pytest.raises(ncgen.ModelError, match=r"ball: hessian does not support events yet \(floor\)"):
        ncgen.hessian(kernels, 0.6, 6, lambda q, qd: (0.0, None, None, None))
    with pytest.raises(ncgen.ModelError, match=r"block: hessian does not support events yet \(push, guide\)"):
        ncgen.hessian(guided(), 0.6, 6, lambda q, qd: (0.0, None, None, None))
    kernels = in_space(push=lambda t: (10 * t, 0, 0))
    with pytest.raises(
        ncgen.ModelError, match=r"floor, which at t = 0.6867[0-9]* s begins to slide in space, where friction has no direction"
    ):
        ncgen.sensitivities(kernels, 1.0, 10, by=["mu"], **GIVEN)


def in_space(push=None):
    """A homogeneous sphere of 1 kg on the ground in space."""
    m = ncgen.Model("ball")
    up, O, C = m.vector("up", (0, 0, 1), fixed=True), m.point("O", (0, 0, 0), fixed=True), m.point("C", (0, 0, RADIUS))
    body = m.body("ball", [C], [m.vector("u", (1, 0, 0)), m.vector("v", (0, 1, 0))], mass=1.0, inertia=[0.4 * RADIUS**2] * 3)
    m.gravity((0, 0, -G))
    if push:
        m.force(C, push(m.time))
    m.contact("floor", body, C, m.ground, O, radius=RADIUS, normal=up, friction=m.parameter("mu", 0.2))
    return ncgen.compile(m)


def test_a_sphere_in_space_slides_and_rolls():
    """Spun about x as it moves along x and y: friction has one direction, of the sliding velocity w, until |w| = 7/2 μ g t."""
    kernels, spin, by = in_space(), 20.0, ["mu", "rate(C.x)", "rate(C.y)"]
    start = dict.fromkeys(kernels.coordinates, 0.0) | {"C.x": 3.0, "C.y": 1.0, "v.z": spin}
    found = ncgen.sensitivities(kernels, 1.5, 15, by=by, qd0=start, **GIVEN)

    def end(mu, x, y):
        v, w = np.array([x, y]), np.array([x, y + RADIUS * spin])
        size = np.sqrt(w @ w)
        t, rolls = 2 * size / (7 * mu * G), v - 2 / 7 * w
        return np.concatenate([[t], v * t - mu * G * w / size * t**2 / 2 + rolls * (1.5 - t), rolls])

    places, sticks = [kernels.index["C.x"], kernels.index["C.y"]], found.events[-1]
    assert sticks.transition == "sticks"
    mine = np.vstack([sticks.t_by, found.q_by[-1][places], found.qd_by[-1][places]])
    assert mine == pytest.approx(slopes_of(end, [0.2, 3.0, 1.0]), rel=1e-9, abs=1e-9)
    check_sweep(kernels, 1.5, 15, found, by, qd0=start, **GIVEN)


def guided():
    """A block of 2 kg in a guide, thrown; its side force presses and the push p t carries it off again."""
    m = ncgen.Model("block")
    axis, O, A = m.vector("axis", (1, 0, 0), fixed=True), m.point("O", (0, 0), fixed=True), m.point("A", (1, 0))
    s = m.slide("s", O, A, axis)
    m.body("block", [A], mass=2.0)
    mu, side, p = m.parameter("mu", 0.5), m.parameter("side", -4.0), m.parameter("p", 1.0)
    on = m.input("on")
    m.force(A, (on * p * m.time, side))
    m.event("push", when=1.5 - m.time, do={"on": 1.0})
    m.friction(s, coefficient=mu, load=m.constrain(A.y, label="guide"), name="guide")
    return ncgen.compile(m)


def test_a_block_in_a_guide():
    """It stops after 2 v/(μ |N|), and is carried off where p t = μ |N|."""
    kernels, by, given = guided(), ["mu", "side", "p", "rate(A.x)"], {"qd0": {"s": 1.0}}
    found = ncgen.sensitivities(kernels, 3.0, 30, by=by, **given)

    def end(mu, side, p, v):
        most = -mu * side
        stops, goes = 2 * v / most, most / p
        place = 1 + v**2 / most + (p * (27 - goes**3) / 6 - p * goes**2 / 2 * (3 - goes) - most * (3 - goes) ** 2 / 2) / 2
        return np.array([stops, goes, place])

    place, (sticks, slips) = kernels.index["s"], [each for each in found.events if each.transition]
    assert [sticks.transition, slips.transition] == ["sticks", "slips"]
    mine = np.vstack([sticks.t_by, slips.t_by, found.q_by[-1, place]])
    assert mine == pytest.approx(slopes_of(end, [0.5, -4.0, 1.0, 1.0]), rel=1e-9, abs=1e-9)
    check_sweep(kernels, 3.0, 30, found, by, **given)


def screw():
    """A nut that lifts a weight by a couple, with friction of its thread's own load (T16)."""
    m = ncgen.Model("screw")
    x, z = m.vector("x", (1, 0, 0), fixed=True), m.vector("z", (0, 0, 1), fixed=True)
    O, P, A = m.point("O", (0, 0), fixed=True), m.point("P", (1, 0)), m.point("A", (1, 0), fixed="y")
    turn, lift = m.angle("turn", x, P - O, z), m.slide("lift", O, A, x)
    m.body("nut", [O, P], mass=1.0, com=(0, 0), inertia=8e-5)
    m.body("load", [A], mass=10.0)
    mu, couple = m.parameter("mu", 0.1), m.parameter("couple", 1.0)
    cos = 1 / math.hypot(1, TAN)
    thread = m.constrain(cos * (lift - 1) - TAN * cos * 0.02 * turn, label="thread")
    m.torque(lift, -100.0)
    m.torque(turn, couple * m.time)
    m.friction(turn, other=lift, ratio=-TAN / 0.02, coefficient=mu * 0.02 * cos, load=thread, name="rubbing")
    return ncgen.compile(m)


def test_a_screw_that_begins_to_lift():
    """The couple reaches W r tan(λ + φ) = W r (tan λ + μ)/(1 − μ tan λ); then m r tan λ θ̈ = N (cos − μ sin) − W, J θ̈ = c t − N r (…)."""
    kernels, by = screw(), ["mu", "couple"]
    found = ncgen.sensitivities(kernels, 0.5, 10, by=by, **GIVEN)

    def end(mu, couple):
        most = 2.0 * (TAN + mu) / (1 - mu * TAN)
        t, lever = most / couple, 0.02 * (TAN + mu) / (1 - mu * TAN)
        inertia = 8e-5 + lever * 10.0 * 0.02 * TAN
        return np.array([t, couple * (0.5 - t) ** 3 / (6 * inertia)])

    mine = np.vstack([found.events[-1].t_by, found.q_by[-1, kernels.index["turn"]]])
    assert found.events[-1].transition == "slips"
    assert mine == pytest.approx(slopes_of(end, [0.1, 1.0]), rel=1e-8, abs=1e-8)
    check_sweep(kernels, 0.5, 10, found, by, **GIVEN)


def leaning():
    """A double pendulum whose lower end falls on the ground, slides with friction, and sticks."""
    m = ncgen.Model("leaning")
    mu, height, e = m.parameter("mu", 0.15), m.parameter("height", -1.25), m.parameter("e", 0.3)
    A, B, C = m.point("A", (0, 0), fixed=True), m.point("B", (1, -0.2)), m.point("C", (1.6, -0.9))
    x, z = m.vector("x", (1, 0, 0), fixed=True), m.vector("z", (0, 0, 1), fixed=True)
    m.body("upper", points=[A, B], mass=1.0, inertia=1 / 12)
    m.body("lower", points=[B, C], mass=0.5, inertia=0.04)
    m.angle("upper.angle", start=x, end=B - A, axis=z)
    m.gravity((0, -G, 0))
    m.gap_contact("floor.contact", C.y - height, C.x.rate, friction=mu, restitution=e)
    return ncgen.compile(m)


@pytest.mark.slow
def test_a_double_pendulum_that_slides_on_the_ground():
    """All coordinates, velocities and event times by differences of runs."""
    kernels, at = leaning(), {"mu": 0.15, "height": -1.25, "e": 0.3}
    found = ncgen.sensitivities(kernels, 0.5, 5, by=list(at), **GIVEN)

    def everything(p):
        run = ncgen.simulate(kernels, 0.5, rtol=1e-13, p=p)
        return np.concatenate([run.q[-1], run.qd[-1], [run.events[0].t]])

    mine = np.vstack([found.q_by[-1], found.qd_by[-1], [found.events[0].t_by]])
    assert mine == pytest.approx(differences_of(everything, at), rel=1e-6, abs=1e-6)
    check_sweep(kernels, 0.5, 5, found, list(at), **GIVEN)


@pytest.mark.slow
def test_a_woodpecker():
    """Through twelve events of Glocker's toy: it sticks, slips, leaves, and hits with its beak; all of it by differences of runs."""
    model, velocities = woodpecker()
    kernels, by = ncgen.compile(model), ["rate(y.x)", "rate(b.x)"]
    found = ncgen.sensitivities(kernels, 0.125, 20, by=by, qd0=velocities, **GIVEN)
    assert len(found.events) == 12 and {each.transition for each in found.events} == {"", "rests", "sticks", "slips", "leaves"}
    start = {name: velocities[name] for name in ("y.x", "a.x", "b.x")}

    def everything(values):
        given = start | {name[len("rate(") : -1]: value for name, value in values.items()}
        run = ncgen.simulate(kernels, 0.125, rtol=1e-12, zd0=given)
        return np.concatenate([run.q[-1], run.qd[-1], [each.t for each in run.events]])

    mine = np.vstack([found.q_by[-1], found.qd_by[-1], [each.t_by for each in found.events]])
    assert mine == pytest.approx(differences_of(everything, {name: start[name[5:-1]] for name in by}), rel=1e-6, abs=1e-7)
    check_sweep(kernels, 0.125, 20, found, by, qd0=velocities, **GIVEN)


def test_a_point_that_slides_sticks_and_is_pushed_on():
    """A particle on the ground: it stops at v/(μ g), sticks, and leaves its place where p t = μ m g; steps of rk4 and of others."""
    m = ncgen.Model("particle")
    up, O, P = m.vector("up", (0, 1), fixed=True), m.point("O", (0, 0), fixed=True), m.point("P", (0, 0))
    mu, p = m.parameter("mu", 0.2), m.parameter("p", 1.5)
    body = m.body("particle", [P], mass=1.0)
    m.gravity((0, -G))
    on = m.input("on")
    m.force(P, (on * p * m.time, 0))
    m.event("push", when=1.0 - m.time, do={"on": 1.0})
    m.contact("floor", body, P, m.ground, O, normal=up, friction=mu)
    kernels, by = ncgen.compile(m), ["mu", "p", "rate(P.x)"]

    def end(mu, p, v):
        most = mu * G
        goes = most / p
        place = v**2 / (2 * most) + p * (8 - goes**3) / 6 - p * goes**2 / 2 * (2 - goes) - most * (2 - goes) ** 2 / 2
        return np.array([v / most, goes, place])

    for given in ({}, GIVEN):
        found = ncgen.sensitivities(kernels, 2.0, 20, by=by, qd0={"P.x": 1.0, "P.y": 0.0}, **given)
        sticks, slips = (next(each for each in found.events if each.transition == what) for what in ("sticks", "slips"))
        mine = np.vstack([sticks.t_by, slips.t_by, found.q_by[-1, kernels.index["P.x"]]])
        assert mine == pytest.approx(slopes_of(end, [0.2, 1.5, 1.0]), rel=1e-9, abs=1e-9)
