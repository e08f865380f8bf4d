"""Bricard's mechanism against the IFToMM benchmark A04 and its closed kinematics."""

from pathlib import Path

import numpy as np
import pytest

import ncgen
from ncgen.solver.positions.position import residual

REFERENCE = np.loadtxt(Path(__file__).parents[1] / "reference" / "bricard.csv", delimiter=",")
"""Rows of t, P3 as published (6 digits), and exact."""


@pytest.fixture(scope="module")
def bricard():
    return ncgen.compile(ncgen.load("bricard"), backend="numpy")


@pytest.fixture(scope="module")
def fall(bricard):
    """The first second, every 0.2 s."""
    return ncgen.simulate(bricard, 1.0, integrator="dop853", rtol=1e-10, atol=1e-11, points=6)


def test_one_degree_of_freedom_where_the_count_says_none(bricard):
    found = ncgen.freedom(bricard)
    assert bricard.n - bricard.m == 0
    assert (found.dof, len(found.redundant)) == (1, 1)
    assert not found.is_singular


def test_it_closes_from_a_perturbed_start(bricard):
    noise = 0.01 * np.random.default_rng(0).standard_normal(bricard.n)
    q = ncgen.assemble(bricard, bricard.q0 + noise)
    assert residual(bricard, q) < 1e-11
    assert np.max(np.abs(q - bricard.q0)) < 0.05


def test_energy(fall):
    assert fall.energy_drift < 1e-8
    assert np.max(fall.violation()) < 1e-11


def test_the_third_joint_stays_on_its_curve(fall):
    x, y, z = fall.point("P3").T
    s = -z / (1 + z)  # the sine of the hinge angle
    assert np.allclose([x, y], [np.sqrt(1 - s**2) / (1 + s), -np.sqrt(1 + 2 * s) / (1 + s)], rtol=0, atol=1e-11)


def test_against_the_benchmark(fall):
    compare(fall, 1e-10)


@pytest.mark.slow
def test_against_the_benchmark_for_ten_seconds(bricard):
    run = ncgen.simulate(bricard, 10.0, integrator="dop853", rtol=1e-10, atol=1e-11, points=51)
    assert run.energy_drift < 1e-8
    compare(run, 2e-9)


def compare(run, tolerance):
    rows = REFERENCE[REFERENCE[:, 0] <= run.t[-1] + 1e-9]
    instants = [int(np.argmin(np.abs(run.t - t))) for t in rows[:, 0]]
    found = run.point("P3")[instants]
    assert np.max(np.abs(found - rows[:, 4:])) < tolerance
    assert np.max(np.abs(found - rows[:, 1:4])) < 1e-6
