"""Radau over all coordinates of a tree of bodies: Newton's steps take place in its degrees of freedom."""

from __future__ import annotations

import numpy as np
import pytest

import ncgen

LINKS = 6


def link(i: int, joint: str) -> str:
    """A link of 0.3 m, hinged to the one before it, in the words of URDF."""
    return f"""
  <link name="l{i}"><inertial><origin xyz="0.02 0.03 0.15"/><mass value="{0.02 + 0.01 * i}"/>
    <inertia ixx="2e-5" iyy="3e-5" izz="1e-5" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="j{i}" type="continuous"><parent link="l{i - 1}"/><child link="l{i}"/><origin xyz="0 0 0.3" rpy="{0.3 * i} 0.7 0"/>
    <axis xyz="0 {i % 2} {1 - i % 2}"/>{joint}</joint>"""


def arm(tmp_path, joint: str) -> ncgen.Kernels:
    links = "".join(link(i, joint) for i in range(1, LINKS + 1))
    path = tmp_path / "arm.urdf"
    path.write_text(f'<robot name="arm"><link name="l0"/>{links}</robot>')
    return ncgen.compile(ncgen.load(str(path)))


@pytest.mark.parametrize(
    ("joint", "most"),
    [('<dynamics damping="3.0"/>', 2_500), ('<dynamics damping="0.5" friction="0.2"/>', 9_000)],
    ids=["damped", "with friction"],
)
def test_damped_joints_are_no_cliff(tmp_path, joint, most):
    """Dampers on light links: the eigenvalue is about -1e5 1/s. The default call finds it within some steps and goes on in six degrees of
    freedom; the same motion comes from independent coordinates, whose Jacobian is exact."""
    kernels = arm(tmp_path, joint)
    run = ncgen.simulate(kernels, 1.0, rtol=1e-6)
    assert run.made_with.startswith("lagrange with radau, emitted")
    assert run.statistics.evaluations < most and run.statistics.fallbacks == 0
    exact = ncgen.simulate(kernels, 1.0, rtol=1e-9, formalism="coordinate-partitioning", integrator="radau")
    assert np.max(np.abs(run.q - exact.q)) < 1e-6
    assert np.max(np.abs(exact.q - exact.q[0])) > 1e-3


def test_a_damped_hinge_against_its_closed_form():
    """A rod on a hinge with a damper, J = m l²/3 = 1 kg m²: its speed falls as exp(-c t / J), c / J = 1e4 1/s, and it turns by v0 J / c."""
    m = ncgen.Model("rod")
    A, B = m.point("A", (0, 0, 0), fixed=True), m.point("B", (1, 0, 0))
    x, z = m.vector("x", (1, 0, 0), fixed=True), m.vector("z", (0, 0, 1), fixed=True)
    side = m.vector("side", (0, 1, 0))
    m.body("rod", [A, B], [side, z], mass=3.0, com=(0.5, 0, 0), inertia=(0.25, 0.25, 0.25))
    m.torsion_spring(m.angle("phi", x, B - A, z), damping=1e4)
    run = ncgen.simulate(ncgen.compile(m), 1.0, zd0={"phi": 2.0}, rtol=1e-8, formalism="lagrange", integrator="radau")
    assert run.engine == "emitted"
    assert run["phi"][-1] == pytest.approx(2e-4, abs=1e-11)


@pytest.mark.parametrize("name", ["robot", "fourbar", "slidercrank3d", "delta", "heavytop", "arm"])
def test_motions_that_are_not_stiff(name):
    """Loops, drivers and balls: the same motion as by an explicit method, and fewer Jacobians than steps."""
    model = ncgen.load(name)
    kernels, start = ncgen.compile(model), {k: v for k, v in model.simulation_options.items() if k in ("zd0", "qd0")}
    exact = ncgen.simulate(kernels, 0.3, rtol=1e-11, **start)
    run = ncgen.simulate(kernels, 0.3, rtol=1e-8, formalism="lagrange", integrator="radau", **start)
    assert run.statistics.jacobians < run.statistics.steps
    assert np.max(np.abs(run.q - exact.q)) < 1e-5 * max(1.0, np.max(np.abs(exact.q)))
