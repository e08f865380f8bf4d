"""Racks push with their teeth: closed forms of racks that move, stand still, carry rods and lie anywhere in space; what stays a couple."""

from __future__ import annotations

import numpy as np
import pytest

import ncgen
from ncgen import Model
from ncgen.errors import ModelError

G, TAN = 9.81, np.tan(np.radians(20))
X, Y, Z = np.eye(3)


def reactions_of(model, **options):
    return ncgen.simulate(ncgen.compile(model), 0.02, points=3, rtol=1e-10).reactions(**options)


def plane(name):
    m = Model(name)
    m.gravity((0, -G, 0))
    return m, m.vector("X", (1, 0, 0), fixed=True), m.vector("z", (0, 0, 1), fixed=True)


def rack_below(r=0.2, guide="prismatic", backwards=""):
    """A pinion (0.03 kg m²) on a pin of the ground at O, a rack (2 kg, centre 0.05 m behind its end R) below it, or above for r < 0."""
    m, x, z = plane("rack")
    O, P = m.point("O", (0, 0), fixed=True), m.point("P", (0.1, 0.05))
    m.body("pinion", [O, P], mass=1.5, com=(0, 0), inertia=0.03)
    S, R, T = m.point("S", (-0.1, -0.25), fixed=True), m.point("R", (0.1, -0.25)), m.point("T", (-0.3, -0.25))
    rack = m.body("rack", [R, T], mass=2.0, com=(0.05, -0.25), inertia=0.1)
    if guide == "prismatic":
        m.prismatic(m.ground, rack, S, R, x)
    else:
        m.point_on_line(m.ground, R, S, x)
    if guide == "lines":
        m.point_on_line(m.ground, T, S, x)
    slide = m.slide("s", R, S, x) if backwards == "slide" else m.slide("s", S, R, x)
    psi = m.angle("psi", P - O, x, z) if backwards == "angle" else m.angle("psi", x, P - O, z)
    m.rack(slide, psi, -r if backwards else r)
    m.torque(psi, -1.5 if backwards == "angle" else 1.5)
    return m


@pytest.mark.parametrize("angle", [0.0, np.radians(20)])
@pytest.mark.parametrize("guide", ["prismatic", "lines"])
@pytest.mark.parametrize(("r", "backwards"), [(0.2, ""), (-0.2, ""), (0.2, "slide"), (0.2, "angle")])
def test_a_rack_that_a_pinion_moves(r, backwards, guide, angle):
    """(I + m r²) α = τ; the teeth push the rack by m r α along it at the pitch line, and by tan 20° of it away from the pinion; the guide
    carries weight, radial force and the moment of the teeth about the rack's centre, the pin what the teeth do to the pinion; its moment
    is the motor's."""
    found = reactions_of(rack_below(r, guide, backwards), pressure_angle=angle)
    alpha = 1.5 / (0.03 + 2.0 * r**2)
    pitch = np.array([0, -r, 0])
    teeth = 2.0 * r * alpha * X - np.sign(r) * abs(2.0 * r * alpha) * np.tan(angle) * Y
    force, moment = found.wrench("rack", "O", neighbour="pinion")
    assert force == pytest.approx(np.tile(teeth, (3, 1)), abs=1e-7)
    assert moment == pytest.approx(np.tile(np.cross(pitch, teeth), (3, 1)), abs=1e-7)
    assert found.wrench("pinion", "O", neighbour="rack")[0] == pytest.approx(-force, abs=1e-9)
    pin, turning = found.wrench("pinion", "O", neighbour="ground")
    assert pin == pytest.approx(np.tile(teeth + 1.5 * G * Y, (3, 1)), abs=1e-7)
    assert turning == pytest.approx(np.tile(1.5 * Z, (3, 1)), abs=1e-8)
    centre = found.run.point("R") - 0.05 * X
    held, about = found.wrench("rack", "O", neighbour="ground")
    assert held == pytest.approx(np.tile(2.0 * r * alpha * X + 2.0 * G * Y - teeth, (3, 1)), abs=1e-7)
    assert about - np.cross(centre, held) == pytest.approx(-np.cross(pitch - centre, np.tile(teeth, (3, 1))), abs=1e-7)
    assert found.couples == ()


def carriage(r=-0.15):
    """A carriage (3 kg) on rails, its motor turns a pinion (0.5 kg, 0.004 kg m²) on a rack of the ground, below for r < 0."""
    m, x, z = plane("carriage")
    O = m.point("O", (0, 0), fixed=True)
    C, D, P = m.point("C", (0.3, 0)), m.point("D", (0.7, 0)), m.point("P", (0.3, 0.1))
    base = m.body("carriage", [C, D], mass=3.0, com=(0.6, 0.1), inertia=0.2)
    m.body("pinion", [C, P], mass=0.5, com=(0.3, 0), inertia=0.004)
    m.prismatic(m.ground, base, O, D, x)
    psi = m.angle("psi", D - C, P - C, z)
    m.rack(m.slide("s", O, C, x), psi, r)
    m.torque(psi, 0.8)
    return m


@pytest.mark.parametrize("r", [-0.15, 0.15])
def test_a_pinion_on_a_rack_of_the_ground(r):
    """(M + m + I/r²) s̈ = τ/r; along the track nothing but the teeth pushes: (M + m) s̈. The rails carry the weight without what the teeth
    lift, and about the pin the moment of the carriage's weight and of the motor, whose other side the pinion has."""
    found = reactions_of(carriage(r))
    a = 0.8 / r / (3.5 + 0.004 / r**2)
    lift = -np.sign(r) * 3.5 * abs(a) * TAN
    teeth = 3.5 * a * X + lift * Y
    assert found.wrench("pinion", "C", neighbour="ground")[0] == pytest.approx(np.tile(teeth, (3, 1)), abs=1e-7)
    assert found.wrench("pinion", "C", neighbour="ground")[1] == pytest.approx(np.tile(np.cross([0, r, 0], teeth), (3, 1)), abs=1e-7)
    pin = 0.5 * a * X + 0.5 * G * Y - teeth
    assert found.wrench("pinion", "C", neighbour="carriage")[0] == pytest.approx(np.tile(pin, (3, 1)), abs=1e-7)
    assert found.wrench("pinion", "C", neighbour="carriage")[1] == pytest.approx(np.tile(0.8 * Z, (3, 1)), abs=1e-7)
    rails, about = found.wrench("carriage", "C", neighbour="ground")
    assert rails == pytest.approx(np.tile((3.5 * G - lift) * Y, (3, 1)), abs=1e-7)
    # about the pin: (com − C) × M (a − g) = rails' moment − τ
    assert about == pytest.approx(np.tile(np.cross([0.3, 0.1, 0], 3.0 * (a * X + G * Y)) + 0.8 * Z, (3, 1)), abs=1e-7)


def steering():
    """A rack whose slide ends at the pin of a tie rod, which a wheel on the ground holds."""
    m, x, z = plane("steering")
    O, P = m.point("O", (0, 0), fixed=True), m.point("P", (0.02, 0.01))
    m.body("pinion", [O, P], mass=0.2, com=(0, 0), inertia=1e-4)
    S, R, T = m.point("S", (0, -0.02), fixed=True), m.point("R", (0.4, -0.02)), m.point("T", (-0.4, -0.02))
    rack = m.body("rack", [R, T], mass=2.0, com=(0, -0.02), inertia=0.1)
    m.prismatic(m.ground, rack, S, T, x)
    K, L = m.point("K", (0.7, 0.1)), m.point("L", (0.75, -0.05), fixed=True)
    m.body("tie", [R, K], mass=0.3, inertia="rod")
    m.body("arm", [K, L], mass=0.4, inertia="rod")
    psi = m.angle("psi", x, P - O, z)
    m.rack(m.slide("s", S, R, x), psi, 0.02)
    m.torque(psi, 0.5)
    return m


def test_a_slide_may_end_at_the_pin_of_a_rod():
    """What the guide and the teeth do to the rack is known beside the rod that shares the slide's end: Newton for every body."""
    found = reactions_of(steering())
    run, index = found.run, found.run.kernels.index
    a = run.qdd[:, index["R.x"]]
    force = found.wrench("rack", "R", neighbour="pinion")[0]
    # the pinion: I α = 0.5 N m and the teeth's moment about O, 0.02 m above them
    assert force[:, 0] == pytest.approx((0.5 - 1e-4 * a / 0.02) / 0.02, abs=1e-7)
    assert force[:, 1] == pytest.approx(-np.abs(force[:, 0]) * TAN, abs=1e-9)
    rod = 0.3 * ((run.qdd[:, [index["R.x"], index["K.x"]]]).mean(axis=1))
    arm = found.wrench("tie", "R", neighbour="arm")[0]
    assert found.wrench("tie", "R", neighbour="rack")[0][:, 0] == pytest.approx(rod - arm[:, 0], abs=1e-7)
    guide = found.wrench("rack", "R", neighbour="ground")[0]
    assert guide[:, 0] == pytest.approx(0 * a, abs=1e-7)  # no friction along it
    whole = found.wrench("rack", "R")
    parts = [found.wrench("rack", "R", neighbour=other) for other in ("ground", "pinion", "tie")]
    assert sum(part[0] for part in parts) == pytest.approx(whole[0], abs=1e-8)
    assert sum(part[1] for part in parts) == pytest.approx(whole[1], abs=1e-8)


def anywhere(turn):
    """The rack below a pinion in space, its axes e, g = e × n and n turned; three points and an axis make the pinion a hinge."""
    m = Model("anywhere")
    m.gravity((0, 0, 0))
    e, up, n = (turn @ axis for axis in (X, Y, Z))
    O, axis = m.point("O", (0, 0, 0), fixed=True), m.vector("n", n, fixed=True)
    start, line = m.vector("start", e, fixed=True), m.vector("e", e, fixed=True)
    P, R = m.point("P", 0.1 * e + 0.02 * n), m.point("R", 0.1 * e - 0.25 * up + 0.05 * n)
    pinion = m.body("pinion", [O, P], [axis], mass=1.5, com=(0, 0, 0), inertia=(0.03, 0.03, 0.03))
    u, v = m.vector("u", up), m.vector("v", n)
    rack = m.body("rack", [R], [u, v], mass=2.0, com=tuple(0.1 * e - 0.25 * up), inertia=(0.1, 0.1, 0.1))
    m.revolute(m.ground, pinion, O, axis)
    S = m.point("S", -0.1 * e - 0.25 * up + 0.05 * n, fixed=True)
    m.prismatic(m.ground, rack, S, R, line)
    psi = m.angle("psi", start, P - O, axis)
    m.rack(m.slide("s", S, R, line), psi, 0.2)
    m.torque(psi, 1.5)
    return m, e, up


@pytest.mark.parametrize("seed", [1, 2])
def test_a_rack_anywhere_in_space(seed):
    turn = np.linalg.qr(np.random.default_rng(seed).standard_normal((3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn))
    m, e, up = anywhere(turn)
    found = reactions_of(m)
    along = 2.0 * 0.2 * 1.5 / (0.03 + 2.0 * 0.2**2)
    teeth = along * e - along * TAN * up
    force, moment = found.wrench("rack", "O", neighbour="pinion")
    assert force == pytest.approx(np.tile(teeth, (3, 1)), abs=1e-7)
    assert moment == pytest.approx(np.tile(np.cross(-0.2 * up, teeth), (3, 1)), abs=1e-7)
    assert found.wrench("pinion", "O", neighbour="ground")[0] == pytest.approx(force, abs=1e-7)


def loose():
    """One point of the rack on a line: it may turn, and no teeth could stay together."""
    return rack_below(guide="one line")


def along_the_axis():
    """A slide along the axis of the wheel: a screw, not a rack."""
    m = Model("along")
    m.gravity((0, 0, 0))
    O, z, x = m.point("O", (0, 0, 0), fixed=True), m.vector("n", (0, 0, 1), fixed=True), m.vector("x", (1, 0, 0), fixed=True)
    P, R = m.point("P", (0.1, 0, 0)), m.point("R", (0, 0.3, 0.2))
    wheel = m.body("wheel", [O, P], [z], mass=1.0, com=(0, 0, 0), inertia=(0.1, 0.1, 0.1))
    m.revolute(m.ground, wheel, O, z)
    nut = m.body("nut", [R], [m.vector("u", (1, 0, 0)), m.vector("v", (0, 1, 0))], mass=1.0, com=(0, 0.3, 0.2), inertia=(0.1, 0.1, 0.1))
    S = m.point("S", (0, 0.3, 0), fixed=True)
    m.prismatic(m.ground, nut, S, R, z)
    psi = m.angle("psi", x, P - O, z)
    m.rack(m.slide("s", S, R, z), psi, 0.1)
    m.torque(psi, 1.0)
    return m


def another_carrier():
    """The carriage's pinion, with its angle told from the ground: no body has both, the slide's start and the wheel's pin."""
    m, x, z = plane("another")
    O = m.point("O", (0, 0), fixed=True)
    C, D, P = m.point("C", (0.3, 0)), m.point("D", (0.7, 0)), m.point("P", (0.3, 0.1))
    base = m.body("carriage", [C, D], mass=3.0, com=(0.6, 0.1), inertia=0.2)
    m.body("pinion", [C, P], mass=0.5, com=(0.3, 0), inertia=0.004)
    m.prismatic(m.ground, base, O, D, x)
    psi = m.angle("psi", x, P - C, z)
    m.rack(m.slide("s", O, C, x), psi, -0.15)
    m.torque(psi, 0.8)
    return m


@pytest.mark.parametrize("model", [loose, along_the_axis, another_carrier])
def test_what_is_no_rack_beside_a_wheel_is_a_couple(model):
    found = reactions_of(model())
    assert found.couples == ("rack s, psi",)
    assert repr(found).endswith("rack s, psi as couples>")
    assert found.meshes == ()


def test_the_pin_beside_a_couple_carries_the_weight_alone():
    """And among its moment are the couple and the motor: together I α."""
    found = reactions_of(loose())
    force, moment = found.wrench("pinion", "O", neighbour="ground")
    assert force == pytest.approx(np.tile(1.5 * G * Y, (3, 1)), abs=1e-7)
    assert moment[:, 2] == pytest.approx(0.03 * found.run.qdd[:, found.run.kernels.index["psi"]], abs=1e-7)


def test_a_radius_of_0_is_refused():
    with pytest.raises(ModelError, match="rack s, psi: radius is 0 m"):
        rack_below(0.0)
