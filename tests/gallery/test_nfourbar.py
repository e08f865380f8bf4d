"""IFToMM A02: N four-bar linkages against the exact and the published motion, up to the first flat position at 0.71 s."""

from pathlib import Path

import numpy as np
import pytest

import ncgen
from ncgen.exchange.examples import example_module
from ncgen.solver.positions.position import residual

TABLE = Path(__file__).parents[1] / "reference" / "nfourbar.csv"


def compiled(N):
    return ncgen.compile(example_module("nfourbar").build(N), backend="numpy")


@pytest.fixture(scope="module")
def kernels():
    return compiled(2)


def run(kernels):
    return ncgen.simulate(kernels, 0.6, zd0={"B0.x": 1.0}, integrator="dop853", rtol=1e-10, atol=1e-12, points=13)


@pytest.fixture(scope="module")
def fall(kernels):
    return run(kernels)


def flat(N):
    """All rods along the x axis, to the right."""
    return np.array([[i + 1.0, 0.0] for i in range(N + 1)]).ravel()


@pytest.mark.parametrize("N", [1, 2, 10])
def test_one_degree_of_freedom(N):
    kernels = compiled(N)
    found = ncgen.freedom(kernels)
    assert (found.dof, kernels.m, found.redundant, found.is_singular) == (1, 2 * N + 1, (), False)


@pytest.mark.parametrize("N", [1, 2, 10])
def test_every_rod_is_free_where_all_lie_flat(N):
    kernels = compiled(N)
    found = ncgen.freedom(kernels, flat(N))
    assert found.is_singular and found.dof == 1
    assert kernels.n - found.rank_here == N + 1


def test_closes_from_a_rough_drawing(kernels):
    rough = kernels.q0 + 0.02 * np.random.default_rng(1).standard_normal(kernels.n)
    closed = ncgen.assemble(kernels, rough)
    assert residual(kernels, closed) < 1e-9
    assert np.abs(closed - kernels.q0).max() < 0.1


def test_energy_stays(fall):
    assert fall.energy_drift < 1e-8


def test_follows_the_exact_motion(fall):
    _, x, y, vx, vy, *_ = np.loadtxt(TABLE, delimiter=",").T
    assert np.abs(fall.point("B0")[:, :2] - np.column_stack([x, y])).max() < 1e-9
    assert np.abs(fall.qd[:, :2] - np.column_stack([vx, vy])).max() < 3e-9


def test_standing_rods_stay_parallel(fall):
    for name, shift in (("B1", 1.0), ("B2", 2.0)):
        assert np.abs(fall.point(name) - fall.point("B0") - [shift, 0, 0]).max() < 1e-9


def test_forty_linkages():
    """The original benchmark; the published file has six digits."""
    *_, x, y = np.loadtxt(TABLE, delimiter=",").T
    fall = run(compiled(40))
    assert np.abs(fall.point("B0")[:, :2] - np.column_stack([x, y])).max() < 1e-6
    assert fall.energy_drift < 1e-8
