"""Events: every crossing of several conditions in order, actions at its instant, and the run goes on."""

from __future__ import annotations

import math

import numpy as np
import pytest
import sympy as sp
from bouncing import G, ball
from sliding import sliding_block

import ncgen
from ncgen.exchange.toml_writer import to_toml


@pytest.fixture(scope="module")
def dropped():
    return ncgen.compile(ball())


def test_a_ball_bounces():
    """Closed form: t₁ = √(2h/g), later bounces are shorter by e each, and accumulate at t₁ (1 + e)/(1 − e)."""
    with pytest.warns(UserWarning, match="event floor: bounces accumulate at t = 1.35457092 s"):
        run = ncgen.simulate(ncgen.compile(ball(rest="end")), 2.0)
    assert run.stopped and {each.name for each in run.events} == {"floor"} and {each.search for each in run.events} == {"polynomial"}
    times = [each.t for each in run.events]
    assert times[:2] == pytest.approx([0.4515236409857309, 0.9030472819714618], rel=1e-13)
    assert times[9] == pytest.approx(1.352807158734592, rel=1e-13)
    assert run.events[-1].limit == pytest.approx(1.354570922957193, rel=1e-13)
    first = run.events[0]
    speed = math.sqrt(2 * G)
    assert [first.before[0], first.after[0]] == pytest.approx([-speed, speed / 2], rel=1e-13)
    assert [first.impulse, first.energy_lost] == pytest.approx([1.5 * speed, 0.75 * G], rel=1e-13)
    assert run.energy_drift < 1e-13


def test_after_one_bounce(dropped):
    run = ncgen.simulate(dropped, 0.7, points=8)
    assert len(run.t) == 8 and not run.stopped
    assert run["P.y"][-1] == pytest.approx(0.2474692639735212, rel=1e-13)


@pytest.mark.parametrize("points", [2, 701, [0.0, 0.4515236409857309, 0.7]], ids=str)
def test_events_do_not_depend_on_the_output_times(dropped, points):
    run = ncgen.simulate(dropped, 0.7, points=points)
    assert [each.t for each in run.events] == pytest.approx([0.4515236409857309], rel=1e-13)
    assert run["P.y"][-1] == pytest.approx(0.2474692639735212, rel=1e-13)


def test_hundreds_of_bounces_keep_the_balance_of_energy():
    """Without loss, each takes 2 t₁; energy and work balance to the end, through 443 of them."""
    m = ball(1.0)
    run = ncgen.simulate(ncgen.compile(m), 400.0, points=3)
    assert len(run.events) == int((400.0 / math.sqrt(2 / G) + 1) / 2) and run.energy_drift < 1e-9


def three_balls(order: str) -> ncgen.Kernels:
    m = ncgen.Model("balls")
    for k, x in enumerate((-1.0, 0.0, 0.1)):
        m.body(f"ball{k}", [m.point(f"P{k}", (x, 0), fixed="y")], mass=1.0)
    x = [m.elements[f"P{k}"].x for k in range(3)]
    for k in (1, 2):
        m.event(f"gap{k}", when=x[k] - x[k - 1] - 0.1, do=ncgen.impact(restitution=1.0, order=order))
    return ncgen.compile(m)


@pytest.mark.parametrize(("order", "expected"), [("simultaneous", (-1 / 3, 2 / 3, 2 / 3)), ("in turn", (0.0, 0.0, 1.0))])
def test_the_law_of_several_impacts(order, expected):
    """One ball hits two that touch: both laws keep energy and momentum, and differ."""
    run = ncgen.simulate(three_balls(order), 1.5, qd0={"P0.x": 1.0, "P1.x": 0.0, "P2.x": 0.0})
    assert run.qd[-1] == pytest.approx(expected, abs=1e-12)
    assert run.events[0].t == pytest.approx(0.9, rel=1e-13) and run.energy_drift < 1e-12


def test_the_law_must_be_said_where_it_matters():
    with pytest.raises(ncgen.ModelError, match='several impacts at one instant, of gap1, gap2 at t = 0.9 s.*order="in turn"'):
        ncgen.simulate(three_balls(""), 1.5, qd0={"P0.x": 1.0, "P1.x": 0.0, "P2.x": 0.0})


def test_a_wheel_without_rim_rolls_down():
    """Steps of the limit cycle in closed form and quadrature: hub mass, l 1 m, half angle π/8, slope 0.08. Each foot turns gravity on by an
    angle and takes cos 2α of the velocity."""

    half, slope = math.pi / 8, 0.08
    m, psi = sliding_block("wheel")
    feet = m.parameter("feet", 0.0)
    m.torque(psi, G * sp.sin(psi - 2 * half * feet))
    m.event(
        "foot", when=psi - slope - half - 2 * half * feet, direction="rising",
        do={"feet": feet + 1, "rate(s)": math.cos(2 * half) * psi.rate},
    )  # fmt: skip
    kernels = ncgen.compile(m)
    run = ncgen.simulate(kernels, 5.0, rtol=1e-11, q0={"s": slope - half, "A.x": slope - half}, qd0={"s": 1.095462839647657})
    times = np.diff([0.0, *(each.t for each in run.events)])
    assert len(times) == 4 and times == pytest.approx([1.034549811423279] * 4, rel=1e-10)
    place = kernels.index["s"]
    assert [each.before[place] for each in run.events] == pytest.approx([1.549218404905459] * 4, rel=1e-9)
    assert [each.after[place] for each in run.events] == pytest.approx([1.095462839647657] * 4, rel=1e-9)
    assert run.energy_drift < 1e-9


def test_a_block_rocks():
    """Housner: half sizes 0.2 and 1 m, from 0.1 rad; the velocity after an impact is 1 − 3/2 sin² α of that before."""

    alpha, radius = math.atan(0.2), math.sqrt(1.04)
    m, theta = sliding_block("block")
    side = m.input("side")
    m.torque(theta, -3 * G / (4 * radius) * side * sp.sin(alpha - side * theta))
    m.event("corner", when=theta, direction="either", do={"side": -side, "rate(s)": (1 - 1.5 * math.sin(alpha) ** 2) * theta.rate})
    kernels = ncgen.compile(m)
    run = ncgen.simulate(kernels, 1.2, rtol=1e-11, p={"side": 1.0}, q0={"s": 0.1, "A.x": 0.1}, points=13)
    first, place = run.events[0], kernels.index["s"]
    assert first.t == pytest.approx(0.4965584599485608, rel=1e-10)
    assert [-first.before[place], -first.after[place]] == pytest.approx([0.4602424499628977, 0.4336900009265767], rel=1e-9)
    stop = ncgen.simulate(kernels, 1.2, rtol=1e-11, p={"side": 1.0}, q0={"s": 0.1, "A.x": 0.1}, stop={"rate(s)": (0.0, "rising")})
    assert stop.stopped and stop["s"][-1] == pytest.approx(-0.08433802361429504, rel=1e-9)
    assert run.inputs["side"][[0, -1]].tolist() == [1.0, -1.0] and run.energy_drift < 1e-9


def test_velocities_that_move_one_another_are_all_set():
    """Each is reached by the least change, which moves the others, too."""
    m = ncgen.load("doublependulum")
    names = ["B.x", "C.x"]
    wanted = dict(zip((f"rate({name})" for name in names), (0.3, -0.5), strict=True))
    m.event("kick", when=0.1 - m.time, do=wanted)
    kernels = ncgen.compile(m)
    run = ncgen.simulate(kernels, 0.2, points=3)
    assert [run.events[0].after[kernels.index[name]] for name in names] == pytest.approx([0.3, -0.5], rel=1e-12)


def thrown(**event) -> ncgen.Kernels:
    m = ncgen.Model("thrown")
    P = m.point("P", (0, 0))
    m.body("ball", [P], mass=1.0)
    m.gravity((0, -G))
    m.event("seen", **{name: value(P, m) if callable(value) else value for name, value in event.items()})
    return ncgen.compile(m)


@pytest.mark.parametrize(
    ("when", "search"),
    [
        pytest.param(lambda P, m: P.y - (1.0 - 1e-10), "polynomial", id="linear"),
        pytest.param(lambda P, m: P.x**2 + P.y**2 - (P.x**2 + (1.0 - 1e-10) ** 2), "polynomial", id="quadratic"),
        pytest.param(lambda P, m: m.time - math.sqrt(2 / G) + 1e-5, "polynomial", id="time"),
        pytest.param(lambda P, m: sp.sin(P.y) - math.sin(1.0 - 1e-10), "interval", id="sine"),
        pytest.param(lambda P, m: sp.atan2(P.y, 2) - math.atan2(1.0 - 1e-10, 2), "interval", id="angle"),
        pytest.param(lambda P, m: P.y**3 - (1.0 - 1e-10) ** 3, "interval", id="cubic"),
        pytest.param(lambda P, m: P.y / (P.x + 1) - (1.0 - 1e-10) / (P.x + 1), "interval", id="quotient"),
    ],
)
def test_a_crossing_inside_one_step(when, search):
    """A ball at its apex for 9 µs, inside one step of more than a second: nothing is compared at the ends of the step."""
    kernels = thrown(when=when, direction="rising")
    run = ncgen.simulate(kernels, 1.0, points=2, qd0={"P.x": 1.0, "P.y": math.sqrt(2 * G)})
    (seen,) = run.events
    early = 1e-5 if when(m := kernels.model.elements["P"], kernels.model).has(kernels.model.time) else math.sqrt(2e-10 / G)
    assert m and seen.search == search and seen.t == pytest.approx(math.sqrt(2 / G) - early, abs=1e-10)


def test_a_transcendental_condition_is_bounded():

    kernels = thrown(when=lambda P, m: sp.sin(P.y) - 0.5, direction="either")
    run = ncgen.simulate(kernels, 0.5, qd0={"P.x": 0.0, "P.y": math.sqrt(2 * G)})
    (seen,) = run.events
    height = math.asin(0.5)
    assert seen.search == "interval" and seen.t == pytest.approx((math.sqrt(2 * G) - math.sqrt(2 * G * (1 - height))) / G, rel=1e-12)


def test_a_condition_without_bounds_is_sampled():
    """1/(y − 1/2) jumps from −∞ to ∞ there; no part of a step around it has bounds, and the event says so."""
    kernels = thrown(when=lambda P, m: 1 / (P.y - 0.5), direction="rising")
    run = ncgen.simulate(kernels, 0.5, qd0={"P.x": 0.0, "P.y": math.sqrt(2 * G)})
    (seen,) = run.events
    assert seen.search == "sampled" and seen.t == pytest.approx((math.sqrt(2 * G) - math.sqrt(G)) / G, rel=1e-9)


def test_a_condition_with_an_input_is_sampled():
    kernels = thrown(when=lambda P, m: P.y - m.input("level"), direction="rising")
    run = ncgen.simulate(kernels, 0.5, qd0={"P.x": 0.0, "P.y": math.sqrt(2 * G)}, inputs={"level": lambda t: 0.5})
    (seen,) = run.events
    assert seen.search == "sampled" and seen.t == pytest.approx((math.sqrt(2 * G) - math.sqrt(G)) / G, rel=1e-9)


def test_simultaneous_events_are_one_instant():
    """Two conditions that are zero together, one of them twice as large, happen in the order of the model at the same time."""
    m, s = sliding_block("block")
    u = m.input("u")
    m.torque(s, 1.0 + 0 * s.rate)
    m.event("first", when=s - 0.5, direction="rising", do={"u": u + 1})
    m.event("second", when=2 * s - 1.0, direction="rising", do={"u": 10 * u})
    m.event("third", when=5 - u, do="stop")
    run = ncgen.simulate(ncgen.compile(m), 2.0)
    assert [each.name for each in run.events] == ["first", "second", "third"] and len({each.t for each in run.events}) == 1
    assert run.events[2].search == "action" and run.stopped and run.t[-1] == pytest.approx(1.0, rel=1e-13)


def test_events_that_bring_about_each_other_without_end():
    m, s = sliding_block("block")
    u = m.input("u")
    m.event("up", when=s + m.time - 1.0 - 2 * u, direction="either", do={"u": 1 - 2 * u})
    m.event("down", when=0.5 - u, direction="either", do={"u": -u})
    with pytest.raises(ncgen.ConvergenceError, match="bring about each other without end at t = 1 s"):
        ncgen.simulate(ncgen.compile(m), 2.0)


def test_a_function_of_the_state():
    m, s = sliding_block("block")
    seen = []
    m.event("half", when=s - 0.5, direction="rising", do=lambda at, kernels: seen.append(at.t) or {"rate(s)": 0.0})
    run = ncgen.simulate(ncgen.compile(m), 1.0, qd0={"s": 1.0})
    assert seen == pytest.approx([0.5], rel=1e-13) and run["s"][-1] == pytest.approx(0.5, rel=1e-13)
    with pytest.raises(ncgen.ModelError, match="a Python function cannot be written"):
        to_toml(m)


def test_files_say_events():
    text = to_toml(ball(order="in turn"))
    assert '[[event]]\nname = "floor"\nwhen = "P.y"\n' in text


@pytest.mark.parametrize("height", [0.0, 1e-16, -1e-16], ids=str)
def test_contact_at_the_start(height):
    """A gap that is closed and closes on at the start is hit there; a ball that is thrown up from the floor is not."""
    kernels = ncgen.compile(ball())
    down = ncgen.simulate(kernels, 0.1, q0={"P.y": height}, qd0={"P.y": -1.0})
    assert [(each.t, each.search) for each in down.events] == [(0.0, "start")] and down.events[0].after[0] == 0.5
    up = ncgen.simulate(kernels, 0.1, q0={"P.y": height}, qd0={"P.y": 1.0})
    assert not up.events and up["P.y"][-1] == pytest.approx(0.1 - G / 200, rel=1e-12)


def test_a_gap_that_is_open_by_less_than_nothing_at_the_start():
    with pytest.raises(ncgen.ModelError, match="event floor: the gap is -0.1 at the start"):
        ncgen.simulate(ncgen.compile(ball()), 0.1, q0={"P.y": -0.1})


REFUSED = [
    (lambda m, s: m.event("a", when=s, direction="up"), "event a: direction 'up' is unknown; choose one of falling, either, rising"),
    (lambda m, s: [m.event("a", when=s) for _ in range(2)], "event a: there is one of that name already"),
    (lambda m, s: m.event("a", when=s, do="halt"), "event a, do: 'halt' is no action"),
    (lambda m, s: m.event("a", when=s, do={"c": 1.0}), "event a, do: 'c' cannot be changed"),
    (lambda m, s: m.event("a", when=s, do=ncgen.impact(1.5)), "event a, do: restitution 1.5; give a number from 0 to 1"),
    (lambda m, s: m.event("a", when=s, direction="rising", do=ncgen.impact(1)), "event a: an impact happens where a gap closes"),
    (lambda m, s: m.event("a", when=s - s.rate, do=ncgen.impact(1)), "event a: rate(s) stands in the gap of an impact"),
    (lambda m, s: ncgen.impact(1, rest="no"), "impact: rest 'no' is unknown; choose one of hold, end"),
    (lambda m, s: m.stop(s), "s.stop: neither lower nor upper is given"),
    (lambda m, s: [m.friction(s, 1.0) for _ in range(2)], "friction s.friction: there is one of that name already"),
    (lambda m, s: ncgen.impact(1, order="both"), "impact: order 'both' is unknown"),
]


@pytest.mark.parametrize(("say", "message"), REFUSED, ids=[message for _, message in REFUSED])
def test_refused(say, message):
    with pytest.raises(ncgen.ModelError) as refused:
        say(*sliding_block("block"))
    assert str(refused.value).startswith(message)


def test_unknown_names_are_refused():

    m, s = sliding_block("block")
    m.event("a", when=s - sp.Symbol("wall", real=True))
    with pytest.raises(ncgen.ModelError, match="event a: wall is neither a coordinate, a velocity"):
        ncgen.simulate(ncgen.compile(m), 1.0)


@pytest.mark.parametrize(
    ("call", "what"),
    [
        (lambda k: ncgen.gradient(k, 1.0, 10, lambda q, qd: (q[-1, 0], None, None), q0=np.ones((2, 1))), "gradient of rows"),
        (lambda k: ncgen.sensitivities(k, 1.0, 10, integrator="rattle"), "a derivative by steps of rattle"),
    ],
    ids=lambda x: x if isinstance(x, str) else "",
)
def test_what_has_no_events_yet_refuses(dropped, call, what):
    with pytest.raises(ncgen.ModelError, match=f"ball: {what} does not support events yet"):
        call(dropped)


@pytest.mark.parametrize(
    "options",
    [{"engine": "python"}, {"number": "float"}, {"formalism": "coordinate-partitioning"}, {"integrator": "rattle", "max_step": 0.01}],
    ids=str,
)
def test_runs_that_cannot_have_events(dropped, options):
    with pytest.raises(ncgen.ModelError, match="ball: events need"):
        ncgen.simulate(dropped, 1.0, **options)


@pytest.mark.parametrize(
    "declare, message",
    [
        (lambda m, x: m.stop(x, 1.0, -1.0), "x.stop: lower is 1 and upper -1; lower must be less"),
        (lambda m, x: m.stop(x, 1.0, restitution=1.5), "x.stop: restitution 1.5; give a number from 0 to 1"),
        (lambda m, x: m.stop(x, 1.0, stiffness=0.0), "x.stop: stiffness is 0; give a number above 0"),
        (lambda m, x: m.stop(x, 1.0, stiffness=1.0, damping=-1.0), "x.stop: damping is -1; give a number that is not negative"),
        (lambda m, x: m.friction(x, -1.0), "x.friction: coulomb is -1; give a number that is not negative"),
        (lambda m, x: m.friction(x, 2.0, static=1.0), "x.friction: static is 1, less than coulomb, 2; give at least as much"),
        (lambda m, x: m.friction(x, 2.0, stribeck=0.0), "x.friction: stribeck is 0; give a number above 0"),
        (lambda m, x: m.rope(m.elements["O"], m.elements["P"], -1.0), "rope.O.P: length is -1; give a number above 0"),
        (lambda m, x: m.strut(m.elements["O"], m.elements["P"], -1.0), "strut.O.P: length is -1; give a number above 0"),
        (lambda m, x: m.rope(m.elements["O"], m.elements["P"], 2.0, 3.0), "rope.O.P: restitution 3; give a number from 0 to 1"),
        (lambda m, x: m.event("e", x, do=[]), "event e, do: [] holds no action; leave it out where the event is only recorded"),
    ],
)
def test_numbers_out_of_their_range_are_refused(declare, message):
    m = ncgen.Model("block")
    O, P = m.point("O", (0, 0), fixed=True), m.point("P", (0.5, 0), fixed="y")
    m.body("block", [P], mass=1.0)
    x = m.length("x", O, P)
    with pytest.raises(ncgen.ModelError) as refused:
        declare(m, x)
    assert str(refused.value) == message


@pytest.mark.parametrize(
    "declare, p, message",
    [
        (lambda m, x, k: m.friction(x, k), -1.0, "x.friction: coulomb is -1; give a number that is not negative"),
        (lambda m, x, k: m.friction(x, 0.1, static=k), 0.05, "x.friction: static is 0.05, less than coulomb, 0.1; give at least as much"),
        (lambda m, x, k: m.stop(x, -k, 0.7), -0.8, "x.stop: lower is 0.8 and upper 0.7; lower must be less"),
        (lambda m, x, k: m.stop(x, -1.0, restitution=k), 1.5, "x.stop: restitution 1.5; give a number from 0 to 1"),
        (lambda m, x, k: m.rope(m.elements["O"], m.elements["P"], 2.0, k), 1.5, "rope.O.P: restitution 1.5; give a number from 0 to 1"),
        (lambda m, x, k: m.event("e", x, do=ncgen.impact(k)), 1.5, "event e, do: restitution 1.5; give a number from 0 to 1"),
    ],
)
def test_parameters_out_of_their_range_are_refused_where_they_are_given(declare, p, message):
    """Given to a run, or by an event on its way."""
    m = ncgen.Model("block")
    O, P = m.point("O", (0, 0), fixed=True), m.point("P", (0.5, 0), fixed="y")
    m.body("block", [P], mass=1.0)
    declare(m, m.length("x", O, P), m.parameter("k", 0.5))
    m.event("late", m.time - 0.15, "rising", {"k": p})
    kernels = ncgen.compile(m)
    assert ncgen.simulate(kernels, 0.1, p={"k": 0.4}).t[-1] == 0.1
    for duration, given, where in ((0.1, p, "p"), (0.2, 0.5, "event late at t = 0.15 s")):
        with pytest.raises(ncgen.ModelError) as refused:
            ncgen.simulate(kernels, duration, p={"k": given})
        assert str(refused.value).endswith(f"{where}: with k = {p:g}, {message}")


@pytest.mark.parametrize("call", [ncgen.linearise, ncgen.equilibrium], ids=lambda f: f.__name__)
def test_dry_friction_has_no_small_motions(call):
    m = ncgen.Model("slope")
    P = m.point("P", (0, 0), fixed="y")
    m.body("block", [P], mass=1.0)
    m.friction(P.x, coulomb=1.0)
    words = rf"slope: {call.__name__} has no dry friction, locks or ratchets \(P.x.friction\); take a model without them"
    with pytest.raises(ncgen.ModelError, match=words):
        call(ncgen.compile(m))
