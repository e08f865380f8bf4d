"""The Stewart-Gough platform: counts, inverse and direct kinematics, leg forces against Newton and Euler's equations."""

import numpy as np
import pytest
import sympy as sp

import ncgen
from ncgen.exchange.examples import example_module
from ncgen.solver.loads.inverse_dynamics import motor_forces

STEWART = example_module("stewart")
LEGS = [f"s{i}" for i in range(1, 7)]
FEET = STEWART.circle(*STEWART.BASE, 0.0)
HEADS = STEWART.circle(*STEWART.TOP, 0.0)
"""Heads relative to the platform's centre, shape (6, 3)."""


@pytest.fixture(scope="module")
def platform():
    return ncgen.compile(STEWART.build(), backend="numpy")


def test_freedom(platform):
    found = ncgen.freedom(platform)
    assert (found.dof, len(found.redundant), found.is_singular) == (6, 0, False)


def test_assembles_near_the_drawing(platform):
    noise = 0.01 * platform.length * np.random.default_rng(2).standard_normal(platform.n)
    q = ncgen.assemble(platform, platform.q0 + noise)
    assert np.max(np.abs(platform.phi(q) / platform.row_sizes)) < 1e-10
    assert np.max(np.abs(q - platform.q0)) < 0.05 * platform.length


def test_energy(platform):
    rates = {"s1": 0.6, "s2": -0.3, "s4": 0.4}
    run = ncgen.simulate(platform, 0.2, integrator="dop853", rtol=1e-9, atol=1e-11, points=5, zd0=rates)
    assert run.energy_drift < 1e-8
    assert np.max(run.violation()) < 1e-10


@pytest.mark.parametrize(
    ("centre", "turn"),
    [((0.3, -0.2, 2.2), (0.2, -0.1, 0.3)), ((-0.4, 0.1, 1.7), (-0.25, 0.2, -0.3)), ((0.0, 0.5, 2.0), (0.0, 0.3, 0.0))],
)
def test_inverse_and_direct_kinematics(platform, centre, turn):
    """Leg lengths of a pose in closed form; moving the legs there must bring the platform to the pose."""
    heads = centre + HEADS @ np.array(sp.rot_axis1(-turn[0]) * sp.rot_axis2(-turn[1]) * sp.rot_axis3(-turn[2]), dtype=float).T
    lengths = np.linalg.norm(heads - FEET, axis=1)
    q = ncgen.move(platform, platform.q0, dict(zip(LEGS, lengths, strict=True)), steps=4).q
    places = [[q[platform.index[f"P{i}.{axis}"]] for axis in "xyz"] for i in range(1, 7)]
    np.testing.assert_allclose(places, heads, atol=1e-10)


def test_leg_forces_of_a_known_motion(platform):
    """The legs are driven along a motion in closed form; forces must be those of the free platform's momentum balance."""
    driven = STEWART.build()
    heads, pose = known_motion(driven.time)
    for leg, head, foot in zip(LEGS, heads, FEET, strict=True):
        driven.drive(driven.elements[leg], sp.sqrt(sum((x - float(b)) ** 2 for x, b in zip(head, foot, strict=True))))
    drive = ncgen.compile(driven, backend="numpy")
    assert ncgen.freedom(drive).dof == 0
    run = ncgen.simulate(drive, 1.0, points=6, rtol=1e-6)
    assert np.max(np.abs(run.point("P1") - [pose(t)[0] + pose(t)[3] @ HEADS[0] for t in run.t])) < 1e-10

    where = [platform.index[leg] for leg in LEGS]
    for t, q, qd, qdd in zip(run.t, run.q, run.qd, run.qdd, strict=True):
        forces, _ = motor_forces(platform, LEGS, t, q, qd, qdd)
        springs = spring_forces(q[where], qd[where])
        expected = newton_euler(*pose(t))
        np.testing.assert_allclose(forces + springs, expected, rtol=1e-9, atol=1e-9 * STEWART.MASS * 9.81)


def spring_forces(s, rate, stiffness=2e5, damping=4e3):
    """The pushes (N) of the example's legs; without motion their vertical parts carry the weight at the start."""
    start = np.linalg.norm(HEADS[0] + [0, 0, STEWART.HEIGHT] - FEET[0])
    weight = STEWART.MASS * 9.81 / 6 * start / STEWART.HEIGHT
    return weight - stiffness * (s - start) - damping * rate


def known_motion(t):
    """Heads as expressions of time t, and a function of a number t: centre, velocity, acceleration, turn and its derivatives."""
    sway = sp.Matrix([0.3 * sp.sin(2 * t), 0.2 * sp.sin(3 * t), STEWART.HEIGHT + 0.15 * sp.sin(4 * t)])
    turn = sp.rot_axis3(-sp.sin(2 * t) / 4) * sp.rot_axis1(-sp.sin(3 * t) / 5)
    heads = [sway + turn * sp.Matrix(head) for head in HEADS]
    terms = [f.diff(t, k) for f in (sway, turn) for k in range(3)]
    numbers = sp.lambdify(t, terms, "numpy", cse=True)

    def pose(instant):
        values = [np.array(x, dtype=float) for x in numbers(instant)]
        return [x.ravel() for x in values[:3]] + values[3:]

    return heads, pose


def newton_euler(centre, _, acceleration, R, dR, ddR):
    """Six pushes along massless legs (N): Σ f e = m (a − g), Σ f (r × e) = J ω̇ + ω × J ω about the centre."""
    spin, change = axial(dR @ R.T), axial(ddR @ R.T + dR @ dR.T)
    inertia = R @ np.diag(STEWART.INERTIA) @ R.T
    arms = HEADS @ R.T
    along = centre + arms - FEET
    along /= np.linalg.norm(along, axis=1)[:, None]
    force = STEWART.MASS * (acceleration + [0, 0, 9.81])
    moment = inertia @ change + np.cross(spin, inertia @ spin)
    return np.linalg.solve(np.vstack([along.T, np.cross(arms, along).T]), np.concatenate([force, moment]))


def axial(matrix):
    """ω of the skew-symmetric ω̃."""
    return np.array([matrix[2, 1] - matrix[1, 2], matrix[0, 2] - matrix[2, 0], matrix[1, 0] - matrix[0, 1]]) / 2
