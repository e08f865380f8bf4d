"""Models as URDF and MJCF: what is read back moves as what was written, and what a format cannot say is refused by name."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import ncgen
from ncgen import Model
from ncgen.errors import ModelError
from ncgen.exchange.robots import robot_text
from ncgen.exchange.robots.placement import Placement

HERE = Path(__file__).parent


def reach() -> Model:
    """An arm whose hinges do not begin at 0, whose second coordinate turns against its axis' vector, and a slider that is not at 0."""
    m = Model("reach")
    O, z = m.point("O", (0.2, 0, 0.1), fixed=True), m.vector("z", (0, 0, 1), fixed=True)
    x, y = m.vector("x", (1, 0, 0), fixed=True), m.vector("y", (0, 1, 0), fixed=True)
    A, u = m.point("A", (0.6, 0.3, 0.5)), m.vector("u", (-0.6, 0.8, 0))
    upper = m.body("upper", [O, A], [z, u], mass=m.parameter("load", 3.0), com=(0.4, 0.2, 0.3), inertia=(0.2, 0.3, 0.1))
    B, w = m.point("B", (1.1, 0.6, 0.4)), m.vector("w", (0.8, 0.6, 0))
    lower = m.body("lower", [A, B], [u, w], mass=2.0, com=(0.8, 0.5, 0.5), inertia=(0.1, 0.1, 0.05))
    C = m.point("C", (1.1 + 0.24, 0.6 + 0.18, 0.4))
    tool = m.body("tool", [C], [w, m.vector("e", (0.6, -0.8, 0))], mass=0.7, inertia=(0.01, 0.02, 0.015))
    m.prismatic(lower, tool, B, C, w)
    turn = m.angle("turn", start=x, end=A - O, axis=z)
    bend = m.angle("bend", start=z, end=B - A, axis=-1 * u)
    out = m.slide("out", B, C, w)
    m.torsion_spring(bend, 0.0, 0.4)
    m.torsion_spring(turn, 5.0, 0.1, 0.3)
    m.rotor(out, 0.2)
    m.gravity((0, 0, -9.81))
    assert upper and y
    return m


def same_motion(first: Model, second: Model) -> None:
    """Masses, forces that hold it, and what springs and dampers say, in random positions and at random rates, joint by joint."""
    spaces = [ncgen.joint_space(ncgen.compile(model, "numpy")) for model in (first, second)]
    a, b = spaces
    order = [b.rates.index(name) for name in a.rates]
    rng = np.random.default_rng(3)
    for _ in range(5):
        values, v, acceleration = (rng.uniform(-1, 1, a.n) for _ in range(3))
        ours, theirs = (space.position(dict(zip(a.rates, values, strict=True))) for space in spaces)
        other_v, other_a = np.empty(a.n), np.empty(a.n)
        other_v[order], other_a[order] = v, acceleration
        np.testing.assert_allclose(b.mass_matrix(theirs)[np.ix_(order, order)], a.mass_matrix(ours), rtol=0, atol=1e-12)
        needed = a.inverse_dynamics(ours, v, acceleration)
        np.testing.assert_allclose(b.inverse_dynamics(theirs, other_v, other_a)[order], needed, rtol=0, atol=1e-11)
        np.testing.assert_allclose(b.loads(theirs, other_v)[order], a.loads(ours, v), rtol=0, atol=1e-12)


def again(model: Model, suffix: str, tmp_path: Path) -> Model:
    path = tmp_path / f"{model.name}{suffix}"
    path.write_text(robot_text(model, suffix), encoding="utf-8")
    return ncgen.load(path)


def test_a_file_comes_back_as_it_went(tmp_path):
    same_motion(ncgen.load(HERE / "crane.urdf"), again(ncgen.load(HERE / "crane.urdf"), ".urdf", tmp_path))


def test_a_model_becomes_a_file(tmp_path):
    """Names, signs and zeros of coordinates, springs, dampers and rotors."""
    pytest.importorskip("mujoco", reason="MJCF is read by MuJoCo: pip install 'ncgen[robots]'")
    back = again(reach(), ".xml", tmp_path)
    same_motion(reach(), back)
    assert back.gravity_field == (0.0, 0.0, -9.81) and {"turn", "bend", "out"} <= set(back.elements)


def test_what_urdf_cannot_say():
    with pytest.raises(ModelError, match=r"joint turn: URDF cannot say a spring; write MJCF \(\.xml\)"):
        robot_text(reach(), ".urdf")
    with pytest.raises(ModelError, match="robot: constraint .* closes a loop; a file of links and joints cannot say it, but SDF .* can"):
        robot_text(ncgen.load("robot"), ".urdf")
    with pytest.raises(ModelError, match="cartpole: motor is no spring or damper of a joint; .* leave it out"):
        robot_text(ncgen.load("cartpole"), ".xml")
    with pytest.raises(ModelError, match=r"files of links and joints end with \.urdf, \.sdf, \.xml, \.mjcf; '.stl' is not one of them"):
        robot_text(reach(), ".stl")


def test_what_mjcf_cannot_say():
    m = Model("bar")
    A, u = m.point("A", (0, 0, 0), fixed=True), m.vector("u", (0, 1, 0), fixed=True)
    m.body("bar", [A, m.point("B", (1, 0, 0))], [u], mass=1.0, com=(0.5, 0, 0), inertia=(0.0, 0.1, 0.1))
    with pytest.raises(
        ModelError, match="body bar: MJCF takes masses and principal moments of inertia above 1e-15; .* give a bar its thickness"
    ):
        robot_text(m, ".xml")


@pytest.mark.parametrize("rpy", [(0.3, -0.7, 2.0), (-3.0, 1.2, -2.5), (0.0, np.pi / 2, 0.4), (1.0, -np.pi / 2, 0.0), (np.pi, 0.0, 0.0)])
def test_rotations_come_back(rpy):
    """From angles or a quaternion, a pitch of a quarter turn included."""
    first = Placement.of_rpy((0.0, 0.0, 0.0), rpy)
    np.testing.assert_allclose(Placement.of_rpy((0.0, 0.0, 0.0), first.rpy).rotation, first.rotation, rtol=0, atol=1e-15)
    np.testing.assert_allclose(
        Placement.of_quaternion(np.zeros(3), np.array(first.quaternion)).rotation, first.rotation, rtol=0, atol=1e-15
    )
    assert first.quaternion[0] >= 0


def test_several_joints_of_a_body_come_back(tmp_path):
    """In MJCF as joints of one body, each with its own anchor: bodies without mass between them are none that MuJoCo takes."""
    text = """<mujoco model="leg"><compiler angle="radian"/><worldbody><body name="hip" pos="0.1 0 1" euler="0.3 0 0.2">
    <joint name="out" axis="-1 0.2 0" pos="0.02 0.01 0"/><joint name="ahead" axis="0 -1 0" pos="0 0.03 0" armature="0.1"/>
    <joint name="long" type="slide" axis="0.1 0 -1"/><inertial pos="0.1 0 -0.2" mass="2" diaginertia="0.1 0.12 0.05"/>
    </body></worldbody></mujoco>"""
    (tmp_path / "first.xml").write_text(text)
    model = ncgen.load(tmp_path / "first.xml")
    (tmp_path / "second.xml").write_text(robot_text(model, ".xml"))
    first, second = (ncgen.joint_space(ncgen.compile(m, "numpy")) for m in (model, ncgen.load(tmp_path / "second.xml")))
    assert first.rates == second.rates == ("out", "ahead", "long")
    values, v = {"out": 0.4, "ahead": -0.7, "long": 0.2}, [1.0, -2.0, 0.5]
    here, there = first.position(values), second.position(values)
    np.testing.assert_allclose(second.mass_matrix(there), first.mass_matrix(here), rtol=0, atol=1e-13)
    np.testing.assert_allclose(second.inverse_dynamics(there, v), first.inverse_dynamics(here, v), rtol=0, atol=1e-12)
