"""Sensors of MJCF as outputs, beside MuJoCo's readings at the same state."""

from pathlib import Path

import numpy as np
import pytest

import ncgen

mujoco = pytest.importorskip("mujoco", reason="MJCF is read by MuJoCo: pip install 'ncgen[robots]'")

ARM = """<mujoco><compiler angle="radian"/><option gravity="0.3 -0.5 -9.7" magnetic="0.1 -0.4 0.2"/><worldbody>
<body name="a" pos="0 0 1" quat="0.9 0.1 0.3 -0.2"><joint name="q" axis="0.2 1 0" ref="0.3"/>
<inertial pos="0.1 0.05 -0.2" quat="0.9 0.1 0.2 0" mass="1.2" diaginertia="0.03 0.02 0.025"/>
<camera name="eye" pos="0 0.1 0" quat="1 1 0 0"/>
<body name="b" pos="0.1 0 -0.4"><joint name="s" type="slide" axis="1 0.3 0"/>
<inertial pos="0 0.02 -0.1" mass="0.8" diaginertia="0.01 0.012 0.008"/>
<body name="fixed" pos="0 0 -0.1" quat="0.8 0.1 0.2 0"><geom name="ball" size="0.03" pos="0.1 0 0" quat="1 0.2 0 0"/>
<site name="imu" pos="0.1 -0.1 0.02" quat="0.7 0.3 0.1 -0.2"/></body></body></body></worldbody>
<tendon><fixed name="t"><joint joint="q" coef="2"/><joint joint="s" coef="-1"/></fixed></tendon>
<actuator><motor name="m" joint="q" gear="3"/></actuator>
<sensor>{said}</sensor><keyframe><key name="here" time="0.7" qpos="1.1 0.2" qvel="-2 1.5"/></keyframe></mujoco>"""

KINDS = {
    ("site", "imu"): ("pos", "xaxis", "yaxis", "zaxis", "linvel", "angvel", "linacc", "angacc"),
    ("body", "a"): ("pos", "yaxis"), ("xbody", "b"): ("pos",), ("geom", "ball"): ("pos", "zaxis"), ("camera", "eye"): ("pos", "xaxis"),
}  # fmt: skip

FRAMES = "".join(
    f'<frame{kind} name="{kind} {name}" objtype="{objtype}" objname="{name}"/>'
    for (objtype, name), kinds in KINDS.items()
    for kind in kinds
)

OTHERS = """<accelerometer name="acc" site="imu"/><velocimeter name="vel" site="imu"/><gyro name="gyro" site="imu"/>
<magnetometer name="mag" site="imu"/><jointpos name="jp" joint="q"/><jointvel name="jv" joint="s"/><tendonpos name="tp" tendon="t"/>
<tendonvel name="tv" tendon="t"/><actuatorpos name="ap" actuator="m"/><actuatorvel name="av" actuator="m"/><clock name="time"/>
<gyro name="cut" site="imu" cutoff="0.5"/><jointvel joint="q" cutoff="1"/>"""

LEFT = """<touch site="imu"/><force site="imu"/><framequat objtype="site" objname="imu"/><rangefinder site="imu"/>
<framepos objtype="site" objname="imu" reftype="body" refname="a"/><subtreecom body="a"/>"""


def test_readings_equal_mujoco(tmp_path):
    path = tmp_path / "arm.xml"
    path.write_text(ARM.format(said=FRAMES + OTHERS + LEFT))
    model = ncgen.load(path, sensors=True)
    assert [said for said in model.left_out if "sensor" in said] == ["sensors (6)"]
    run = ncgen.simulate(ncgen.compile(model, "numpy"), 1e-3, points=2, **model.starts["here"])
    theirs = mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(theirs)
    mujoco.mj_resetDataKeyframe(theirs, data, 0)
    mujoco.mj_forward(theirs, data)
    compared = 0
    for s in range(theirs.nsensor - 6):
        name, size = theirs.sensor(s).name or f"sensor{s}", theirs.sensor_dim[s]
        labels = [name] if size == 1 else [f"{name}.{axis}" for axis in "xyz"]
        reading = data.sensordata[theirs.sensor_adr[s] : theirs.sensor_adr[s] + size]
        np.testing.assert_allclose([run[label][0] for label in labels], reading, rtol=1e-9, atol=1e-9, err_msg=name)
        compared += size
    assert compared == len(model.outputs) == 3 * (15 + 5) + 8


def test_without_sensors_they_are_left_out(tmp_path):
    path = tmp_path / "arm.xml"
    path.write_text(ARM.format(said=OTHERS))
    model = ncgen.load(Path(path))
    assert not model.outputs and "sensors (13)" in model.left_out


def test_sensors_that_the_file_switches_off_are_left_out(tmp_path):
    path = tmp_path / "arm.xml"
    path.write_text(ARM.format(said=OTHERS).replace('gravity="0.3', '><flag sensor="disable"/></option><option gravity="0.3'))
    assert mujoco.MjModel.from_xml_path(str(path)).opt.disableflags == int(mujoco.mjtDisableBit.mjDSBL_SENSOR)
    model = ncgen.load(path, sensors=True)
    assert not model.outputs and "sensors (13)" in model.left_out
