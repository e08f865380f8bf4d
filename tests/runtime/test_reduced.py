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


def test_a_driver_under_way():
    """A carriage moves evenly beside the hinge of a damped arm, which it would push at rest: as many steps as on independent
    coordinates, whose Jacobian is exact, or twice as many."""
    m = ncgen.Model("arm")
    A, B, C, D = m.point("A", (0, 0), fixed=True), m.point("B", (1, 0)), m.point("C", (0.3, 0.4)), m.point("D", (0, 0.4))
    e = m.vector("e", (1, 0), fixed=False)
    arm = m.body("arm", [A, B, D], [e], mass=1.0, inertia=0.1)
    carriage = m.body("carriage", [C], [e], mass=2.0, inertia=0.05)
    m.prismatic(arm, carriage, D, C, e)
    phi = m.angle("phi", m.vector("x", (1, 0), fixed=True), e, m.vector("z", (0, 0, 1), fixed=True))
    m.torsion_spring(phi, stiffness=1e3, damping=1e4)
    m.drive(m.slide("s", D, C, e), 0.3 + 0.4 * m.time)
    m.gravity((0, -9.81))
    kernels = ncgen.compile(m)
    exact = ncgen.simulate(kernels, 1.0, rtol=1e-11, formalism="coordinate-partitioning", integrator="radau")
    apart = ncgen.simulate(kernels, 1.0, rtol=1e-8, formalism="coordinate-partitioning", integrator="radau")
    run = ncgen.simulate(kernels, 1.0, rtol=1e-8, formalism="lagrange", integrator="radau")
    assert run.engine == "emitted" and run.statistics.steps < 2 * apart.statistics.steps + 20
    assert np.max(np.abs(run.q - exact.q)) < 1e-9


def test_a_driver_that_pushes_a_body_beside_its_hinge():
    """A carriage is driven along a turning body: angular momentum stays, and the steps are as many as with the matrix of all coordinates.
    The joints' velocities that a driver gives are measured as those of a state are, not by the least kinetic energy."""
    m = ncgen.Model("spinner")
    O, A, C = m.point("O", (0, 0), fixed=True), m.point("A", (0, 0.4)), m.point("C", (0.5, 0.4))
    e = m.vector("e", (1, 0, 0), fixed="z")
    base = m.body("base", [O, A], [e], mass=1.0, com=(0, 0), inertia=1.5)
    carriage = m.body("carriage", [C], [e], mass=2.0, com=(0.5, 0.4), inertia=0.3)
    m.prismatic(base, carriage, A, C, e)
    s = m.slide("s", A, C, e)
    m.independent(m.angle("phi", m.vector("x", (1, 0, 0), fixed=True), e, m.vector("z", (0, 0, 1), fixed=True)))
    m.drive(s, 0.5 + 0.7 * m.time)
    kernels = ncgen.compile(m)
    runs = [ncgen.simulate(kernels, 2.0, zd0={"phi": 1.3}, rtol=1e-8, integrator="radau", engine=engine) for engine in ("auto", "c")]
    assert runs[0].engine == "emitted"
    for run in runs:
        momentum = (1.8 + 2.0 * (0.4**2 + run["s"] ** 2)) * run["rate(phi)"] - 2.0 * 0.4 * run["rate(s)"]
        assert momentum == pytest.approx(momentum[0], abs=1e-7)
    assert runs[0].statistics.steps < 1.2 * runs[1].statistics.steps


def test_where_it_cannot_go_on_the_matrix_does():
    """The governor closes a loop near a singular position, where Newton's steps in the degrees of freedom do not end."""
    model = ncgen.load("flyball")
    kernels, options = ncgen.compile(model), model.simulation_options
    run = ncgen.simulate(kernels, **{"duration": 1.0, **options})
    exact = ncgen.simulate(kernels, **{"duration": 1.0, **options, "integrator": "dop853", "rtol": 1e-11})
    assert 0 < run.statistics.fallbacks < run.statistics.evaluations
    assert np.max(np.abs(run.q - exact.q)) < 1e-6


def test_steps_that_fail_bound_those_after_them():
    """The governor's dampers turn within a step, which Newton's method sees only in short ones."""
    done = ncgen.simulate(ncgen.compile(ncgen.load("flyball")), 1.0).statistics
    assert done.repeated_steps < done.steps / 4
    assert not done.fallbacks
