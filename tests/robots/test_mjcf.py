"""Robots from MJCF beside MuJoCo itself."""

from pathlib import Path

import numpy as np
import pytest

import ncgen
from ncgen.errors import ModelError

mujoco = pytest.importorskip("mujoco", reason="MJCF is read by MuJoCo: pip install 'ncgen[robots]'")

HERE = Path(__file__).parent
JOINTS = ("run", "nod", "tilt", "spin", "look")


def test_mass_bias_and_springs_equal_mujoco():
    """Of all joints with a coordinate, in random positions and at random rates; the free body stays where it is."""
    kernels = ncgen.compile(ncgen.load(HERE / "gantry.xml"), "numpy")
    space = ncgen.joint_space(kernels)
    theirs = mujoco.MjModel.from_xml_path(str(HERE / "gantry.xml"))
    data, rng = mujoco.MjData(theirs), np.random.default_rng(7)
    mine = [space.rates.index(name) for name in JOINTS]
    dofs = [theirs.joint(name).dofadr[0] for name in JOINTS]
    for _ in range(10):
        values, v = rng.uniform(-1, 1, len(JOINTS)), np.zeros(space.n)
        v[mine] = rng.normal(size=len(JOINTS))
        data.qpos[[theirs.joint(name).qposadr[0] for name in JOINTS]] = values
        data.qvel[dofs] = v[mine]
        mujoco.mj_forward(theirs, data)
        mass = np.zeros((theirs.nv, theirs.nv))
        mujoco.mj_fullM(theirs, data, mass)
        q = space.position(dict(zip(JOINTS, values, strict=True)))
        np.testing.assert_allclose(space.mass_matrix(q)[np.ix_(mine, mine)], mass[np.ix_(dofs, dofs)], rtol=0, atol=1e-13)
        np.testing.assert_allclose(space.inverse_dynamics(q, v)[mine], data.qfrc_bias[dofs], rtol=0, atol=1e-12)
        np.testing.assert_allclose(space.loads(q, v)[mine], data.qfrc_passive[dofs], rtol=0, atol=1e-13)
        # an acceleration needs the rotor's inertia, too
        a = rng.normal(size=space.n)
        needed = space.inverse_dynamics(q, v, a) - space.inverse_dynamics(q, v)
        np.testing.assert_allclose(needed, space.mass_matrix(q) @ a, rtol=0, atol=1e-12)


def test_rotors_are_in_the_motion():
    """The default run and accelerations over the joints say the same."""
    kernels = ncgen.compile(ncgen.load(HERE / "gantry.xml"))
    space = ncgen.joint_space(kernels)
    q = space.position({"nod": 0.5, "tilt": -0.3})
    acceleration = space.forward_dynamics(q)
    h = 1e-4
    run = ncgen.simulate(kernels, h, q0=q, points=2, rtol=1e-12)
    T = space.velocities(q, np.eye(space.n)).T
    gained = np.linalg.lstsq(T, run.qd[-1], rcond=None)[0] / h
    np.testing.assert_allclose(gained, acceleration, rtol=0, atol=20 * h * np.max(np.abs(acceleration)))


def test_what_is_left_out_is_told():
    said = ncgen.load(HERE / "gantry.xml").left_out
    assert said == ("actuators (1)", "limits of joints (1)", "friction of joints (1)")


def test_a_connection_closes_the_same_loop_as_a_hinge_of_sdf():
    runs = []
    for file in ("fourbar.xml", "fourbar.sdf"):
        kernels = ncgen.compile(ncgen.load(HERE / file), "numpy")
        assert ncgen.freedom(kernels).dof == 1
        run = ncgen.simulate(kernels, 1.0, rtol=1e-10)
        runs.append(np.stack([run[name] for name in ("motor", "elbow", "pillar")]))
    assert np.ptp(runs[0][0]) > 1.0
    np.testing.assert_allclose(runs[0], runs[1], rtol=0, atol=2e-8)


TENDON = """<tendon><fixed name="t"><joint joint="spin" coef="2"/><joint joint="nod" coef="-1"/></fixed>
<fixed name="s"><joint joint="look" coef="3"/></fixed></tendon>
<equality><tendon name="belt" tendon1="t" tendon2="s" polycoef="0 0.5 0 0 0"/></equality>"""


POINTS = """<tendon><spatial name="t"><site site="here"/><site site="there"/></spatial></tendon>
<equality><tendon name="belt" tendon1="t"/></equality>"""


def test_coupled_tendons_are_rows_over_joints(tmp_path):
    """2 spin − nod = ½ · 3 look, from beginning to end."""
    path = tmp_path / "gantry.xml"
    path.write_text((HERE / "gantry.xml").read_text().replace("<actuator>", f"{TENDON}<actuator>", 1))
    kernels, free = (ncgen.compile(ncgen.load(file), "numpy") for file in (path, HERE / "gantry.xml"))
    assert ncgen.freedom(kernels).dof == ncgen.freedom(free).dof - 1
    run = ncgen.simulate(kernels, 0.2, points=3)
    assert max(np.ptp(run[name]) for name in ("spin", "nod", "look")) > 1e-3
    np.testing.assert_allclose(2 * run["spin"] - run["nod"], 1.5 * run["look"], rtol=0, atol=1e-9)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("<mujoco", "<mujoco></mujoco><mujoco", "line 1: no XML: junk after document element"),
        ('type="slide"', 'type="rope"', "gantry.xml: XML Error"),
        ('mass="3"', 'mass="-3"', "gantry.xml: "),
        ("<actuator>", POINTS + "<actuator>", "equality belt couples tendons through points; only those over joints are read"),
    ],
)
def test_what_is_wrong_is_one_line(tmp_path, old, new, said):
    text = (HERE / "gantry.xml").read_text().split("\n", 1)[1]
    path = tmp_path / "gantry.xml"
    text = text.replace("<worldbody>", '<worldbody><site name="here"/>')
    text = text.replace('<body name="tool"', '<site name="there"/><body name="tool"')
    path.write_text(text.replace(old, new, 1))
    with pytest.raises(ModelError) as refused:
        ncgen.load(path)
    assert said in str(refused.value) and str(refused.value).startswith("gantry.xml")
    assert "\n" not in str(refused.value) and len(str(refused.value)) <= 300
