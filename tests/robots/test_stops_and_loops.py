"""Stops and dry friction where they are asked for, and loops said beside a URDF."""

from pathlib import Path

import numpy as np
import pytest

import ncgen
from ncgen.errors import ModelError
from ncgen.exchange.robots.robot import Joint
from ncgen.exchange.robots.stops import FRICTION_RATE, LOSS, STIFFNESS

HERE = Path(__file__).parent

BAR = """<robot name="bar"><link name="a"/>
<link name="b"><inertial><origin xyz="0.5 0 0"/><mass value="2"/><inertia ixx="0.01" iyy="0.3" izz="0.3"/></inertial></link>
<joint name="hinge" type="revolute"><parent link="a"/><child link="b"/><axis xyz="0 -1 0"/>
<limit lower="-0.4" upper="1.1" effort="1" velocity="1"/><dynamics friction="1.5"/></joint></robot>"""


@pytest.fixture
def bar(tmp_path):
    path = tmp_path / "bar.urdf"
    path.write_text(BAR)
    return path


def test_stops_push_back_and_say_nothing_between(bar):
    model = ncgen.load(bar, limits=True)
    assert model.left_out == ("friction of joints (1)", "effort limits (1)", "velocity limits (1)")
    space = ncgen.joint_space(ncgen.compile(model, "numpy"))
    for angle, rate in ((0.0, 3.0), (-0.4, -1.0), (1.1, 1.0), (1.3, 0.7), (1.3, -0.7), (-0.9, 0.2), (-0.9, -0.2)):
        high, low = max(angle - 1.1, 0.0), max(-0.4 - angle, 0.0)
        expected = -STIFFNESS * (high * (1 + np.tanh(LOSS * rate)) - low * (1 - np.tanh(LOSS * rate)))
        assert space.loads(space.position({"hinge": angle}), [rate]) == pytest.approx([expected], abs=1e-9)


def test_a_bar_rests_on_its_stop(bar):
    """m g l cos ψ = k s where it has come to rest, with friction that takes the swing."""
    kernels = ncgen.compile(ncgen.load(bar, limits=True, friction=True), "c")
    run = ncgen.simulate(kernels, 3.0, rtol=1e-6, points=7)
    psi = run["hinge"][-1]
    assert np.min(run["hinge"]) < -0.4 < 0.0
    assert STIFFNESS * (-0.4 - psi) == pytest.approx(2 * 9.81 * 0.5 * np.cos(psi), abs=1.5)
    assert run["hinge"][-1] == pytest.approx(run["hinge"][-2], abs=1e-5)


def test_friction_is_dry_but_near_rest(bar):
    space = ncgen.joint_space(ncgen.compile(ncgen.load(bar, friction=True), "numpy"))
    assert space.kernels.model.left_out == ("limits of joints (1)", "effort limits (1)", "velocity limits (1)")
    q = space.position({"hinge": 0.3})
    for rate, expected in ((2.0, -1.5), (-0.5, 1.5), (0.0, 0.0), (FRICTION_RATE, -1.5 * np.tanh(1.0))):
        assert space.loads(q, [rate]) == pytest.approx([expected], abs=1e-12)


def test_rigid_stops_and_friction_that_sticks(bar):
    """The bar falls onto its stop, m g l (sin 0.4) less friction on the way, and stays exactly there."""
    model = ncgen.load(bar, limits="rigid", friction="exact")
    assert model.left_out == ("effort limits (1)", "velocity limits (1)") and list(model.events) == ["hinge.stop.lower", "hinge.stop.upper"]
    run = ncgen.simulate(ncgen.compile(model), 2.0, rtol=1e-9, points=5)
    hit = next(event for event in run.events if event.t > 0)
    work = 2 * 9.81 * 0.5 * np.sin(0.4) - 1.5 * 0.4
    assert hit.name == "hinge.stop.lower" and hit.energy_lost == pytest.approx(work, rel=1e-8)
    assert run["hinge"][-2:] == pytest.approx([-0.4, -0.4], abs=1e-14)
    bounces = ncgen.simulate(run.kernels, 2.0, p={"stop_restitution": 0.5}).events
    hit = next(event for event in bounces if event.t > 0)
    assert hit.energy_lost == pytest.approx(0.75 * work, rel=1e-6)


@pytest.mark.parametrize(("word", "given"), [("limits", "soft"), ("friction", "rigid"), ("limits", 1)])
def test_words_of_stops(bar, word, given):
    with pytest.raises(ModelError, match=f'{word}: .* given; give True \\(smooth\\), "(rigid|exact)" or False'):
        ncgen.load(bar, **{word: given})


def test_they_are_for_robots():
    for word in ("limits", "friction"):
        with pytest.raises(ModelError, match=f"pendulum: {word} is for a robot's file"):
            ncgen.load("pendulum", **{word: True})
    assert Joint(name="j", kind="revolute", parent="a", child="b").limits is None


LOOP = """
[[revolute]]
name = "closing"
parent = "coupler"
child = "rocker"
point = [{x}, 0.0, {z}]
axis = [0.0, -1.0, 0.0]
"""


def opened() -> str:
    """The four-bar of fourbar.sdf as a URDF, without the hinge that closes it."""
    inertias = {
        "crank": (1.2, "0.5 0 0", "0.001 0.1 0.1"),
        "coupler": (2, "1.0 0 0.1", "0.002 0.7 0.7"),
        "rocker": (1.5, "-0.25 0 1", "0.4 0.4 0.01"),
    }
    text = '<robot name="fourbar"><link name="base"/>'
    for name, (mass, com, moments) in inertias.items():
        xx, yy, zz = moments.split()
        inertia = f'<mass value="{mass}"/><inertia ixx="{xx}" iyy="{yy}" izz="{zz}"/>'
        text += f'<link name="{name}"><inertial><origin xyz="{com}"/>{inertia}</inertial></link>'
    for name, parent, child, xyz, rpy in (
        ("motor", "base", "crank", "0 0 1", "0 -1.0471975511965976 0"),
        ("elbow", "crank", "coupler", "1 0 0", "0 0 0"),
        ("pillar", "base", "rocker", "3 0 1", "0 0 0"),
    ):
        text += f'<joint name="{name}" type="continuous"><parent link="{parent}"/><child link="{child}"/><origin xyz="{xyz}" rpy="{rpy}"/>'
        text += f'<axis xyz="0 -1 0"/>{"<dynamics damping=" + chr(34) + "0.2" + chr(34) + "/>" if name == "motor" else ""}</joint>'
    return text + "</robot>"


@pytest.fixture
def fourbar(tmp_path):
    """The URDF, and where its loop closes in the coupler's frame: rocker's (-0.5, 0, 2) in the base is (2.5, 0, 3)."""
    path = tmp_path / "fourbar.urdf"
    path.write_text(opened())
    turn = np.array([[np.cos(np.pi / 3), -np.sin(np.pi / 3)], [np.sin(np.pi / 3), np.cos(np.pi / 3)]])  # of x and z by the crank
    elbow = np.array([0.0, 1.0]) + turn @ [1.0, 0.0]
    x, z = turn.T @ (np.array([2.5, 3.0]) - elbow)
    return path, LOOP.format(x=repr(float(x)), z=repr(float(z)))


@pytest.mark.parametrize("named", [True, False])
def test_a_table_closes_the_loop_of_a_urdf(fourbar, named):
    """Beside the file, or named; the motion is that of the SDF with the same loop."""
    path, table = fourbar
    assert ncgen.freedom(ncgen.compile(ncgen.load(path), "numpy")).dof == 3
    where = path.with_name("other.toml") if named else path.with_name("fourbar.loops.toml")
    where.write_text(table)
    ours = ncgen.compile(ncgen.load(path, loops=where) if named else ncgen.load(path), "numpy")
    theirs = ncgen.compile(ncgen.load(HERE / "fourbar.sdf"), "numpy")
    assert ncgen.freedom(ours).dof == 1
    runs = [ncgen.simulate(each, 0.5, rtol=1e-10, points=6) for each in (ours, theirs)]
    for name in ("motor", "elbow", "pillar"):
        np.testing.assert_allclose(runs[0][name], runs[1][name], rtol=0, atol=1e-8)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("[[revolute]]", "[[rope]]", "other.toml: there is no kind of loop 'rope'; known are connect, revolute, prismatic, weld"),
        ("[[revolute]]", "[revolute]", "other.toml: revolute is no list of tables; write [[revolute]]"),
        ("[[revolute]]", "[[revolute", "other.toml, line 2: not TOML"),
        ('"rocker"', '"roker"', "other.toml: revolute 1: its child 'roker' is no link of fourbar"),
        ('"rocker"', '"coupler"', "revolute 1: it joins link coupler to itself; name two links"),
        ("axis = [0.0, -1.0, 0.0]", "axis = [0, 0, 0]", "revolute 1: its axis is 0 0 0; give a direction"),
        ("axis = [0.0, -1.0, 0.0]", "", "revolute 1: axis is None; give three numbers"),
        ("axis = [0.0, -1.0, 0.0]", "axis = [0.0, nan, 0.0]", "revolute 1: axis is [0.0, nan, 0.0]; give three numbers"),
        ("axis = [0.0, -1.0, 0.0]", f"axis = [0.0, 1{'0' * 400}, 0.0]", "give three numbers of at most 1e+100"),
        ("axis = [0.0, -1.0, 0.0]", "axes = [0.0, -1.0, 0.0]", "revolute 1: 'axes' is not known; give name, parent, child, point, axis"),
        ('"closing"', '"elbow"', "there are two joints 'elbow'; rename the loop"),
        ('"closing"', "3", "revolute 1: its name is 3; give a text"),
    ],
)
def test_what_is_wrong_with_a_table(fourbar, old, new, said):
    path, table = fourbar
    where = path.with_name("other.toml")
    where.write_text(table.replace(old, new, 1))
    with pytest.raises(ModelError) as refused:
        ncgen.load(path, loops=where)
    assert said in str(refused.value) and "\n" not in str(refused.value)
    with pytest.raises(ModelError, match="nowhere.toml: there is no such file"):
        ncgen.load(path, loops="nowhere.toml")
