"""The stiff flyball governor against the IFToMM benchmark A05."""

from pathlib import Path

import numpy as np
import pytest

import ncgen
from ncgen.solver.positions.position import residual

REFERENCE = np.loadtxt(Path(__file__).parents[1] / "reference" / "flyball.csv", delimiter=",")
"""Rows of t, s as published (6 digits); s, alpha, shaft angle and speed from minimal coordinates."""


@pytest.fixture(scope="module")
def governor():
    return ncgen.compile(ncgen.load("flyball"), backend="numpy")


@pytest.fixture(scope="module")
def rise(governor):
    """Two tenths of a second, every 0.1 s."""
    return run(governor, 0.2, rtol=1e-7, atol=1e-8, points=3)


def run(governor, duration, **options):
    return ncgen.simulate(governor, **{**governor.model.simulation_options, "duration": duration, **options})


def test_four_degrees_of_freedom(governor):
    found = ncgen.freedom(governor)
    assert (found.dof, len(found.redundant)) == (4, 0)


def test_it_closes_from_a_perturbed_start(governor):
    noise = 0.01 * np.random.default_rng(0).standard_normal(governor.n)
    q = ncgen.assemble(governor, governor.q0 + noise)
    assert residual(governor, q) < 1e-11
    assert np.max(np.abs(q - governor.q0)) < 0.05


def test_energy_and_the_work_of_the_dampers(rise):
    assert rise.energy_drift < 1e-8
    assert rise.work[-1] < 0
    assert np.max(rise.violation()) < 1e-11


def test_both_rods_rise_alike(rise):
    assert np.allclose(rise["alpha1"], rise["alpha2"], rtol=0, atol=1e-12)


def test_against_the_benchmark(rise):
    compare(rise, 1e-8)


@pytest.mark.slow
def test_against_the_benchmark_for_three_seconds(governor):
    compare(run(governor, 3.0, rtol=1e-8, points=31), 1e-7)


def compare(run, tolerance):
    rows = REFERENCE[REFERENCE[:, 0] <= run.t[-1] + 1e-9]
    instants = [int(np.argmin(np.abs(run.t - t))) for t in rows[:, 0]]
    found = np.transpose([run[name][instants] for name in ("S.z", "alpha1", "turn", "rate(turn)")])
    assert np.max(np.abs(found - rows[:, 2:])) < tolerance
    assert np.max(np.abs(found[:, 0] - rows[:, 1])) < 2e-6
