"""The heavy top against Euler's equations with Euler parameters, and against published numbers."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

import ncgen
from ncgen.solver.positions.position import residual

MASS, GRAVITY = 15.0, 9.81
INERTIA = np.array([15.234375, 0.46875, 15.234375])
"""About the fixed point, the centre of mass being 1 m away along y."""


@pytest.fixture(scope="module")
def top():
    return ncgen.compile(ncgen.load("heavytop"), backend="numpy")


@pytest.fixture(scope="module")
def spin(top):
    """Nearly two turns about its axis, every 0.02 s."""
    return run(top, 0.08, rtol=1e-10, points=5)


def run(top, duration, **options):
    return ncgen.simulate(top, **{**top.model.simulation_options, "duration": duration, **options})


def centre(run):
    """The centre of mass, in the middle of the rim's three points."""
    return sum(run.point(name) for name in "PQR") / 3


def euler_equations(t, y):
    """Euler parameters and body-fixed angular velocity of a top on a fixed point."""
    e0, e, omega = y[0], y[1:4], y[4:]
    weight = Rotation.from_quat([*e, e0]).inv().apply([0, 0, -MASS * GRAVITY])
    moment = np.cross([0, 1, 0], weight)
    rates = (moment - np.cross(omega, INERTIA * omega)) / INERTIA
    return np.concatenate([[-e @ omega / 2], (e0 * omega + np.cross(e, omega)) / 2, rates])


def independent(t):
    """Euler parameters (K, 4) and body-fixed angular velocities (K, 3) at times t."""
    start = [1, 0, 0, 0, 0, 150, -4.61538]
    y = solve_ivp(euler_equations, (0, t[-1]), start, method="DOP853", t_eval=t, rtol=1e-12, atol=1e-12).y.T
    return y[:, :4], y[:, 4:]


def test_three_degrees_of_freedom(top):
    found = ncgen.freedom(top)
    assert (found.dof, top.m, len(found.redundant)) == (3, 6, 0)


def test_constant_mass_matrix(top):
    somewhere = np.random.default_rng(0).standard_normal(top.n)
    assert np.array_equal(top.mass_matrix(somewhere), top.mass_matrix(top.q0))


def test_it_closes_from_a_perturbed_start(top):
    noise = 0.01 * np.random.default_rng(0).standard_normal(top.n)
    q = ncgen.assemble(top, top.q0 + noise)
    assert residual(top, q) < 1e-11
    assert np.max(np.abs(q - top.q0)) < 0.05


def test_energy(spin):
    assert spin.energy_drift < 1e-8
    assert np.max(spin.violation()) < 1e-11


def test_against_euler_equations(spin):
    parameters, omega = independent(spin.t)
    turned = Rotation.from_quat(parameters, scalar_first=True)
    assert np.allclose(centre(spin), turned.apply([0, 1, 0]), rtol=0, atol=1e-9)
    assert np.allclose(spin.rotation("top").as_matrix(), turned.as_matrix(), rtol=0, atol=1e-7)
    assert np.allclose(spin.angular_velocity("top"), turned.apply(omega), rtol=0, atol=2e-6)


@pytest.mark.slow
def test_against_published_positions(top):
    """Seven turns. Euler parameters at 0.2 s: Runge-Kutta in Matlab, printed with five digits in Exudyn's heavyTop.py.

    Centre of mass at 0.3 s: a Runge-Kutta run of the equations with multipliers in another set of coordinates, five digits.
    """
    spin = run(top, 0.3, rtol=1e-8, points=4)
    parameters = np.abs(spin.rotation("top").as_quat(scalar_first=True)[2])
    turned = Rotation.from_quat(independent(spin.t)[0], scalar_first=True)
    assert np.allclose(parameters, [0.70828, 0.43878, 0.54573, 0.0894], rtol=0, atol=1e-5)
    assert np.allclose(centre(spin), turned.apply([0, 1, 0]), rtol=0, atol=1e-6)
    assert np.allclose(centre(spin)[-1], [0.38461, 0.21567, -0.89753], rtol=0, atol=1e-5)
