"""Forces that MJCF says beside gravity: accelerations of all natural coordinates at random states beside MuJoCo's."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import ncgen

pytest.importorskip("mujoco", reason="MJCF is read by MuJoCo: pip install 'ncgen[robots]'")

from by_mujoco import Beside  # noqa: E402

ARM = """<mujoco><compiler angle="radian"/>{option}<worldbody>
<body name="a" pos="0 0 1" quat="0.9 0.1 0.3 -0.2" {a}><joint name="q" axis="0.2 1 0" pos="0.1 0 0" {q}/>
<inertial pos="0.1 0.05 -0.2" mass="1.2" diaginertia="0.03 0.02 0.025"/>
<body name="b" pos="0.1 0 -0.4" {b}><joint name="s" type="slide" axis="1 0.3 0" {s}/>
<inertial pos="0 0.02 -0.1" mass="0.8" diaginertia="0.01 0.012 0.008"/>
<body name="c" pos="0 0.1 -0.3" quat="0.7 0.7 0 0.1" {c}><joint name="ball" type="ball" pos="0.02 0 0.03" {ball}/>
<inertial pos="0.1 0.05 -0.1" mass="0.5" diaginertia="0.004 0.005 0.003"/></body></body></body>
<body name="f" pos="1 2 3" quat="0.5 0.5 -0.5 0.5" {f}><joint type="free" name="free" {free}/>
<inertial pos="0.1 -0.05 0.2" mass="0.6" diaginertia="0.004 0.005 0.003"/></body>
</worldbody>{more}</mujoco>"""


def arm(path: Path, **said: str) -> Path:
    """The file, with attributes of its parts."""
    names = ("option", "a", "b", "c", "f", "q", "s", "ball", "free", "more")
    path.write_text(ARM.format(**{name: said.get(name, "") for name in names}))
    return path


CASES = {
    "springs and dampers": {"q": 'stiffness="3" springref="0.4" damping="0.2"', "s": 'stiffness="30" damping="2"'},
    "polynomials": {"q": 'stiffness="3 -1 2" springref="0.4" damping="0.2 0.1 0.3"', "s": 'stiffness="0 5 7" damping="0 2 1"'},
    "a ball's spring": {"ball": 'stiffness="2"'},
    "a ball's spring and damper": {"ball": 'stiffness="2 0.5 0.3" damping="0.2 0.1 0.05"'},
    "of a free body": {"free": 'stiffness="4 0.5 0.3" damping="0.2 0.1 0.05"'},
    "linear, of a free body": {"free": 'stiffness="4" damping="0.2"'},
    "compensated weights": {"a": 'gravcomp="1"', "b": 'gravcomp="0.4"', "c": 'gravcomp="-0.3"', "f": 'gravcomp="1.7"'},
    "no springs": {"option": '<option><flag spring="disable"/></option>', "q": 'stiffness="3" damping="1"', "ball": 'stiffness="2"'},
    "no dampers": {"option": '<option><flag damper="disable"/></option>', "q": 'stiffness="3" damping="1"', "ball": 'damping="2"'},
    "nothing passive": {
        "option": '<option><flag damper="disable" spring="disable"/></option>',
        "q": 'stiffness="3" damping="1"',
        "a": 'gravcomp="1"',
    },
    "no gravity": {"option": '<option><flag gravity="disable"/></option>', "q": 'stiffness="3"', "a": 'gravcomp="1"'},
    "motors' rotors and dampers": {
        "q": 'armature="0.01" damping="0.1"',
        "more": '<actuator><motor joint="q" gear="3" armature="0.002" damping="0.03 0.01 0.02"/>'
        '<general joint="q" gear="2" armature="0.001" damping="0.01"/></actuator>',
    },
}
"""Attributes of the arm's parts: one thing at a time."""

TOGETHER = {
    "a": 'gravcomp="1"', "c": 'gravcomp="-0.3"', "f": 'gravcomp="1.7"', "q": 'stiffness="3 -1 2" springref="0.4" damping="0.2 0.1 0.3"',
    "s": 'stiffness="30" damping="2"', "ball": 'stiffness="2 0.5" damping="0.2"', "free": 'stiffness="4" damping="0.2"',
    "more": CASES["motors' rotors and dampers"]["more"],
}  # fmt: skip


def test_accelerations_equal_mujoco(tmp_path):
    """All at once, at random states, where nothing has turned, and nearly there."""
    both = Beside(arm(tmp_path / "arm.xml", **TOGETHER))
    assert both.model.left_out == ("actuators (2)",)
    assert both.error(np.random.default_rng(3), states=4) < 1e-9
    for size in (0.0, 1e-12, 1e-7, 1e-3):
        assert both.error(np.random.default_rng(3), states=1, size=size) < 1e-9


def test_armature_of_a_ball_in_the_world_equals_mujoco(tmp_path):
    """With that of a motor, of which the first number of the gear counts."""
    path = tmp_path / "ball.xml"
    path.write_text("""<mujoco><worldbody><body pos="0 0 1"><body name="b" pos="0.1 0 0" quat="0.9 0.1 0.3 -0.2">
<joint name="ball" type="ball" pos="0 0.1 0" armature="0.3"/><inertial pos="0.1 0.05 -0.1" mass="0.5" diaginertia="0.004 0.005 0.003"/>
<body pos="0 0.2 0"><joint axis="0 1 0"/><inertial pos="0.1 0 0" mass="1" diaginertia="0.1 0.1 0.1"/></body></body></body></worldbody>
<actuator><motor joint="ball" gear="2 3 4" armature="0.1"/></actuator></mujoco>""")
    both = Beside(path)
    assert both.model.left_out == ("actuators (1)",) and both.error(np.random.default_rng(3), states=2) < 1e-9


def test_weights_that_are_only_increased_are_not(tmp_path):
    """MuJoCo compensates weights where one body has a factor of more than 0."""
    assert Beside(arm(tmp_path / "arm.xml", b='gravcomp="-0.4"')).error(np.random.default_rng(3), states=2) < 1e-9


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES)
def test_each_acceleration_equals_mujoco(case, tmp_path):
    both = Beside(arm(tmp_path / "arm.xml", **CASES[case]))
    assert both.error(np.random.default_rng(3), states=4) < 1e-9


@pytest.mark.parametrize(
    "flag, springs, potentials, gravity",
    [("spring", {"stiffness": 0.0, "damping": 1.0}, 1, -9.81), ("damper", {"stiffness": 3.0, "damping": 0.0}, 1, -9.81),
     ("gravity", {"stiffness": 3.0, "damping": 1.0}, 0, 0.0)],
)  # fmt: skip
def test_flags_switch_off(flag, springs, potentials, gravity, tmp_path):
    """As MuJoCo says in its documentation."""
    option = f'<option><flag {flag}="disable"/></option>'
    model = ncgen.load(arm(tmp_path / "arm.xml", option=option, q='stiffness="3" damping="1"', a='gravcomp="1"'))
    (found,) = model.springs
    assert {name: getattr(found, name) for name in springs} == springs
    assert len(model.potentials) == potentials and model.gravity_field[2] == gravity


def test_without_springs_and_dampers_nothing_is_passive(tmp_path):
    option = '<option><flag spring="disable" damper="disable"/></option>'
    model = ncgen.load(arm(tmp_path / "arm.xml", option=option, q='stiffness="3" damping="1"', a='gravcomp="1"'))
    assert not model.springs and not model.potentials and model.left_out == ()


FIRST_MOTION = """
import sys, warnings, ncgen
warnings.simplefilter("ignore")
ncgen.simulate(ncgen.compile(ncgen.load(sys.argv[1]), "c"), 1e-3)
print(*({"sympy", "http.client", "mujoco._structs", "jinja2", "ncgen.program.assemble"} & {*sys.modules}))
"""


def test_a_cached_motion_imports_little_and_a_changed_number_compiles_nothing(tmp_path, monkeypatch):
    """Not with springs and dampers of a ball, of a free body, polynomial ones of hinges and sliders, and compensated weights."""
    cache, path = tmp_path / "cache", arm(tmp_path / "arm.xml", **TOGETHER)
    monkeypatch.setenv("NCGEN_CACHE_DIR", str(cache))

    def imported():
        return subprocess.run([sys.executable, "-c", FIRST_MOTION, str(path)], capture_output=True, text=True, check=True).stdout.split()

    assert "mujoco._structs" in imported()
    assert imported() == []
    libraries = sorted(cache.glob("*/build.json"))
    changes = ('mass="0.5"', 'mass="0.52"'), ('stiffness="2 0.5"', 'stiffness="2.1 0.6"'), ('stiffness="4"', 'stiffness="4.2"')
    changes += (
        ('damping="0.2 0.1 0.3"', 'damping="0.21 0.11 0.3"'),
        ('pos="0.02 0 0.03"', 'pos="0.021 0 0.03"'),
        ('"0 0.1 -0.3"', '"0 0.11 -0.3"'),
    )
    for old, new in (*changes, ('gravcomp="1.7"', 'gravcomp="1.6"')):
        text = path.read_text()
        assert text.count(old) == 1
        path.write_text(text.replace(old, new))
        assert "sympy" not in imported(), new
        assert sorted(cache.glob("*/build.json")) == libraries, new
