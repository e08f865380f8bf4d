"""IFToMM A03: Andrews' squeezing mechanism against the published motion of F and an exact solution."""

from pathlib import Path

import numpy as np
import pytest

import ncgen
from ncgen.exchange.examples import example_module
from ncgen.solver.positions.position import residual

TABLE = Path(__file__).parents[1] / "reference" / "andrews.csv"


@pytest.fixture(scope="module")
def kernels():
    return ncgen.compile(ncgen.load("andrews"), backend="numpy")


@pytest.fixture(scope="module")
def squeezing(kernels):
    """The benchmark's 50 ms, at the 21 times of the table."""
    return ncgen.simulate(kernels, 0.05, integrator="dop853", rtol=1e-9, atol=1e-9, points=201)


@pytest.fixture(scope="module")
def reference():
    """{column: values}, and the index of its times in the run's grid of 0.25 ms."""
    names = ("t", "x_published", "y_published", "x", "y", "beta", "beta_rate")
    columns = dict(zip(names, np.loadtxt(TABLE, delimiter=",").T, strict=True))
    return columns, np.rint(columns["t"] / 0.00025).astype(int)


def test_one_degree_of_freedom(kernels):
    found = ncgen.freedom(kernels)
    assert (found.dof, kernels.m, found.redundant, found.is_singular) == (1, 10, (), False)


def test_starts_closed_on_the_published_branch(kernels):
    """Angles of the initial position as published, to their last digit: γ of BE, δ of AG, ε of AH."""
    A, B, E, G, H = (kernels.model.elements[name].initial[:2] for name in "ABEGH")
    (ex, ey), (gx, gy), (hx, hy) = E - B, G - A, H - A
    angles = [np.arctan2(ex, -ey), np.arctan2(gy, gx), np.arctan2(hx, -hy)]
    assert np.allclose(angles, [0.45527981210, 0.48736498114, 1.23054743916], rtol=0, atol=1e-11)


def test_closes_from_a_rough_drawing(kernels):
    size = np.where(np.arange(kernels.n) == kernels.index["beta"], 1.0, 0.1)
    rough = kernels.q0 + 0.01 * size * np.random.default_rng(1).standard_normal(kernels.n)
    closed = ncgen.assemble(kernels, rough)
    assert residual(kernels, closed) < 1e-9
    assert np.abs((closed - kernels.q0) / size).max() < 0.1


def test_energy_comes_from_the_torque(squeezing):
    assert squeezing.energy_drift < 1e-8
    assert np.allclose(squeezing.work, 0.033 * (squeezing["beta"] + 0.0620), rtol=0, atol=1e-8)


def test_follows_the_published_motion(squeezing, reference):
    """The published file is printed to 1e-8 m."""
    columns, at = reference
    F = squeezing.point("F")[at, :2]
    assert np.abs(F - np.column_stack([columns["x_published"], columns["y_published"]])).max() < 1e-8


def test_follows_the_exact_motion(squeezing, reference):
    columns, at = reference
    F = squeezing.point("F")[at, :2]
    assert np.abs(F - np.column_stack([columns["x"], columns["y"]])).max() < 2e-9
    assert np.abs(squeezing["beta"][at] - columns["beta"]).max() < 3e-7
    assert np.abs(squeezing["rate(beta)"][at] - columns["beta_rate"]).max() < 1e-4


@pytest.mark.slow
def test_ivp_test_set():
    """The other start, 0.03 s: the crank's angle as published by the IVP test set (PSIDE), good to ten digits itself."""
    model = example_module("andrews").build(beta0=-0.0617138900142764496)
    run = ncgen.simulate(ncgen.compile(model, backend="numpy"), 0.03, integrator="dop853", rtol=1e-11, atol=1e-11, points=2)
    assert np.isclose(run["beta"][-1], 15.81077119629904, rtol=3e-10, atol=0)
