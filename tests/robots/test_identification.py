"""The regressor and base parameters next to Pinocchio's, on arms of its collection."""

import re
import sysconfig
from pathlib import Path

import numpy as np
import pytest

import ncgen
from ncgen.model.names import word
from tests.robots.test_link_frames import ARM

ROBOTS = Path(sysconfig.get_paths()["purelib"], "cmeel.prefix/share/example-robot-data/robots")

FILES = {"z1": "z1_description/urdf/z1.urdf", "panda": "panda_description/urdf/panda.urdf"}

RANK = 1e-9
"""A singular value of Pinocchio's regressor that is smaller, over the largest, is rounding."""


class Theirs:
    """Pinocchio's model of a file, told in the rates of a joint space: v = G v' where joints mimic others."""

    def __init__(self, pin, path, space):
        self.pin, self.model = pin, pin.buildModelFromUrdf(str(path))
        self.data, self.space = self.model.createData(), space
        called = {word(name, "joint"): name for name in self.model.names}
        self.G = np.zeros((self.model.nv, space.n))
        for k, name in enumerate(space.rates):
            self.G[self.model.joints[self.model.getJointId(called[name])].idx_v, k] = 1.0
        if "panda_finger_joint1" in space.rates:  # whose second finger does what the first one does
            self.G[self.model.joints[self.model.getJointId("panda_finger_joint2")].idx_v, space.rates.index("panda_finger_joint1")] = 1.0
        frames = space.kernels.model.frames
        homes = [next(name for name, frame in frames.items() if frame.body == link.body.name) for link in space.tree.links]
        joints = [self.model.frames[self.model.getFrameId(home, pin.BODY)].parentJoint for home in homes]
        self.columns = [10 * (joint - 1) + k for joint in joints for k in range(10)]

    def regressor(self, x, v, a):
        q = self.pin.neutral(self.model)
        for joint in list(self.model.joints)[1:]:
            value = (self.G @ x)[joint.idx_v]
            q[joint.idx_q : joint.idx_q + joint.nq] = [value] if joint.nq == 1 else [np.cos(value), np.sin(value)]
        return self.G.T @ self.pin.computeJointTorqueRegressor(self.model, self.data, q, self.G @ v, self.G @ a)[:, self.columns]

    def parameters(self):
        return np.concatenate([inertia.toDynamicParameters() for inertia in list(self.model.inertias)[1:]])[self.columns]


def draw(rng, n):
    return rng.uniform(-1, 1, n), rng.normal(size=n), rng.normal(size=n)


@pytest.fixture(scope="module", params=["z1", pytest.param("panda", marks=pytest.mark.slow)])
def arm(request):
    """A joint space, and Pinocchio's model."""
    pin = pytest.importorskip("pinocchio")
    path = ROBOTS / FILES[request.param]
    space = ncgen.joint_space(ncgen.compile(ncgen.load(path), "numpy"))
    return space, Theirs(pin, path, space)


def test_the_regressor_is_pinocchios(arm):
    space, theirs = arm
    rng = np.random.default_rng(4)
    values = space.inertial_values()
    np.testing.assert_allclose(values, theirs.parameters(), rtol=0, atol=1e-14)
    for _ in range(5):
        x, v, a = draw(rng, space.n)
        q = space.placed(x)
        Y, expected, forces = space.regressor(q, v, a), theirs.regressor(x, v, a), space.inverse_dynamics(q, v, a)
        assert np.max(np.abs(Y - expected)) < 1e-12 * np.max(np.abs(expected))
        assert np.max(np.abs(Y @ values - forces)) < 1e-12 * np.max(np.abs(forces))


def test_base_parameters_are_as_many_as_the_rank_says(arm):
    space, theirs = arm
    rng = np.random.default_rng(5)
    found = space.base_parameters()
    Y = np.vstack([theirs.regressor(*draw(rng, space.n)) for _ in range(60)])
    sizes = np.linalg.svd(Y, compute_uv=False)
    assert found.count == np.sum(sizes > RANK * sizes[0]) and found.gap > 1e6
    # at states that it has not seen, the base parameters make all forces that the inertial ones make
    assert np.max(np.abs(Y - Y[:, found.kept] @ found.combinations)) < 1e-10 * np.max(np.abs(Y))
    np.testing.assert_allclose(found.combinations[:, found.kept], np.eye(found.count), atol=1e-8)


@pytest.fixture(scope="module")
def small(tmp_path_factory):
    path = tmp_path_factory.mktemp("arm") / "arm.urdf"
    path.write_text(ARM)
    return ncgen.joint_space(ncgen.compile(ncgen.load(path, parameters=["inertia", "tool0"]), "numpy"))


def test_parameters_change_the_inertial_values_and_not_the_regressor(small):
    rng, p = np.random.default_rng(6), {"tool0.mass": 1.5, "tool0.centre.z": 0.2, "hand.mass": 2.0, "lower.inertia.xy": 0.01}
    changed = small.at(p)
    x, v, a = draw(rng, small.n)
    q = small.placed(x)
    Y, forces = small.regressor(q, v, a), changed.inverse_dynamics(q, v, a)
    np.testing.assert_array_equal(changed.regressor(q, v, a), Y)
    assert np.max(np.abs(Y @ changed.inertial_values() - forces)) < 1e-12 * np.max(np.abs(forces))
    assert changed.inertial_values()[small.inertial_names.index("hand.m")] == 3.5


def test_of_many_states_it_is_that_of_each(small):
    rng = np.random.default_rng(7)
    states = [draw(rng, small.n) for _ in range(3)]
    x, v, a = (np.array(part) for part in zip(*states, strict=True))
    many = small.regressor(small.placed(x), v, a)
    assert many.shape == (3, small.n, len(small.inertial_names))
    for k, state in enumerate(states):
        np.testing.assert_allclose(many[k], small.regressor(small.placed(state[0]), *state[1:]), rtol=1e-13, atol=1e-13)


def test_of_loops_it_is_linear_in_the_same_way():
    space = ncgen.joint_space(ncgen.compile(ncgen.load("fourbar"), "numpy"))
    rng = np.random.default_rng(8)
    q = space.placed(space.values(space.kernels.q0) + 0.1)
    v, a = rng.normal(size=(2, space.n))
    forces = space.inverse_dynamics(q, v, a)
    assert np.max(np.abs(space.regressor(q, v, a) @ space.inertial_values() - forces)) < 1e-12 * np.max(np.abs(forces))


def test_a_base_parameter_is_told_in_words(small):
    found = small.base_parameters()
    assert found.names == small.inertial_names
    assert {found.text(k).split(" ")[0] for k in range(found.count)} == {found.names[k] for k in found.kept}


def test_the_example_of_the_robots_page_prints_what_stands_there(monkeypatch, capsys):
    root = Path(__file__).resolve().parents[2]
    monkeypatch.chdir(root)
    page = (root / "docs" / "robots.md").read_text(encoding="utf-8")
    code, printed = re.search(r"```python\n((?:(?!```).)*?base_parameters.*?)```\n\n```\n(.*?)```", page, re.S).groups()
    exec(code, {})
    assert capsys.readouterr().out == printed
