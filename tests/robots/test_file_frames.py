"""Frames that MJCF and SDF name: those of bodies and sites are MuJoCo's, those of links and frames of SDF are placements by hand."""

import warnings
from pathlib import Path

import numpy as np
import pytest
from by_mujoco import Beside

import ncgen
from ncgen.errors import ModelError

STATES = 3

MJCF = """<mujoco model="bench"><compiler angle="radian"/><worldbody><site name="corner" pos="1 2 0.5" euler="0.3 0 0.2"/>
<body name="shoulder" pos="0.1 0 1" euler="0.2 0.1 -0.4"><joint name="pan" axis="0 0 1" pos="0.02 0.01 0" ref="0.4"/>
<joint name="tilt" axis="0 1 0.2"/><inertial pos="0.1 0 0" mass="2" diaginertia="0.02 0.03 0.03"/>
<body name="hand" pos="0.4 0 0.1" quat="0.8 0.2 -0.1 0.4"><joint name="reach" type="slide" axis="1 0.3 0" pos="0.1 0.1 0"/>
<joint name="roll" axis="1 0 0" pos="0 0.05 0.02"/><inertial pos="0.05 0 0.01" mass="1" diaginertia="0.01 0.012 0.013"/>
<site name="hand" pos="0.1 0.02 0.03" euler="0.5 -0.2 0.7"/>
<body name="finger" pos="0.1 0 0.02" euler="0 0.4 0"><site name="tip" pos="0.03 0 0" quat="0.5 0.5 -0.5 0.5"/></body></body></body>
<body name="ball" pos="0 1 0.2" euler="0.1 0.2 0.3"><freejoint/><inertial pos="0.02 0 0.01" mass="1" diaginertia="0.01 0.012 0.013"/>
<site name="spot" pos="0.1 0 0" euler="0 0.3 0"/></body></worldbody></mujoco>"""


def misses(path: Path, states: int = STATES) -> dict[str, float]:
    """{what: the largest difference from MuJoCo over 1 + the largest entry} of all frames of bodies and sites at random states."""
    import mujoco

    both = Beside(path)
    m, d, space = both.theirs, both.data, ncgen.joint_space(both.kernels)
    objects = {(m.body(i).name or f"body{i}"): (mujoco.mjtObj.mjOBJ_BODY, i) for i in range(m.nbody)}
    sites = {m.site(i).name: (mujoco.mjtObj.mjOBJ_SITE, i) for i in range(m.nsite) if m.site(i).name}
    twice = objects.keys() & sites.keys()
    named = {f"body:{name}" if name in twice else name: each for name, each in objects.items()}
    named |= {f"site:{name}" if name in twice else name: each for name, each in sites.items()}
    assert named.keys() == both.model.frames.keys()
    rng, worst = np.random.default_rng(3), dict.fromkeys(("pose", "jacobian", "velocity", "derivative"), 0.0)

    def look(what, found, expected):
        worst[what] = max(worst[what], float(np.max(np.abs(found - expected)) / (1 + np.max(np.abs(expected), initial=0.0))))

    for _ in range(states):
        qpos, _ = both.random(rng, 0.8)
        if m.neq:
            both.close(qpos, np.zeros(m.nv))
            qpos = d.qpos.copy()
        v = rng.normal(size=space.n)
        theirs = np.stack([both.state(qpos, e)[1] for e in np.eye(m.nv)], axis=-1)
        q, _ = both.state(qpos, np.zeros(m.nv))
        ours = np.stack([space.velocities(q, e) for e in np.eye(space.n)], axis=-1)
        rates = np.linalg.lstsq(theirs, ours, rcond=None)[0]  # of MuJoCo's joints for those of the space
        np.testing.assert_allclose(theirs @ rates, ours, atol=1e-11)
        both.state(qpos, rates @ v)
        for name, (kind, i) in named.items():
            found = space.frame(name)
            is_site = kind == mujoco.mjtObj.mjOBJ_SITE
            place, turn = (d.site_xpos, d.site_xmat) if is_site else (d.xpos, d.xmat)
            rows = np.zeros((2, 3, m.nv))
            (mujoco.mj_jacSite if is_site else mujoco.mj_jacBody)(m, d, rows[0], rows[1], i)
            pose, aligned = found.pose(q), np.concatenate(rows) @ rates
            rotation = turn[i].reshape(3, 3)
            look("pose", pose[0], rotation)
            look("pose", pose[1], place[i])
            look("jacobian", found.jacobian(q), aligned)
            look("jacobian", found.jacobian(q, "local"), np.concatenate([rotation.T @ half for half in np.split(aligned, 2)]))
            shifted = np.concatenate([aligned[:3] - np.cross(aligned[3:].T, place[i]).T, aligned[3:]])
            look("jacobian", found.jacobian(q, "world"), shifted)
            twist = np.zeros(6)
            for local in (0, 1) if is_site else (0,):  # of a body MuJoCo's local axes are those of its inertia
                mujoco.mj_objectVelocity(m, d, kind if is_site else mujoco.mjtObj.mjOBJ_XBODY, i, twist, local)
                look("velocity", found.velocity(q, v, "local" if local else "world-aligned"), np.roll(twist, 3))
            if np.all(m.jnt_type >= 2) and not space.why:  # else MuJoCo's rates are not constant multiples of ours
                body = m.site_bodyid[i] if is_site else i
                mujoco.mj_jacDot(m, d, rows[0], rows[1], place[i], body)
                look("derivative", found.jacobian_derivative(q, v), np.concatenate(rows) @ rates)
    return worst


def test_bodies_and_sites_are_where_mujoco_has_them(tmp_path):
    """Joints away from the origin of their body, two joints of one body, a reference that is not 0, a site called like its body."""
    (tmp_path / "bench.xml").write_text(MJCF)
    assert max(misses(tmp_path / "bench.xml").values()) < 1e-12
    arm = MJCF.replace("<freejoint/>", '<joint name="swing" axis="0 1 0"/>')
    (tmp_path / "bench.xml").write_text(arm)
    assert max(misses(tmp_path / "bench.xml").values()) < 1e-12
    (tmp_path / "bench.xml").write_text(MJCF)
    space = ncgen.joint_space(ncgen.compile(ncgen.load(tmp_path / "bench.xml"), "numpy"))
    with pytest.raises(ModelError, match="^bench has no frame hand; say body:hand or site:hand$"):
        space.frame("hand")
    with pytest.raises(
        ModelError, match="^bench has no frame tipp; known: world, shoulder, body:hand, finger, ball, corner, site:hand, tip"
    ):
        space.frame("tipp")


def test_the_model_of_mujocos_own_package():
    """Free bodies, a ball, a body that is welded to the world, sites called like their bodies."""
    mujoco = pytest.importorskip("mujoco")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        found = misses(Path(mujoco.__file__).parent / "testdata/model.xml")
    assert max(found.values()) < 1e-11, found


SDF = """<sdf version="1.9"><model name="arm"><pose>0 0 1 0 0 0</pose>
<frame name="mount" attached_to="world"><pose relative_to="__model__">0 0.5 0 0 0 1.5707963267948966</pose></frame>
<link name="base"/><joint name="ground" type="fixed"><parent>world</parent><child>base</child></joint>
<link name="upper"><pose>0.2 0 0 0 0 0</pose><inertial><pose>0.1 0 0 0 0 0</pose><mass>1</mass></inertial></link>
<joint name="turn" type="revolute"><pose>-0.2 0 0 0 0 0.5</pose><parent>base</parent><child>upper</child>
<axis><xyz>0 0 1</xyz></axis></joint>
<frame name="tool" attached_to="upper"><pose degrees="true">0.3 0 0.1 0 90 0</pose></frame>
<frame name="tip" attached_to="tool"><pose>0.05 0 0 0 0 0</pose></frame>
<model name="grip"><pose relative_to="tool"/><link name="upper"/><frame name="pad"><pose>0 0.2 0 0 0 0</pose></frame></model>
<joint name="hold" type="fixed"><parent>upper</parent><child>grip::upper</child></joint></model></sdf>"""


def test_links_and_frames_of_sdf(tmp_path):
    """The joint at (0, 0, 1) turns about z; its frame stands apart from that of its child, and turned: placements by hand."""
    (tmp_path / "arm.sdf").write_text(SDF)
    space = ncgen.joint_space(ncgen.compile(ncgen.load(tmp_path / "arm.sdf"), "numpy"))
    angle, rate = 0.7, 2.0
    c, s = np.cos(angle), np.sin(angle)
    turn, down = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]), np.array([[0, 0, 1], [0, 1, 0], [-1, 0, 0]])
    flat, quarter = np.eye(3), np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1]])
    placed = {
        "world": (None, flat, [0, 0, 0]),
        "mount": (None, quarter, [0, 0.5, 1]),
        "base": (None, flat, [0, 0, 1]),
        "upper": (turn, flat, [0.2, 0, 1]),
        "tool": (turn, down, [0.5, 0, 1.1]),
        "tip": (turn, down, [0.5, 0, 1.05]),
        "grip::upper": (turn, down, [0.5, 0, 1.1]),
        "grip::pad": (turn, down, [0.5, 0.2, 1.1]),
    }
    q = space.position({"turn": angle})
    assert placed.keys() == space.kernels.model.frames.keys()
    for name, (moves, rotation, position) in placed.items():
        found, motion = space.frame(name), flat if moves is None else moves
        place = motion @ position
        np.testing.assert_allclose(found.pose(q)[0], motion @ rotation, atol=1e-15, err_msg=name)
        np.testing.assert_allclose(found.pose(q)[1], place, atol=1e-15, err_msg=name)
        twist = [-rate * place[1], rate * place[0], 0, 0, 0, rate] if moves is not None else np.zeros(6)
        np.testing.assert_allclose(found.velocity(q, [rate]), twist, atol=1e-15, err_msg=name)
    with pytest.raises(ModelError, match="^arm has no frame pad; say grip::pad$"):
        space.frame("pad")


def test_frames_of_the_world_where_a_model_moves_freely_and_frames_of_nothing(tmp_path):
    text = SDF.replace('<joint name="ground" type="fixed"><parent>world</parent><child>base</child></joint>', "")
    (tmp_path / "arm.sdf").write_text(text)
    space = ncgen.joint_space(ncgen.compile(ncgen.load(tmp_path / "arm.sdf"), "numpy"))
    np.testing.assert_allclose(space.frame("mount").pose(space.kernels.q0)[1], [0, 0.5, 1])
    assert not space.frame("mount").jacobian(space.kernels.q0).any()
    assert space.frame("tool").jacobian(space.kernels.q0).shape == (6, 7)
    (tmp_path / "arm.sdf").write_text(SDF.replace('name="mount" attached_to="world"', 'name="mount" attached_to="wall"'))
    with pytest.raises(ModelError, match="arm.sdf, line 2: frame mount: what it is attached to moves with no link; name a link"):
        ncgen.load(tmp_path / "arm.sdf")
