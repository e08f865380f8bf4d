"""Two rods in natural coordinates against Lagrange's equations in two angles."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import ncgen
from ncgen.solver.positions.position import residual

L1, L2, M1, M2, G = 1.0, 0.8, 1.0, 0.5, 9.81


@pytest.fixture(scope="module")
def kernels():
    return ncgen.compile(ncgen.load("doublependulum"), backend="numpy")


@pytest.fixture(scope="module")
def fall(kernels):
    return ncgen.simulate(kernels, 2.0, integrator="dop853", rtol=1e-10, atol=1e-12, points=21)


def lagrange(t, y):
    """State derivative of θ1, θ2 (from the downward vertical) and their rates, for uniform rods."""
    th1, th2, w1, w2 = y
    coupling = M2 * L1 * L2 / 2
    mass = np.array([[(M1 / 3 + M2) * L1**2, coupling * np.cos(th1 - th2)], [coupling * np.cos(th1 - th2), M2 * L2**2 / 3]])
    force = np.array(
        [
            -coupling * np.sin(th1 - th2) * w2**2 - (M1 / 2 + M2) * G * L1 * np.sin(th1),
            coupling * np.sin(th1 - th2) * w1**2 - M2 * G * L2 / 2 * np.sin(th2),
        ]
    )
    return [w1, w2, *np.linalg.solve(mass, force)]


def expected(t):
    """B and C at times t from rest, the upper rod horizontal and the lower upright, shape (K, 4)."""
    start = [np.pi / 2, np.pi, 0.0, 0.0]
    th1, th2, *_ = solve_ivp(lagrange, (0, t[-1]), start, "DOP853", t, rtol=1e-13, atol=1e-13).y
    B = np.column_stack([L1 * np.sin(th1), -L1 * np.cos(th1)])
    return np.column_stack([B, B + np.column_stack([L2 * np.sin(th2), -L2 * np.cos(th2)])])


def test_two_degrees_of_freedom(kernels):
    found = ncgen.freedom(kernels)
    assert (found.dof, kernels.m, found.redundant, found.is_singular) == (2, 2, (), False)


def test_closes_from_a_rough_drawing(kernels):
    rough = kernels.q0 + 0.01 * np.random.default_rng(1).standard_normal(kernels.n)
    closed = ncgen.assemble(kernels, rough)
    assert residual(kernels, closed) < 1e-9
    assert np.abs(closed - kernels.q0).max() < 0.05


def test_energy_stays(fall):
    assert fall.energy_drift < 1e-8


def test_same_motion_as_in_angles(fall):
    assert np.abs(fall.q - expected(fall.t)).max() < 5e-9
