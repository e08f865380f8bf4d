"""Motions on independent coordinates end before a singular position of the mechanism, with one row through it or with many, and soon.

N four-bars flatten where their N + 1 equal bars are level: they have N + 1 degrees of freedom there, and N singular values pass 0 at once.
"""

from __future__ import annotations

import numpy as np
import pytest

import ncgen
from ncgen.comparisons.hard_linkages import four_bars_position
from ncgen.exchange.examples import example_module, load
from ncgen.solver.positions.kinematics import kinematics
from ncgen.solver.positions.partition import choose_partition

START = 1.0
"""Velocity of the bars' ends along x (m/s), upright; they are level after 0.7 s."""

METHODS = {
    "rk4": {"max_step": 5e-4},
    "trapezoidal": {"max_step": 1e-3},
    "dopri5": {"rtol": 1e-8},
    "dop853": {"rtol": 1e-10},
    "radau": {"rtol": 1e-8},
}


def four_bars(count: int) -> ncgen.Kernels:
    return ncgen.compile(example_module("nfourbar").build(count))


def rates(count: int) -> dict[str, float]:
    return {f"B{i}.x": START for i in range(count + 1)}


@pytest.mark.parametrize("count", [1, 2, 3, 10])
@pytest.mark.parametrize("integrator", METHODS)
def test_no_step_passes(integrator, count):
    given = {"formalism": "coordinate-partitioning", "integrator": integrator, **METHODS[integrator]}
    with pytest.raises(ncgen.ConvergenceError, match="comes to a singular position there") as raised:
        ncgen.simulate(four_bars(count), 3.0, qd0=rates(count), **given)
    end = float(str(raised.value).split("t = ")[1].split(" s")[0])
    flat = np.linspace(0.7, 0.73, 30001)
    flat = flat[np.argmin(np.abs(four_bars_position(count, flat)[:, 1]))]
    assert flat - 2e-3 < end < flat


@pytest.mark.parametrize("count", [1, 2])
def test_the_reference_neither(count):
    with pytest.raises(ncgen.SingularError, match="comes to a singular position there"):
        ncgen.simulate(
            four_bars(count), 0.75, formalism="coordinate-partitioning", integrator="rk4", max_step=2e-3, qd0=rates(count), engine="python"
        )


@pytest.mark.parametrize("count", [1, 2])
def test_derivatives_neither(count):
    with pytest.raises(ncgen.SingularError, match="comes to a singular position there"):
        ncgen.sensitivities(four_bars(count), 0.75, 376, by=("B0.x", "rate(B0.x)"), qd0=rates(count), integrator="rk4")


@pytest.mark.parametrize("count", [1, 2, 10])
def test_an_emitted_order_of_elimination_is_left_where_its_pivots_become_small(count):
    kernels = four_bars(count)
    with pytest.raises(ncgen.ConvergenceError, match="comes to a singular position there"):
        ncgen.simulate(
            kernels, 3.0, formalism="coordinate-partitioning", integrator="rk4", max_step=5e-4, qd0=rates(count), engine="emitted"
        )


def test_a_turn_is_told_by_eigenvalues():
    """On both sides of the flat position, also far apart, and not on one side."""
    kernels, angles = four_bars(4), np.array([0.2, 0.05, 0.02, -0.02, -0.05, -0.2])
    positions = [kernels.q0.copy() for _ in angles]
    for angle, q in zip(angles, positions, strict=True):
        for i in range(5):
            q[[kernels.index[f"B{i}.x"], kernels.index[f"B{i}.y"]]] = i + np.cos(angle), np.sin(angle)
    choice = choose_partition(kernels, positions[0], independent=("B0.y",))
    frames = [kinematics(kernels, choice, q) for q in positions]
    for i, start in enumerate(frames):
        for j, here in enumerate(frames):
            assert here.has_turned(start) == (angles[i] * angles[j] < 0), (angles[i], angles[j])


def test_coordinates_that_come_to_their_dead_centre_are_left_soon():
    """Bennett's linkage took 3.7 million evaluations, and ended 0.09 m off."""
    kernels = ncgen.compile(load("bennett"))
    given = {key: value for key, value in kernels.model.simulation_options.items() if key in ("qd0", "zd0")}
    run = ncgen.simulate(kernels, 5.0, formalism="coordinate-partitioning", integrator="dopri5", points=2, **given)
    expected = ncgen.simulate(kernels, 5.0, formalism="lagrange", integrator="dop853", rtol=1e-11, points=2, **given)
    assert np.abs(run.q[-1] - expected.q[-1]).max() < 1e-4 * kernels.length
    assert run.statistics.evaluations < 10_000
