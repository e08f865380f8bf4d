"""Reference values of joints, and keyframes as named starts, beside MuJoCo."""

import pickle
from pathlib import Path

import numpy as np
import pytest

import ncgen
from ncgen.errors import ModelError
from ncgen.exchange.robots import starts

pytest.importorskip("mujoco", reason="MJCF is read by MuJoCo: pip install 'ncgen[robots]'")

from by_mujoco import Beside  # noqa: E402

REFERENCES = """<mujoco><compiler angle="radian"/><worldbody>
<body name="a" pos="0 0 1" quat="0.9 0.1 0.3 -0.2"><joint name="lift" type="slide" axis="0.2 0 1" ref="1.25" stiffness="5" springref="1.5"/>
<inertial pos="0.1 0.05 -0.2" mass="1.2" diaginertia="0.03 0.02 0.025"/>
<body name="b" pos="0.1 0 -0.4"><joint name="q" axis="0.2 1 0" pos="0.1 0 0" ref="4.5" stiffness="2" springref="4" range="4 5"
limited="true"/><inertial pos="0 0.02 -0.1" mass="0.8" diaginertia="0.01 0.012 0.008"/>
<body name="c" pos="0 0.1 -0.3"><joint name="s" type="slide" axis="1 0.3 0" ref="-0.4"/>
<inertial pos="0.1 0.05 -0.1" mass="0.5" diaginertia="0.004 0.005 0.003"/>
<body name="d" pos="0 0.2 -0.1"><joint name="r" axis="1 0.3 0.3" ref="0.3"/>
<inertial pos="0.1 0.05 -0.1" mass="0.3" diaginertia="0.004 0.005 0.003"/></body></body></body></body>
</worldbody>{more}</mujoco>"""

ROWS = """<equality><joint joint1="q" joint2="r" polycoef="0.1 0.8 0 0 0"/><joint joint1="s" joint2="lift" polycoef="0.05 0.4 0.3 0 0"/>
</equality>"""

FREE = """<mujoco><compiler angle="radian"/><worldbody>
<body name="f" pos="1 2 3" quat="0.5 0.5 -0.5 0.5"><joint type="free" name="free"/>
<inertial pos="0.1 -0.05 0.2" mass="0.6" diaginertia="0.004 0.005 0.003"/>
<body name="b" pos="0.1 0 -0.4"><joint name="q" axis="0.2 1 0" pos="0.1 0 0" ref="0.2"/>
<inertial pos="0 0.02 -0.1" mass="0.8" diaginertia="0.01 0.012 0.008"/>
<body name="c" pos="0 0.1 -0.3" quat="0.7 0.7 0 0.1"><joint name="ball" type="ball" pos="0.02 0 0.03"/>
<inertial pos="0.1 0.05 -0.1" mass="0.5" diaginertia="0.004 0.005 0.003"/>
<body name="d" pos="0 0.1 0.1"><joint name="s" type="slide" axis="1 0.3 0" ref="-0.4"/>
<inertial pos="0.1 0.05 -0.1" mass="0.5" diaginertia="0.004 0.005 0.003"/></body></body></body></body></worldbody>
<keyframe><key name="home" qpos="0 0 1 1 0 0 0 0.4 1 0 0 0 0.1"/>
<key time="2" qpos="0.3 0.1 1 0.9 0.1 0.3 0.2 -0.7 0.5 0.6 -0.3 0.2 0.2" qvel="0.1 0.2 0.3 -1 2 1.5 0.7 0.3 -0.4 0.9 -0.6"/>
</keyframe></mujoco>"""


def written(path: Path, text: str, **said: str) -> Path:
    path.write_text(text.format(**said) if said else text)
    return path


def test_coordinates_begin_at_the_references_of_the_file(tmp_path):
    """Their values, springs and accelerations are MuJoCo's; limits are told as the file tells them."""
    both = Beside(written(tmp_path / "r.xml", REFERENCES, more=""))
    start = dict(zip(both.kernels.coordinates, both.kernels.q0, strict=True))
    np.testing.assert_allclose([start[name] for name in ("lift", "q", "s", "r")], [1.25, 4.5, -0.4, 0.3], rtol=0, atol=1e-15)
    assert both.model.left_out == ("limits of joints (1)",)
    assert both.error(np.random.default_rng(2), states=3) < 1e-9
    limited = ncgen.load(tmp_path / "r.xml", limits=True)
    (stop,) = (spring for spring in limited.springs if spring.label == "stops of q")
    numbers = {"x": 4.5, "v": 0.0, "stop_stiffness": 1.0, "stop_loss": 1.0}
    for x, torque in ((4.5, 0.0), (5.25, 0.25), (3.5, -0.5)):
        assert float(stop.law.subs({s: (numbers | {"x": x})[s.name] for s in stop.law.free_symbols})) == torque


def test_rows_count_from_the_references(tmp_path):
    both = Beside(written(tmp_path / "r.xml", REFERENCES, more=ROWS))
    assert both.closed_error(np.random.default_rng(2), states=2) < 1e-9


@pytest.fixture(scope="module")
def free(tmp_path_factory) -> Beside:
    return Beside(written(tmp_path_factory.mktemp("free") / "free.xml", FREE))


@pytest.mark.parametrize("number, name", [(0, "home"), (1, "key1")])
def test_keyframes_are_starts(free, number, name):
    """All natural coordinates and their rates are those of MuJoCo's bodies there."""
    q, qd = free.state(free.theirs.key_qpos[number], free.theirs.key_qvel[number])
    start, names = free.model.starts[name], free.kernels.coordinates
    np.testing.assert_allclose([start["q0"][each] for each in names], q, rtol=0, atol=1e-14)
    np.testing.assert_allclose([start.get("qd0", {}).get(each, 0.0) for each in names], qd, rtol=0, atol=1e-14)
    assert start.get("t0") == (2.0 if number else None) and ("qd0" in start) == bool(number)


def test_starts_are_found_when_they_are_asked_for(tmp_path, monkeypatch):
    """Once, with all that the file had; a model that went to another process has them, too."""
    found = []
    original = starts.named_start
    monkeypatch.setattr(starts, "named_start", lambda *arguments: found.append(1) or original(*arguments))
    model = ncgen.load(written(tmp_path / "free.xml", FREE))
    assert list(model.starts) == ["home", "key1"] and len(model.starts) == 2 and not found
    assert model.starts["home"] is model.starts["home"] and len(found) == 1
    assert pickle.loads(pickle.dumps(model)).starts == dict(model.starts) and len(found) == 2


def test_a_run_begins_at_a_keyframe(free):
    run = ncgen.simulate(free.kernels, 0.01, points=2, **free.model.starts["key1"])
    q, qd = free.state(free.theirs.key_qpos[1], free.theirs.key_qvel[1])
    np.testing.assert_allclose(run.q[0], q, rtol=0, atol=1e-12)
    np.testing.assert_allclose(run.qd[0], qd, rtol=0, atol=1e-11)
    assert run.t[0] == 2.0 and free.model.left_out == ()


def test_a_keyframe_with_a_huge_number_is_refused(tmp_path):
    text = FREE.replace('qpos="0 0 1 1 0 0 0 0.4', 'qpos="0 0 1 1 0 0 0 1e200')
    with pytest.raises(ModelError, match="keyframe home has the number 1e\\+200"):
        ncgen.load(written(tmp_path / "r.xml", text))
