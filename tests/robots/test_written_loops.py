"""Mechanisms with loops as SDF: what is read back moves as what was written."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import ncgen
from ncgen import Model
from ncgen.errors import ModelError
from ncgen.exchange.examples import example_module
from ncgen.exchange.robots import robot_text
from ncgen.solver.frames import transformation

HERE = Path(__file__).parent


def excavator() -> Model:
    """Without its cylinders' control, which depends on time: it falls."""
    model = ncgen.load("excavator")
    model.forces.clear()
    return model


def delta() -> Model:
    """With ball joints on its rods, and without motors."""
    model = example_module("delta").build(hinged=False)
    model.forces.clear()
    return model


def fivebar() -> Model:
    m = Model("fivebar")
    A, E = m.point("A", (0, 0), fixed=True), m.point("E", (0.6, 0), fixed=True)
    B, C, D = m.point("B", (-0.2, 0.5)), m.point("C", (0.4, 0.9)), m.point("D", (0.9, 0.4))
    for name, pair in {"left": (A, B), "over": (B, C), "under": (C, D), "right": (E, D)}.items():
        m.body(name, pair, mass=1.3, inertia=0.02)
    x, z = m.vector("x", (1, 0), fixed=True), m.vector("z", (0, 0, 1), fixed=True)
    first, second = m.angle("first", x, B - A, z), m.angle("second", D - E, x, z)
    m.torsion_spring(first, 3.0, 0.1, 1.2)
    m.torsion_spring(second, 0.0, 0.2)
    m.independent(first, second)
    m.gravity((0, -9.81, 0))
    return m


def cardan() -> Model:
    """A spatial four-bar whose coupler hangs on a universal joint and a ball."""
    m = Model("cardan")
    A, D = m.point("A", (0, 0, 0), fixed=True), m.point("D", (0.6, 0, 0.3), fixed=True)
    B, C = m.point("B", (0.2, 0, 0)), m.point("C", (0.6, 0.5, 0.3))
    x, z = m.vector("x", (1, 0, 0), fixed=True), m.vector("z", (0, 0, 1), fixed=True)
    across, w = m.vector("across", (0, 1, 0)), m.vector("w", (0, 0.6, -0.8))
    over = m.vector("over", (0.6, 0, 0.8))
    inertia = [0.01, 0.02, 0.015]
    crank = m.body("crank", [A, B], [z, across], mass=1.0, inertia=inertia)
    coupler = m.body("coupler", [B, C], [over], mass=0.7, inertia=inertia)
    m.body("rocker", [D, C], [x, w], mass=0.8, inertia=inertia)
    m.universal(crank, coupler, B, across, over)
    m.angle("psi", x, B - A, z)
    m.independent("psi")
    m.gravity((0, -9.81, 0))
    return m


MODELS = {
    "cardan": (cardan, {"psi": 3.0}, {"psi"}),
    "fourbar": (lambda: ncgen.load("fourbar"), {}, {"psi"}),
    "fivebar": (fivebar, {}, {"first", "second"}),
    "excavator": (excavator, {}, {"lift", "crowd", "curl"}),
    "stewart": (
        lambda: ncgen.load("stewart"),
        {"s1": 0.6, "s2": -0.3, "s4": 0.4, "s3": 0.0, "s5": 0.0, "s6": 0.0},
        {f"s{i}" for i in range(1, 7)},
    ),
    "delta": (delta, {}, {"psi1", "psi2", "psi3"}),
}


@pytest.mark.parametrize("name", MODELS)
def test_what_is_read_back_moves_as_what_was_written(name, tmp_path):
    """Rotations of all bodies, and what coordinates changed by, over a short fall."""
    make, zd0, coordinates = MODELS[name]
    model = make()
    path = tmp_path / f"{name}.sdf"
    path.write_text(robot_text(model, ".sdf"), encoding="utf-8")
    read = ncgen.load(path)
    read.independent(*sorted(coordinates))
    kernels = [ncgen.compile(each, "numpy") for each in (model, read)]
    assert ncgen.freedom(kernels[0]).dof == ncgen.freedom(kernels[1]).dof
    ours, theirs = (ncgen.simulate(each, 0.12, zd0=zd0, rtol=1e-11, points=4) for each in kernels)
    for body in (body for body in model.bodies.values() if len(body.elements) > 2 or body.frame.planar):
        turned = [transformation(each, body.name, run.q) for each, run in zip(kernels, (ours, theirs), strict=True)]
        np.testing.assert_allclose(turned[1], turned[0], rtol=0, atol=1e-9)
    moved = 0.0
    for coordinate in coordinates:
        first, second = ours[coordinate], theirs[coordinate]
        np.testing.assert_allclose(second - second[0], first - first[0], rtol=0, atol=1e-9)
        assert second[0] == pytest.approx(0.0, abs=1e-14)
        moved = max(moved, float(np.ptp(first)))
    assert moved > 1e-2


FREE_LOOP = """<sdf version="1.7"><model name="free">
<link name="trunk"><inertial><mass>3</mass><inertia><ixx>0.3</ixx><iyy>0.2</iyy><izz>0.25</izz></inertia></inertial></link>
<link name="low"><pose>0.1 0 -0.1 0 0 0</pose>{0}</link>
<link name="end"><pose>0.3 0 -0.1 0 0 0</pose>{0}</link>
<link name="high"><pose>0.1 0 0.1 0 0 0</pose>{0}</link>
<joint name="j1" type="revolute"><parent>trunk</parent><child>low</child><axis><xyz>0 1 0</xyz></axis></joint>
<joint name="j2" type="revolute"><parent>low</parent><child>end</child><axis><xyz>0 1 0</xyz></axis></joint>
<joint name="j3" type="revolute"><parent>trunk</parent><child>high</child><axis><xyz>0 1 0</xyz></axis></joint>
<joint name="j4" type="revolute"><pose relative_to="__model__">0.3 0 0.1 0 0 0</pose><parent>high</parent><child>end</child>
<axis><xyz>0 1 0</xyz></axis></joint>
</model></sdf>""".format("<inertial><mass>1</mass><inertia><ixx>0.01</ixx><iyy>0.02</iyy><izz>0.02</izz></inertia></inertial>")


@pytest.mark.parametrize("suffix", [".sdf", ".xml"])
def test_a_loop_on_a_free_body_stays_free(tmp_path, suffix):
    """Six freedoms of the trunk and one of the parallelogram."""
    (tmp_path / "first.sdf").write_text(FREE_LOOP)
    path = tmp_path / f"second{suffix}"
    path.write_text(robot_text(ncgen.load(tmp_path / "first.sdf"), suffix), encoding="utf-8")
    model = ncgen.load(path)
    assert set(model.bodies) == {"trunk", "low", "end", "high"}
    assert ncgen.freedom(ncgen.compile(model, "numpy")).dof == 7


MIMIC = """<robot name="grip">
<link name="base"/>
<link name="hand"><inertial><origin xyz="0.2 0 0.1"/><mass value="2"/><inertia ixx="0.1" iyy="0.12" izz="0.09"/></inertial></link>
<link name="left"><inertial><origin xyz="0.1 0 0"/><mass value="1"/><inertia ixx="0.02" iyy="0.02" izz="0.03"/></inertial></link>
<link name="right"><inertial><mass value="1"/><inertia ixx="0.02" iyy="0.02" izz="0.03"/></inertial></link>
<joint name="turn" type="continuous"><parent link="base"/><child link="hand"/><axis xyz="0 -1 0.3"/></joint>
<joint name="close" type="continuous"><parent link="hand"/><child link="left"/><origin xyz="0.5 0 0" rpy="0.3 0 1"/>
<axis xyz="0 0 1"/></joint>
<joint name="other" type="prismatic"><parent link="hand"/><child link="right"/><origin xyz="0 0.4 0" rpy="0 0.4 0"/><axis xyz="1 0 -1"/>
<mimic joint="close" multiplier="-0.7"/></joint>
</robot>"""


@pytest.mark.parametrize("suffix", [".urdf", ".sdf", ".xml"])
def test_mimics_come_back(tmp_path, suffix):
    (tmp_path / "first.urdf").write_text(MIMIC)
    model = ncgen.load(tmp_path / "first.urdf")
    path = tmp_path / f"second{suffix}"
    path.write_text(robot_text(model, suffix), encoding="utf-8")
    read = ncgen.load(path)
    ours, theirs = (
        ncgen.simulate(ncgen.compile(m, "numpy"), 0.3, zd0={"turn": 2.0, "close": 3.0}, rtol=1e-11, points=4) for m in (model, read)
    )
    assert np.ptp(ours["other"]) > 0.1
    for name in ("turn", "close", "other"):
        np.testing.assert_allclose(theirs[name], ours[name], rtol=0, atol=1e-10)


def test_gears_become_mimics(tmp_path):
    """Wheels of radii 0.1 and 0.3 on the ground, from angles that are not 0: ψ₂ − ψ₂(0) = −(ψ₁ − ψ₁(0)) / 3."""
    m = Model("gears")
    x, z = m.vector("x", (1, 0), fixed=True), m.vector("z", (0, 0, 1), fixed=True)
    angles = []
    for number, (place, angle) in enumerate((((0, 0), 0.3), ((0.4, 0), -0.8)), 1):
        A = m.point(f"A{number}", place, fixed=True)
        B = m.point(f"B{number}", (place[0] + 0.1 * np.cos(angle), 0.1 * np.sin(angle)))
        m.body(f"wheel{number}", [A, B], mass=1.0, com=(place[0] + 0.05, 0.02), inertia=0.01)
        angles.append(m.angle(f"psi{number}", x, B - A, z))
    m.gear(*angles, 0.1, 0.3)
    m.gravity((0, -9.81, 0))
    path = tmp_path / "gears.sdf"
    path.write_text(robot_text(m, ".sdf"), encoding="utf-8")
    ours, theirs = (ncgen.simulate(ncgen.compile(each, "numpy"), 0.5, rtol=1e-11, points=6) for each in (m, ncgen.load(path)))
    assert np.ptp(ours["psi1"]) > 0.3
    for name, start in (("psi1", 0.3), ("psi2", -0.8)):
        np.testing.assert_allclose(theirs[name], ours[name] - start, rtol=0, atol=1e-9)
    np.testing.assert_allclose(theirs["psi2"], -theirs["psi1"] / 3, rtol=0, atol=1e-12)


def test_a_slider_in_a_loop(tmp_path):
    model = ncgen.load("slidercrank")
    path = tmp_path / "slider.sdf"
    path.write_text(robot_text(model, ".sdf"), encoding="utf-8")
    read = ncgen.load(path)
    read.independent("psi")
    kernels = (ncgen.compile(each, "numpy") for each in (model, read))
    ours, theirs = (ncgen.simulate(each, 0.02, zd0={"psi": 100.0}, rtol=1e-10, points=4) for each in kernels)
    assert np.ptp(ours["psi"]) > 1.0
    np.testing.assert_allclose(theirs["psi"] - theirs["psi"][0], ours["psi"] - ours["psi"][0], rtol=0, atol=1e-7)


def test_an_open_tree_keeps_its_zeros_in_sdf(tmp_path):
    path = tmp_path / "crane.sdf"
    model = ncgen.load(HERE / "crane.urdf")
    path.write_text(robot_text(model, ".sdf"), encoding="utf-8")
    first, second = (ncgen.joint_space(ncgen.compile(each, "numpy")) for each in (model, ncgen.load(path)))
    values = dict(zip(first.rates, np.sin(np.arange(first.n)), strict=True))
    order = [second.rates.index(name) for name in first.rates]
    masses = first.mass_matrix(first.position(values)), second.mass_matrix(second.position(values))[np.ix_(order, order)]
    np.testing.assert_allclose(masses[1], masses[0], rtol=0, atol=1e-12)


def test_a_free_robot_stays_free(tmp_path):
    path = tmp_path / "crane.sdf"
    path.write_text(robot_text(ncgen.load(HERE / "crane.urdf", floating=True), ".sdf"), encoding="utf-8")
    assert ncgen.freedom(ncgen.compile(ncgen.load(path), "numpy")).dof == 12


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (
            lambda: ncgen.load("excavator"),
            "excavator: cylinder lift is no spring or damper of a joint; a file of links and joints cannot say it",
        ),
        (lambda: ncgen.load("jansen"), "jansen: constraint driver of psi .* belongs to no joint; a file of links"),
        (lambda: ncgen.load("flyball"), "flyball: spring K1-M1 is no spring or damper of a joint"),
    ],
)
def test_what_sdf_cannot_say(make, said):
    with pytest.raises(ModelError, match=said):
        robot_text(make(), ".sdf")
