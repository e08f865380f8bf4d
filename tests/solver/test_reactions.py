"""Loads between bodies: Newton and Euler body by body, closed forms of pendulums, pins of a four-bar."""

from __future__ import annotations

import numpy as np
import pytest
from robot_motions import TIGHT, six_angles

import ncgen
from ncgen import Model
from ncgen.errors import ModelError


@pytest.fixture(scope="module")
def free(spatial):
    """Loads along the robot's spatial motion, where no motor acts."""
    return spatial.reactions()


@pytest.fixture(scope="module")
def motored(driven):
    return driven.reactions()


def resultant(reactions, body, about):
    """(K, 3) force and (K, 3) moment about points (K, 3) of all loads on the movable elements of a body."""
    run = reactions.run
    elements = run.model.bodies[body]
    force, moment = np.zeros_like(about), np.zeros_like(about)
    for point in elements.points:
        load = reactions.force(body, point.name)
        force += load
        moment += np.cross(run.point(point.name) - about, load)
    return force, moment + sum(reactions.moment(body, vector.name) for vector in elements.vectors)


@pytest.mark.parametrize("body", ["body3", "body4", "body5", "body6", "body7", "body8", "body9"])
@pytest.mark.parametrize("name", ["spatial", "driven"])
def test_newton_and_euler(request, tree, name, body):
    """All loads on a body give m (a − g) and d/dt (I ω), with a and ω of the tree; unique or not, their sum is."""
    run = request.getfixturevalue(name)
    loads = request.getfixturevalue({"spatial": "free", "driven": "motored"}[name])
    instants = [tree.loads(psi, rates, acc)[int(body[4:])] for _, psi, rates, acc in six_angles(run)]
    expected_force, expected_moment, centre = (np.array(part) for part in zip(*instants, strict=True))
    force, moment = resultant(loads, body, centre)
    assert force == pytest.approx(expected_force, abs=1e-9 * np.max(np.abs(expected_force)))
    assert moment == pytest.approx(expected_moment, abs=1e-9 * np.max(np.abs(expected_force)))


@pytest.mark.parametrize(("body", "about"), [("body3", "r1"), ("body5", "r8"), ("body9", "r7")])
def test_wrench_about_a_named_point(tree, motored, body, about):
    """m (a − g), and d/dt (I ω) + (c − r) × m (a − g) about any point r."""
    run = motored.run
    instants = [tree.loads(psi, rates, acc)[int(body[4:])] for _, psi, rates, acc in six_angles(run)]
    force, turning, centre = (np.array(part) for part in zip(*instants, strict=True))
    found, moment = motored.wrench(body, about)
    expected = turning + np.cross(centre - run.point(about), force)
    assert found == pytest.approx(force, abs=1e-9 * np.max(np.abs(force)))
    assert moment == pytest.approx(expected, abs=1e-9 * np.max(np.abs(expected)))


def rods():
    """Two rods hanging from the ground one below the other, let go."""
    m = Model("rods")
    m.gravity((0, -9.81, 0))
    z = m.vector("z", (0, 0, 1), fixed=True)
    O, A, B = m.point("O", (0, 0), fixed=True), m.point("A", (0.5, 0)), m.point("B", (0.9, 0.3))
    m.body("upper", [O, A], mass=1.2, inertia="point")
    m.body("lower", [A, B], mass=0.7, inertia="point")
    m.angle("psi", A - O, B - A, z)
    return m


def test_wrench_between_two_bodies():
    """Newton and Euler for the lower rod; what the ground does to the upper one carries both."""
    run = ncgen.simulate(ncgen.compile(rods()), 0.4, points=5, **TIGHT)
    loads = run.reactions()
    index, g = run.kernels.index, np.array([0.0, -9.81, 0.0])

    def middle(first: str, second: str) -> np.ndarray:
        ends = [np.stack([run.qdd[:, index[f"{name}.{axis}"]] if f"{name}.{axis}" in index else 0 * run.t for axis in "xyz"], -1)
                for name in (first, second)]  # fmt: skip
        return sum(ends) / 2

    lower = 0.7 * (middle("A", "B") - g)
    force, moment = loads.wrench("lower", "A", neighbour="upper")
    assert force == pytest.approx(lower, abs=1e-9)
    assert moment == pytest.approx(0 * moment, abs=1e-12)  # a hinge that nothing drives
    back, other = loads.wrench("upper", "B", neighbour="lower")
    assert back == pytest.approx(-lower, abs=1e-9)
    assert other == pytest.approx(np.cross(run.point("A") - run.point("B"), -lower), abs=1e-9)
    held, _ = loads.wrench("upper", "O", neighbour="ground")
    assert held == pytest.approx(lower + 1.2 * (middle("O", "A") - g), abs=1e-9)


def test_wrenches_that_are_not_known(free):
    for ask, said in (
        (("body8", "r8", "body7"), "r7 joins body8 and body7 with body6, too, so the wrench between two of them is not known"),
        (("body9", "r8", "body2"), "body body9 shares no point and no vector with body2"),
        (("body9", "r8", "table"), "neighbour: there is no body table"),
        (("body9", "nowhere"), "about: there is no point nowhere"),
        (("table", "r8"), "there is no body table"),
    ):
        with pytest.raises(ModelError) as refused:
            free.wrench(*ask)
        assert said in str(refused.value)


def test_force_and_its_reaction(free):
    """r8 belongs to bodies 8 and 9 alone; r7 to 6 and 7 besides, and their forces there cancel as well."""
    force = free.force("body8", "r8")
    assert np.max(np.abs(force)) > 1.0
    assert free.force("body9", "r8") == pytest.approx(-force, abs=1e-10 * np.max(np.abs(force)))
    forces = [free.force(body, "r7") for body in ("body6", "body7", "body8", "body9")]
    assert np.max(np.abs(sum(forces))) < 1e-10 * max(np.max(np.abs(f)) for f in forces)


def test_moment_and_its_reaction(free):
    """u4 belongs to bodies 7 and 8 alone; the moment is square to it, since the joint between them is free to turn."""
    moment = free.moment("body7", "u4")
    assert np.max(np.abs(moment)) > 1e-3
    assert free.moment("body8", "u4") == pytest.approx(-moment, abs=1e-10 * np.max(np.abs(moment)))
    along = np.sum(moment * free.run.vector("u4"), axis=1)
    assert np.max(np.abs(along)) < 1e-12 * np.max(np.abs(moment))


def test_all_loads_cancel(free):
    """On every coordinate what the bodies exert on one another adds up to nothing."""
    names = free.run.coordinates
    still = np.zeros(len(free.run.t))
    loads = [np.array([body.get(name, still) for name in names]) for body in free.loads.values()]
    assert np.max(np.abs(sum(loads))) < 1e-9 * max(np.max(np.abs(load)) for load in loads)


def test_private_elements_carry_no_load(free):
    """u5 belongs to body 9 alone, and no motor pulls at it."""
    assert np.max(np.abs(free.moment("body9", "u5"))) < 1e-10


def test_a_motor_is_felt_by_its_body(motored, driven):
    """The couple on body 9 about r8 − r7 is the motor's: the multiplier of ψ6's row acts through u5."""
    axis = driven.point("r8") - driven.point("r7")
    along = np.sum(motored.moment("body9", "u5") * axis / np.linalg.norm(axis, axis=1, keepdims=True), axis=1)
    t = driven.t
    assert along == pytest.approx(0.2 * np.sin(10.0 * t) + 0.1, abs=1e-9)


# -- closed forms -------------------------------------------------------------------------------


def test_tension_of_the_pendulum():
    """The bar pulls the mass with 3 m g (depth below the start)/L, once v² = 2 g depth."""
    run = ncgen.simulate(ncgen.compile(ncgen.load("pendulum"), "numpy"), 1.0, points=6, **TIGHT)
    bob = run.point("B")
    tension = 3.0 * 9.81 * -bob[:, 1]
    assert run.reactions().force("bob", "B") == pytest.approx(-tension[:, None] * bob, abs=1e-8)


def physical_pendulum(mass, com, inertia):
    """A bar from a hinge H at the origin to an end E at (1, 0, 0), turning about z. Rows that no body owns hold H."""
    m = Model("physical")
    H, E = m.point("H", (0, 0), fixed="z"), m.point("E", (1, 0))
    bar = m.body("bar", points=[H, E], mass=mass, com=com, inertia=inertia)
    m.distance(H, E, owner=bar)
    m.constrain(H.x.symbol, "hinge x")
    m.constrain(H.y.symbol, "hinge y")
    m.gravity((0, -9.81, 0))
    return m


def test_hinge_of_a_physical_pendulum():
    """θ from the horizontal, from rest: θ̇² = 2 m g d sin θ/I_H, θ̈ = m g d cos θ/I_H, and m a_com = R + m g."""
    mass, d, inertia, g = 2.0, 0.4, 0.3, 9.81
    kernels = ncgen.compile(physical_pendulum(mass, (d, 0, 0), inertia), "numpy")
    run = ncgen.simulate(kernels, 0.6, points=7, **TIGHT)
    about_hinge = inertia + mass * d**2
    x, y, _ = run.point("E").T
    radial, onward = np.stack([x, y], axis=1), np.stack([y, -x], axis=1)  # θ is counted downwards
    speed2 = 2 * mass * g * d * -y / about_hinge
    acceleration = d * (mass * g * d * x / about_hinge)[:, None] * onward - d * speed2[:, None] * radial
    expected = mass * (acceleration + [0, g])
    loads = run.reactions()
    assert loads.is_determinate
    assert loads.force("bar", "H")[:, :2] == pytest.approx(expected, abs=1e-7)
    assert np.max(np.abs(loads.force("bar", "E"))) < 1e-10


def test_pins_of_the_four_bar(turning, fourbar, loop):
    """The forces at B and C from the balances of coupler and rocker, in the one-angle formulation."""
    loads = turning.reactions()
    psi = fourbar.index["psi"]
    for k in range(0, 21, 4):
        at_b, at_c = loop.pin_forces(turning.q[k, psi], turning.qd[k, psi], turning.qdd[k, psi])
        for body, point, force in [("coupler", "B", at_b), ("crank", "B", -at_b), ("coupler", "C", at_c), ("rocker", "C", -at_c)]:
            assert loads.force(body, point)[k, :2] == pytest.approx(force, abs=1e-9 * np.abs(force).max())
    assert loads.is_determinate


def test_force_on_a_fixed_point(turning, fourbar, loop):
    """The crank's hinge A: m a of its middle, less its weight and the pin B; or a refusal, but no wrong number."""
    psi = fourbar.index["psi"]
    k = 7
    state = turning.q[k, psi], turning.qd[k, psi], turning.qdd[k, psi]
    at_b, _ = loop.pin_forces(*state)
    middle = loop.accelerations(*state)[0] / 2
    expected = 0.2 * (middle + [0, 9.81]) + at_b
    try:
        found = turning.reactions().force("crank", "A")[k, :2]
    except ModelError:
        return
    assert found == pytest.approx(expected, abs=1e-9)


def test_unknown_names_are_refused(free):
    with pytest.raises(ModelError, match="no body body1; the bodies are body2"):
        free.force("body1", "r1")
    with pytest.raises(ModelError, match="body9 has no element r6; it has r7, r8, u5"):
        free.force("body9", "r6")


def test_springs_are_no_joint_loads():
    """A bob on a massless rod, pulled by a spring: the rod's force is m a − m g − the spring's, and along the rod."""
    m = ncgen.Model("bob")
    A, G = m.point("A", (0, 0), fixed=True), m.point("G", (1, 1), fixed=True)
    B = m.point("B", (1, 0))
    m.body("bob", [B], mass=2.0)
    m.distance(A, B)
    m.spring(B, G, stiffness=30.0, damping=1.0, free_length=0.5)
    m.gravity((0, -9.81, 0))
    run = ncgen.simulate(ncgen.compile(m, "numpy"), 0.3, points=4, **TIGHT)
    line = np.array([1.0, 1.0, 0.0]) - run.point("B")
    length = np.linalg.norm(line, axis=1, keepdims=True)
    speed = np.pad(run.qd, ((0, 0), (0, 1)))
    rate = -np.sum(speed * line, axis=1, keepdims=True) / length
    pull = (30.0 * (length - 0.5) + rate) * line / length
    expected = 2.0 * np.pad(run.qdd, ((0, 0), (0, 1))) - 2.0 * np.array([0, -9.81, 0]) - pull
    found = run.reactions().force("bob", "B")
    assert found == pytest.approx(expected, abs=1e-9)
    assert np.max(np.abs(np.cross(found, run.point("B")))) < 1e-8
