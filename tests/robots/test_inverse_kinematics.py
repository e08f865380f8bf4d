"""Values of joints that bring frames to poses: round trips, checked by Pinocchio's kinematics, and what cannot be reached."""

import sysconfig
from pathlib import Path

import numpy as np
import pytest
from test_link_frames import ARM

import ncgen
from ncgen.errors import ConvergenceError, ModelError
from ncgen.model.names import word
from ncgen.solver.joints.inverse_kinematics import _Search, aims_of

HERE = Path(__file__).parent
ROBOTS = Path(sysconfig.get_paths()["purelib"], "cmeel.prefix/share/example-robot-data/robots")

TOOLS = {
    "ur_description/urdf/ur5_robot.urdf": ("tool0",),
    "panda_description/urdf/panda.urdf": ("panda_leftfinger", "panda_rightfinger"),
    "kinova_description/robots/kinova.urdf": ("j2s6s200_end_effector",),
    "z1_description/urdf/z1.urdf": ("gripperMover",),
    "talos_data/robots/talos_left_arm.urdf": ("gripper_left_fingertip_1_link",),
}
"""{file: frames that are brought to a pose at once}."""

QUICK = ("z1_description/urdf/z1.urdf",)

BALLS = """<mujoco model="balls"><worldbody><body name="base" pos="0.1 0.2 1" euler="10 20 30"><freejoint/>
<inertial pos="0.1 0 0" mass="2" diaginertia="0.02 0.03 0.03"/>
<body name="arm" pos="0.4 0 0.1"><joint name="turn" axis="0 1 0.2"/><inertial pos="0.05 0 0.01" mass="1" diaginertia="0.01 0.012 0.013"/>
<body name="hand" pos="0.3 0 0.1"><joint name="wrist" type="ball"/><inertial pos="0.05 0.02 0.01" mass="1" diaginertia="0.01 0.012 0.013"/>
<site name="tip" pos="0.2 0.1 0" euler="0 40 0"/></body></body></body></worldbody></mujoco>"""


def loaded(path: Path, **options):
    return ncgen.joint_space(ncgen.compile(ncgen.load(path, **options), "numpy"))


@pytest.mark.parametrize("file", [pytest.param(file, marks=[pytest.mark.slow] * (file not in QUICK)) for file in TOOLS])
@pytest.mark.skipif(not ROBOTS.is_dir(), reason="needs example-robot-data")
def test_round_trips_of_arms(file):
    """Poses that random joint values give are reached from others; where the values found take the frames Pinocchio says."""
    pin = pytest.importorskip("pinocchio")
    theirs, space = pin.buildModelFromUrdf(str(ROBOTS / file)), loaded(ROBOTS / file)
    data, rng = theirs.createData(), np.random.default_rng(5)
    for _ in range(1 if file in QUICK else 2):
        limits = [space.kernels.model.limits.get(name, (-1.0, 1.0)) for name in space.rates]
        wanted = space.placed(rng.uniform(*(np.clip(end, *np.transpose(limits)) for end in (-1.0, 1.0))))
        targets = {name: space.frame(name).pose(wanted) for name in TOOLS[file]}
        reached = space.position(space.inverse_kinematics(targets))
        q = pin.neutral(theirs)
        for number in range(1, theirs.njoints):
            joint, value = theirs.joints[number], reached[space.kernels.index[word(theirs.names[number], "joint")]]
            q[joint.idx_q : joint.idx_q + joint.nq] = [value] if joint.nq == 1 else [np.cos(value), np.sin(value)]
        pin.framesForwardKinematics(theirs, data, q)
        for name, (rotation, position) in targets.items():
            found = data.oMf[theirs.getFrameId(name, pin.BODY)]
            np.testing.assert_allclose(found.rotation, rotation, atol=1e-8)
            np.testing.assert_allclose(found.translation, position, atol=1e-8)


def test_a_body_that_moves_freely_and_a_ball_that_it_carries(tmp_path):
    """Their values are rotation vectors, so the search's derivative is not the Jacobian: central differences say what it is."""
    pytest.importorskip("mujoco")
    (tmp_path / "balls.xml").write_text(BALLS)
    space, rng = loaded(tmp_path / "balls.xml"), np.random.default_rng(2)
    x = rng.uniform(-1, 1, space.n)
    wanted = space.placed(rng.uniform(-1, 1, space.n))
    targets = {"tip": space.frame("tip").pose(wanted), "arm": (None, space.frame("arm").pose(wanted)[1])}
    search = _Search(space, aims_of(space, targets, None, None, None))
    for at in (x, 1e-5 * x):
        expected = np.stack([(search.left(at + h) - search.left(at - h)) / 2e-6 for h in 1e-6 * np.eye(space.n)], axis=-1)
        np.testing.assert_allclose(search.slope(at), expected, atol=1e-9)
    reached = space.placed(np.array([*space.inverse_kinematics(targets).values()]))
    for name, (rotation, position) in targets.items():
        found = space.frame(name).pose(reached)
        np.testing.assert_allclose(found[1], position, atol=1e-8)
        assert rotation is None or np.allclose(found[0], rotation, atol=1e-8)


def test_a_frame_in_a_loop():
    """The crank of the four-bar turns by 0.4 rad about y from (0, 0, 0): so its coupler's joint is told where to go."""
    space = loaded(HERE / "fourbar.sdf")
    (name,) = space.rates
    wanted = space.position({name: space.values(space.kernels.q0)[0] + 0.4})
    for frame in ("crank", "coupler", "rocker"):
        rotation, position = space.frame(frame).pose(wanted)
        found = space.frame(frame).pose(space.position(space.inverse_kinematics({frame: (rotation, position)})))
        np.testing.assert_allclose(found[0], rotation, atol=1e-8)
        np.testing.assert_allclose(found[1], position, atol=1e-8)


@pytest.fixture(scope="module")
def arm(tmp_path_factory):
    path = tmp_path_factory.mktemp("arm") / "arm.urdf"
    path.write_text(ARM)
    return loaded(path)


def test_ways_to_say_a_target(arm):
    """A rotation or a position alone; a frame by its name in place of a point's."""
    q = arm.position({"a": 0.5, "b": 0.1, "c": -0.4})
    rotation, position = arm.frame("tool0").pose(q)
    for target in ((rotation, position), [rotation.tolist(), None], (None, position)):
        turn, place = arm.frame("tool0").pose(arm.position(arm.inverse_kinematics({"tool0": target}, start={"a": 0.3})))
        assert target[0] is None or np.allclose(turn, rotation, atol=1e-8)
        assert target[1] is None or np.allclose(place, position, atol=1e-8)
    assert arm.inverse_kinematics("tool0", position, rotation) == arm.inverse_kinematics({"tool0": (rotation, position)})
    assert arm.inverse_kinematics("tool0", place=position) == arm.inverse_kinematics("tool0", position=position)


def test_a_target_that_is_reached_at_a_limit_alone(arm):
    """The pose of the slider's link says where the first hinge and the slider are: at the slider's limit of 1 m, and beyond it."""
    target = {"lower": arm.frame("lower").pose(arm.position({"a": 0.4, "b": 1.0}))}
    with pytest.warns(UserWarning, match="^arm: joint b is at its upper limit 1$"):
        found = arm.inverse_kinematics(target, start={"b": 5.0})
    assert found["b"] == pytest.approx(1.0, abs=1e-8)
    assert found["a"] == pytest.approx(0.4, abs=1e-8)
    target = {"lower": arm.frame("lower").pose(arm.position({"a": 0.4, "b": 1.2}))}
    said = r"^arm: lower does not get there, 0.199 m and [\d.e-]+ rad are left, and joint b is at its upper limit 1; .* \(limits=False\)$"
    with pytest.raises(ConvergenceError, match=said):
        arm.inverse_kinematics(target)
    assert arm.inverse_kinematics(target, limits=False)["b"] == pytest.approx(1.2, abs=1e-8)
    model = arm.kernels.model
    model.limits["b"], before = (1.0, -1.0), model.limits["b"]
    with pytest.raises(ModelError, match="joint b: its lower limit 1 is beyond the upper one -1; say limits=False"):
        arm.inverse_kinematics(target)
    model.limits["b"] = before


def test_a_limit_of_a_joint_that_follows_another_one(tmp_path):
    text = ARM.replace(
        'rpy="0.2 0.1 0.9"/><axis xyz="0 0 1"/>',
        'rpy="0.2 0.1 0.9"/><axis xyz="0 0 1"/><mimic joint="b" multiplier="2"/><limit lower="-1" upper="1"/>',
    )
    (tmp_path / "arm.urdf").write_text(text.replace('name="c" type="continuous"', 'name="c" type="revolute"'))
    space = loaded(tmp_path / "arm.urdf")
    assert space.rates == ("a", "b")
    reached = {"lower": space.frame("lower").pose(space.position({"a": 0.4, "b": 0.45}))}
    assert space.inverse_kinematics(reached)["b"] == pytest.approx(0.45, abs=1e-8)
    beyond = {"lower": space.frame("lower").pose(space.position({"a": 0.4, "b": 0.6}))}
    with pytest.raises(ConvergenceError, match="^arm: joint c, which others determine, is at 1.2 and has the limits -1 and 1; begin"):
        space.inverse_kinematics(beyond)
    assert space.inverse_kinematics(beyond, limits=False)["b"] == pytest.approx(0.6, abs=1e-8)


@pytest.mark.slow
@pytest.mark.skipif(not ROBOTS.is_dir(), reason="needs example-robot-data")
def test_the_panda_reaches_near_with_its_elbow_at_the_limit():
    """How far the wrist (link 5) is from the shoulder says the elbow's angle, or the one as far on the other side of -0.47 rad: for its
    limit of -3.0718 that is 2.13, beyond the other limit."""
    pin = pytest.importorskip("pinocchio")
    path = ROBOTS / "panda_description/urdf/panda.urdf"
    theirs, space = pin.buildModelFromUrdf(str(path)), loaded(path)
    data, elbow = theirs.createData(), "panda_joint4"
    at = {f"panda_joint{k}": value for k, value in enumerate((0.3, 0.4, -0.2, 0.0, 0.5, 1.1, 0.7), 1)}
    assert space.kernels.model.limits[elbow] == (-3.0718, -0.0698)

    def placed(values):
        q = pin.neutral(theirs)
        for name, value in values.items():
            q[theirs.joints[theirs.getJointId(name)].idx_q] = value
        pin.framesForwardKinematics(theirs, data, q)
        hand, wrist = (data.oMf[theirs.getFrameId(name, pin.BODY)] for name in ("panda_link8", "panda_link5"))
        return {"panda_link8": (hand.rotation.copy(), hand.translation.copy()), "panda_link5": (None, wrist.translation.copy())}

    def compare(values, wanted):
        for name, target in placed(values).items():
            for found, expected in zip(target, wanted[name], strict=True):
                assert expected is None or np.allclose(found, expected, rtol=0, atol=1e-8)

    wanted = placed(at | {elbow: -3.0718})
    with pytest.warns(UserWarning, match="panda_joint4 is at its lower limit -3.0718"):
        found = space.inverse_kinematics(wanted)
    compare(found, wanted)
    for name, (least, most) in space.kernels.model.limits.items():
        assert name not in found or least <= found[name] <= most
    wanted = placed(at | {elbow: -3.12})
    with pytest.raises(ConvergenceError, match="does not get there, .* joint panda_joint4 is at its lower limit -3.0718"):
        space.inverse_kinematics(wanted)
    compare(space.inverse_kinematics(wanted, limits=False), wanted)


def check_refusals(arm, cases):
    for arguments, message in cases:
        with pytest.raises((ConvergenceError, ModelError), match=message) as error:
            arm.inverse_kinematics(*arguments)
        assert "\n" not in str(error.value)


def test_what_is_out_of_reach(arm):
    rotation, _ = arm.frame("tool0").pose(arm.kernels.q0)
    tip = np.array([9.0, 0.0, 0.0])
    cases = [
        (({"tool0": (rotation, tip)},), r"^arm: tool0 does not get there, [\d.]+ m and [\d.e-]+ rad are left, and joint b is at its upper"),
        (({"tool0": (np.diag([1.0, -1, -1]), None), "upper": (np.eye(3), None)},), r"^arm: \w+ does not get there, [\d.]+ rad are left"),
    ]
    check_refusals(arm, cases)


def test_what_is_refused(arm):
    rotation, position = arm.frame("tool0").pose(arm.kernels.q0)
    tip = np.array([9.0, 0.0, 0.0])
    cases = [
        (({"tool0": (None, [1e300, 0, 0])},), "^frame tool0: position: 1e[+]300 m given; .* check the unit"),
        (({"tool1": (rotation, position)},), "^arm has no frame tool1; known: base"),
        (({"tool0": position},), r"^frame tool0: give \(rotation \(3, 3\), position \(3,\) in m\), one of which may be None, and not"),
        (({"tool0": (None, None)},), "^frame tool0: give .rotation"),
        (({"tool0": (2 * rotation, None)},), "^frame tool0: rotation: Rᵀ R is off the unit matrix by 3"),
        (({},), "^arm: nothing to reach; give a point and a position, or {frame: .rotation, position.}"),
        (({"tool0": (rotation, position)}, tip), "^position, rotation and body are those of a point"),
        (("tool0",), "^frame tool0: give"),
    ]
    check_refusals(arm, cases)
