"""Frames of robots in exports: poses and Jacobians in C, NumPy and CasADi next to Pinocchio, and in loops next to joint space here."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from test_joints_in_c import called, library

import ncgen
from ncgen.errors import ModelError
from ncgen.exchange.export import export

pytestmark = pytest.mark.skipif(not shutil.which("cc"), reason="no C compiler")

ROBOTS = Path(__file__).parents[1] / "robots"
CRANE = ROBOTS / "crane.urdf"
ASKED = ("base", "hook", "counterweight")


class Theirs:
    """The crane in Pinocchio, at random joint values."""

    def __init__(self, rates) -> None:
        self.pin = pytest.importorskip("pinocchio")
        self.model = self.pin.buildModelFromUrdf(str(CRANE))
        self.data, self.rates = self.model.createData(), rates
        self.order = [self.model.joints[self.model.getJointId(name)].idx_v for name in rates]

    def at(self, x: np.ndarray) -> None:
        q = self.pin.neutral(self.model)
        for name, value in zip(self.rates, x, strict=True):
            joint = self.model.joints[self.model.getJointId(name)]
            q[joint.idx_q : joint.idx_q + joint.nq] = [value] if joint.nq == 1 else [np.cos(value), np.sin(value)]
        self.pin.computeJointJacobians(self.model, self.data, q)
        self.pin.updateFramePlacements(self.model, self.data)

    def frame(self, name: str) -> tuple[np.ndarray, np.ndarray, list[np.ndarray]]:
        """Position, rotation, and Jacobians world-aligned, local, world."""
        pin, number = self.pin, self.model.getFrameId(name, self.pin.BODY)
        references = (pin.LOCAL_WORLD_ALIGNED, pin.LOCAL, pin.WORLD)
        jacobians = [pin.getFrameJacobian(self.model, self.data, number, each)[:, self.order] for each in references]
        return self.data.oMf[number].translation, self.data.oMf[number].rotation, jacobians


def test_frames_in_c_equal_pinocchio(tmp_path):
    """At 8 states, in all three ways of telling a Jacobian; only the frames that are asked for are there."""
    model = ncgen.load(CRANE, frames=ASKED)
    space = ncgen.joint_space(ncgen.compile(model, "numpy"))
    theirs, lib, rng = Theirs(space.rates), library(model, tmp_path), np.random.default_rng(4)
    q, p = np.zeros(space.kernels.n), space.kernels.p0.copy() if len(space.kernels.p0) else np.zeros(1)
    position, rotation, J = np.zeros(3), np.zeros((3, 3)), np.zeros((6, space.n))
    for _ in range(8):
        x = rng.uniform(-1.5, 1.5, space.n)
        theirs.at(x)
        assert called(lib.crane_joint_position, 0.0, x, p, q) == 0
        for number, name in enumerate(ASKED):
            place, turn, jacobians = theirs.frame(name)
            assert called(lib.crane_frame_pose, number, q, p, position, rotation) == 0
            np.testing.assert_allclose(position, place, rtol=0, atol=1e-13)
            np.testing.assert_allclose(rotation, turn, rtol=0, atol=1e-13)
            for reference, expected in enumerate(jacobians):
                assert called(lib.crane_frame_jacobian, number, reference, q, p, J) == 0
                np.testing.assert_allclose(J, expected, rtol=0, atol=1e-12)
    assert called(lib.crane_frame_pose, 3, q, p, position, rotation) != 0
    assert called(lib.crane_frame_jacobian, -1, 0, q, p, J) != 0
    assert called(lib.crane_frame_jacobian, 0, 3, q, p, J) != 0
    header = (tmp_path / "crane_joints.h").read_text()
    assert [line.split()[0] for line in header.splitlines() if "CRANE_FRAME_" in line] == [f"CRANE_FRAME_{name.upper()}" for name in ASKED]
    export(ncgen.load(CRANE), "joints", tmp_path / "none")
    assert "frame" not in "".join(path.read_text() for path in (tmp_path / "none").iterdir())


def test_frames_in_a_loop_in_c(tmp_path):
    """Of the four-bar's coupler, which two cranks carry."""
    model = ncgen.load(ROBOTS / "fourbar.sdf", frames=["coupler"])
    space = ncgen.joint_space(ncgen.compile(model, "numpy"))
    lib, name, p = library(model, tmp_path), model.name, np.zeros(1)
    found = space.frame("coupler")
    position, rotation, J = np.zeros(3), np.zeros((3, 3)), np.zeros((6, space.n))
    for x in (0.1, 0.4):
        q = space.placed(space.values(space.kernels.q0) + x)
        turn, place = found.pose(q)
        assert called(getattr(lib, f"{name}_frame_pose"), 0, q, p, position, rotation) == 0
        np.testing.assert_allclose(position, place, rtol=0, atol=1e-13)
        np.testing.assert_allclose(rotation, turn, rtol=0, atol=1e-13)
        for number, reference in enumerate(("world-aligned", "local", "world")):
            assert called(getattr(lib, f"{name}_frame_jacobian"), 0, number, q, p, J) == 0
            np.testing.assert_allclose(J, found.jacobian(q, reference), rtol=0, atol=1e-12)


def states_of_hook():
    """The crane with outputs of its hook: a run, joint values where it begins, Pinocchio's pose of the hook there, and its Jacobian."""
    model = ncgen.load(CRANE, frames=["hook"])
    kernels = ncgen.compile(model, "numpy")
    space = ncgen.joint_space(kernels)
    theirs, x = Theirs(space.rates), np.array([0.4, 0.2, -0.3, 0.1, 0.5, -0.2])
    theirs.at(x)
    place, turn, (jacobian, *_) = theirs.frame("hook")
    return model, ncgen.simulate(kernels, 1e-3, q0=space.placed(x)), x, np.concatenate([place, turn.ravel()]), jacobian


def test_frames_are_outputs_of_runs():
    _, run, _, expected, _ = states_of_hook()
    assert list(run.outputs) == [f"hook.{axis}" for axis in "xyz"] + [f"hook.r{i}{j}" for i in (1, 2, 3) for j in (1, 2, 3)]
    np.testing.assert_allclose([values[0] for values in run.outputs.values()], expected, rtol=0, atol=1e-13)


@pytest.mark.slow
def test_frames_are_outputs_of_packages(tmp_path):
    """In the Python package, and in CasADi's library, whose derivative by the joints is Pinocchio's Jacobian."""
    casadi = pytest.importorskip("casadi")
    model, _, x, expected, jacobian = states_of_hook()
    turn, n = expected[3:].reshape(3, 3), len(x)
    export(model, "casadi", tmp_path / "casadi")
    subprocess.run(["make", "-s", "CFLAGS=-O0"], cwd=tmp_path / "casadi", check=True, capture_output=True)
    outputs = casadi.external("crane_outputs", str(tmp_path / "casadi/crane.so"))
    s = casadi.MX.sym("s", n)
    pose = outputs(0.0, s, np.zeros(n), np.zeros(0), np.zeros(0))
    found = casadi.Function("found", [s], [pose, casadi.jacobian(pose, s)])(x)
    np.testing.assert_allclose(found[0].full().ravel(), expected, rtol=0, atol=1e-13)
    turned = np.stack([np.cross(jacobian[3:, k], turn, axisb=0, axisc=0).ravel() for k in range(n)], axis=-1)
    np.testing.assert_allclose(found[1].full(), np.concatenate([jacobian[:3], turned]), rtol=0, atol=1e-12)

    export(model, "python", tmp_path / "python")
    build = [sys.executable, "setup.py", "--quiet", "build_ext", "--inplace"]
    subprocess.run(build, cwd=tmp_path / "python", check=True, capture_output=True)
    use = "import json, crane; print(json.dumps(list(crane.Motion().outputs.values())))"
    told = subprocess.run([sys.executable, "-c", use], cwd=tmp_path / "python", check=True, capture_output=True, text=True).stdout
    begins = ncgen.joint_space(ncgen.compile(model, "numpy")).frame("hook").pose(ncgen.compile(model, "numpy").q0)
    np.testing.assert_allclose(json.loads(told), [*begins[1], *begins[0].ravel()], rtol=0, atol=1e-13)


def test_frames_that_are_not_there():
    with pytest.raises(ModelError, match="^crane has no frame tool0; known: base, column"):
        ncgen.load(CRANE, frames=["tool0"])
    with pytest.raises(ModelError, match="^frames: hook given; give a list of names$"):
        ncgen.load(CRANE, frames="hook")
    with pytest.raises(ModelError, match="^pendulum: frames is for a robot's file"):
        ncgen.load("pendulum", frames=["bob"])
