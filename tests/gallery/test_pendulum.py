"""IFToMM A01: the simple pendulum against elliptic functions and the published motion."""

from pathlib import Path

import numpy as np
import pytest
from scipy.special import ellipj, ellipk

import ncgen
from ncgen.solver.positions.position import residual

TABLE = Path(__file__).parents[1] / "reference" / "pendulum.csv"


@pytest.fixture(scope="module")
def kernels():
    return ncgen.compile(ncgen.load("pendulum"), backend="numpy")


def run(kernels, duration, points):
    return ncgen.simulate(kernels, duration, integrator="dop853", rtol=1e-10, atol=1e-12, points=points)


@pytest.fixture(scope="module")
def swing(kernels):
    """A little more than one period, 2.368 s."""
    return run(kernels, 2.5, 26)


def closed_form(t):
    """The swing of 90° amplitude: sin(θ/2) = sn(u)/√2, cos(θ/2) = dn(u) with u = K − ωt and modulus m = 1/2."""
    omega = np.sqrt(9.81)
    sn, cn, dn, _ = ellipj(ellipk(0.5) - omega * t, 0.5)
    s, c = np.sqrt(0.5) * sn, dn
    ds, dc = -omega * np.sqrt(0.5) * cn * dn, omega * 0.5 * sn * cn
    position = np.column_stack([-2 * s * c, s**2 - c**2])
    velocity = np.column_stack([-2 * (ds * c + s * dc), 2 * (s * ds - c * dc)])
    return position, velocity


def published(duration):
    t, x, y = np.loadtxt(TABLE, delimiter=",").T
    return (x[t <= duration], y[t <= duration])


def test_one_degree_of_freedom(kernels):
    found = ncgen.freedom(kernels)
    assert (found.dof, kernels.m, found.redundant, found.is_singular) == (1, 1, (), False)


def test_closes_from_a_rough_drawing(kernels):
    rough = kernels.q0 + 0.01 * np.random.default_rng(1).standard_normal(kernels.n)
    closed = ncgen.assemble(kernels, rough)
    assert residual(kernels, closed) < 1e-9
    assert np.abs(closed - kernels.q0).max() < 0.05


def test_energy_stays(swing):
    assert swing.energy_drift < 1e-8


def test_follows_the_closed_form(swing):
    position, velocity = closed_form(swing.t)
    assert np.abs(swing.q - position).max() < 1e-8
    assert np.abs(swing.qd - velocity).max() < 3e-8


def test_follows_the_published_motion(swing):
    """The published file has six digits."""
    x, y = published(2.5)
    assert np.allclose(swing["B.x"][::5], x, rtol=0, atol=1e-6)
    assert np.allclose(swing["B.y"][::5], y, rtol=0, atol=1e-6)


@pytest.mark.slow
def test_ten_seconds(kernels):
    """The benchmark's IFToMM version asks for an energy drift below 5e-5 J in 10 s."""
    swing = run(kernels, 10.0, 21)
    x, y = published(10.0)
    assert np.abs(swing.q - closed_form(swing.t)[0]).max() < 3e-8
    assert np.allclose(swing.q, np.column_stack([x, y]), rtol=0, atol=1e-6)
    assert np.ptp(swing.energy()[:, :2].sum(axis=1)) < 5e-5
