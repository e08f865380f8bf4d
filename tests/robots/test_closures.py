"""Loops closed by two frames: the robot is assembled when it is read, from a table of TOML or from the YAML of Gepetto's robots."""

import numpy as np
import pytest

import ncgen
from ncgen.errors import ModelError

LENGTHS = {"crank": 1.0, "coupler": 2.4, "rocker": 2.0}
BASE = 2.0


def linkage(extra=""):
    """A four-bar that is open where all joints are at 0: crank and coupler stretched along x, the rocker along x from (2, 0, 0)."""
    text = '<robot name="linkage"><link name="base"/><link name="tip"/><link name="pin"/>'
    for name, length in LENGTHS.items():
        inertia = '<inertia ixx="0.01" iyy="0.1" izz="0.1"/>'
        text += f'<link name="{name}"><inertial><origin xyz="{length / 2} 0 0"/><mass value="1"/>{inertia}</inertial></link>'
    for name, parent, child, x in (("motor", "base", "crank", 0), ("elbow", "crank", "coupler", 1.0), ("pillar", "base", "rocker", BASE)):
        origin = f'<origin xyz="{x} 0 0" rpy="0 0 {0.3 if name == "elbow" else 0}"/>'
        links = f'<parent link="{parent}"/><child link="{child}"/>'
        text += f'<joint name="{name}" type="continuous">{links}{origin}<axis xyz="0 0 1"/></joint>'
    for name, parent, x in (("tip", "coupler", LENGTHS["coupler"]), ("pin", "rocker", LENGTHS["rocker"])):
        links = f'<parent link="{parent}"/><child link="{name}"/>'
        text += f'<joint name="at_{name}" type="fixed">{links}<origin xyz="{x} 0 0"/></joint>'
    return text + extra + "</robot>"


TABLE = '[[{kind}]]\nname = "closing"\nparent_frame = "tip"\nchild_frame = "pin"\n'
YAML = "closed_loop: [['tip', 'pin']]  # as it is\ntype:\n  [\n    '3d',\n  ]\nname_mot: [\"motor\"]\n"


@pytest.fixture
def load(tmp_path):
    def made(urdf, table=None, name="other.toml"):
        path = tmp_path / "linkage.urdf"
        path.write_text(urdf)
        if table is None:
            return ncgen.load(path)
        (tmp_path / name).write_text(table)
        return ncgen.load(path) if name == "linkage.yaml" else ncgen.load(path, loops=tmp_path / name)

    return made


def test_motors_of_the_yaml_are_the_robots(tmp_path):
    """Of three hinges the file gives one a motor, or says nothing of motors."""
    (tmp_path / "linkage.urdf").write_text(linkage())
    for yaml, inputs in ((YAML, ("motor_motor",)), (YAML.partition("name_mot")[0], ("motor_motor", "motor_elbow", "motor_pillar"))):
        (tmp_path / "linkage.yaml").write_text(yaml)
        assert set(ncgen.load(tmp_path / "linkage.urdf", motors=True).inputs) == set(inputs)


def ends_of(angles):
    """Where tip and pin stand, from the angles alone."""
    one, two = angles["motor"], angles["motor"] + angles["elbow"] + 0.3
    tip = np.array([np.cos(one) + 2.4 * np.cos(two), np.sin(one) + 2.4 * np.sin(two)])
    return tip, np.array([BASE + 2.0 * np.cos(angles["pillar"]), 2.0 * np.sin(angles["pillar"])])


@pytest.mark.parametrize(
    ("table", "name"),
    [(TABLE.format(kind="revolute"), "other.toml"), (TABLE.format(kind="connect"), "other.toml"), (YAML, "linkage.yaml"), (YAML, "a.yml")],
)
def test_two_frames_close_a_loop_that_is_open_at_zero(load, table, name):
    kernels = ncgen.compile(load(linkage(), table, name), "numpy")
    assert ncgen.freedom(kernels).dof == 1
    angles = {name: kernels.q0[kernels.index[name]] for name in ("motor", "elbow", "pillar")}
    np.testing.assert_allclose(*ends_of(angles), rtol=0, atol=1e-12)
    run = ncgen.simulate(kernels, 0.3, zd0={"motor": 1.0}, rtol=1e-9, points=3)
    np.testing.assert_allclose(*ends_of({name: run[name][-1] for name in angles}), rtol=0, atol=1e-9)


def test_a_weld_by_frames_holds_the_turn_too(load):
    """Three hinges whose end is welded to a bracket of the base: their sum makes the frames parallel, and they do not move."""
    links = '<parent link="base"/><child link="bracket"/>'
    bracket = f'<link name="bracket"/><joint name="b" type="fixed">{links}<origin xyz="2.6 1 0" rpy="0 0 1.1"/></joint>'
    more = '<link name="hand"/><joint name="wrist" type="continuous"><parent link="tip"/><child link="hand"/><axis xyz="0 0 1"/></joint>'
    model = load(linkage(extra=bracket + more), TABLE.format(kind="weld").replace("tip", "hand").replace("pin", "bracket"))
    kernels = ncgen.compile(model, "numpy")
    assert ncgen.freedom(kernels).dof == 1  # the rocker
    total = sum(kernels.q0[kernels.index[name]] for name in ("motor", "elbow", "wrist")) + 0.3
    assert np.remainder(total - 1.1 + np.pi, 2 * np.pi) - np.pi == pytest.approx(0.0, abs=1e-12)


def test_what_cannot_close_is_refused_with_its_gap(load):
    with pytest.raises(
        ModelError, match=r"revolute 1: loop closing cannot close: its frames stay 400 mm .* apart, wherever the joints are"
    ):
        load(linkage().replace('xyz="2.0 0 0"', 'xyz="5.8 0 0"', 1), TABLE.format(kind="revolute"))


def places(**on_x):
    """Links fixed to the base, that many m along x, and a hand at the end of the crank."""
    text = ""
    for name, parent, x in (("hand", "crank", 1.0), *((name, "base", x) for name, x in on_x.items())):
        links = f'<parent link="{parent}"/><child link="{name}"/>'
        text += f'<link name="{name}"/><joint name="at_{name}" type="fixed">{links}<origin xyz="{x} 0 0"/></joint>'
    return text


def hand_at(*names):
    """A table of loops that bring the hand to places."""
    return "".join(f'[[connect]]\nname = "to_{name}"\nparent_frame = "hand"\nchild_frame = "{name}"\n' for name in names)


def test_the_loop_that_cannot_close_by_itself_is_named(load):
    """A crank of 1 m reaches (-1, 0), and comes to 0.5 m of (1.5, 0). The sum of squares is least there, 2 m from the other place."""
    says = "connect 2: loop to_far cannot close, even without the other loops: its frames stay 500 mm apart, wherever the joints are"
    with pytest.raises(ModelError, match=says):
        load(linkage(extra=places(near=-1.0, far=1.5)), hand_at("near", "far"))


def test_loops_that_only_together_cannot_close_are_refused(load):
    """One crank cannot be at two places, each of which it reaches."""
    with pytest.raises(ModelError, match=r"loop to_(west|east) cannot close: its frames stay [12](\.\d+)? m apart"):
        load(linkage(extra=places(west=-1.0, east=1.0)), hand_at("west", "east"))


def test_a_joint_that_mimics_with_an_offset_begins_moved_and_its_leader_does_not(load):
    """2 q + 0.5: as the file says it of every position, and the first one is with the leader at 0."""
    mimic = '<mimic joint="motor" multiplier="2" offset="0.5"/>'
    urdf = linkage().replace('<axis xyz="0 0 1"/></joint>', f'<axis xyz="0 0 1"/>{mimic}</joint>').replace(mimic, "", 1)
    kernels = ncgen.compile(load(urdf), "numpy")
    values = [kernels.q0[kernels.index[name]] for name in ("motor", "elbow", "pillar")]
    np.testing.assert_allclose(values, [0.0, 0.5, 0.5], rtol=0, atol=1e-15)
    q = ncgen.joint_space(kernels).position({"motor": 0.2}) if len(ncgen.joint_space(kernels).rates) == 1 else None
    assert q is not None
    assert q[kernels.index["elbow"]] == pytest.approx(0.9, abs=1e-12)


def test_joints_that_the_yaml_calls_otherwise(load):
    """A hinge that is really a ball, and one that is fixed."""
    table = YAML + "joint_name: ['elbow', 'pillar']\njoint_type: ['SPHERICAL', UJOINT_ZX]\n"
    kernels = ncgen.compile(load(linkage(), table, "a.yaml"), "numpy")
    assert ncgen.freedom(kernels).dof == 1 + 3 + 2 - 3
    fixed = YAML + "joint_name: ['motor']\njoint_type: ['FIXED']\n"
    kernels = ncgen.compile(load(linkage().replace('xyz="2.0 0 0"', 'xyz="3.0 0 0"'), fixed, "a.yaml"), "numpy")
    assert ncgen.freedom(kernels).dof == 0


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("'pin'", "'pn'", "a.yaml: closed_loop 1: there is no link or joint 'pn' in linkage"),
        ("'3d'", "'4d'", "a.yaml: closed_loop 1: there is no type '4d'; known are 6d and 3d"),
        ("'3d',", "'3d', '3d'", "a.yaml: closed_loop has 1 pairs and type 2 texts"),
        ("name_mot", "motors", "a.yaml, line 6: there is no key 'motors'; known are closed_loop"),
        ('"motor"]', '"motor"', "a.yaml: a list has no end; close its bracket"),
        ('"motor"]', '&anchor]', "a.yaml, line 6: '&' is not read here"),
        ("[['tip', 'pin']]", "[['tip']]", "a.yaml: closed_loop 1: ['tip'] given; name two links"),
    ],
)  # fmt: skip
def test_what_is_wrong_with_a_yaml(load, old, new, says):
    with pytest.raises(ModelError) as caught:
        load(linkage(), YAML.replace(old, new), "a.yaml")
    assert says in str(caught.value)


def test_frames_and_links_are_not_mixed(load):
    with pytest.raises(ModelError, match="weld 1: it has frames and point; leave point out"):
        load(linkage(), TABLE.format(kind="weld") + "point = [0.0, 0.0, 0.0]\n")
    with pytest.raises(ModelError, match="its child_frame 'nail' is no link"):
        load(linkage(), TABLE.format(kind="weld").replace("pin", "nail"))
