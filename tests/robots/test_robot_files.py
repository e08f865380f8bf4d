"""Robots from URDF and SDF: what becomes of links and joints, loops and mimics, and what is said about files that are wrong."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import ncgen
from ncgen import Model
from ncgen.errors import ModelError
from ncgen.exchange.checking import checked
from ncgen.exchange.robots import read_robot
from ncgen.exchange.robots.placement import Placement
from ncgen.exchange.robots.robot import Joint
from ncgen.exchange.toml_reader import load_toml
from ncgen.exchange.toml_writer import to_toml
from ncgen.symbolic.tree import spanning_tree

HERE = Path(__file__).parent

TWO = """<robot name="two">
<link name="a"/>
<link name="b"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1"/></inertial></link>
<link name="c"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1"/></inertial></link>
<joint name="one" type="revolute"><parent link="a"/><child link="b"/><axis xyz="0 1 0"/></joint>
<joint name="two" type="revolute"><parent link="b"/><child link="c"/><origin xyz="1 0 0"/><axis xyz="0 1 0"/></joint>
</robot>
"""


@pytest.fixture
def write(tmp_path):
    def file(text, name="two.urdf"):
        path = tmp_path / name
        path.write_text(text, encoding="utf-8")
        return path

    return file


def test_neighbours_share_points_and_axes():
    """Two hinges that meet have one point; parallel ones one direction; every body has what spans space."""
    model = ncgen.load(HERE / "crane.urdf")
    jib, swivel = model.bodies["jib"], model.bodies["swivel"]
    assert {e.name for e in jib.elements} & {e.name for e in swivel.elements} == {"r_roll", "u_luff"}
    assert [len(link.screws) for link in spanning_tree(model).links] == [1] * 6
    for body in model.bodies.values():
        base = body.points[0]
        rows = [v.initial for v in body.vectors] + [p.initial - base.initial for p in body.points[1:]]
        assert np.linalg.matrix_rank(rows, tol=1e-3) == 3


def test_coordinates_have_the_names_and_zeros_of_the_file():
    model = ncgen.load(HERE / "crane.urdf")
    kernels = ncgen.compile(model, "numpy")
    names = ["slew", "roll", "luff", "travel", "swing", "balance"]
    assert [name for name in kernels.coordinates if name in names] == names
    assert np.max(np.abs(kernels.q0[[kernels.index[name] for name in names]])) < 1e-15
    assert ncgen.freedom(kernels).dof == 6
    assert model.left_out == ("limits of joints (4)", "friction of joints (1)", "effort limits (4)", "velocity limits (4)")


def test_elements_that_the_format_does_not_have_are_told(tmp_path):
    """Nothing is dropped in silence: an include that nobody expanded, a misspelt element of a joint."""
    text = (HERE / "crane.urdf").read_text(encoding="utf-8")
    text = text.replace("</robot>", '<xi:include href="more.xml" xmlns:xi="x"/></robot>').replace(
        "<axis ", '<dynamic damping="3"/><axis ', 1
    )
    (tmp_path / "crane.urdf").write_text(text, encoding="utf-8")
    told = ncgen.load(tmp_path / "crane.urdf").left_out
    unknown = {f"<{tag}>, which is none of the format's elements (1)" for tag in ("xi:include> in <robot", "dynamic> in <joint")}
    assert unknown <= set(told)


def test_a_floating_base_is_a_body_more():
    fixed, floating = (ncgen.load(HERE / "crane.urdf", floating=free) for free in (False, True))
    assert set(floating.bodies) - set(fixed.bodies) == {"base"}
    assert ncgen.freedom(ncgen.compile(floating, "numpy")).dof == 12


def test_a_pendulum_falls_as_it_should(write):
    """ψ̈ = m g l cos ψ / (I + m l²) of a bar that hangs on a hinge about y, from the horizontal."""
    text = """<robot name="bar"><link name="a"/>
    <link name="b"><inertial><origin xyz="0.5 0 0"/><mass value="2"/><inertia ixx="0.01" iyy="0.3" izz="0.3"/></inertial></link>
    <joint name="hinge" type="continuous"><parent link="a"/><child link="b"/><axis xyz="0 1 0"/></joint></robot>"""
    kernels = ncgen.compile(ncgen.load(write(text)), "numpy")
    space = ncgen.joint_space(kernels)
    for psi in (0.0, 0.7, -1.1):
        expected = 2 * 9.81 * 0.5 * np.cos(psi) / (0.3 + 2 * 0.25)
        assert space.forward_dynamics(space.position({"hinge": psi})) == pytest.approx([expected], rel=1e-13)


def test_a_closed_loop_of_sdf_moves_as_the_same_one_by_hand():
    read = ncgen.load(HERE / "fourbar.sdf")
    kernels = ncgen.compile(read, "numpy")
    assert ncgen.freedom(kernels).dof == 1
    assert read.left_out == ()

    m = Model("byhand")
    c, s = np.cos(np.pi / 3), np.sin(np.pi / 3)
    A, D = m.point("A", (0, 1), fixed=True), m.point("D", (3, 1), fixed=True)
    B, C = m.point("B", (c, 1 + s)), m.point("C", (2.5, 3))
    away = (
        np.array([c, s]) + np.array([c - 0.1 * s, s + 0.1 * c]) + (0, 1)
    )  # of the coupler's centre of mass, its frame turned like the crank's
    m.body("crank", [A, B], mass=1.2, com=(c / 2, 1 + s / 2), inertia=0.1)
    m.body("coupler", [B, C], mass=2.0, com=tuple(away), inertia=0.7)
    m.body("rocker", [D, C], mass=1.5, com=(2.75, 2), inertia=0.4)
    m.gravity((0, -9.81, 0))
    motor = m.angle("motor", m.vector("ahead", (1, 0), fixed=True), B - A, m.vector("up", (0, 0, 1), fixed=True))
    m.torsion_spring(motor, damping=0.2)
    hand = ncgen.compile(m, "numpy")

    theirs, ours = ncgen.simulate(hand, 1.0, rtol=1e-10), ncgen.simulate(kernels, 1.0, rtol=1e-10)
    turned = theirs.q[:, hand.index["motor"]] - np.pi / 3
    assert np.ptp(turned) > 1.0
    np.testing.assert_allclose(ours.q[:, kernels.index["motor"]], turned, rtol=0, atol=2e-8)


@pytest.mark.parametrize(("last", "led"), [("", True), ('<mimic joint="one" multiplier="-2" offset="0"/>', False)])
def test_joints_of_a_free_robot_are_independent(write, last, led):
    """So they take initial velocities by their names, and what leads is a rate of joint space, not what follows."""
    mass = '<inertial><mass value="2"/><inertia ixx="1" iyy="1" izz="1"/></inertial>'
    text = TWO.replace("</joint>\n</robot>", f"{last}</joint>\n</robot>").replace('<link name="a"/>', f'<link name="a">{mass}</link>')
    kernels = ncgen.compile(ncgen.load(write(text), floating=True), "numpy")
    rates = ncgen.joint_space(kernels).rates
    assert ["one" in rates, "two" in rates] == [True, led]
    run = ncgen.simulate(kernels, 0.1, zd0={"one": 0.5}, points=2)
    assert run["rate(one)"][0] == pytest.approx(0.5, abs=1e-12)


def test_a_mimic_follows(write):
    text = TWO.replace("</joint>\n</robot>", '<mimic joint="one" multiplier="-2" offset="0"/></joint>\n</robot>')
    kernels = ncgen.compile(ncgen.load(write(text)), "numpy")
    assert ncgen.freedom(kernels).dof == 1
    run = ncgen.simulate(kernels, 0.5)
    one, two = (run.q[:, kernels.index[name]] for name in ("one", "two"))
    assert np.ptp(one) > 0.1
    np.testing.assert_allclose(two, -2 * one, atol=1e-12)


GEARS = """<link name="wheel"><inertial><pose>0.2 0 0 0 0 0</pose><mass>2</mass><inertia><iyy>0.3</iyy></inertia></inertial></link>
<link name="pinion"><pose>1 0 0 0 0 0</pose><inertial><mass>1</mass><inertia><iyy>0.05</iyy></inertia></inertial></link>
<joint name="slow" type="revolute"><parent>world</parent><child>wheel</child><axis><xyz>0 -1 0</xyz></axis></joint>
<joint name="fast" type="revolute"><parent>world</parent><child>pinion</child><axis><xyz>0 1 0</xyz>{}</axis></joint>"""
GEARBOX = """<joint name="gears" type="gearbox"><parent>wheel</parent><child>pinion</child><gearbox_ratio>4</gearbox_ratio>
<gearbox_reference_body>world</gearbox_reference_body><axis><xyz>0 1 0</xyz></axis><axis2><xyz>0 1 0</xyz></axis2></joint>"""
MIMIC = '<mimic joint="slow"><multiplier>4</multiplier><offset>0.3</offset><reference>0.075</reference></mimic>'


@pytest.mark.parametrize("inside", [GEARS.format("") + GEARBOX, GEARS.format(MIMIC)])
def test_gears_of_sdf(write, inside):
    """θ₂ = −4 θ₁ about one axis: the coordinates, about opposite ones, are 1 : 4, and (I₁ + 16 I₂) ψ̈ = −m g l cos ψ."""
    kernels = ncgen.compile(ncgen.load(write(SDF.format(inside), "m.sdf")), "numpy")
    assert ncgen.freedom(kernels).dof == 1
    run = ncgen.simulate(kernels, 0.6, rtol=1e-10, points=13)
    assert np.ptp(run["slow"]) > 0.1
    np.testing.assert_allclose(run["fast"], 4 * run["slow"], rtol=0, atol=1e-12)
    inertia = 0.3 + 2 * 0.2**2 + 16 * 0.05
    speed = np.sqrt(2 * 2 * 9.81 * 0.2 * -np.sin(run["slow"]) / inertia)
    np.testing.assert_allclose(np.abs(run["rate(slow)"]), speed, rtol=0, atol=1e-8)


def test_hinges_on_one_axis_hang_one_after_the_other(write):
    """The second of two bodies that turn about one line hangs on the first, not on what carries both."""
    text = TWO.replace('<origin xyz="1 0 0"/>', "")
    model = ncgen.load(write(text))
    tree = spanning_tree(model)
    assert [link.parent for link in tree.links] == [None, 0]
    assert ncgen.joint_space(ncgen.compile(model, "numpy")).rates == ("one", "two")


def test_it_comes_back_from_a_model_file(tmp_path):
    model = ncgen.load(HERE / "crane.urdf")
    path = tmp_path / "crane.toml"
    path.write_text(to_toml(model), encoding="utf-8")
    mine, again = (ncgen.compile(m, "numpy") for m in (model, load_toml(path)))
    assert again.coordinates == mine.coordinates
    q = mine.q0 + 0.1 * np.sin(np.arange(mine.n))
    np.testing.assert_array_equal(again.phi(q), mine.phi(q))


def test_placements():
    """Roll, pitch and yaw are about fixed axes, in this order; a quaternion is the same rotation."""
    roll, pitch, yaw = 0.3, -1.1, 2.0
    place = Placement.of_rpy((1.0, 2.0, 3.0), (roll, pitch, yaw))
    from scipy.spatial.transform import Rotation

    rotation = Rotation.from_euler("xyz", (roll, pitch, yaw))
    np.testing.assert_allclose(place.rotation, rotation.as_matrix(), atol=1e-15)
    x, y, z, w = rotation.as_quat()
    np.testing.assert_allclose(Placement.of_quaternion(np.zeros(3), np.array([w, x, y, z])).rotation, place.rotation, atol=1e-15)
    back = place.inverse() @ place
    np.testing.assert_allclose(back.rotation, np.eye(3), atol=1e-15)
    np.testing.assert_allclose(back.position, 0.0, atol=1e-15)


ENTITY = '<?xml version="1.0"?>\n<!DOCTYPE robot [<!ENTITY a "x">]>\n<robot name="&a;"/>'

BAD = [
    ("", "two.urdf, line 1: no XML: no element found"),
    ("<robot name='r'>\n<link name='a'>\n</robot>", "two.urdf, line 3: no XML: mismatched tag"),
    (ENTITY, "two.urdf, line 2: document types and entities are not read"),
    ("<html/>", "two.urdf, line 1: <html> begins no robot"),
    ("<robot name='r'/>", "two.urdf, line 1: <robot> has no <link>"),
    ("<robot name='r'>\n<xacro:arm/></robot>", "two.urdf, line 2: "),
    ("<robot xmlns:xacro='x'>\n<xacro:arm/></robot>", "two.urdf, line 2: <xacro:arm> is a macro of xacro; expand it first: xacro"),
    ("<robot>" + 200 * "<a>" + 200 * "</a>" + "</robot>", "elements are more than 100 deep in each other"),
    (TWO.replace('type="revolute"', 'type="rubber"', 1), "two.urdf, line 5: joint one: there is no type rubber; known are fixed, revolute"),
    (TWO.replace('name="two" type', 'name="one" type'), "two.urdf, line 6: there are two joints 'one'; rename one"),
    (TWO.replace('name="c"', 'name="b"'), "two.urdf, line 4: there are two links 'b'; rename one"),
    (TWO.replace('<child link="c"/>', '<child link="d"/>'), "two.urdf, line 6: joint two: there is no link 'd'"),
    (TWO.replace('<child link="c"/>', '<child link="b"/>'), "two.urdf, line 6: joint two: link b hangs on joint one already"),
    (TWO.replace('<child link="c"/>', '<child link="a"/>'), "two.urdf, line 5: joint one: its links a and b are in a circle; cut it"),
    (TWO.replace('<parent link="a"/>', '<parent link="c"/>').replace('<link name="a"/>', ""), "every link hangs on another: joint one is"),
    (TWO.replace('<parent link="a"/>', '<parent link="c"/>'), "two.urdf, line 5: joint one: its links c and b are in a circle; cut it"),
    (TWO.replace('<link name="a"/>', '<link name="a"/><link name="e"/>'), "links a and e both hang on nothing"),
    (TWO.replace('xyz="0 1 0"', 'xyz="0 0 0"', 1), "two.urdf, line 5: joint one: its axis is 0 0 0; give a direction"),
    (TWO.replace('xyz="0 1 0"', 'xyz="0 1"', 1), "two.urdf, line 5: xyz: 3 numbers are needed, '0 1' is given"),
    (TWO.replace('value="1"', 'value="nan"', 1), "two.urdf, line 3: value: 'nan' is not finite; give a number"),
    (TWO.replace('value="1"', 'value="one"', 1), "two.urdf, line 3: value: 'one' is no number"),
    (TWO.replace('value="1"', 'value="-1"', 1), "two.urdf, line 3: the mass is -1 kg; give a positive number"),
    (TWO.replace('<mass value="1"/>', "", 1), "two.urdf, line 3: <inertial> has no <mass>; give it one"),
    (TWO.replace('izz="1"', 'izz="3"', 1), "two.urdf, line 3: body b: no body has principal moments of inertia 1, 1, 3 kg m2"),
    (TWO.replace("</joint>\n</robot>", '<mimic joint="two"/></joint></robot>'), "two.urdf, line 6: joint two mimics itself; name another"),
    (TWO.replace("</joint>\n</robot>", '<mimic joint="x"/></joint></robot>'), "joint two: there is no joint 'x' that moves"),
    (
        TWO.replace("</joint>\n</robot>", '<mimic joint="one" multiplier="1e200"/></joint></robot>'),
        "line 6: multiplier: '1e200' is too large",
    ),
    (TWO.replace("</joint>\n</robot>", '<dynamics damping="1e250"/></joint></robot>'), "two.urdf, line 6: damping: '1e250' is too large"),
    (TWO.replace('xyz="1 0 0"', 'xyz="1e200 0 0"'), "two.urdf, line 6: xyz: '1e200' is too large; the largest number is 1e+100"),
    (TWO.replace('"one"', f'"{"j" * 1000}"'), "two.urdf, line "),
]


@pytest.mark.parametrize(("text", "said"), BAD)
def test_what_is_wrong_is_told_with_its_line(write, text, said):
    if said.endswith("line 2: "):
        said = "two.urdf, line 2: "
    with pytest.raises(ModelError) as refused:
        ncgen.load(write(text))
    assert said in str(refused.value)
    assert len(str(refused.value)) <= 300 and "\n" not in str(refused.value)


SDF = '<sdf version="1.7"><model name="m">{}</model></sdf>'
LINKS = '<link name="a"/><link name="b"><pose>1 0 0 0 0 0</pose></link>'
JOINT = '<joint name="j" type="{}"><parent>a</parent><child>b</child>{}</joint>'

BAD_SDF = [
    ('<sdf version="1.7"/>', "it has no <model>; a robot's file has one"),
    (SDF.format(""), "<model> has no <link>"),
    (SDF.format("<include/>"), "<include> has no <uri>; give it one"),
    (
        SDF.format("<include><uri>https://127.0.0.1:9/arm</uri></include>"),
        "there is no file of 'https://127.0.0.1:9/arm' on this machine, and nothing is fetched; name the folder",
    ),
    (SDF.format(LINKS + JOINT.format("piston", "")), "joint j: the type 'piston' is not read; known are fixed, revolute"),
    (SDF.format(LINKS + JOINT.format("gearbox", "")), "<joint> has no <gearbox_reference_body>; give it one"),
    (
        SDF.format(LINKS + JOINT.format("gearbox", "<gearbox_reference_body>b</gearbox_reference_body><axis><xyz>0 1 0</xyz></axis>")),
        "joint j: no hinge along its axis joins its parent 'a' to 'b'; give it one",
    ),
    (SDF.format(LINKS + JOINT.format("revolute", "")), "joint j: it has no axis; give it one"),
    (SDF.format(LINKS + JOINT.format("revolute", "<axis><xyz>0 0 0</xyz></axis>")), "joint j: its axis is 0 0 0"),
    (SDF.format('<link name="a"/>' + JOINT.format("ball", "")), "joint j: its child 'b' is no link, frame or model here"),
    (SDF.format('<link name="a"><pose>1 2 3</pose></link>'), "<pose>: 6 numbers are needed, '1 2 3' is given"),
    (SDF.format('<link name="a"><pose relative_to="c"/></link>'), "link a: there is no link, joint or frame 'c'"),
    (
        SDF.format('<link name="a"><pose relative_to="b"/></link><link name="b"><pose relative_to="a"/></link>'),
        "link a is placed relative to itself, by way of 'a', 'b'",
    ),
    (
        SDF.format(
            "".join(f'<frame name="f{k}" attached_to="f{k + 1}"/>' for k in range(2000)) + '<frame name="f2000"/><link name="a"/>'
        ).replace('<link name="a"/>', '<link name="a"><pose relative_to="f0"/></link>'),
        "frame f100 is placed relative to more than 100 others",
    ),
    (
        SDF.format(LINKS + JOINT.format("universal", "<axis><xyz>0 1 0</xyz></axis><axis2><xyz>0 1 0</xyz></axis2>")),
        "joint universal a-b, angle u_j, v_j: the cosine is 1",
    ),
]


@pytest.mark.parametrize(("text", "said"), BAD_SDF)
def test_what_is_wrong_with_sdf_is_told(write, text, said):
    with pytest.raises(ModelError) as refused:
        ncgen.load(write(text, "m.sdf"))
    assert said in str(refused.value)
    assert str(refused.value).startswith("m.sdf, line 1: ")


def test_a_joint_to_the_world_is_one_from_it_with_the_same_coordinate(write):
    """A slider and a hinge whose child is the world: ψ̈ = m g l cos ψ / (I + m l²), s̈ = −g, signs as the file has them."""
    body = """<link name="a"><inertial><pose>0.5 0 0 0 0 0</pose><mass>2</mass><inertia><iyy>0.3</iyy></inertia></inertial></link>
    <joint name="j" type="{}"><pose relative_to="a">0 0 0 0 0 0</pose><parent>{}</parent><child>{}</child>
    <axis><xyz>{}</xyz></axis></joint>"""
    for kind, axis, first in (("revolute", "0 1 0", 2 * 9.81 * 0.5 / (0.3 + 2 * 0.25)), ("prismatic", "0 0 1", -9.81)):
        for ends, sign in ((("world", "a"), 1), (("a", "world"), -1)):
            kernels = ncgen.compile(ncgen.load(write(SDF.format(body.format(kind, *ends, axis)), "m.sdf")), "numpy")
            space = ncgen.joint_space(kernels)
            assert space.forward_dynamics(space.position({"j": 0.0})) == pytest.approx([sign * first], rel=1e-13)
    turned = Joint(name="u", kind="universal", parent="p", child="c", axis=np.array([0.0, 1, 0]), second=np.array([1.0, 0, 0])).turned()
    assert (turned.parent, turned.axis.tolist(), turned.second.tolist()) == ("c", [-1, 0, 0], [0, -1, 0])


def test_infinite_limits_are_none(write):
    """SDF's own default is −inf, and what Gazebo prints −1.79769e+308."""
    limited = "<axis><xyz>0 1 0</xyz><limit><lower>{}</lower><upper>{}</upper></limit></axis>"
    for lower, upper, bounds in (("-inf", "inf", None), ("-1.79769e+308", "1.79769e+308", None), ("-1", "inf", (-1.0, 1e15))):
        path = write(SDF.format(LINKS + JOINT.format("revolute", limited.format(lower, upper))), "m.sdf")
        assert read_robot(path).joints[0].limits == bounds
    path = write(TWO.replace("</joint>\n</robot>", '<limit lower="-inf" upper="2"/></joint></robot>'))
    assert read_robot(path).joints[1].limits == (-1e15, 2.0)


def test_stops_whose_limits_are_exchanged_are_refused(write):
    path = write(TWO.replace("</joint>\n</robot>", '<limit lower="1" upper="-1"/></joint></robot>'))
    assert "limits of joints (1)" in ncgen.load(path).left_out
    with pytest.raises(ModelError, match="two.urdf, line 6: joint two: its lower limit 1 is beyond the upper one -1; exchange them"):
        ncgen.load(path, limits=True)


def test_names_of_every_language_and_of_expressions(write):
    """Letters stay; what would be two things of one name, or a keyword, gets something behind it."""
    text = (
        TWO.replace('"b"', '"ground"').replace('"c"', '"😀"').replace('"a"', '"🤖"').replace('"one"', '"関節"').replace('"two"', '"lambda"')
    )
    model = ncgen.load(write(text))
    assert list(model.bodies) == ["ground_2", "link__"]
    assert ncgen.joint_space(ncgen.compile(model, "numpy")).rates == ("関節", "lambda_")
    assert set(ncgen.load(write(TWO.replace('"b"', '"x-1"').replace('"c"', '"x_1"').replace('"two"', '"t"'))).bodies) == {"x_1", "x_1_2"}


def test_what_is_there_and_is_no_robot_is_told_so(write, tmp_path):
    """A suffix in capitals is one; a folder and a file of another kind are not missing; macros are named whatever the file's name."""
    assert set(ncgen.load(write(TWO, "TWO.URDF")).bodies) == {"b", "c"}
    (tmp_path / "folder.urdf").mkdir()
    with pytest.raises(ModelError, match="a model file is an ordinary file, not a folder"):
        ncgen.load(tmp_path / "folder.urdf")
    macro = "<robot xmlns:xacro='x'>\n<xacro:arm/></robot>"
    for name, said in (("two.urdf.xacro", r"xacro 'two.urdf.xacro' > 'two.urdf'"), ("two.urdf", r"xacro 'two.urdf' > 'expanded-two.urdf'")):
        with pytest.raises(ModelError, match=said):
            ncgen.load(write(macro, name))


def test_a_file_in_the_working_folder_is_looked_at(write, monkeypatch, tmp_path):
    write(TWO, "two.stl")
    monkeypatch.chdir(tmp_path)
    with pytest.raises(ModelError, match="two.stl: not a model; give a .toml, .urdf"):
        ncgen.load("two.stl")


def test_a_large_file_is_not_read(write):
    with pytest.raises(ModelError, match="a model file has at most 4000000 bytes"):
        ncgen.load(write(TWO + " " * 4_000_000))


def test_floating_is_for_robots(write):
    with pytest.raises(
        ModelError, match=r"floating is for a robot's file \(.urdf, .sdf, .xml, .mjcf, .xacro\); a model says itself what it has"
    ):
        ncgen.load("pendulum", floating=True)


def test_a_file_that_is_not_there():
    with pytest.raises(ModelError, match=r"nothing\.urdf: there is no such file or example"):
        ncgen.load("nothing.urdf")


def test_check_tells_all_that_is_wrong(write):
    """Three links and joints of a URDF, each with its line; and impossible inertias, if nothing else is wrong."""
    text = TWO.replace('value="1"', 'value="-1"', 1).replace('xyz="0 1 0"', 'xyz="0 0 0"', 1).replace('<child link="c"/>', "")
    model, problems = checked(write(text))
    assert model is None
    assert [problem.partition(": ")[0] for problem in problems] == ["two.urdf, line 3", "two.urdf, line 5", "two.urdf, line 6"]
    assert "the mass is -1 kg" in problems[0] and "its axis is 0 0 0" in problems[1] and "has no <child>" in problems[2]
    model, problems = checked(write(TWO.replace('izz="1"', 'izz="3"')))
    assert [problem.partition(": no body has")[0] for problem in problems] == ["two.urdf, line 3: body b", "two.urdf, line 4: body c"]
    model, problems = checked(write(TWO))
    assert model is not None and problems == []
    joints = JOINT.format("revolute", "") + JOINT.format("piston", "").replace('"j"', '"k"')
    _, problems = checked(write(SDF.format(LINKS + joints), "m.sdf"))
    assert ["has no axis" in problems[0], "'piston' is not read" in problems[1], len(problems)] == [True, True, 2]


def test_meshes_that_are_not_there_are_nothing_to_motion(write):
    """Nothing is opened or fetched for them."""
    mesh = '<visual><geometry><mesh filename="http://127.0.0.1:9/none.stl"/></geometry></visual>'
    model = ncgen.load(write(TWO.replace('<link name="b">', f'<link name="b">{mesh}')))
    assert set(model.bodies) == {"b", "c"}
    assert any("mesh" in said for said in model.left_out)


def test_a_link_called_like_a_keyword(write):
    """It is a body whose loads an expression can mention, and the robot's own name may be one, too."""
    model = ncgen.load(write(TWO.replace('"b"', '"in"').replace('name="two"', 'name="class"', 1)))
    assert "in_" in model.bodies
    model.output("load", model.bodies["in_"].force(model.bodies["in_"].points[0]).x, "N")
    assert ncgen.simulate(ncgen.compile(model), 0.01, points=2).outputs["load"].shape == (2,)


def test_a_mass_without_moments_means_what_its_format_says(write):
    """URDF has moments of 0 then, SDF those of 1 kg m2 on the diagonal; a body of a model would have to say it."""
    urdf = '<robot name="r"><link name="a"/><link name="b"><inertial><mass value="2"/></inertial></link>'
    urdf += '<joint name="j" type="continuous"><parent link="a"/><child link="b"/></joint></robot>'
    sdf = '<sdf version="1.9"><model name="r"><link name="b"><inertial><mass>2</mass></inertial></link>'
    sdf += '<joint name="j" type="revolute"><parent>world</parent><child>b</child><axis><xyz>0 0 1</xyz></axis></joint></model></sdf>'
    for text, name, moment in ((urdf, "r.urdf", 0.0), (sdf, "r.sdf", 1.0)):
        assert np.array_equal(ncgen.load(write(text, name)).bodies["b"].inertia.tensor, moment * np.eye(3))


def test_a_robot_of_numbers_is_read_without_sympy():
    """Importing it takes as long as all the rest of a motion that is in the cache."""
    code = "import sys, ncgen; ncgen.load(sys.argv[1]); assert not [name for name in sys.modules if name.split('.')[0] == 'sympy']"
    subprocess.run([sys.executable, "-c", code, str(HERE / "crane.urdf")], check=True)


@pytest.mark.parametrize("quarter", ["1.570796327", "1.57079632679", "1.5707963267948966"])
def test_quarter_turns_are_exact_with_the_digits_that_files_have(write, quarter):
    """Axes that are parallel but for a file's last digits would be bound by rows that contradict each other: no position would close."""
    turned = TWO.replace('<origin xyz="1 0 0"/>', f'<origin xyz="1 0 0" rpy="{quarter} 0 {quarter}"/>')
    rotation = next(joint for joint in read_robot(write(turned)).joints if joint.name == "two").placement.rotation
    assert rotation.tolist() == [[0, 0, 1], [1, 0, 0], [0, 1, 0]]


def test_angles_that_are_no_quarter_turns_stay_as_they_are(write):
    turned = TWO.replace('<origin xyz="1 0 0"/>', '<origin xyz="1 0 0" rpy="1.5708 0 0"/>')
    rotation = next(joint for joint in read_robot(write(turned)).joints if joint.name == "two").placement.rotation
    assert rotation[2, 2] == pytest.approx(np.cos(1.5708), rel=1e-15)


def test_a_refused_call_leaves_no_trace_in_a_model_that_was_loaded():
    """While a file is read nothing is kept for that: a refusal then ends the reading."""
    model = ncgen.load(HERE / "crane.urdf")
    before = repr(model), len(model.facts), list(model.elements)
    with pytest.raises(ModelError, match="lies|coincide|length"):
        model.body("twice", [model.point("A", (0, 0, 0)), model.point("B", (0, 0, 0))], mass=1.0)
    names = [name for name in model.elements if name not in before[2]]
    assert names == ["A", "B"] and "twice" not in model.bodies and len(model.facts) == before[1] + 2
