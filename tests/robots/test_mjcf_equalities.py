"""Equalities of MJCF beside MuJoCo: positions in which they hold, and accelerations without MuJoCo's softness."""

from pathlib import Path

import numpy as np
import pytest

import ncgen
from ncgen.errors import ModelError

pytest.importorskip("mujoco", reason="MJCF is read by MuJoCo: pip install 'ncgen[robots]'")

from by_mujoco import Beside  # noqa: E402

CHAIN = """<mujoco><compiler angle="radian"/>{option}<worldbody><site name="nail" pos="0.3 0 0.4" quat="0.8 0 0.6 0"/>
<body name="a" pos="0 0 1"><joint name="q" axis="0 1 0"/><inertial pos="0 0 -0.3" mass="1" diaginertia="0.02 0.02 0.01"/>
<body name="b" pos="0 0 -0.6"><joint name="r" axis="0 1 0" {r}/><inertial pos="0.3 0 0" mass="0.7" diaginertia="0.01 0.02 0.02"/>
<site name="tip" pos="0.3 0 0" quat="0.8 0 0.6 0"/>
<body name="c" pos="0.6 0 0"><joint name="s" type="slide" axis="1 0 0" {s}/>
<inertial pos="0.1 0 0.1" mass="0.4" diaginertia="0.01 0.02 0.01"/>
</body></body></body>
<body name="d" pos="0.9 0 0.4"><joint name="u" axis="0 1 0.2"/><inertial pos="0 0.1 0.2" mass="0.5" diaginertia="0.01 0.02 0.02"/>
<site name="hole" pos="-0.6 0 0"/><site name="near" pos="-0.5 0 0.1"/><site name="away" pos="9 0 0"/></body>
</worldbody>{tendon}<equality>{said}</equality></mujoco>"""

TENDONS = """<tendon><fixed name="t"><joint joint="q" coef="2"/><joint joint="r" coef="-1"/></fixed>
<fixed name="v"><joint joint="s" coef="3"/><joint joint="u" coef="0.5"/></fixed></tendon>"""

ROWS = """<joint joint1="q" joint2="r" polycoef="0.1 0.8 -0.3 0.2 0.15"/><joint joint1="u" polycoef="0.2 0 0 0 0"/>
<tendon tendon1="v" tendon2="t" polycoef="0.05 0.4 0.1 0 0"/>"""

APART = '<connect site1="tip" site2="near"/>'

CASES = {
    "sites that are apart": APART,
    "a weld with a pose of its own": '<weld body1="a" body2="b" relpose="0 0 -0.6 0.9 0 0.2 0"/>',
    "a polynomial of fourth order": '<joint joint1="q" joint2="r" polycoef="0.1 0.8 -0.3 0.2 0.15"/>',
    "a constant": '<joint joint1="q" polycoef="0.2 0 0 0 0"/>',
    "two for one joint": '<joint joint1="q" joint2="r" polycoef="0 2 0 0 0"/><joint joint1="q" joint2="s" polycoef="0 -1 0 0 0"/>',
    "tendons": '<tendon tendon1="t" tendon2="v" polycoef="0.1 0.5 0.2 -0.1 0.05"/>',
    "a tendon's constant": '<tendon tendon1="t" polycoef="-0.1 0 0 0 0"/>',
    "sites, a ball": '<connect site1="tip" site2="hole"/>',
    "sites of the world, a ball": '<connect site1="tip" site2="nail"/>',
}


def chain(path: Path, said: str, **more: str) -> Path:
    path.write_text(CHAIN.format(said=said, **{name: more.get(name, "") for name in ("option", "r", "s")}, tendon=TENDONS))
    return path


def test_rows_over_joints_equal_mujoco(tmp_path):
    """A polynomial of fourth order, a constant, and sums of joints."""
    both = Beside(chain(tmp_path / "chain.xml", ROWS))
    assert ncgen.freedom(both.kernels).dof == 1
    assert both.closed_error(np.random.default_rng(1)) < 1e-9


def test_sites_equal_mujoco(tmp_path):
    """A ball between two sites, which are one where the model begins."""
    both = Beside(chain(tmp_path / "chain.xml", CASES["sites, a ball"]))
    assert both.closed_error(np.random.default_rng(1)) < 1e-9


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES)
def test_each_equality_equals_mujoco(case, tmp_path):
    both = Beside(chain(tmp_path / "chain.xml", CASES[case]))
    assert both.closed_error(np.random.default_rng(1)) < 1e-9


@pytest.mark.parametrize("said", ['<weld body1="foot"/>', '<weld body1="world" body2="foot"/>'])
def test_a_weld_to_the_world_holds_in_either_order(said, tmp_path):
    """A free body; one joint that it carries is what remains."""
    body = '<inertial pos="0 0 -0.1" mass="1" diaginertia="0.02 0.02 0.01"/>'
    toe = f'<body name="toe" pos="0.3 0 0"><joint name="q" axis="0 1 0"/>{body}</body>'
    world = f'<body name="foot" pos="0 0 1" quat="0.8 0 0.6 0"><freejoint/>{body}{toe}</body>'
    (tmp_path / "foot.xml").write_text(f"<mujoco><worldbody>{world}</worldbody><equality>{said}</equality></mujoco>")
    both = Beside(tmp_path / "foot.xml")
    assert ncgen.freedom(both.kernels).dof == 1
    assert both.closed_error(np.random.default_rng(1), states=1) < 1e-9


@pytest.mark.parametrize("flag", ["equality", "constraint"])
def test_equalities_that_are_switched_off(flag, tmp_path):
    said = CASES["a constant"] + '<weld body1="a" body2="d" active="false"/>'
    off = ncgen.load(chain(tmp_path / "chain.xml", said, option=f'<option><flag {flag}="disable"/></option>'))
    on = ncgen.load(chain(tmp_path / "on.xml", said))
    assert len(off.rows) == len(on.rows) - 1


def test_softness_is_told(tmp_path):
    said = '<joint joint1="q" joint2="r" solref="0.005 1"/><joint joint1="u" joint2="r"/>'
    assert "softness of equalities, which are rigid here (1)" in ncgen.load(chain(tmp_path / "chain.xml", said)).left_out


def test_frames_that_are_apart_are_brought_together(tmp_path):
    """Joints move to where the loop is closed, and count from the zeros of the file; rows over them count from its references."""
    said = APART + '<joint joint1="s" polycoef="0.02 0 0 0 0"/>'
    both = Beside(chain(tmp_path / "chain.xml", said, s='ref="0.1"'))
    moved = [both.kernels.q0[both.kernels.index[name]] for name in "qr"]
    assert max(map(abs, moved)) > 0.01
    assert both.closed_error(np.random.default_rng(1), states=1) < 1e-9


def test_frames_that_never_meet_are_refused_with_the_gap(tmp_path):
    said = '<connect name="far" site1="tip" site2="away"/>'
    with pytest.raises(ModelError, match="loop far cannot close: its frames stay"):
        ncgen.load(chain(tmp_path / "chain.xml", said))


FREE = """<mujoco><worldbody><site name="nail" pos="0.3 0 0.4" quat="0.8 0 0.6 0"/>
<body name="a" pos="0 0 1"><freejoint/><site name="tip" pos="0.1 0 0"/>
<inertial pos="0 0 -0.3" mass="1" diaginertia="0.02 0.02 0.01"/></body>
<body name="b" pos="1 0 1"><freejoint/><site name="eye" pos="0 0.1 0" quat="1 0.2 0 0"/>
<inertial pos="0 0.1 -0.3" mass="1" diaginertia="0.02 0.02 0.01"/></body></worldbody>
<equality><connect site1="tip" site2="nail"/><weld site1="eye" site2="tip"/></equality></mujoco>"""


def test_free_bodies_are_brought_together(tmp_path):
    """To the world's site by a ball, and to each other by a weld."""
    path = tmp_path / "free.xml"
    path.write_text(FREE)
    both = Beside(path)
    assert ncgen.freedom(both.kernels).dof == 3
    assert both.closed_error(np.random.default_rng(1), states=2) < 1e-9
