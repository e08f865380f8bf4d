"""Loops closed in Python by two frames: `model.close`, the report of what moved, refusals."""

import copy
import pickle

import numpy as np
import pytest
from test_closures import ends_of, linkage

import ncgen
from ncgen.errors import ModelError
from ncgen.model.bodies import BodyFrame
from ncgen.report.inspection import inspect

CUP = '<link name="cup"/><joint name="c" type="fixed"><parent link="base"/><child link="cup"/><origin xyz="{}"/></joint>'


@pytest.fixture
def robot(tmp_path):
    def made(extra=""):
        (tmp_path / "linkage.urdf").write_text(linkage(extra))
        return ncgen.load(tmp_path / "linkage.urdf")

    return made


@pytest.mark.parametrize("kind", ["hinge", "ball", "point"])
def test_a_robot_is_assembled_with_a_report(robot, kind):
    model = robot()
    model.close("tip", "pin", kind, name="closing")
    kernels = ncgen.compile(model, "numpy")
    assert ncgen.freedom(kernels).dof == 1
    angles = {name: kernels.q0[kernels.index[name]] for name in ("motor", "elbow", "pillar")}
    np.testing.assert_allclose(*ends_of(angles), rtol=0, atol=1e-12)
    assert [(name, unit) for name, _, unit in model.assembled] == [(name, "rad") for name in angles]
    for name, amount, _ in model.assembled:
        assert amount == pytest.approx(angles[name], abs=1e-12)
    assert inspect(kernels)["assembled"] == [{"joint": n, "moved": x, "unit": unit} for n, x, unit in model.assembled]


def test_a_robot_whose_loop_is_not_opened_has_nothing_to_report(robot):
    assert robot().assembled == ()


def test_a_weld_closes_too_and_what_is_said_is_that_of_a_table(tmp_path, robot):
    bracket = CUP.format('2.6 1 0" rpy="0 0 1.1')
    more = '<link name="hand"/><joint name="wrist" type="continuous"><parent link="tip"/><child link="hand"/><axis xyz="0 0 1"/></joint>'
    model = robot(bracket + more)
    model.close("hand", "cup", "weld")
    (tmp_path / "other.toml").write_text('[[weld]]\nname = "hand-cup"\nparent_frame = "hand"\nchild_frame = "cup"\n')
    other = ncgen.load(tmp_path / "linkage.urdf", loops=tmp_path / "other.toml")
    assert model.assembled == other.assembled
    assert {n: e.initial.tolist() for n, e in model.elements.items()} == {n: e.initial.tolist() for n, e in other.elements.items()}


def test_what_cannot_close_is_refused_with_its_gap(robot):
    model = robot(CUP.format("9 0 0"))
    with pytest.raises(ModelError, match="loop tip-cup cannot close: its frames stay 5.6 m apart"):  # 9 − 1 − 2.4
        model.close("tip", "cup", "ball")
    assert ncgen.freedom(ncgen.compile(model, "numpy")).dof == 3


@pytest.mark.parametrize(
    ("ends", "kind", "axis", "said"),
    [
        (("crank", "base"), "hinge", (0, 0, 1), "joint closing changes nothing: its links meet wherever the joints are"),
        (("crank", "base"), "ball", (0, 0, 1), "joint closing changes nothing"),
        (("tip", "tip"), "ball", (0, 0, 1), "both frames are on link tip, so it changes nothing"),
        (("tip", "coupler"), "weld", (0, 0, 1), "joint closing changes nothing|cannot close"),
        (("tip", "nose"), "ball", (0, 0, 1), "'nose' is no link or frame of the file"),
        (("tip", "pin"), "glue", (0, 0, 1), "the kind 'glue' is not known; give weld, hinge, ball, point"),
        (("tip", "pin"), "hinge", (0, 0, 0), "its axis is .* give a direction"),
    ],
)
def test_what_is_refused(robot, ends, kind, axis, said):
    with pytest.raises(ModelError, match=said):
        robot().close(*ends, kind, axis=axis, name="closing")


ENDS = {
    "sdf": """<sdf version="1.7"><model name="arm"><link name="crank"><pose>0 0 1 0 0.3 0</pose>{0}</link>
<link name="rod"><pose relative_to="crank">1 0 0 0 0.2 0</pose>{0}</link><link name="rocker"><pose>1.3 0.1 0.9 0.1 0 0.4</pose>{0}</link>
<frame name="tip" attached_to="rod"><pose>0.3 0.1 0 0.4 0 0.5</pose></frame>
<joint name="a" type="revolute"><pose>0.1 0.05 0.02 0.3 0 0</pose><parent>world</parent><child>crank</child><axis><xyz>0 1 0</xyz></axis>
</joint>
<joint name="b" type="ball"><pose>0.2 0 0.1 0.3 0.2 0</pose><parent>crank</parent><child>rod</child></joint>
<joint name="c" type="revolute"><pose>0.3 -0.1 0 0 0 0.7</pose><parent>world</parent><child>rocker</child><axis><xyz>0 0.6 0.8</xyz></axis>
</joint>
</model></sdf>""",
    "xml": """<mujoco model="arm"><compiler angle="radian"/><worldbody><body name="crank" pos="0 0 1" euler="0 0.3 0">{1}
<joint name="a" pos="0.1 0.05 0.02" axis="0 0.9553364891256 0.2955202066613"/><body name="rod" pos="1 0 0" euler="0 0.2 0">{1}
<joint name="b" type="ball" pos="0.2 0 0.1"/><site name="tip" pos="0.3 0.1 0" euler="0.4 0 0.5"/></body></body>
<body name="rocker" pos="1.3 0.1 0.9" euler="0.1 0 0.4">{1}<joint name="c" pos="0.3 -0.1 0" axis="0 0.6 0.8"/></body>
</worldbody></mujoco>""",
}
"""Frames of links and bodies that are not those of their joints."""

SOLID = (
    "<inertial><mass>1</mass><inertia><ixx>0.02</ixx><iyy>0.03</iyy><izz>0.04</izz></inertia></inertial>",
    '<inertial pos="0 0 0" mass="1" diaginertia="0.02 0.03 0.04"/>',
)


@pytest.mark.parametrize("kind", ENDS)
def test_ends_of_loops_are_frames_of_links_and_not_of_joints(tmp_path, kind):
    """The rod turns by 0.5 rad about y at (cos 0.3, 0, 1 − sin 0.3)."""
    if kind == "xml":
        pytest.importorskip("mujoco")
    path, table = tmp_path / f"arm.{kind}", tmp_path / "loops.toml"
    path.write_text(ENDS[kind].format(*SOLID))
    for one, other in (("rod", "rocker"), ("tip", "rocker")):
        table.write_text(f'[[connect]]\nparent_frame = "{one}"\nchild_frame = "{other}"\n')
        closed = ncgen.load(path)
        closed.close(one, other, "point")
        for model in (ncgen.load(path, loops=table), closed):
            space = ncgen.joint_space(ncgen.compile(model, "numpy"))
            ends = [space.frame(name).pose(space.kernels.q0)[1] for name in (one, other)]
            np.testing.assert_allclose(*ends, rtol=0, atol=1e-12)
            assert [joint for joint, _, _ in model.assembled]
    table.write_text('[[revolute]]\nname = "pin"\nparent = "rod"\nchild = "rocker"\npoint = [0.3, 0.1, 0.0]\naxis = [1.0, 0.0, 0.0]\n')
    found = ncgen.load(path, loops=table).elements
    place = [np.cos(0.3) + 0.3 * np.cos(0.5), 0.1, 1 - np.sin(0.3) - 0.3 * np.sin(0.5)]
    np.testing.assert_allclose(found["r_pin"].initial, place, atol=1e-12)
    np.testing.assert_allclose(found["u_pin"].initial, [np.cos(0.5), 0.0, -np.sin(0.5)], atol=1e-12)


def test_a_loop_of_a_file_that_changes_nothing_is_refused(tmp_path):
    """A second hinge on the axis of the first one."""
    hinge = '<joint name="{}" type="revolute"><parent>a</parent><child>b</child><axis><xyz>0 0 1</xyz></axis></joint>'
    links = "".join(f'<link name="{name}"/>' for name in "ab")
    text = f'<sdf version="1.9"><model name="m">{links}{hinge.format("j")}{hinge.format("closing")}</model></sdf>'
    (tmp_path / "m.sdf").write_text(text)
    with pytest.raises(ModelError, match="m.sdf, line 1: joint closing changes nothing: its links meet wherever the joints are"):
        ncgen.load(tmp_path / "m.sdf")


def test_a_third_crank_is_redundant_and_no_error(tmp_path):
    """A parallelogram stays movable: its last loop takes no degree of freedom, but its rows are there."""
    text = '<robot name="p"><link name="base"/>'
    for k in range(3):
        text += f'<link name="c{k}"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1"/></inertial></link>'
        links = f'<parent link="base"/><child link="c{k}"/>'
        text += f'<joint name="j{k}" type="continuous">{links}<origin xyz="{k} 0 0"/><axis xyz="0 0 1"/></joint>'
    text += '<link name="bar"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1"/></inertial></link>'
    text += '<joint name="b" type="continuous"><parent link="c0"/><child link="bar"/><origin xyz="0 1 0"/><axis xyz="0 0 1"/></joint>'
    for k in (1, 2):
        for name, parent, x, y in ((f"on{k}", "bar", k, 0), (f"end{k}", f"c{k}", 0, 1)):
            links = f'<parent link="{parent}"/><child link="{name}"/>'
            text += f'<link name="{name}"/><joint name="f{name}" type="fixed">{links}<origin xyz="{x} {y} 0"/></joint>'
    (tmp_path / "p.urdf").write_text(text + "</robot>")
    model = ncgen.load(tmp_path / "p.urdf")
    for k in (1, 2):
        model.close(f"on{k}", f"end{k}", "hinge")
    assert ncgen.freedom(ncgen.compile(model, "numpy")).dof == 1


def test_a_model_that_has_more_than_its_file_is_not_read_again(robot):
    model = robot()
    model.gravity((0, 0, -1))
    with pytest.raises(ModelError, match="close tip-pin: the robot is assembled anew, and the model has more than its file"):
        model.close("tip", "pin", "ball")


def test_models_travel(robot):
    for again in (pickle.loads(pickle.dumps(robot())), copy.deepcopy(robot())):
        again.close("tip", "pin", "hinge")
        assert len(again.assembled) == 3


def pair():
    """Two bars of 1 m on hinges 1 m apart, both along x: drawn open by 1 m."""
    m = ncgen.Model("pair")
    u = m.vector("u", (0, 0, 1), fixed=True)
    for k in (0, 1):
        start, end = m.point(f"A{k}", (k, 0, 0), fixed=True), m.point(f"B{k}", (k + 1.0, 0, 0))
        side = m.vector(f"s{k}", (0, 1, 0))
        m.body(f"bar{k}", [start, end], [u, side], mass=1.0, inertia="rod")
        m.revolute(m.ground, m.bodies[f"bar{k}"], start, u)
    return m


@pytest.mark.parametrize("kind", ["ball", "point"])
def test_points_of_a_python_model(kind):
    """An equilateral triangle."""
    m = pair()
    m.close(m.elements["B0"], BodyFrame("bar1", np.eye(3), np.array([2.0, 0.0, 0.0])), kind)
    kernels = ncgen.compile(m, "numpy")
    q = ncgen.assemble(kernels, {"B0.y": 0.5, "B1.y": 0.5})
    x, y = (q[kernels.index[name]] for name in ("B0.x", "B0.y"))
    assert abs(x - 0.5) < 1e-9 and abs(abs(y) - np.sqrt(0.75)) < 1e-9


def test_frames_of_a_python_model():
    """A bar that is welded to the ground as it was drawn does not move; by a hinge it turns."""
    for kind, dof in (("weld", 0), ("hinge", 1)):
        m = ncgen.Model("free")
        A, B = m.point("A", (0, 0, 0)), m.point("B", (1, 0, 0))
        m.body("bar", [A, B], [m.vector("s", (0, 1, 0)), m.vector("t", (0, 0, 1))], mass=1.0, inertia=(1, 1, 1))
        turn = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
        m.close(BodyFrame("bar", turn, np.array([0.5, 0.1, 0])), BodyFrame("ground", turn, np.array([0.5, 0.1, 0])), kind)
        assert ncgen.freedom(ncgen.compile(m, "numpy")).dof == dof
    with pytest.raises(ModelError, match="close A-B: both ends belong to one body, so it changes nothing"):
        m.close(A, B, "ball")
    with pytest.raises(ModelError, match="point A has no axes; give a BodyFrame"):
        m.close(A, BodyFrame("ground", turn, np.zeros(3)), "weld")
