"""Every joint's rank and freedom: one body against ground in random geometry.

Expected values: the table of ranks and degrees of freedom of lower pairs in any textbook; the redundancy of a shared
unit vector (its unit norm repeats) is García de Jalón & Bayo's.
"""

from __future__ import annotations

import numpy as np
import pytest
import sympy

import ncgen
from ncgen.exchange.toml_writer import to_toml

AXIS = np.array([1.0, 2.0, 2.0]) / 3


def body(m, generator):
    """A body of two points and two vectors in a random orientation."""
    frame = np.linalg.qr(generator.standard_normal((3, 3)))[0]
    start = generator.standard_normal(3)
    A, B = m.point("A", start), m.point("B", start + 0.7 * frame[0])
    u, v = m.vector("u", frame[1]), m.vector("v", frame[2])
    return m.body("body", [A, B], [u, v]), A, u


def on_axis(m, A):
    return m.point("P", A.initial - 0.4 * AXIS, fixed=True), m.vector("e", AXIS, fixed=True)


def elsewhere(m):
    return m.point("P", (0.9, 0.1, 0.4), fixed=True)


def beside(m, A):
    """A fixed point in the plane through A normal to the axis."""
    return m.point("P", A.initial - np.array([0.0, 0.2, -0.2]), fixed=True), m.vector("e", AXIS, fixed=True)


JOINTS = {
    "none": (lambda m, b, A, u: None, 6),
    "spherical": (lambda m, b, A, u: m.spherical(m.ground, b, elsewhere(m)), 3),
    "revolute": (lambda m, b, A, u: m.revolute(m.ground, b, elsewhere(m), m.vector("e", AXIS, fixed=True)), 1),
    "universal": (lambda m, b, A, u: m.universal(m.ground, b, elsewhere(m), m.vector("e", AXIS, fixed=True), u), 2),
    "cylindrical": (lambda m, b, A, u: m.cylindrical(m.ground, b, on_axis(m, A)[0], A, m.elements["e"]), 2),
    "prismatic": (lambda m, b, A, u: m.prismatic(m.ground, b, on_axis(m, A)[0], A, m.elements["e"]), 1),
    "planar": (lambda m, b, A, u: m.planar(m.ground, b, beside(m, A)[0], A, m.elements["e"]), 3),
    "screw": (lambda m, b, A, u: m.screw(m.ground, b, on_axis(m, A)[0], A, m.elements["e"], 0.01, "screw"), 1),
    "point on line": (lambda m, b, A, u: m.point_on_line(m.ground, A, on_axis(m, A)[0], m.elements["e"]), 4),
    "point in plane": (lambda m, b, A, u: m.point_in_plane(m.ground, A, beside(m, A)[0], m.elements["e"]), 5),
    "massless rod": (lambda m, b, A, u: m.distance(elsewhere(m), A), 5),
}


@pytest.mark.parametrize("seed", [1, 2])
@pytest.mark.parametrize("name", JOINTS)
def test_freedom_of_joint(name, seed):
    """The body keeps the joint's degrees of freedom, wherever it is."""
    join, dof = JOINTS[name]
    m = ncgen.Model("joint")
    join(m, *body(m, np.random.default_rng(seed)))
    found = ncgen.freedom(ncgen.compile(m, backend="numpy"))
    assert found.dof == dof
    assert not found.is_singular


@pytest.mark.parametrize("name", ["revolute", "universal", "cylindrical", "prismatic", "screw"])
def test_joint_between_two_moving_bodies(name):
    """Two bodies have 6 degrees of freedom together and those of the joint."""
    generator = np.random.default_rng(7)
    m = ncgen.Model("pair")
    first, A, u = body(m, generator)
    frame = np.linalg.qr(generator.standard_normal((3, 3)))[0]
    C = m.point("C", A.initial + 0.3 * u.initial)
    D = m.point("D", C.initial + 0.5 * frame[0])
    v, w = m.vector("v2", frame[1]), m.vector("w2", frame[2])
    second = m.body("second", [C, D], [v, w])
    if name == "revolute":
        m.revolute(first, second, A, u)
    elif name == "universal":
        m.universal(first, second, A, u, v)
    elif name == "cylindrical":
        m.cylindrical(first, second, A, C, u)
    elif name == "prismatic":
        m.prismatic(first, second, A, C, u)
    else:
        m.screw(first, second, A, C, u, 0.02, "screw")
    expected = {"revolute": 1, "universal": 2, "cylindrical": 2, "prismatic": 1, "screw": 1}[name]
    assert ncgen.freedom(ncgen.compile(m, backend="numpy")).dof == 6 + expected


def test_rigid_joint_welds():
    """Two welded bodies move as one."""
    generator = np.random.default_rng(3)
    m = ncgen.Model("weld")
    first, A, u = body(m, generator)
    frame = np.linalg.qr(generator.standard_normal((3, 3)))[0]
    C = m.point("C", (1.0, 1.0, 0.0))
    D = m.point("D", C.initial + frame[0])
    second = m.body("second", [C, D], [m.vector("v2", frame[1]), m.vector("w2", frame[2])])
    m.rigid(first, second)
    assert ncgen.freedom(ncgen.compile(m, backend="numpy")).dof == 6


def test_directions_across_an_axis_of_parameters_exist_once():
    """A screw needs two directions of its body across the axis for the line that it slides on, and takes one of these for its angle."""
    m = ncgen.Model("screw")
    a = m.parameter("a", 0.3).symbol
    along = (sympy.cos(a), sympy.sin(a), 0)
    u, A, B, C = m.vector("u", along), m.point("A", (0, 0, 0)), m.point("B", (0.1, 0.2, 1)), m.point("C", along)
    nut = m.body("nut", [A, B], [u], mass=1.0, inertia=(0.1, 0.1, 0.1))
    bolt = m.body("bolt", [C, m.point("D", (0.5, 1, 0.4))], [u], mass=1.0, inertia=(0.1, 0.1, 0.1))
    m.screw(nut, bolt, A, C, u, 0.02, "screw")
    assert [v.name for v in nut.vectors] == ["u", "nut.across1", "nut.across2"]


def test_screw_advances_by_its_pitch():
    """One turn of the screw moves the body by the pitch along the axis."""
    m = ncgen.Model("screw")
    b, A, _ = body(m, np.random.default_rng(5))
    P, e = on_axis(m, A)
    psi, s = m.screw(m.ground, b, P, A, e, 0.01, "screw")
    kernels = ncgen.compile(m, backend="numpy")
    q = kernels.q0
    for turn in np.linspace(0, 2 * np.pi, 9)[1:]:
        q = ncgen.move(kernels, q, {psi.name: psi.components[0].initial + turn}).q
    advance = q[[kernels.index[f"A.{x}"] for x in "xyz"]] - A.initial
    assert np.allclose(advance, 0.01 * AXIS, atol=1e-10)


def test_gear_and_rack_keep_their_ratio():
    """A gear pair of radii 0.1 and 0.3, and a rack on the second wheel."""
    m = ncgen.Model("gears")
    z = m.vector("z", (0, 0, 1), fixed=True)
    x = m.vector("x", (1, 0, 0), fixed=True)
    O1, O2 = m.point("O1", (0, 0), fixed=True), m.point("O2", (0.4, 0), fixed=True)
    A, B = m.point("A", (0.1, 0)), m.point("B", (0.4, 0.3))
    m.body("pinion", [O1, A])
    m.body("wheel", [O2, B])
    R, S = m.point("R", (0, -0.3)), m.point("S", (0, -0.3), fixed=True)
    m.point_on_line(m.ground, R, S, x)
    first = m.angle("first", x, A - O1, z)
    second = m.angle("second", x, B - O2, z)
    slide = m.slide("slide", S, R, x)
    m.gear(first, second, 0.1, 0.3)
    m.rack(slide, second, 0.3)
    kernels = ncgen.compile(m, backend="numpy")
    assert ncgen.freedom(kernels).dof == 1
    q = ncgen.move(kernels, kernels.q0, {"first": 0.6}).q
    assert np.isclose(q[kernels.index["second"]], np.pi / 2 - 0.2, atol=1e-12)
    assert np.isclose(q[kernels.index["R.x"]], -0.06, atol=1e-12)


def pair_of_cranks(ratio):
    m = ncgen.Model("cranks")
    z, x = m.vector("z", (0, 0, 1), fixed=True), m.vector("x", (1, 0, 0), fixed=True)
    O1, O2 = m.point("O1", (0, 0), fixed=True), m.point("O2", (1, 0), fixed=True)
    A, B = m.point("A", (0.2, 0)), m.point("B", (1.1, 0))
    m.body("first", [O1, A])
    m.body("second", [O2, B])
    first, second = m.angle("first", x, A - O1, z), m.angle("second", x, B - O2, z)
    m.follow(second, first, ratio)
    return m, first


@pytest.mark.parametrize("ratio", [-1.5, 0.25])
def test_a_coordinate_follows_another(tmp_path, ratio):
    """So does it from a model file."""
    m, first = pair_of_cranks(ratio)
    (tmp_path / "cranks.toml").write_text(to_toml(m), encoding="utf-8")
    for model in (m, ncgen.load(tmp_path / "cranks.toml")):
        kernels = ncgen.compile(model, backend="numpy")
        q = ncgen.move(kernels, kernels.q0, {"first": 0.6}).q
        assert q[kernels.index["second"]] == pytest.approx(0.6 * ratio, abs=1e-14)
        assert q[kernels.index["B.y"]] == pytest.approx(0.1 * np.sin(0.6 * ratio), abs=1e-14)
    with pytest.raises(ncgen.ModelError, match="tied to itself"):
        m.follow(first, first, 2.0)
