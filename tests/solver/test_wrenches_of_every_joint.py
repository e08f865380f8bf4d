"""Newton and Euler for every body beside every joint of the catalogue: neighbours and applied loads together are m a and I α + ω × I ω."""

from __future__ import annotations

import numpy as np
import pytest
from free_bodies import G, Setup, closes

from ncgen import Model
from ncgen.model.joints import Joints

# -- in space -------------------------------------------------------------------------------------


def space(generator):
    """A body on a ball joint of the ground, and a second one."""
    m = Model("space")
    m.gravity(tuple(G))
    setup = Setup(m)
    m.point("origin", (0, 0, 0), fixed=True)
    frame, other = (np.linalg.qr(generator.standard_normal((3, 3)))[0] for _ in range(2))
    H = m.point("H", generator.uniform(-0.5, 0.5, 3), fixed=True)
    A, u, v = m.point("A", H.initial + 0.6 * frame[0]), m.vector("u", frame[1]), m.vector("v", frame[2])
    first = setup.body("first", [H, A], [u, v], generator)
    C = m.point("C", A.initial + 0.4 * frame[1])
    D, w, x = m.point("D", C.initial + 0.5 * other[0]), m.vector("w", other[1]), m.vector("x", other[2])
    second = setup.body("second", [C, D], [w, x], generator)
    return setup, first, second


def between(join, makers=space, bearer="second"):
    """A joint between two bodies, made from (model, first, second, elements), a spring between both, a force and a couple on the second.

    bearer: of loads at the point D, which is the first's where the second is welded to it
    """

    def made(generator):
        setup, first, second = makers(generator)
        m, e = setup.model, setup.model.elements
        flat = np.array([1, 1, 0]) if makers is plane else np.ones(3)
        setup.force(bearer, e["D"], generator.uniform(-3, 3, 3) * flat)
        setup.couple("second", generator.uniform(-1, 1, 3) * (1 - flat if makers is plane else flat))
        setup.spring("first", e["A"], bearer, e["D"], 40.0, 0.3)
        join(m, first, second, e)
        return setup, {("ground", "first"), ("first", "second")}

    return made


def alone(join, makers=space):
    """The same of the second body and the ground; the first one is elsewhere."""

    def made(generator):
        setup, _, second = makers(generator)
        join(setup.model, setup.model.ground, second, setup.model.elements)
        return setup, {("ground", "first"), ("ground", "second")}

    return made


def in_plane(m, a, b, e):
    N = m.attach_point(a, "N", e["C"].initial)
    m.planar(a, b, N, e["C"], e["v"])


def fixed_axis(m, e):
    """A fixed point 0.4 m before C, and a fixed axis through both."""
    axis = np.array([0.6, 0.8, 0.0])
    return m.point("S", e["C"].initial - 0.4 * axis, fixed=True), m.vector("k", axis, fixed=True)


def hinge(m, a, b, e):
    m.revolute(a, b, e["C"], e["u"])
    return m.angle("psi", e["H"] - e["A"], e["D"] - e["C"], e["u"])


def drive(m, a, b, e):
    m.drive(hinge(m, a, b, e), 0.3 * m.time**2 + hinge_angle(m))


def hinge_angle(m):
    return float(m.elements["psi"].initial[0])


def drive_slide(m, a, b, e):
    m.cylindrical(a, b, e["A"], e["C"], e["u"])
    m.drive(m.slide("s", e["A"], e["C"], e["u"]), 0.4 + 0.2 * m.time**2)


def drive_length(m, a, b, e):
    s = m.length("s", e["A"], e["C"])
    m.drive(s, 0.4 + 0.2 * m.time**2)


def loaded_hinge(m, a, b, e):
    """A motor, a spring and a rotor act through the angle's row."""
    psi = hinge(m, a, b, e)
    m.torque(psi, 0.7 - 0.1 * psi.rate)
    m.torsion_spring(psi, 2.0)
    m.rotor(psi, 0.05)


def own_rows(m, a, b, e):
    for axis in "xyz":
        m.constrain(getattr(e["C"], axis) - getattr(e["A"], axis) - 0.4 * getattr(e["u"], axis))


def own_velocity(m, a, b, e):
    """The distance of A and C stays as it is, said of velocities."""
    along = [(getattr(e["C"], x), getattr(e["A"], x)) for x in "xyz"]
    m.constrain_velocity(sum((c.symbol - a.symbol) * (c.rate - a.rate) for c, a in along))


SPACE = {
    "spherical": lambda m, a, b, e: m.spherical(a, b, e["C"]),
    "revolute": lambda m, a, b, e: m.revolute(a, b, e["C"], e["u"]),
    "universal": lambda m, a, b, e: m.universal(a, b, e["C"], e["u"], e["w"]),
    "cylindrical": lambda m, a, b, e: m.cylindrical(a, b, e["A"], e["C"], e["u"]),
    "prismatic": lambda m, a, b, e: m.prismatic(a, b, e["A"], e["C"], e["u"]),
    "planar": in_plane,
    "screw": lambda m, a, b, e: m.screw(a, b, e["A"], e["C"], e["u"], 0.1, "screw"),
    "rigid": lambda m, a, b, e: m.rigid(a, b),
    "point_on_line": lambda m, a, b, e: m.point_on_line(a, e["C"], e["A"], e["u"]),
    "point_in_plane": lambda m, a, b, e: m.point_in_plane(a, e["C"], e["A"], e["v"]),
    "distance": lambda m, a, b, e: m.distance(e["A"], e["D"]),
    "driven angle": drive,
    "driven slide": drive_slide,
    "driven length": drive_length,
    "loads of an angle": loaded_hinge,
    "own rows": own_rows,
    "own velocity row": own_velocity,
}


def on_ground(call):
    def join(m, a, b, e):
        call(m, a, b, e, *fixed_axis(m, e))

    return join


GROUND = {
    "spherical": lambda m, a, b, e, S, k: m.spherical(a, b, S),
    "revolute": lambda m, a, b, e, S, k: m.revolute(a, b, S, k),
    "universal": lambda m, a, b, e, S, k: m.universal(a, b, S, k, e["w"]),
    "cylindrical": lambda m, a, b, e, S, k: m.cylindrical(a, b, S, e["C"], k),
    "prismatic": lambda m, a, b, e, S, k: m.prismatic(a, b, S, e["C"], k),
    "planar": lambda m, a, b, e, S, k: m.planar(a, b, m.point("N", e["C"].initial, fixed=True), e["C"], k),
    "screw": lambda m, a, b, e, S, k: m.screw(a, b, S, e["C"], k, 0.1, "screw"),
    "point_on_line": lambda m, a, b, e, S, k: m.point_on_line(a, e["C"], S, k),
    "point_in_plane": lambda m, a, b, e, S, k: m.point_in_plane(a, e["C"], m.point("N", e["C"].initial, fixed=True), k),
    "distance": lambda m, a, b, e, S, k: m.distance(S, e["C"]),
    "own row": lambda m, a, b, e, S, k: m.constrain(e["C"].x + 2 * e["D"].y - (e["C"].initial[0] + 2 * e["D"].initial[1])),
    "driven coordinate": lambda m, a, b, e, S, k: m.drive(e["C"].x, float(e["C"].initial[0]) + 0.1 * m.time**2),
}


@pytest.mark.parametrize("seed", [1, 2])
@pytest.mark.parametrize("name", SPACE)
def test_joints_in_space(name, seed):
    closes(*between(SPACE[name], bearer="first" if name == "rigid" else "second")(np.random.default_rng(seed)))


@pytest.mark.parametrize("name", GROUND)
def test_joints_of_the_ground_in_space(name):
    closes(*alone(on_ground(GROUND[name]))(np.random.default_rng(3)))


# -- three bodies: gears, racks, discs --------------------------------------------------------------


def wheel(setup, name, centre, axis, generator):
    """A body on two points and an axis, its centre of mass off the axis."""
    m, n = setup.model, axis.initial
    away = np.cross(n, generator.standard_normal(3))
    end = m.point(f"{name}.end", centre.initial + 0.3 * away / np.linalg.norm(away))
    setup.body(name, [centre, end], [axis], generator)
    return end


def gears(generator, kind="gear"):
    """Two wheels (or a wheel and a rack) on the first body, whose axes are u; the second body of `space` is not there."""
    m = Model("gears")
    m.gravity(tuple(G))
    setup = Setup(m)
    m.point("origin", (0, 0, 0), fixed=True)
    frame = np.linalg.qr(generator.standard_normal((3, 3)))[0]
    H = m.point("H", generator.uniform(-0.5, 0.5, 3), fixed=True)
    C, u, v = m.point("C", H.initial + 0.6 * frame[0]), m.vector("u", frame[1]), m.vector("v", frame[2])
    first = setup.body("first", [H, C], [u, v], generator)
    end = wheel(setup, "second", C, u, generator)
    psi = m.angle("psi", H - C, end - C, u)
    m.torque(psi, 0.9)
    if kind == "gear":
        B = m.attach_point(first, "B", C.initial + 0.3 * frame[2])
        w = m.vector("w", frame[1])
        m.extend(first, w)
        other = wheel(setup, "third", B, w, generator)
        m.gear(psi, m.angle("psi3", H - C, other - B, u), 0.1, 0.2)
    else:
        S = m.attach_point(first, "S", C.initial - 0.2 * frame[2] + 0.4 * frame[0])
        R, w = m.point("R", S.initial + 0.5 * frame[2]), m.vector("w", frame[0])
        rack = setup.body("third", [R], [v, w], generator)
        m.prismatic(first, rack, S, R, v)
        m.rack(m.slide("s", S, R, v), psi, 0.15)
    setup.force("third", other if kind == "gear" else R, generator.uniform(-3, 3, 3))
    return setup, {("ground", "first"), ("first", "second"), ("first", "third"), ("second", "third")}


@pytest.mark.parametrize("seed", [1, 2])
@pytest.mark.parametrize("kind", ["gear", "rack"])
def test_teeth_in_space(kind, seed):
    closes(*gears(np.random.default_rng(seed), kind))


def test_a_rolling_disc():
    m = Model("disc")
    m.gravity((0.3, 0, -9.81))
    setup, generator = Setup(m), np.random.default_rng(1)
    m.point("origin", (0, 0, 0), fixed=True)
    lean = np.radians(70)
    C, n = m.point("C", (0.2, 0.1, 0.3 * np.sin(lean))), m.vector("n", (np.sin(lean), 0, np.cos(lean)))
    c = m.vector("c", (0, 1, 0))
    disc = setup.body("disc", [C], [n, c], generator)
    m.rolling(disc, C, n, c, 0.3)
    closes(setup, {("ground", "disc")}, gravity=(0.3, 0, -9.81))


# -- in the plane -----------------------------------------------------------------------------------


def plane(generator):
    """A body hinged to the ground, and a second one."""
    m = Model("plane")
    m.gravity(tuple(G))
    setup = Setup(m)
    O = m.point("origin", (0, 0), fixed=True)
    m.vector("z", (0, 0, 1), fixed=True)
    turn, other = generator.uniform(-3, 3, 2)
    ahead = np.array([np.cos(turn), np.sin(turn)])
    A = m.point("A", 0.7 * ahead)
    first = setup.body("first", [O, A], [], generator)
    C = m.point("C", 1.1 * ahead)
    D = m.point("D", C.initial[:2] + 0.5 * np.array([np.cos(other), np.sin(other)]))
    return setup, first, setup.body("second", [C, D], [], generator)


def hinged(m, a, b, e):
    m.spherical(a, b, e["C"])
    return m.angle("psi", e["A"] - e["origin"], e["D"] - e["C"], e["z"])


def ahead_of(m, a, e):
    """A vector of the first body along it."""
    if "ahead" not in e:
        ahead = e["A"].initial / np.linalg.norm(e["A"].initial)
        m.extend(a, m.vector("ahead", ahead[:2]))
    return e["ahead"]


def flat_drive(m, a, b, e):
    psi = hinged(m, a, b, e)
    m.drive(psi, float(psi.initial[0]) + 0.4 * m.time**2)


def flat_motor(m, a, b, e):
    psi = hinged(m, a, b, e)
    m.torque(psi, 0.7)
    m.rotor(psi, 0.05)


def own_distance(m, a, b, e):
    far = [getattr(e["D"], x).symbol - getattr(e["A"], x).symbol for x in "xy"]
    m.constrain(far[0] ** 2 + far[1] ** 2 - float(np.sum((e["D"].initial - e["A"].initial) ** 2)))


PLANE = {
    "spherical": lambda m, a, b, e: m.spherical(a, b, e["C"]),
    "prismatic": lambda m, a, b, e: m.prismatic(a, b, e["A"], e["C"], ahead_of(m, a, e)),
    "slider": lambda m, a, b, e: m.slider(a, b, e["A"], e["C"], e["A"] - e["origin"]),
    "rigid": lambda m, a, b, e: m.rigid(a, b),
    "point_on_line": lambda m, a, b, e: m.point_on_line(a, e["C"], e["A"], ahead_of(m, a, e)),
    "distance": lambda m, a, b, e: m.distance(e["A"], e["D"]),
    "driven angle": flat_drive,
    "loads of an angle": flat_motor,
    "driven length": lambda m, a, b, e: m.drive(m.length("s", e["A"], e["C"]), 0.4 + 0.2 * m.time**2),
    "own row": own_distance,
}


@pytest.mark.parametrize("seed", [1, 2])
@pytest.mark.parametrize("name", PLANE)
def test_joints_in_the_plane(name, seed):
    setup, pairs = between(PLANE[name], plane, "first" if name == "rigid" else "second")(np.random.default_rng(seed))
    closes(setup, pairs)


# -- all of them ------------------------------------------------------------------------------------


def test_every_joint_of_the_catalogue_is_here():
    joints = {name for name, method in vars(Joints).items() if getattr(method, "is_fact", False)}
    assert joints <= {*SPACE, *GROUND, *PLANE, "gear", "rack", "rolling"}
