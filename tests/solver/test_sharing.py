"""Which joint loads are unique: hand statics, Newton and Euler with unknown hinge loads, and what must raise no alarm."""

from __future__ import annotations

import numpy as np
import pytest
import sympy

import ncgen
from ncgen import Model


def reactions(model, duration=0.1, points=3, **options):
    return ncgen.simulate(ncgen.compile(model, "numpy"), duration, points=points, **options).reactions()


def open_loads(loads):
    """{(body, coordinate)} that are not unique."""
    return {(body, name) for body, each in loads.determinate.items() for name, unique in each.items() if not unique}


def door(height):
    """10 kg on two ball joints of a vertical axis; a third point somewhere on the door."""
    m = Model("door")
    A, B, C = m.point("A", (0, 0, 0), fixed=True), m.point("B", (0, 0, 2), fixed=True), m.point("C", (1, 0, height))
    m.body("door", [A, B, C], mass=10.0, com=(0.5, 0, 1), inertia=(3.4, 4.2, 0.9))
    m.gravity((0, 0, -9.81))
    return m


@pytest.mark.parametrize("height", [0.5, 1.5])
def test_two_hinges_share_the_weight_of_a_door(height):
    """Six unknown forces, five equations that do not vanish about the axis: the two vertical ones are known by their sum only.
    The others follow from moments: the weight pulls the upper hinge with m g · 0.5/2."""
    loads = reactions(door(height))
    assert open_loads(loads) == {("door", "A.z"), ("door", "B.z")} and not loads.is_determinate
    assert loads.shared == ("door: A.z and B.z share 98.1 N",)
    assert loads.force("door", "A")[:, 2] + loads.force("door", "B")[:, 2] == pytest.approx(98.1, abs=1e-9)
    assert loads.force("door", "A")[0, :2] == pytest.approx((24.525, 0), abs=1e-9)
    assert loads.force("door", "B")[0, :2] == pytest.approx((-24.525, 0), abs=1e-9)


def test_two_pins_share_what_pushes_along_them():
    """A beam of 10 kg on two pins, pushed with 100 N along its axis: who takes it nobody knows; across, the lever decides.
    A second body hangs at one of the pins and is held by it alone."""
    m = Model("beam")
    A, B, C = m.point("A", (0, 0), fixed=True), m.point("B", (2, 0), fixed=True), m.point("C", (1.5, 0))
    m.body("beam", [A, B, C], mass=10.0, com=(1, 0, 0), inertia=1.0)
    m.body("pendulum", [B, m.point("D", (2, 1))], mass=1.0, inertia=0.1)
    m.force(C, (100.0, 20.0, 0))
    m.gravity((0, -9.81, 0))
    loads = reactions(m)
    assert open_loads(loads) == {("beam", "A.x"), ("beam", "B.x")}
    assert loads.shared == ("beam: A.x and B.x share 100 N",)
    assert loads.force("beam", "A")[0, 1] == pytest.approx(98.1 / 2 - 20 * 0.25, abs=1e-9)
    assert loads.force("beam", "B")[0, 1] == pytest.approx(98.1 / 2 - 20 * 0.75, abs=1e-9)


def test_a_hinge_of_two_points_between_bodies_that_move():
    """The same door at the end of another: on both bodies the forces along the axis between them are shared, nothing else."""
    m = Model("doors")
    E, F = m.point("E", (-1, 0, 0), fixed=True), m.point("F", (-1, 0, 2), fixed=True)
    A, B, C = m.point("A", (0, 0, 0)), m.point("B", (0, 0, 2)), m.point("C", (1, 0, 0.5))
    m.body("inner", [E, F, A, B], mass=10.0, com=(-0.5, 0, 1), inertia=(3.4, 4.2, 0.9))
    m.body("outer", [A, B, C], mass=10.0, com=(0.5, 0, 1), inertia=(3.4, 4.2, 0.9))
    m.gravity((0, 0, -9.81))
    loads = reactions(m, qd0={"C.y": 1.0})
    assert open_loads(loads) == {("inner", name) for name in ("A.z", "B.z", "E.z", "F.z")} | {("outer", "A.z"), ("outer", "B.z")}
    assert loads.shared == (
        "inner: E.z and F.z share 196 N",
        "inner: A.z and B.z share 98.1 N",
        "outer: A.z and B.z share 98.1 N",
    )


def hinge_statics(run, hinges):
    """{(body, coordinate)} that are not unique by Newton and Euler: of every hinge (point, axis, body, other) a force and a moment
    square to the axis are unknown; of every body six equations are known."""
    bodies, found = list(run.model.bodies), set()
    for k in range(len(run.t)):
        rows = np.zeros((6 * len(bodies) + len(hinges), 6 * len(hinges)))
        for h, (point, axis, *sides) in enumerate(hinges):
            r = run.point(point)[k]
            for body, sign in zip(sides, (1.0, -1.0), strict=True):
                if body is None:
                    continue
                b = 6 * bodies.index(body)
                rows[b : b + 3, 6 * h : 6 * h + 3] = sign * np.eye(3)
                rows[b + 3 : b + 6, 6 * h : 6 * h + 3] = sign * np.cross(r, np.eye(3)).T
                rows[b + 3 : b + 6, 6 * h + 3 : 6 * h + 6] = sign * np.eye(3)
            rows[6 * len(bodies) + h, 6 * h + 3 : 6 * h + 6] = run.vector(axis)[k]
        values, right = np.linalg.svd(rows)[1:]
        free = right[int(np.sum(values > 1e-9)) :]
        for h, (point, axis, *sides) in enumerate(hinges):
            names = [f"{e}.{x}" for e in (point, axis) for x in "xyz"]
            reached = np.linalg.norm(free[:, 6 * h : 6 * h + 6], axis=0) > 1e-7
            found |= {(body, name) for body in sides if body for name, r in zip(names, reached, strict=True) if r}
    return found, len(free)


BRICARD = [("P1", "u1", "rod1", None), *((f"P{i}", f"u{i}", f"rod{i}", f"rod{i - 1}") for i in range(2, 6)), ("P6", "u6", "rod5", None)]
BENNETT = [("B", "uB", "BC", None), ("C", "uC", "BC", "CD"), ("D", "uD", "CD", "DA"), ("A", "uA", "DA", None)]


@pytest.mark.parametrize("name, hinges, excess", [("bricard", BRICARD, 1), ("bennett", BENNETT, 3)])
def test_overconstrained_linkages_against_newton_and_euler(name, hinges, excess):
    """Mobility 1 where Grübler's count says 0 and −2: as many loads are free to choose, and they reach the same components."""
    model = ncgen.load(name)
    run = ncgen.simulate(ncgen.compile(model, "numpy"), 0.4, points=5, **_start(model))
    expected, free = hinge_statics(run, hinges)
    assert free == excess
    loads = run.reactions()
    assert open_loads(loads) == expected
    assert len(loads.shared) == len(run.model.bodies) and all(len(line) <= 300 for line in loads.shared)


def _start(model):
    return {key: value for key, value in model.simulation_options.items() if key in ("z", "zd0", "qd0")}


@pytest.mark.parametrize("name", ["fourbar", "slidercrank", "slidercrank3d", "stewart", "pendulum", "doublependulum"])
def test_no_false_alarm(name):
    """Mechanisms with as many joint loads as equations: the plane ones in their plane, across it nothing acts."""
    model = ncgen.load(name)
    loads = reactions(model, **_start(model))
    assert loads.is_determinate and loads.shared == () and "all unique" in repr(loads)


def test_pairs_of_points_are_hinges_of_the_robot(spatial):
    """Bodies 6 and 7 meet in r6 and r7, 8 and 9 in r7 and r8: two ball joints on one axis, whose forces along it are shared.
    What is square to the axis is not: along it nothing else changes. The chain of bodies 2 to 5 is overconstrained."""
    loads = spatial.reactions()
    assert {body for body, _ in open_loads(loads)} == {f"body{i}" for i in range(2, 10)}
    for a, b, first, second in [("body6", "body7", "r6", "r7"), ("body8", "body9", "r7", "r8")]:
        for body in (a, b):
            points = {name.split(".")[0] for owner, name in open_loads(loads) if owner == body}
            assert points == {first, second}
    assert all(loads.determinate["body9"][f"u5.{axis}"] for axis in "xyz")


def supported(count, gravity):
    """A flat plate that turns about a pin and slides on `count` supports of the plane."""
    m = Model("plate")
    corners = [(0, 0), (1, 0), (1, 1), (0, 1)][:count]
    points = [m.point(f"P{i}", p, fixed=True if i == 0 else "z") for i, p in enumerate(corners)]
    m.body("plate", points, mass=2.0, com=(0.5, 0.4, 0), inertia=0.4)
    m.gravity(gravity)
    return m


@pytest.mark.parametrize("count, gravity, shared", [(4, (0, -9.81, 0), False), (3, (0, 0, -9.81), False), (4, (0, 0, -9.81), True)])
def test_a_table_on_four_legs(count, gravity, shared):
    """Three legs take a weight in one way, four in many; where nothing presses on them there is nothing to share."""
    loads = reactions(supported(count, gravity))
    assert open_loads(loads) == ({("plate", f"P{i}.z") for i in range(4)} if shared else set())
    assert loads.shared == (("plate: P0.z, P1.z, P2.z and P3.z share 19.6 N",) if shared else ())


@pytest.mark.parametrize("twice", [False, True])
def test_a_driver_takes_a_load_like_a_joint(twice):
    """A crank that is driven has unique loads; driven by its angle and by its end as well, it has not."""
    m = Model("crank")
    A, B = m.point("A", (0, 0), fixed=True), m.point("B", (1, 0))
    x, z = m.vector("x", (1, 0, 0), fixed=True), m.vector("z", (0, 0, 1), fixed=True)
    m.body("bar", [A, B], mass=1.0, inertia=0.1)
    psi = m.angle("psi", x, B - A, z)
    m.drive(psi, 0.3 * m.time)
    if twice:
        m.drive(B.y, sympy.sin(0.3 * m.time))
    m.gravity((0, -9.81, 0))
    assert reactions(m).is_determinate is not twice


@pytest.mark.parametrize("kept", [False, True])
def test_bodies_whose_rows_the_user_wrote(kept):
    """Two points of a body that no row keeps apart have no internal load; kept apart they could be pushed apart, if anything else did."""
    m = Model("cloud")
    A, B, C = m.point("A", (0, 0), fixed=True), m.point("B", (1, 0)), m.point("C", (2, 0.5))
    cloud = m.body("cloud", [B, C], mass=1.0, inertia=0.3, rigid=False)
    m.body("link", [A, B], mass=1.0, inertia=0.1)
    if kept:
        m.distance(B, C, owner=cloud)
        m.distance(B, C)  # a strut beside the body
    m.gravity((0, -9.81, 0))
    assert {body for body, _ in open_loads(reactions(m))} == ({"cloud"} if kept else set())
