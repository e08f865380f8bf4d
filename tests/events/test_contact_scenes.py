"""Contacts of all surfaces, at their limits: friction of nothing and of everything, files, starts that touch, and what is refused."""

from __future__ import annotations

import math

import numpy as np
import pytest
import sympy
from test_contacts import RADIUS, G, disc, velocity

import ncgen
from ncgen.exchange.toml_writer import to_toml

TOP = 1.0


def on_a_sphere(friction: object, flat: bool = True, **surface: object) -> ncgen.Model:
    """A sphere of 0.1 m on top of a fixed one of 1 m."""
    m = ncgen.Model("tumbling")
    zero = (0,) * (1 if flat else 2)
    O, C = m.point("O", (*zero, 0), fixed=True), m.point("C", (*zero, TOP + RADIUS))
    if flat:
        body = m.body("ball", [C, m.point("D", (RADIUS, TOP + RADIUS))], mass=1.0, com=(0, TOP + RADIUS), inertia=0.4 * RADIUS**2)
    else:
        body = m.body("ball", [C], [m.vector("u", (1, 0, 0)), m.vector("v", (0, 1, 0))], mass=1.0, inertia=[0.4 * RADIUS**2] * 3)
    m.gravity((*zero, -G))
    m.contact("top", body, C, m.ground, O, radius=RADIUS, friction=friction, **(surface or {"around": TOP}))
    return m


@pytest.mark.parametrize(("friction", "kinetic", "flat"), [(0.0, 0.5, True), (1e9, 0.7, True), (1e9, 0.7, False)])
def test_a_sphere_leaves_another(friction, kinetic, flat):
    """Where v² = g R cos θ, and k v² = k v₀² + g R (1 − cos θ), k being 1/2 or with rotation 7/10: cos θ = 2/3 and 10/17 from rest."""
    speed, R = 1.0, TOP + RADIUS
    start = {"C.x": speed, "C.y": 0.0}
    if not flat:
        start |= {"C.z": 0.0, "u.z": -speed / RADIUS}
    elif friction:
        start |= {"D.x": speed, "D.y": -speed}
    else:
        start |= {"D.x": speed, "D.y": 0.0}
    run = ncgen.simulate(ncgen.compile(on_a_sphere(friction, flat)), 2.0, qd0=start, rtol=1e-11)
    leaves = next(each for each in run.events if each.transition == "leaves")
    cosine = leaves.q[1 if flat else 2] / R
    assert cosine == pytest.approx((kinetic * speed**2 / (G * R) + 1) / (kinetic + 1), rel=1e-9)


def test_a_curve_is_the_circle_that_it_describes():
    """A circle about a point beside its centre, as a spline of 400 knots over the angle: rolling, sliding and leaving are the same."""
    off, angles = 0.2, np.linspace(0, 2 * math.pi, 401)
    R = TOP + RADIUS
    m = on_a_sphere(0.3)
    start = {"C.x": 0.5, "C.y": 0.0, "D.x": 0.5, "D.y": 0.0}
    expected = ncgen.simulate(ncgen.compile(m), 1.2, qd0=start, rtol=1e-11)
    other = ncgen.Model("curve")
    x, O = other.vector("x", (1, 0), fixed=True), other.point("O", (-off, 0), fixed=True)
    C, D = other.point("C", (0, R)), other.point("D", (RADIUS, R))
    body = other.body("ball", [C, D], mass=1.0, com=(0, R), inertia=0.4 * RADIUS**2)
    other.gravity((0, -G))
    profile = other.spline("profile", angles, off * np.cos(angles) + np.sqrt(R**2 - (off * np.sin(angles)) ** 2), end="periodic")
    other.contact("top", body, C, other.ground, O, radius=RADIUS, curve=profile, start=x, friction=0.3)
    run = ncgen.simulate(ncgen.compile(other), 1.2, qd0=start, rtol=1e-11)
    transitions = [each.transition for each in run.events]
    assert transitions == [each.transition for each in expected.events] and "leaves" in transitions
    assert [each.t for each in run.events] == pytest.approx([each.t for each in expected.events], rel=1e-6)
    assert run.q[-1] == pytest.approx(expected.q[-1], abs=1e-6)


def test_the_rim_of_a_disc_rolls_as_a_rolling_disc():
    """A contact that sticks is the joint m.rolling, which has the same rows."""
    from examples.disc.model import MASS, build
    from examples.disc.model import RADIUS as rim

    rolling = build(spokes=0)
    m = ncgen.Model("rim")
    C = m.point("C", rolling.elements["C"].initial)
    u, v = (m.vector(name, rolling.elements[name].initial) for name in "uv")
    n, O = m.vector("n", (0, 0, 1), fixed=True), m.point("O", (0, 0, 0), fixed=True)
    axle = u.initial
    inertia = MASS * rim**2 / 4 * (np.eye(3) + np.outer(axle, axle))
    body = m.body("disc", [C], [u, v], mass=MASS, inertia=inertia, constant_mass=True)
    m.gravity((0, 0, -G))
    m.contact("rim", body, C, m.ground, O, radius=rim, edge=u, normal=n, friction=100.0)
    kernels = ncgen.compile(rolling)
    expected = ncgen.simulate(kernels, 0.5, zd0=rolling.simulation_options["zd0"], rtol=1e-11)
    start = dict(zip(kernels.coordinates, expected.qd[0], strict=True))
    run = ncgen.simulate(ncgen.compile(m), 0.5, qd0={name: start[name] for name in start if name[0] in "Cuv"}, rtol=1e-11)
    assert [each.transition for each in run.events] == ["rests", "sticks"]
    assert [run[f"{name}.{axis}"][-1] for name in "Cuv" for axis in "xyz"] == pytest.approx(
        [expected[f"{name}.{axis}"][-1] for name in "Cuv" for axis in "xyz"], abs=1e-9
    )


def test_files_say_contacts(tmp_path):
    file = tmp_path / "ball.toml"
    m = disc(1.0, tangential=0.5, restitution=0.2, order="in turn", law="newton")
    file.write_text(to_toml(m), encoding="utf-8")
    again = ncgen.load(file)
    assert "[[contact]]" in to_toml(m) and to_toml(again) == to_toml(m)
    runs = [ncgen.simulate(ncgen.compile(each), 0.6, qd0=velocity(1.0, 5.0)) for each in (m, again)]
    assert np.array_equal(runs[0].q, runs[1].q)


def test_friction_is_a_parameter():
    """Without friction it slides for ever; with some it rolls at 2 v₀/(7 μ g)."""
    m = ncgen.Model("ball")
    up, O = m.vector("up", (0, 1), fixed=True), m.point("O", (0, 0), fixed=True)
    C = m.point("C", (0, RADIUS))
    body = m.body("ball", [C, m.point("D", (RADIUS, RADIUS))], mass=1.0, com=(0, RADIUS), inertia=0.4 * RADIUS**2)
    m.gravity((0, -G))
    m.contact("floor", body, C, m.ground, O, radius=RADIUS, normal=up, friction=m.parameter("mu", 0.2))
    kernels = ncgen.compile(m)
    for mu, what in ((0.0, ["rests"]), (0.4, ["rests", "sticks"])):
        run = ncgen.simulate(kernels, 0.5, qd0=velocity(5.0, 0.0), p={"mu": mu}, rtol=1e-11)
        assert [each.transition for each in run.events] == what
        assert run["rate(C.x)"][-1] == pytest.approx(25 / 7 if mu else 5.0, rel=1e-9)
    with pytest.raises(ncgen.ModelError, match="contact floor: friction is -0.1; give a number that is not negative"):
        ncgen.simulate(kernels, 0.5, p={"mu": -0.1})


def test_a_block_on_a_slope_sticks_up_to_its_friction():
    """A point that is pushed along: it slides when the push exceeds μ N, and then with the rest."""
    m = ncgen.Model("block")
    up, O, P = m.vector("up", (0, 1), fixed=True), m.point("O", (0, 0), fixed=True), m.point("P", (0, 0))
    body = m.body("block", [P], mass=1.0)
    m.gravity((0, -G))
    m.force(P, (m.time, 0))
    m.contact("floor", body, P, m.ground, O, normal=up, friction=0.2)
    run = ncgen.simulate(ncgen.compile(m), 3.0, rtol=1e-11)
    assert [each.transition for each in run.events] == ["rests", "sticks", "slips"]
    assert run.events[2].t == pytest.approx(0.2 * G, rel=1e-10) and run["P.x"][-1] == pytest.approx((3 - 0.2 * G) ** 3 / 6, rel=1e-9)


def test_a_compliant_contact():
    """Hunt and Crossley: out with 0.7484 of the velocity, without friction."""
    m = ncgen.Model("compliant")
    side, O, P = m.vector("side", (-1, 0), fixed=True), m.point("O", (0.5, 0), fixed=True), m.point("P", (0, 0))
    body = m.body("block", [P], mass=1.0)
    m.contact("wall", body, P, m.ground, O, normal=side, stiffness=1e4, damping=0.5, exponent=1.5)
    run = ncgen.simulate(ncgen.compile(m), 0.8, rtol=1e-11, qd0={"P.x": 1.0, "P.y": 0.3})
    assert [each.name for each in run.events] == ["wall", "wall.left"] and run.events[0].t == pytest.approx(0.5, rel=1e-12)
    assert run.qd[-1] == pytest.approx([-0.7484349315974342, 0.3], rel=1e-9)


def test_a_compliant_contact_that_is_pressed_at_the_start():
    """It pushes from the start on: half a period of the spring later it leaves with all its energy."""
    m = ncgen.Model("pressed")
    side, O, P = m.vector("side", (1, 0), fixed=True), m.point("O", (0, 0), fixed=True), m.point("P", (-0.1, 0))
    m.contact("wall", m.body("block", [P], mass=1.0), P, m.ground, O, normal=side, stiffness=100.0)
    run = ncgen.simulate(ncgen.compile(m), 0.8, rtol=1e-11)
    (left,) = run.events
    assert left.name == "wall.left" and left.t == pytest.approx(math.pi / 20, rel=1e-9)
    assert run.qd[-1] == pytest.approx([1.0, 0.0], abs=1e-9)


def test_starts_that_touch_and_that_overlap():
    m = disc(RADIUS, restitution=0.5)
    kernels = ncgen.compile(m)
    run = ncgen.simulate(kernels, 0.1, qd0={"C.x": 0.0, "C.y": -1.0, "D.x": 0.0, "D.y": -1.0})
    assert run.events[0].t == 0.0 and run.events[0].search == "start" and run.qd[0, 1] == pytest.approx(0.5, rel=1e-12)
    with pytest.raises(ncgen.ModelError, match="event floor: the gap is -0.05 at the start; begin where it is not below 0"):
        ncgen.simulate(kernels, 0.1, q0={"C.y": 0.05, "C.x": 0.0, "D.y": 0.05})


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"friction": -0.1}, "contact floor: friction is -0.1; give a number that is not negative"),
        ({"friction": math.inf}, "contact floor, friction: inf is not a finite number; correct it"),
        ({"friction": 0.0, "tangential": 0.5}, "tangential restitution needs friction, which is 0; give friction, or leave tangential out"),
        ({"tangential": 1.5}, "contact floor: tangential restitution 1.5; give a number from 0 to 1"),
        ({"restitution": 1.5}, "restitution 1.5; give a number from 0 to 1"),
        ({"law": "poisson", "tangential": 0.5}, 'tangential restitution goes with law="newton" only'),
        ({"law": "hertz"}, "contact floor: law"),
        ({"stiffness": 1e4}, "contact floor: friction and stiffness do not go together"),
        ({"damping": 1.0}, "damping and exponent belong to a compliant contact; give its stiffness"),
        ({"around": 1.0}, "one surface is needed at O; give normal"),
        ({"normal": None}, "one surface is needed at O; give normal"),
        ({"inside": True}, "inside is of a sphere or a cylinder"),
        ({"radius": -0.1}, "contact floor: radius is -0.1 m; give a positive one"),
        ({"normal": None, "around": 0.05, "inside": True}, "around less radius is -0.05 m; what is inside must be smaller"),
        ({"on": "ball", "at": "C"}, "both sides belong to body ball"),
        ({"body": "ground"}, "the ground is its first body; give the one that moves first"),
        ({"at": "D"}, "D is not a point of ground; give one of its points"),
    ],
)
def test_contacts_that_are_refused(options, message):
    m = ncgen.Model("ball")
    m.vector("up", (0, 1), fixed=True)
    m.point("O", (0, 0), fixed=True)
    m.body("ball", [m.point("C", (0, 1)), m.point("D", (RADIUS, 1))], mass=1.0, inertia=0.004)
    given = {"body": "ball", "point": "C", "on": "ground", "at": "O", "radius": RADIUS, "normal": "up", "friction": 0.2} | options
    with pytest.raises(ncgen.ModelError, match=message):
        m.contact("floor", **given)


def test_a_body_that_cannot_turn_has_no_sphere():
    m = ncgen.Model("point")
    up, O, P = m.vector("up", (0, 1), fixed=True), m.point("O", (0, 0), fixed=True), m.point("P", (0, 1))
    body = m.body("mass", [P], mass=1.0)
    with pytest.raises(ncgen.ModelError, match="contact floor: body mass has no directions with which it turns; give it another point"):
        m.contact("floor", body, P, m.ground, O, radius=0.1, normal=up)


def sliding_rod(t: float, y: np.ndarray, mu: float) -> list[float]:
    """Another formulation of a rod of 1 m and 1 kg whose end slides to the right: its place x, the angle θ at which it leans to the left,
    and their rates. Its load follows from Newton's and Euler's equations of the rod with a friction −μ N."""
    _, angle, _, rate = y
    s, c = math.sin(angle), math.cos(angle)
    per_load = -6 * (c - mu * s)  # θ̈ for N = 1: moment of inertia 1/12
    load = (G - s * rate**2 / 2) / (1 - c * per_load / 2)
    turn = per_load * load
    return [y[2], rate, -mu * load - (s * turn + c * rate**2) / 2, turn]


@pytest.mark.parametrize("mu", [0.3, 1.5])
def test_a_rod_slides_as_another_formulation_says(mu):
    """Until it sticks."""
    from scipy.integrate import solve_ivp
    from test_contacts import rod

    def slides(t, y, mu):
        return y[2]

    slides.terminal = True
    angle = math.radians(45)
    found = solve_ivp(sliding_rod, (0.0, 1.0), [0.0, angle, 1.0, 0.0], "DOP853", events=slides, args=(mu,), rtol=1e-13, atol=1e-14)
    kernels = ncgen.compile(rod(mu, angle))
    run = ncgen.simulate(kernels, 1.1 * found.t[-1], qd0={"A.x": 1.0, "A.y": 0.0, "B.x": 1.0, "B.y": 0.0}, rtol=1e-11)
    stops = run.events[1]
    assert stops.t == pytest.approx(found.t[-1], rel=1e-9)
    x, theta = found.y[:2, -1]
    assert stops.q == pytest.approx([x, 0.0, x - math.cos(theta), math.sin(theta)], abs=1e-9)


def test_two_tips_begin_to_slide_together():
    """Which of them friction holds is not determined; the time at which the push exceeds that of both is."""
    m = ncgen.Model("block")
    up, O = m.vector("up", (0, 1), fixed=True), m.point("O", (0, 0), fixed=True)
    A, B, C = m.point("A", (0, 0)), m.point("B", (1, 0)), m.point("C", (0.5, 0.3))
    body = m.body("block", [A, B, C], mass=1.0, com=(0.5, 0.3), inertia=0.1)
    m.gravity((0, -G))
    m.force(C, (m.time, 0))
    for P in (A, B):
        m.contact(f"tip_{P.name}", body, P, m.ground, O, normal=up, friction=0.3)
    run = ncgen.simulate(ncgen.compile(m), 4.0, rtol=1e-11)
    assert run.events[-1].transition == "slips" and run.events[-1].t == pytest.approx(0.3 * G, rel=1e-10) and len(run.events) < 10


def test_contacts_step_by_step():
    kernels = ncgen.compile(disc(1.0))
    sim = ncgen.start(kernels, qd0=velocity(0.0, 50.0), rtol=1e-11)
    for _ in range(20):
        sim.step(0.05)
    assert [each.transition for each in sim.events] == ["", "rests", "sticks"]
    assert sim.events[2].t == pytest.approx(0.72811999417504, rel=1e-9) and sim.qd[0] == pytest.approx(-10 / 7, rel=1e-9)


def test_models_that_call_python_do_not_slide():
    m = disc(RADIUS)
    m.callback(lambda t, q, qd, kernels: np.zeros(4))
    with pytest.raises(ncgen.ModelError, match="ball: contact floor cannot slide: the model calls a Python function"):
        ncgen.simulate(ncgen.compile(m), 0.1, qd0=velocity(1.0, 0.0))


@pytest.mark.parametrize("com", [0.5, 0.8, 0.95])
def test_a_block_on_two_tips_that_is_pushed_to_and_fro_stays(com):
    """Friction holds 2.943 N, so 2.9 N at 1 Hz move nothing, however the loads of the tips are shared; 3.2 N move it at asin(2.943/3.2)."""
    pushed = {2.9: 2.0, 3.2: 0.25}
    for most, duration in pushed.items():
        m = ncgen.Model("block")
        up, O = m.vector("up", (0, 1), fixed=True), m.point("O", (0, 0), fixed=True)
        tips = {"left": m.point("A", (0, 0)), "right": m.point("B", (1, 0))}
        body = m.body("block", list(tips.values()), mass=1.0, com=(com, 0), inertia=0.1)
        m.gravity((0, -9.81))
        m.force(tips["left"], (most * sympy.sin(2 * math.pi * m.time), 0))
        for name, P in tips.items():
            m.contact(name, body, P, m.ground, O, normal=up, friction=0.3, order="simultaneous")
        run = ncgen.simulate(ncgen.compile(m), duration, rtol=1e-10)
        if most < 2.943:
            assert not np.any(run.q - run.q[0]) and not np.any(run.qd)
        else:
            first = math.asin(2.943 / most) / (2 * math.pi)
            assert [each.t for each in run.events if each.transition == "slips"][-1] == pytest.approx(first, rel=1e-9)
            assert run["rate(A.x)"][-1] > 1e-3
