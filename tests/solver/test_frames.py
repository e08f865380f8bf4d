"""Orientation and angular velocity of the robot's bodies, and the paper's eqs 1-8 written out."""

from __future__ import annotations

import numpy as np
import pytest
from robot_motions import six_angles

from ncgen.errors import ModelError
from ncgen.solver import frames

BODIES = tuple(f"body{i}" for i in range(2, 10))


def euler_matrix(psi, theta, phi):
    """Eq. 1: precession ψ, nutation θ, spin φ."""
    cp, sp, ct, st, cf, sf = np.cos(psi), np.sin(psi), np.cos(theta), np.sin(theta), np.cos(phi), np.sin(phi)
    return np.array([
        [cp * cf - sp * ct * sf, -cp * sf - sp * ct * cf, sp * st],
        [sp * cf + cp * ct * sf, -sp * sf + cp * ct * cf, -cp * st],
        [st * sf, st * cf, ct],
    ])  # fmt: skip


def euler_omega(psi, theta, rates):
    """Eq. 2, with the rates of (θ, ψ, φ)."""
    cp, sp, ct, st = np.cos(psi), np.sin(psi), np.cos(theta), np.sin(theta)
    return np.array([[cp, 0, st * sp], [sp, 0, -st * cp], [0, 1, ct]]) @ rates


def bryant_matrix(alpha, beta, gamma):
    """Roll, pitch and yaw about x, then the new y, then the new z."""
    (ca, cb, cg), (sa, sb, sg) = np.cos([alpha, beta, gamma]), np.sin([alpha, beta, gamma])
    x = np.array([[1, 0, 0], [0, ca, -sa], [0, sa, ca]])
    y = np.array([[cb, 0, sb], [0, 1, 0], [-sb, 0, cb]])
    z = np.array([[cg, -sg, 0], [sg, cg, 0], [0, 0, 1]])
    return x @ y @ z


def parameter_matrix(e0, e1, e2, e3):
    """Eq. 4."""
    return np.array([
        [e0**2 + e1**2 - e2**2 - e3**2, 2 * (e1 * e2 - e0 * e3), 2 * (e1 * e3 + e0 * e2)],
        [2 * (e1 * e2 + e0 * e3), e0**2 - e1**2 + e2**2 - e3**2, 2 * (e2 * e3 - e0 * e1)],
        [2 * (e1 * e3 - e0 * e2), 2 * (e2 * e3 + e0 * e1), e0**2 - e1**2 - e2**2 + e3**2],
    ])  # fmt: skip


def parameter_omega(e, rates):
    """Eq. 5."""
    e0, e1, e2, e3 = e
    return 2 * np.array([[-e1, e0, -e3, e2], [-e2, e3, e0, -e1], [-e3, -e2, e1, e0]]) @ rates


def rate_of(run, body, k, view, step=1e-4):
    """d/dt of a view of the orientation at instant k: differences of fourth order along q + s q̇."""
    values = [view(frames.rotation(run.kernels, body, run.q[k] + s * step * run.qd[k])) for s in (-2, -1, 1, 2)]
    return (values[0] - 8 * values[1] + 8 * values[2] - values[3]) / (12 * step)


@pytest.mark.parametrize("body", BODIES)
def test_rotations_of_the_tree(spatial, tree, body):
    """A is orthogonal, and it and ω are the tree's."""
    A = frames.transformation(spatial.kernels, body, spatial.q)
    assert np.max(np.abs(np.swapaxes(A, 1, 2) @ A - np.eye(3))) < 1e-11
    assert spatial.rotation(body).as_matrix() == pytest.approx(A, abs=1e-11)
    omega = spatial.angular_velocity(body)
    for k, (_, psi, rates, _) in enumerate(six_angles(spatial)):
        frame = tree.frames(psi, rates)[int(body[4:])]
        assert A[k] == pytest.approx(frame.matrix, abs=1e-11)
        assert omega[k] == pytest.approx(frame.omega, abs=1e-10)


@pytest.mark.parametrize("body", BODIES)
def test_angular_velocity_is_the_rate_of_rotation(spatial, body):
    """ω̃ = Ȧ Aᵀ (eq. 8), with Ȧ by a complex step along q̇: exact to rounding."""
    A = frames.transformation(spatial.kernels, body, spatial.q)
    rate = frames.transformation(spatial.kernels, body, spatial.q + 1e-30j * spatial.qd).imag / 1e-30
    W = rate @ np.swapaxes(A, 1, 2)
    x, y, z = spatial.angular_velocity(body).T
    zero = np.zeros_like(x)
    expected = np.moveaxis(np.array([[zero, -z, y], [z, zero, -x], [-y, x, zero]]), 2, 0)
    assert pytest.approx(expected, abs=1e-10) == W


def test_angular_velocity_by_differences_along_the_run(spatial):
    """Rotation vectors between neighbouring instants, 10 ms apart, over the time between: ω of the middle to second order."""
    turns = spatial.rotation("body9")
    step = (turns[2:] * turns[:-2].inv()).as_rotvec() / (spatial.t[2:] - spatial.t[:-2])[:, None]
    assert step == pytest.approx(spatial.angular_velocity("body9")[1:-1], abs=2e-2)


@pytest.mark.parametrize("body", ["body6", "body7", "body8", "body9"])
@pytest.mark.parametrize("k", [20, 50])
def test_euler_angles(spatial, body, k):
    """Eqs 1 and 2; not at the start, where the nutation is 0 and Euler angles are singular, as the paper says."""

    def view(rotation):
        return rotation.as_euler("ZXZ")

    psi, theta, phi = view(spatial.rotation(body)[k])
    assert euler_matrix(psi, theta, phi) == pytest.approx(spatial.rotation(body)[k].as_matrix(), abs=1e-13)
    psi_rate, theta_rate, phi_rate = rate_of(spatial, body, k, view)
    omega = spatial.angular_velocity(body)[k]
    assert euler_omega(psi, theta, [theta_rate, psi_rate, phi_rate]) == pytest.approx(omega, abs=1e-7)


@pytest.mark.parametrize("k", [0, 25, 50])
def test_bryant_angles(spatial, k):
    for body in BODIES:
        turned = spatial.rotation(body)[k]
        assert bryant_matrix(*turned.as_euler("XYZ")) == pytest.approx(turned.as_matrix(), abs=1e-13)


@pytest.mark.parametrize("k", [1, 25, 50])
def test_euler_parameters(spatial, k):
    """Eqs 3, 4 and 5: never singular."""

    def view(rotation):
        return rotation.as_quat(canonical=True, scalar_first=True)

    for body in BODIES:
        turned = spatial.rotation(body)[k]
        e = view(turned)
        assert e @ e == pytest.approx(1.0, abs=1e-14)
        assert parameter_matrix(*e) == pytest.approx(turned.as_matrix(), abs=1e-13)
        rates = rate_of(spatial, body, k, view)
        assert parameter_omega(e, rates) == pytest.approx(spatial.angular_velocity(body)[k], abs=1e-9)


def test_the_start_is_no_rotation(spatial):
    """Orientation is counted from the initial position."""
    for body in BODIES:
        assert spatial.rotation(body)[0].as_matrix() == pytest.approx(np.eye(3), abs=1e-15)


def test_what_has_no_orientation_is_refused(spatial):
    with pytest.raises(ModelError, match="robot has no body body1; it has body2"):
        spatial.rotation("body1")
    import ncgen

    swing = ncgen.simulate(ncgen.compile(ncgen.load("pendulum"), "numpy"), 0.01, points=2)
    with pytest.raises(ModelError, match="bob"):
        swing.rotation("bob")
