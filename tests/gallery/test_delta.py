"""The delta robot: counts and redundancy, direct kinematics by three spheres, and motor torques by virtual work."""

import numpy as np
import pytest

import ncgen
from ncgen.exchange.examples import example_module
from ncgen.solver.loads.inverse_dynamics import motor_forces

DELTA = example_module("delta")
MOTORS = ["psi1", "psi2", "psi3"]
OUT = np.column_stack([np.cos(DELTA.TURNS), np.sin(DELTA.TURNS), np.zeros(3)])
POSES = [(0.3, 0.3, 0.3), (0.9, 0.1, 0.4), (-0.3, 0.2, 0.0), (1.1, 1.0, 0.6)]


@pytest.fixture(scope="module")
def robot():
    return ncgen.compile(DELTA.build(), backend="numpy")


def test_three_translations_and_six_redundant_rows(robot):
    """Clavel: three degrees of freedom. Per parallelogram, the normal's four rows say one thing twice (its sides close), and
    that its platform side stays in plane is said by the other two already."""
    found = ncgen.freedom(robot)
    assert (found.dof, len(found.redundant), found.is_singular) == (3, 6, False)
    assert {robot.rows[r.row].owner.name[:3] for r in found.redundant} <= {"rod", "mod"}


def test_ball_joints_are_not_redundant_and_move_alike(robot):
    balls = ncgen.compile(DELTA.build(hinged=False), backend="numpy")
    found = ncgen.freedom(balls)
    assert (found.dof, len(found.redundant)) == (3, 0)
    options = dict(integrator="dop853", rtol=1e-9, atol=1e-11, points=5)
    runs = [ncgen.simulate(kernels, 0.15, **options) for kernels in (robot, balls)]
    assert max(run.energy_drift for run in runs) < 1e-8
    np.testing.assert_allclose(runs[0].point("C"), runs[1].point("C"), atol=1e-10)


def test_assembles_near_the_drawing(robot):
    noise = 0.01 * robot.length * np.random.default_rng(3).standard_normal(robot.n)
    q = ncgen.assemble(robot, robot.q0 + noise)
    assert np.max(np.abs(robot.phi(q) / robot.row_sizes)) < 1e-10
    assert np.max(np.abs(q - robot.q0)) < 0.2


@pytest.mark.parametrize("angles", POSES)
def test_direct_kinematics(robot, angles):
    q = turned(robot, angles)
    tool = [q[robot.index[f"C.{axis}"]] for axis in "xyz"]
    np.testing.assert_allclose(tool, centre(np.array(angles)) - [0, 0, DELTA.TOOL], atol=1e-12)


@pytest.mark.parametrize("angles", POSES)
def test_motors_that_hold_the_weight(robot, angles):
    """At rest a motor's torque is ∂V/∂ψ of the closed form, differentiated by a complex step."""
    q = turned(robot, angles)
    control = -DELTA.STIFFNESS * (np.array(angles) - DELTA.START)
    missing, _ = motor_forces(robot, MOTORS, 0.0, q, np.zeros(robot.n), np.zeros(robot.n))
    steps = np.array(angles) + 1e-30j * np.eye(3)
    expected = [weight_potential(step).imag / 1e-30 for step in steps]
    np.testing.assert_allclose(missing + control, expected, rtol=1e-11)


def turned(robot, angles):
    return ncgen.move(robot, robot.q0, dict(zip(MOTORS, angles, strict=True)), steps=4).q


def centre(angles):
    """The platform's centre (m): the lower point common to three spheres of the rods' length about the shifted elbows."""
    knees = elbows(angles) - DELTA.PLATFORM * OUT
    a, b = knees[1] - knees[0], knees[2] - knees[0]
    normal = np.cross(a, b)
    square = normal @ normal
    middle = np.cross((a @ a) * b - (b @ b) * a, normal) / (2 * square)  # of the circle through the knees, from the first
    rise = np.sqrt((DELTA.ROD**2 - middle @ middle) / square)
    return knees[0] + middle - rise * normal


def elbows(angles):
    reach = DELTA.BASE + DELTA.ARM * np.cos(angles)
    return reach[:, None] * OUT - DELTA.ARM * np.sin(angles)[:, None] * np.array([0, 0, 1])


def weight_potential(angles, gravity=9.81):
    """J; an arm weighs in its middle, each of two rods in the middle between elbow and platform."""
    knees, height = elbows(angles)[:, 2], centre(angles)[2]
    arms = DELTA.ARM_MASS * np.sum(knees) / 2
    rods = 2 * DELTA.ROD_MASS * np.sum((knees + height) / 2)
    return gravity * (arms + rods + DELTA.PLATFORM_MASS * height)
