"""Moments of inertia that no body has, taken as a file gives them: right as long as the mass matrix is positive definite, else refused."""

import warnings

import numpy as np
import pytest

import ncgen
from ncgen.errors import ModelError, SingularError
from ncgen.exchange.toml_writer import to_toml
from ncgen.solver.positions import negative_mass

ARM = """<robot name="r"><link name="a"/>
<link name="b"><inertial><origin xyz="0.5 0.1 0.2" rpy="0.1 0.2 0.3"/><mass value="2"/>
<inertia ixx="{ixx}" iyy="0.3" izz="0.1" ixy="0.01" ixz="0" iyz="0.02"/></inertial></link>
<link name="c"><inertial><origin xyz="0.1 0.3 0.2"/><mass value="1"/>
<inertia ixx="0.01" iyy="0.9" izz="0.2" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="j" type="continuous"><parent link="a"/><child link="b"/><axis xyz="0 1 0"/></joint>
<joint name="k" type="continuous"><parent link="b"/><child link="c"/><origin xyz="1 0 0" rpy="0.3 0.1 0"/>
<axis xyz="0.6 0 0.8"/></joint></robot>"""

TURNING = """<robot name="r"><link name="a"/><link name="b"/>
<link name="c"><inertial><origin xyz="{x} 0 0"/><mass value="1"/>
<inertia ixx="0.1" iyy="{y}" izz="{z}" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="j" type="continuous"><parent link="a"/><child link="b"/><axis xyz="0 1 0"/></joint>
<joint name="k" type="continuous"><parent link="b"/><child link="c"/><axis xyz="1 0 0"/></joint></robot>"""
"""About j the moment of inertia is y cos² k + z sin² k + x²."""


def given(folder, text):
    """A robot whose moments are taken as given, without the warning of it."""
    (folder / "r.urdf").write_text(text)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return ncgen.load(folder / "r.urdf", inertias="as given")


def test_they_are_accepted_with_a_warning_that_counts_bodies(tmp_path):
    (tmp_path / "r.urdf").write_text(ARM.format(ixx=0.9))
    with pytest.raises(ModelError, match="body b: no body has principal moments.*; inertias='as given' takes the file's numbers$"):
        ncgen.load(tmp_path / "r.urdf")
    with pytest.warns(UserWarning, match=r"^r: moments of inertia that no body has are taken as given, those of b first \(2\)$"):
        ncgen.load(tmp_path / "r.urdf", inertias="as given")
    with pytest.raises(ModelError, match="inertias: 'guessed' given; give 'refused', 'balanced' or 'as given'"):
        ncgen.load(tmp_path / "r.urdf", inertias="guessed")


@pytest.mark.parametrize("ixx", [0.9, -5.0])
def test_they_are_those_of_pinocchio(tmp_path, ixx):
    pin = pytest.importorskip("pinocchio")
    space = ncgen.joint_space(ncgen.compile(given(tmp_path, ARM.format(ixx=ixx)), backend="numpy"))
    model = pin.buildModelFromXML(ARM.format(ixx=ixx))
    data, x, v, a = model.createData(), (0.4, -0.7), np.array([1.0, 2.0]), np.array([3.0, -1.0])
    turns = np.array([np.cos(x[0]), np.sin(x[0]), np.cos(x[1]), np.sin(x[1])])
    q = space.position(dict(zip("jk", x, strict=True)))
    mass = np.triu(pin.crba(model, data, turns))
    np.testing.assert_allclose(space.mass_matrix(q), mass + np.triu(mass, 1).T, atol=1e-13)
    np.testing.assert_allclose(space.inverse_dynamics(q, v, a), pin.rnea(model, data, turns, v, a), atol=1e-13)
    np.testing.assert_allclose(space.forward_dynamics(q, v), pin.aba(model, data, turns, v, np.zeros(2)), atol=1e-12)


def test_a_run_keeps_its_energy(tmp_path):
    kernels = ncgen.compile(given(tmp_path, ARM.format(ixx=0.9)), backend="numpy")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert abs(ncgen.simulate(kernels, 1.0, zd0={"j": 1.0}).energy_drift) < 1e-7


WORDS = "the mass matrix is not positive definite by body c, whose moments of inertia no body has; correct them, or load the robot with"


@pytest.mark.parametrize("formalism", ["auto", "coordinate-partitioning"])
def test_a_run_that_begins_with_a_negative_mass_is_refused_by_the_bodys_name(tmp_path, formalism):
    kernels = ncgen.compile(given(tmp_path, TURNING.format(x=0, y=-1, z=2)), backend="numpy")
    with pytest.raises(SingularError, match=f"^r: at t = 0 s {WORDS}"):
        ncgen.simulate(kernels, 1.0, formalism=formalism)


def driven(folder, x, backend="numpy"):
    """j with the moment cos 2t + x² is negative from then on; k turns at 1 rad/s."""
    model = given(folder, TURNING.format(x=x, y=1, z=-1))
    model.drive(model.elements["k"], model.time)
    return ncgen.compile(model, backend=backend)


def test_a_run_that_comes_to_a_negative_mass_is_refused_by_the_bodys_name(tmp_path):
    with pytest.raises(SingularError, match=f"^r: at t = 0.8.* s {WORDS}"):  # arccos(-0.04) / 2 = 0.805
        ncgen.simulate(driven(tmp_path, 0.2, "c"), 1.5, zd0={"j": 1.0})


def test_a_run_that_passes_a_negative_mass_warns_with_the_bodys_name(tmp_path):
    """Without a force and a velocity nothing stops it; of the twenty instants that are looked at 0.855 s is the first after π/4."""
    with pytest.warns(UserWarning, match=f"^r: at t = 0.855 s {WORDS}"):
        ncgen.simulate(driven(tmp_path, 0.0), 1.5)


@pytest.mark.parametrize("name", ["bennett", "chain", "heavytop", "pendulum", "stewart"])
def test_the_energies_of_bodies_make_that_of_the_mass_matrix(name):
    """The body that is named is the one with the least kinetic energy; together they have ½ q̇ᵀ M q̇ in any motion."""
    kernels = ncgen.compile(ncgen.load(name), backend="numpy")
    p = kernels.present(0.0, kernels.p0)
    _, motions, M = negative_mass.principal_motions(kernels, kernels.q0, 0.0, p)
    bodies = [body for body in kernels.model.bodies.values() if body.own_inertia is not None]
    for k in range(2):
        qd = motions @ np.cos(np.arange(motions.shape[1]) + k)
        energies = [negative_mass._kinetic_energy(kernels, body, qd, p) for body in bodies]
        assert sum(energies) == pytest.approx(qd @ M @ qd / 2, rel=1e-12)


def test_they_may_be_parameters(tmp_path):
    (tmp_path / "r.urdf").write_text(ARM.format(ixx=0.9))
    with pytest.warns(UserWarning, match="taken as given"):
        model = ncgen.load(tmp_path / "r.urdf", inertias="as given", parameters="inertia")
    space = ncgen.joint_space(ncgen.compile(model, backend="numpy"))
    fixed = ncgen.joint_space(ncgen.compile(given(tmp_path, ARM.format(ixx=0.9)), backend="numpy"))
    M, expected = (each.mass_matrix(each.position({"k": 0.5})) for each in (space, fixed))
    np.testing.assert_allclose(M, expected, atol=1e-13)


def test_they_go_through_toml(tmp_path):
    text = to_toml(given(tmp_path, ARM.format(ixx=0.9)))
    (tmp_path / "r.toml").write_text(text)
    again = ncgen.load(tmp_path / "r.toml")
    assert text.count("as_given = true") == 2 and to_toml(again) == text
    assert not again.bodies["b"].inertia.is_judged
