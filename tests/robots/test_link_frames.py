"""Frames of links beside Pinocchio: pose, velocity, Jacobian and its derivative, in all three ways of telling them."""

import re
import sysconfig
from pathlib import Path

import numpy as np
import pytest

import ncgen
from ncgen.errors import ModelError
from ncgen.model.names import word
from ncgen.model.shapes import QUARTER

ROBOTS = Path(sysconfig.get_paths()["purelib"], "cmeel.prefix/share/example-robot-data/robots")

ARM = """<robot name="arm"><link name="base"/><link name="tool0"/><link name="rail"/>
<link name="upper"><inertial><origin xyz="0.2 0 0.1"/><mass value="2"/><inertia ixx="0.02" iyy="0.1" izz="0.1"/></inertial></link>
<link name="lower"><inertial><origin xyz="0.1 0.05 0"/><mass value="1"/><inertia ixx="0.02" iyy="0.04" izz="0.05"/></inertial></link>
<link name="hand"><inertial><origin xyz="0 0.05 0"/><mass value="1"/><inertia ixx="0.02" iyy="0.04" izz="0.05"/></inertial></link>
<joint name="r" type="fixed"><parent link="base"/><child link="rail"/><origin xyz="0.4 0.2 0.1" rpy="0.1 0.2 0.3"/></joint>
<joint name="a" type="continuous"><parent link="rail"/><child link="upper"/><origin xyz="0.1 0 0.3" rpy="0.4 0 0.2"/><axis xyz="0 0.6 0.8"/>
</joint>
<joint name="b" type="prismatic"><parent link="upper"/><child link="lower"/><origin xyz="0.4 0 0" rpy="0 0.7 0"/><axis xyz="1 0 0"/>
<limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
<joint name="c" type="continuous"><parent link="lower"/><child link="hand"/><origin xyz="0.3 0.1 0" rpy="0.2 0.1 0.9"/><axis xyz="0 0 1"/>
</joint>
<joint name="t" type="fixed"><parent link="hand"/><child link="tool0"/><origin xyz="0 0.1 0.2" rpy="1.5 0.3 -0.2"/></joint></robot>"""

LINKAGE = (
    ARM.removesuffix("</robot>")
    + """<link name="pin"/><link name="tip"/>
<link name="crank"><inertial><mass value="1"/><inertia ixx="0.02" iyy="0.04" izz="0.05"/></inertial></link>
<link name="rod"><inertial><mass value="1"/><inertia ixx="0.02" iyy="0.04" izz="0.05"/></inertial></link>
<joint name="d" type="continuous"><parent link="rail"/><child link="crank"/><origin xyz="0.2 0.8 0.1" rpy="0.5 0 0.3"/><axis xyz="1 0 0"/>
</joint><joint name="p" type="fixed"><parent link="crank"/><child link="pin"/><origin xyz="0.1 0.2 0" rpy="0 1 0"/></joint>
<joint name="e" type="continuous"><parent link="hand"/><child link="rod"/><origin xyz="0.1 0 0.05" rpy="0 0.4 0"/><axis xyz="0 1 0"/>
</joint><joint name="q" type="fixed"><parent link="rod"/><child link="tip"/><origin xyz="0.5 0 0.1" rpy="1 2 3"/></joint></robot>"""
)
"""The arm with a link more, whose tip a crank carries."""

CLOSING = '[[connect]]\nparent_frame = "pin"\nchild_frame = "tip"\n'

TOLERANCE = 1e-11


def with_exact_quarters(text):
    """A URDF whose quarter turns have all digits: ncgen takes them for what the file means, and Pinocchio for what it says."""

    def exact(said):
        turns = [float(x) for x in said[2].split()]
        nearest = [round(x / (np.pi / 2)) * np.pi / 2 for x in turns]
        return said[1] + " ".join(repr(float(n if abs(x - n) < QUARTER else x)) for x, n in zip(turns, nearest, strict=True)) + said[3]

    return re.sub(r"""(rpy\s*=\s*["'])([^"']*)(["'])""", exact, text)


def compare(path, count):
    """The largest difference over `count` states and all frames, relative to the largest entry of a matrix or 1."""
    pin = pytest.importorskip("pinocchio")
    theirs = pin.buildModelFromXML(with_exact_quarters(path.read_text()))
    data, space = theirs.createData(), ncgen.joint_space(ncgen.compile(ncgen.load(path), "numpy"))
    rng, worst = np.random.default_rng(7), 0.0
    references = {"world-aligned": pin.LOCAL_WORLD_ALIGNED, "local": pin.LOCAL, "world": pin.WORLD}
    called = {word(name, "joint"): name for name in theirs.names}  # the file's names, of which ncgen's are made
    order = [theirs.joints[theirs.getJointId(called[name])].idx_v for name in space.rates]
    for _ in range(count):
        values, w, q = {}, rng.normal(size=theirs.nv), pin.neutral(theirs)
        for name, at in zip(space.rates, order, strict=True):
            joint = theirs.joints[theirs.getJointId(called[name])]
            values[name] = float(rng.uniform(-1, 1))
            q[joint.idx_q : joint.idx_q + joint.nq] = [values[name]] if joint.nq == 1 else [np.cos(values[name]), np.sin(values[name])]
            assert joint.idx_v == at
        pin.computeJointJacobiansTimeVariation(theirs, data, q, w)
        pin.forwardKinematics(theirs, data, q, w)
        pin.updateFramePlacements(theirs, data)
        ours = space.position(values)
        for name in space.kernels.model.frames:
            found, number = space.frame(name), theirs.getFrameId(name, pin.BODY)
            rotation, position = found.pose(ours)
            pairs = [(rotation, data.oMf[number].rotation), (position, data.oMf[number].translation)]
            for told, reference in references.items():
                J = pin.getFrameJacobian(theirs, data, number, reference)[:, order]
                dJ = pin.getFrameJacobianTimeVariation(theirs, data, number, reference)[:, order]
                pairs += [(found.jacobian(ours, told), J), (found.jacobian_derivative(ours, w[order], told), dJ)]
                pairs += [(found.velocity(ours, w[order], told), pin.getFrameVelocity(theirs, data, number, reference).vector)]
            worst = max(worst, *(np.max(np.abs(a - b)) / max(1.0, np.max(np.abs(b))) for a, b in pairs))
    return worst


def test_frames_of_an_arm_are_those_of_pinocchio(tmp_path):
    (tmp_path / "arm.urdf").write_text(ARM)
    assert compare(tmp_path / "arm.urdf", 3) < TOLERANCE


def test_axes_that_are_nearly_parallel_are_as_the_file_says(tmp_path):
    """By 9e-10 rad, as in the hands of allegro: π/2 with ten digits. Sharing one vector turned all that follows by as much."""
    text = (
        ARM.replace('xyz="0.4 0 0" rpy="0 0.7 0"', 'xyz="0.4 0.1 0" rpy="0 -1.570796326 0"')
        .replace('xyz="0 0.6 0.8"', 'xyz="1 0 0"')
        .replace(' rpy="0.2 0.1 0.9"', "")
    )
    text = text.replace('type="prismatic"', 'type="revolute"').replace('<axis xyz="1 0 0"/>\n<limit', '<axis xyz="0 0 1"/>\n<limit')
    (tmp_path / "arm.urdf").write_text(text)
    assert compare(tmp_path / "arm.urdf", 3) < TOLERANCE


@pytest.fixture(scope="module")
def space(tmp_path_factory):
    path = tmp_path_factory.mktemp("arm") / "arm.urdf"
    path.write_text(ARM)
    return ncgen.joint_space(ncgen.compile(ncgen.load(path), "numpy"))


def test_a_jacobian_is_the_derivative_of_the_pose(space):
    """By central differences of the position and of the rotation, joint by joint."""
    at = {"a": 0.3, "b": 0.2, "c": -0.7}
    found, step = space.frame("tool0"), 1e-6
    J = found.jacobian(space.position(at))
    rotation, _ = found.pose(space.position(at))
    for k, name in enumerate(space.rates):
        (turn, ahead), (back, behind) = (found.pose(space.position({**at, name: at[name] + sign * step})) for sign in (1, -1))
        spin = (turn - back) / (2 * step) @ rotation.T
        np.testing.assert_allclose(J[:3, k], (ahead - behind) / (2 * step), atol=1e-9)
        np.testing.assert_allclose(J[3:, k], [spin[2, 1], spin[0, 2], spin[1, 0]], atol=1e-9)


def test_a_frame_that_rests_and_one_that_is_not_there(space):
    q = np.stack([space.position({"a": 0.1}), space.position({"a": 0.2})])
    rotation, position = space.frame("rail").pose(q)
    assert position.shape == (2, 3)
    np.testing.assert_allclose(position[1], [0.4, 0.2, 0.1], atol=1e-15)
    assert rotation.shape == (2, 3, 3)
    assert not space.frame("rail").jacobian(q).any()
    with pytest.raises(ModelError, match="arm has no frame tool1; known: base, rail, upper, lower, hand, tool0"):
        space.frame("tool1")
    with pytest.raises(ModelError, match="reference: body is not one of world-aligned, local, world"):
        space.frame("tool0").jacobian(q, "body")


DIFFERENCES = {1: 672.0, 2: -168.0, 3: 32.0, 4: -3.0}
"""Of a central difference of eighth order, times 840 steps (Fornberg, Mathematics of Computation 51, 1988, table 1)."""


@pytest.fixture(scope="module", params=["fourbar", "linkage"])
def loops(request, tmp_path_factory):
    """Joint space of a mechanism with loops, from a file: a planar one, and one in space with frames that are turned."""
    path = Path(__file__).parent / "fourbar.sdf"
    if request.param != path.stem:
        path = tmp_path_factory.mktemp("loops") / "linkage.urdf"
        path.write_text(LINKAGE)
        path.with_suffix(".loops.toml").write_text(CLOSING)
    return ncgen.joint_space(ncgen.compile(ncgen.load(path), "numpy"))


@pytest.mark.parametrize("reference", ["world-aligned", "local", "world"])
def test_frames_in_loops_move_as_differences_say(loops, reference):
    """Velocity and the Jacobian's derivative where the independent joints turn at constant rates."""
    rng, step = np.random.default_rng(3), 0.01
    v = rng.normal(size=loops.n)
    x = loops.values(loops.kernels.q0) + rng.uniform(-0.1, 0.1, loops.n)
    q, around = loops.placed(x), {k: loops.placed(x + k * step * v) for k in range(-4, 5)}
    for name in loops.kernels.model.frames:
        found = loops.frame(name)

        def rate(what):
            return sum(factor * (what(around[k]) - what(around[-k])) for k, factor in DIFFERENCES.items()) / (840 * step)

        turn, position = found.pose(q)
        spin = rate(lambda at, found=found: found.pose(at)[0]) @ turn.T
        turning, along = np.array([spin[2, 1], spin[0, 2], spin[1, 0]]), rate(lambda at, found=found: found.pose(at)[1])
        twist = {"world-aligned": along, "local": turn.T @ along, "world": along - np.cross(turning, position)}[reference]
        expected = np.concatenate([twist, turn.T @ turning if reference == "local" else turning])
        np.testing.assert_allclose(found.velocity(q, v, reference), expected, atol=1e-11)
        np.testing.assert_allclose(found.jacobian(q, reference) @ v, expected, atol=1e-11)
        expected = rate(lambda at, found=found: found.jacobian(at, reference))
        np.testing.assert_allclose(found.jacobian_derivative(q, v, reference), expected, atol=1e-11 * max(1.0, np.max(np.abs(expected))))


def test_a_joint_that_is_driven_carries_its_frames(space, tmp_path):
    """The arm's first joint turns at 2 rad/s whatever the others do: the motion is that of the arm that moves freely."""
    (tmp_path / "arm.urdf").write_text(ARM)
    model = ncgen.load(tmp_path / "arm.urdf")
    model.drive(model.elements["a"], 2.0 * model.time)
    driven = ncgen.joint_space(ncgen.compile(model, "numpy"))
    assert driven.rates == ("b", "c")
    q = driven.position({"b": 0.1, "c": 0.4})
    for reference in ("world-aligned", "local", "world"):
        found = driven.frame("tool0").velocity(q, [0.3, -0.7], reference)
        expected = space.frame("tool0").velocity(space.position({"b": 0.1, "c": 0.4}), [2.0, 0.3, -0.7], reference)
        np.testing.assert_allclose(found, expected, atol=1e-12)
        found = driven.frame("tool0").jacobian_derivative(q, [0.3, -0.7], reference)
        expected = space.frame("tool0").jacobian_derivative(space.position({"b": 0.1, "c": 0.4}), [2.0, 0.3, -0.7], reference)
        np.testing.assert_allclose(found, expected[:, 1:], atol=1e-12)


@pytest.mark.slow
@pytest.mark.skipif(not ROBOTS.is_dir(), reason="needs example-robot-data")
def test_frames_of_twenty_robots_are_those_of_pinocchio():
    """Of example-robot-data, each with fixed base and at most 24 hinges and sliders that follow none."""
    found = {}
    for path in sorted(ROBOTS.rglob("*.urdf")):
        text = path.read_text()
        moving = sum(text.count(f'type="{kind}"') for kind in ("revolute", "continuous", "prismatic"))
        is_simple = not any(word in text for word in ("<mimic", '"floating"', '"planar"'))
        if len(found) < 20 and 0 < moving <= 24 and is_simple:
            found[path.name] = compare(path, 2)
    assert len(found) == 20
    assert max(found.values()) < TOLERANCE, found
