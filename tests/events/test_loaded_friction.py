"""Friction that follows the load of a constraint: guides, screws and joints whose loads depend on each other, by closed forms."""

from __future__ import annotations

import math
from itertools import product

import numpy as np
import pytest
import sympy

import ncgen
from ncgen.errors import ConvergenceError, ModelError
from ncgen.exchange.toml_writer import to_toml

TAN, RADIUS, WEIGHT, MASS = 0.05, 0.02, 100.0, 10.0


def guided(push, side, mu=0.5):
    """A block of 2 kg in a guide along x. push, side: forces (N) along the guide and across it"""
    m = ncgen.Model("block")
    axis = m.vector("axis", (1, 0, 0), fixed=True)
    O, A = m.point("O", (0, 0), fixed=True), m.point("A", (1, 0))
    s = m.slide("s", O, A, axis)
    m.body("block", [A], mass=2.0)
    m.force(A, (push(m.time) if callable(push) else push, side(m.time) if callable(side) else side))
    m.friction(s, coefficient=mu, load=m.constrain(A.y, label="guide"))
    return m


def screw(mu, ratio_of_inertia):
    """A nut that lifts a weight. ratio_of_inertia: m r²/J"""
    m = ncgen.Model("screw")
    x, z = m.vector("x", (1, 0, 0), fixed=True), m.vector("z", (0, 0, 1), fixed=True)
    O, P, A = m.point("O", (0, 0), fixed=True), m.point("P", (1, 0)), m.point("A", (1, 0), fixed="y")
    turn, lift = m.angle("turn", x, P - O, z), m.slide("lift", O, A, x)
    m.body("nut", [O, P], mass=1.0, com=(0, 0), inertia=MASS * RADIUS**2 / ratio_of_inertia)
    m.body("load", [A], mass=MASS)
    cos = 1 / math.hypot(1, TAN)
    thread = m.constrain(cos * (lift - 1) - TAN * cos * RADIUS * turn, label="thread")
    m.torque(lift, -WEIGHT)
    m.torque(turn, m.input("couple"))
    m.friction(turn, other=lift, ratio=-TAN / RADIUS, coefficient=mu * RADIUS * cos, load=thread, name="rubbing")
    return ncgen.compile(m)


@pytest.mark.parametrize("side", [4.0, -4.0])
def test_a_block_in_a_guide(side):
    """It sticks below μ N and slides with (F − μ N)/m."""
    run = ncgen.simulate(ncgen.compile(guided(3.0, side)), 2.0, rtol=1e-11)
    assert run["s"][-1] == pytest.approx(1 + (3.0 - 0.5 * 4) / 2 * 2.0**2 / 2, rel=1e-13) and not run.events
    assert run["rate(rate(s))"] == pytest.approx(0.5, rel=1e-13) and run.energy_drift < 1e-13
    run = ncgen.simulate(ncgen.compile(guided(1.9, side)), 2.0)
    assert [each.transition for each in run.events] == ["sticks"] and np.ptp(run["s"]) == 0


def test_it_comes_to_rest_and_is_pushed_off_at_the_limit():
    """From 1 m/s against 0.5 · 4 N it stops after 1 s; the push t N exceeds μ N at 2 s."""
    run = ncgen.simulate(ncgen.compile(guided(lambda t: sympy.Piecewise((0, t < 1.5), (t, True)), 4.0)), 3.0, rtol=1e-11, qd0={"s": 1.0})
    assert [(each.transition, pytest.approx(each.t, rel=1e-10)) for each in run.events] == [("sticks", 1.0), ("slips", 2.0)]
    assert run["s"][-1] == pytest.approx(1.5 + 1 / 12, rel=1e-10)


def test_a_load_that_changes_its_sign():
    """Side force 4 cos t: the velocity falls by μ/m ∫ |4 cos t| dt."""
    run = ncgen.simulate(ncgen.compile(guided(0.0, lambda t: 4 * sympy.cos(t))), 5.0, rtol=1e-11, qd0={"s": 10.0})
    assert run["rate(s)"][-1] == pytest.approx(10.0 - 4 - math.sin(5.0), rel=1e-9) and run.energy_drift < 1e-9


@pytest.mark.parametrize(("angle", "what"), [(0.99, ["sticks"]), (1.01, [])])
def test_a_push_within_the_cone_of_friction_never_moves_it(angle, what):
    """However large: self-locking for angles from the normal below atan μ."""
    angle *= math.atan(0.5)
    run = ncgen.simulate(ncgen.compile(guided(1e6 * math.sin(angle), -1e6 * math.cos(angle))), 1.0)
    assert [each.transition for each in run.events] == what


def test_a_screw():
    """Couples W r tan(λ ± φ), by which it locks itself; the efficiency of lifting is tan λ/tan(λ + φ)."""
    mu, kernels = 0.1, screw(0.1, 50.0)
    up, down = (WEIGHT * RADIUS * (TAN + way * mu) / (1 - way * mu * TAN) for way in (1, -1))
    for way, most in ((1, up), (-1, -down)):
        run = ncgen.simulate(kernels, 0.4, rtol=1e-11, inputs={"couple": lambda t, way=way: way * t}, qd0={"turn": 0.0})
        assert [each.transition for each in run.events] == ["sticks", "slips"] and run.events[1].t == pytest.approx(most, rel=1e-11)

    def acceleration(couple):
        run = ncgen.simulate(kernels, 0.01, rtol=1e-11, inputs={"couple": couple}, qd0={"turn": 1000.0})
        return run["rate(rate(turn))"][-1]

    first, second = acceleration(0.5), acceleration(0.2)
    steady = 0.2 + 0.3 * second / (second - first)
    assert WEIGHT * RADIUS * TAN / steady == pytest.approx(0.331666666666667, rel=1e-11)


def test_a_screw_that_does_not_lock_itself():
    """m r tan λ θ̈ = N (cos λ + μ sin λ) − W and J θ̈ = −N r (sin λ − μ cos λ)."""
    mu, ratio, cos = 0.04, 50.0, 1 / math.hypot(1, TAN)
    A = [[MASS * RADIUS * TAN, -cos * (1 + mu * TAN)], [MASS * RADIUS**2 / ratio, RADIUS * cos * (TAN - mu)]]
    run = ncgen.simulate(screw(mu, ratio), 0.2, rtol=1e-11, inputs={"couple": 0.0}, qd0={"turn": 0.0})
    assert run["rate(turn)"][-1] == pytest.approx(0.2 * np.linalg.solve(A, [-WEIGHT, 0.0])[0], rel=1e-10)


@pytest.mark.parametrize("velocity", [1.0, -1.0])
def test_loads_that_are_not_determined(velocity):
    """The load is unique for μ tan λ |1 − κ| < 1 + κ tan² λ, with κ = m r²/J: below 402 for μ = 0.1. At rest it sticks in any case."""
    run = ncgen.simulate(screw(0.1, 401.0), 0.01, inputs={"couple": 0.0}, qd0={"turn": velocity})
    assert [each.transition for each in run.events] == ["sticks"]
    with pytest.raises(ConvergenceError, match="friction rubbing with coefficient 0.0019975 is not determined"):
        ncgen.simulate(screw(0.1, 403.0), 0.01, inputs={"couple": 0.0}, qd0={"turn": velocity})
    (event,) = ncgen.simulate(screw(0.1, 403.0), 0.01, inputs={"couple": 0.0}, qd0={"turn": 0.0}).events
    assert event.transition == "sticks"


@pytest.mark.parametrize("joints", [1, 2, 3, 4])
@pytest.mark.parametrize("seed", range(4))
def test_joints_whose_loads_depend_on_each_other(joints, seed):
    """Of all signs of loads one agrees if all determinants are positive; otherwise the run ends with the names."""
    random = np.random.default_rng(100 * joints + seed)
    count = 2 * joints + 1
    masses, forces = random.uniform(0.5, 2.0, count), random.normal(size=count)
    C, mu = random.normal(size=(joints, count)), random.uniform(0.5, 1.5, joints) * [1.0, 4.0][seed % 2]
    velocities = random.normal(size=count)
    velocities -= (C.T / masses[:, None]) @ np.linalg.solve(C @ (C.T / masses[:, None]), C @ velocities)

    m = ncgen.Model("joints")
    x, O = m.vector("x", (1, 0, 0), fixed=True), m.point("O", (0, 0), fixed=True)
    lengths = []
    for k in range(count):
        A = m.point(f"A{k}", (1, 0), fixed="y")
        lengths.append(m.slide(f"s{k}", O, A, x))
        m.body(f"b{k}", [A], mass=masses[k])
        m.torque(lengths[-1], forces[k])
    for k in range(joints):
        row = m.constrain(sum(float(c) * (s - 1) for c, s in zip(C[k], lengths, strict=True)), label=f"row {k}")
        m.friction(lengths[k], coefficient=mu[k], load=row)
    kernels = ncgen.compile(m)

    along = np.eye(count)[:joints] * np.sign(velocities[:joints])[:, None]
    response = np.linalg.inv(C @ (C.T / masses[:, None]))
    plain, share = response @ C @ (forces / masses), response @ C @ (along.T / masses[:, None])
    determinants, agreeing = [], []
    for signs in product((1, -1), repeat=joints):
        matrix = np.eye(joints) - share * mu * signs
        determinants.append(np.linalg.det(matrix))
        loads = np.linalg.solve(matrix, -plain)  # N = −λ
        if np.all(loads * signs >= 0):
            agreeing.append((forces + along.T @ (-mu * np.abs(loads)) + C.T @ loads) / masses)
    start = {f"s{k}": v for k, v in enumerate(velocities)}
    if min(determinants) > 0:
        (expected,) = agreeing
        run = ncgen.simulate(kernels, 1e-3, qd0=start)
        assert [run[f"rate(rate(s{k}))"][0] for k in range(count)] == pytest.approx(expected, rel=1e-9)
    else:
        with pytest.raises(ConvergenceError, match="is not determined"):
            ncgen.simulate(kernels, 1e-3, qd0=start)


def test_it_goes_with_friction_of_contacts_and_steps():
    """A block slides on the floor, pressed by its weight, and in a guide by a side force: its acceleration is −μ g − μ' N/m. Where it
    stops the guide and the friction of the floor share the side force, so that the load is not determined."""
    m = ncgen.Model("block")
    up = m.vector("up", (0, 0, 1), fixed=True)
    x = m.vector("x", (1, 0, 0), fixed=True)
    O, A = m.point("O", (0, 0, 0), fixed=True), m.point("A", (1, 0, 0))
    s = m.slide("s", O, A, x)
    block = m.body("block", [A], mass=2.0)
    m.gravity((0, 0, -9.81))
    m.force(A, (0, 4.0, 0))
    m.friction(s, coefficient=0.5, load=m.constrain(A.y, label="guide"))
    m.contact("floor", block, A, m.ground, O, normal=up, friction=0.2)
    kernels = ncgen.compile(m)
    slowing, start = 0.2 * 9.81 + 0.5 * 4 / 2, {"s": 3.0, "A.z": 0.0}
    run = ncgen.simulate(kernels, 1.0, rtol=1e-11, qd0=start)
    assert run["rate(rate(s))"] == pytest.approx(-slowing, rel=1e-12)
    assert run["s"][-1] == pytest.approx(1 + 3.0 - slowing / 2, rel=1e-12)
    sim = ncgen.start(kernels, qd0=start)
    for _ in range(4):
        sim.step(0.25)
    assert sim["s"] == pytest.approx(1 + 3.0 - slowing / 2, rel=1e-12)
    with pytest.raises(
        ConvergenceError, match=f"at t = {3.0 / slowing:.6g} s the load of friction s.friction, constraint guide, is shared"
    ):
        ncgen.simulate(kernels, 1.1, qd0=start)


def test_files(tmp_path):
    m, path = guided(3.0, 4.0), tmp_path / "block.toml"
    path.write_text(to_toml(m))
    assert 'load = "guide"' in path.read_text() and to_toml(ncgen.load(path)) == path.read_text()
    assert ncgen.simulate(ncgen.compile(ncgen.load(path)), 2.0)["s"][-1] == pytest.approx(2.0, rel=1e-6)
    m.constrain(m.elements["s"] - 1, label="guide")
    with pytest.raises(ModelError, match="2 constraints have the label guide"):
        to_toml(m)


@pytest.mark.parametrize(
    ("given", "why"),
    [
        ({}, "there is no friction"),
        ({"coefficient": 0.1}, "belong together"),
        ({"load": "guide"}, "belong together"),
        ({"coefficient": -0.1, "load": "guide"}, "coefficient is -0.1"),
        ({"coefficient": 0.1, "load": "none"}, "there is no constraint none"),
        ({"coefficient": 0.1, "load": "slide s"}, "slide s is a scaled constraint"),
        ({"coefficient": 0.1, "load": 3}, "3 is not a constraint"),
        ({"coefficient": 0.1, "load": "guide", "static": 1.0}, "static does not go"),
    ],
)
def test_refusals(given, why):
    m = guided(3.0, 4.0)
    with pytest.raises(ModelError, match=why):
        m.friction("s", name="other", **given)


def test_a_load_that_is_shared_is_refused_by_name():
    m = guided(3.0, 4.0)
    m.constrain(2 * m.elements["A"].y, label="second")
    with pytest.raises(ConvergenceError, match=r"load of friction s.friction, constraint guide, is shared"):
        ncgen.simulate(ncgen.compile(m), 1.0)
