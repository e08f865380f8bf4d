"""The excavator's arm: counts, cylinder lengths by the law of cosines, cylinder forces by virtual work."""

import numpy as np
import pytest

import ncgen
from ncgen.exchange.examples import example_module
from ncgen.solver.loads.inverse_dynamics import motor_forces

ARM = example_module("excavator")
CYLINDERS = ["lift", "crowd", "curl"]
POSES = [(0.75, -0.95, -1.4), (0.3, -1.2, -1.6), (1.0, -0.6, -1.5), (0.5, -1.4, -2.1)]
"""Angles of boom, stick and bucket to the horizontal (rad)."""


@pytest.fixture(scope="module")
def arm():
    return ncgen.compile(ARM.build(), backend="numpy")


def test_freedom(arm):
    found = ncgen.freedom(arm)
    assert (found.dof, len(found.redundant), found.is_singular) == (3, 0, False)


def test_assembles_near_the_drawing(arm):
    noise = 0.01 * arm.length * np.random.default_rng(4).standard_normal(arm.n)
    q = ncgen.assemble(arm, arm.q0 + noise)
    assert np.max(np.abs(arm.phi(q) / arm.row_sizes)) < 1e-10
    assert np.max(np.abs(q - arm.q0)) < 0.2


def test_energy(arm):
    run = ncgen.simulate(arm, 0.4, integrator="dop853", rtol=1e-9, atol=1e-11, points=5)
    assert run.energy_drift < 1e-8
    assert np.max(run.violation()) < 1e-10


@pytest.mark.parametrize("pose", POSES)
def test_cylinders_bring_the_arm_to_a_pose(arm, pose):
    q = posed(arm, pose)
    tips = [complex(q[arm.index[f"{p}.x"]], q[arm.index[f"{p}.y"]]) for p in "BCT"]
    np.testing.assert_allclose(np.angle(np.diff([0, *tips])), pose, atol=1e-10)


@pytest.mark.parametrize("pose", POSES)
def test_cylinders_hold_the_weight(arm, pose):
    """At rest Fᵀ δs = δV for every motion of the three parts; derivatives of the closed forms by a complex step."""
    q = posed(arm, pose)
    missing, _ = motor_forces(arm, CYLINDERS, 0.0, q, np.zeros(arm.n), np.zeros(arm.n))
    lengths = cylinder_lengths(np.array(pose))
    control = -ARM.STIFFNESS * (lengths - cylinder_lengths(np.array(list(ARM.START.values()))))
    steps = np.array(pose) + 1e-30j * np.eye(3)
    change = np.array([cylinder_lengths(step).imag for step in steps]) / 1e-30
    weight = np.array([weight_potential(step).imag for step in steps]) / 1e-30
    np.testing.assert_allclose(missing + control, np.linalg.solve(change, weight), rtol=1e-9)


def posed(arm, pose):
    lengths = cylinder_lengths(np.array(pose))
    return ncgen.move(arm, arm.q0, dict(zip(CYLINDERS, lengths, strict=True)), steps=4).q


# -- closed forms: triangles over the parts' angles -----------------------------------------------------


def cylinder_lengths(pose):
    """Lengths (m) of lift, crowd and curl, each the third side of a triangle whose angle is known."""
    boom, stick, bucket = pose
    lugs = {name: polar(*offset) for part in ARM.LUGS.values() for name, offset in part.items()}
    (g, at_g), (p, at_p) = polar(*ARM.FOOT), lugs["L"]
    lift = third_side(g, p, boom + at_p - at_g)

    d, at_d = polar(ARM.LUGS["boom"]["D"][0] - ARM.BOOM, ARM.LUGS["boom"]["D"][1])  # seen from the boom's end
    r, at_r = lugs["R"]
    crowd = third_side(d, r, stick + at_r - boom - at_d)

    # The linkage H-E-F over the line from H to the bucket's hinge C, then the triangle K-H-E; angles relative to the stick.
    x, y = ARM.LUGS["stick"]["H"]
    c, at_c = polar(ARM.STICK - x, -y)
    f, at_f = lugs["F"]
    at_bucket = bucket - stick + at_f
    corner = np.pi + at_c - at_bucket  # at C, from F to H
    span = third_side(c, f, corner)
    below = np.arcsin(f * np.sin(corner) / span)  # at H, from F to C
    above = np.arccos((span**2 + ARM.ROCKER**2 - ARM.LINK**2) / (2 * span * ARM.ROCKER))  # at H, from F to E
    k, at_k = polar(ARM.LUGS["stick"]["K"][0] - x, ARM.LUGS["stick"]["K"][1] - y)
    curl = third_side(k, ARM.ROCKER, at_k - (at_c + below + above))
    return np.array([lift, crowd, curl])


def third_side(a, b, angle):
    return np.sqrt(a * a + b * b - 2 * a * b * np.cos(angle))


def polar(x, y):
    return np.hypot(x, y), np.arctan2(y, x)


def weight_potential(pose, gravity=9.81):
    """J, from the heights of the centres of mass."""
    height, total = 0.0, 0.0
    for (name, (along, across)), angle in zip(ARM.CENTRES.items(), pose, strict=True):
        total += ARM.MASSES[name] * gravity * (height + along * np.sin(angle) + across * np.cos(angle))
        height = height + ARM.SPANS[name] * np.sin(angle)
    return total
