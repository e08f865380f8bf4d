"""Actuators of MJCF as inputs: accelerations at random states and controls beside MuJoCo's."""

from pathlib import Path

import numpy as np
import pytest

import ncgen
from ncgen.errors import ModelError

pytest.importorskip("mujoco", reason="MJCF is read by MuJoCo: pip install 'ncgen[robots]'")

from by_mujoco import Beside  # noqa: E402

HERE = Path(__file__).parent

ARM = """<mujoco><compiler angle="radian"/>{option}<worldbody>
<body name="a" pos="0 0 1"><joint name="q" axis="0.2 1 0" {q}/><inertial pos="0.1 0.05 -0.2" mass="1.2" diaginertia="0.03 0.02 0.025"/>
<body name="b" pos="0.1 0 -0.4"><joint name="s" type="slide" axis="1 0.3 0" ref="0.2"/>
<inertial pos="0 0.02 -0.1" mass="0.8" diaginertia="0.01 0.012 0.008"/>
<body name="c" pos="0 0.1 -0.3"><joint name="r" axis="1 0.3 0.3"/>
<inertial pos="0.1 0.05 -0.1" mass="0.5" diaginertia="0.004 0.005 0.003"/></body></body></body></worldbody>
<tendon><fixed name="t"><joint joint="q" coef="2"/><joint joint="r" coef="-1"/></fixed></tendon>
<actuator>{said}</actuator>{more}</mujoco>"""

SERVOS = """<motor name="q" joint="q" gear="3" ctrllimited="true" ctrlrange="-0.5 0.8"/><position name="hold" joint="s" kp="30" kv="2"/>
<velocity name="turn" joint="r" kv="0.7" forcelimited="true" forcerange="-0.3 0.3"/><motor name="rope" tendon="t" gear="1.5"/>
<general name="all" joint="s" gear="2" gaintype="affine" gainprm="2 0.3 0.1" biastype="affine" biasprm="0.4 -3 -0.2"/>
<position name="damped" joint="r" kp="5" dampratio="1"/>"""


def arm(path: Path, said: str, **more: str) -> Path:
    path.write_text(ARM.format(said=said, **{name: more.get(name, "") for name in ("option", "q", "more")}))
    return path


class Driven(Beside):
    """With controls, which are inputs by their names."""

    def drive(self, controls: dict[str, float]) -> None:
        for name, value in controls.items():
            self.data.ctrl[self.theirs.actuator(name).id] = value
        names = list(self.model.numbers)
        for name, value in controls.items():
            own = name if name in self.model.inputs else f"motor_{name}"
            self.p[names.index(own)] = value


def test_accelerations_equal_mujoco(tmp_path):
    """Motors, servos and general ones, over joints and a tendon, within their limits and beyond."""
    path = arm(tmp_path / "arm.xml", SERVOS, q='actuatorfrcrange="-2 2" actuatorfrclimited="true"')
    both, rng = Driven(path, motors=True), np.random.default_rng(4)
    assert list(both.model.inputs) == ["motor_q", "hold", "turn", "rope", "all", "damped"] and both.model.left_out == ()
    for size in (0.3, 3.0, 3.0, 10.0):
        both.drive({name: size * rng.normal() for name in ("q", "hold", "turn", "rope", "all", "damped")})
        assert both.error(rng, states=2) < 1e-9


def test_joints_whose_motors_cannot_rest_have_a_force(tmp_path):
    """Bounds of a joint that do not hold 0 act where no motor does, or one that is switched off."""
    said = '<motor joint="s" group="1" forcerange="0.3 1"/><motor name="r" joint="r"/>'
    option = '<option actuatorgroupdisable="1"/>'
    path = arm(tmp_path / "arm.xml", said, q='actuatorfrcrange="0.2 2"', option=option)
    both = Driven(path, motors=True)
    assert both.model.left_out == ("actuators (1)",)
    both.theirs.actuator_forcelimited[0] = 0
    both.drive({"r": 0.4})
    assert both.error(np.random.default_rng(5), states=2) < 1e-9
    both.theirs.jnt_actfrclimited[0] = 0
    assert both.error(np.random.default_rng(5), states=1) > 1e-4


def test_without_motors_they_are_left_out(tmp_path):
    model = ncgen.load(arm(tmp_path / "arm.xml", SERVOS))
    assert not model.inputs and model.left_out == ("actuators (6)",)


@pytest.mark.parametrize(
    "said, left",
    [
        ('<intvelocity joint="q" kp="1" actrange="-1 1"/>', 1),
        ('<general joint="q" dyntype="filter" dynprm="0.1"/><motor joint="r"/>', 1),
        ('<damper joint="q" kv="1" ctrlrange="0 1"/>', 0),
        ('<cylinder joint="q"/>', 1),
    ],
)
def test_those_with_a_state_are_left_out(said, left, tmp_path):
    model = ncgen.load(arm(tmp_path / "arm.xml", said), motors=True)
    assert model.left_out == ((f"actuators ({left})",) if left else ())


def test_those_of_plugins_are_left_out(tmp_path):
    config = '<instance name="pid"><config key="kp" value="4"/></instance>'
    more = f'<extension><plugin plugin="mujoco.pid">{config}</plugin></extension>'
    said = '<plugin joint="q" plugin="mujoco.pid" instance="pid"/><motor name="m" joint="r"/>'
    both = Driven(arm(tmp_path / "arm.xml", said, more=more), motors=True)
    assert list(both.model.inputs) == ["m"] and both.model.left_out == ("actuators (1)", "plugins (1)")
    both.drive({"m": 0.7})
    assert both.error(np.random.default_rng(4), states=1) > 0.1
    both.only_what_is_modelled()
    assert both.error(np.random.default_rng(4), states=2) < 1e-9


@pytest.mark.parametrize(
    "option, inputs", [('<option><flag actuation="disable"/></option>', []), ('<option actuatorgroupdisable="2"/>', ["m"])]
)
def test_what_is_switched_off_has_no_input(option, inputs, tmp_path):
    said = '<motor name="off" joint="q" group="2"/><motor name="m" joint="r"/>'
    model = ncgen.load(arm(tmp_path / "arm.xml", said, option=option), motors=True)
    assert list(model.inputs) == inputs and model.left_out == ()


def test_keyframes_bring_controls(tmp_path):
    key = '<keyframe><key name="home" qpos="0.1 0.3 0.2" ctrl="0.7"/></keyframe>'
    path = arm(tmp_path / "arm.xml", '<motor name="drive" joint="q"/>', more=key)
    assert ncgen.load(path, motors=True).starts["home"]["inputs"] == {"drive": 0.7}
    assert "inputs" not in ncgen.load(path).starts["home"]


def test_joints_of_urdf_have_motors():
    """Each that follows no other; torques are forces along the joints."""
    model = ncgen.load(HERE / "crane.urdf", motors=True)
    space = ncgen.joint_space(ncgen.compile(model, "numpy"))
    assert list(model.inputs) == [f"motor_{name}" for name in space.coordinates]
    assert not any(said.startswith("effort limits") for said in model.left_out)
    for torque, felt in ((1.0, 1.0), (1e6, 10.0), (-1e6, -10.0)):
        p = np.array(space.kernels.p0)
        p[list(model.numbers).index("motor_luff")] = torque
        rest = space.kernels.force(space.kernels.q0, 0 * space.kernels.q0)
        gained = space.kernels.force(space.kernels.q0, 0 * space.kernels.q0, p=p) - rest
        assert gained[space.kernels.index["luff"]] == felt and np.count_nonzero(gained) == 1


def test_motors_are_of_robots():
    with pytest.raises(ModelError, match="motors is for a robot's file"):
        ncgen.load("fourbar", motors=True)
