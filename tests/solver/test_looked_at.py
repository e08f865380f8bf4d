"""The energy of a run is looked at where its steps end, so that nothing is computed for it."""

import numpy as np
import pytest

import ncgen
from ncgen.exchange.examples import load
from ncgen.methods.table import INTEGRATORS

BEGUN = 2
"""Evaluations before the first step: at the start, and to find how long it may be."""


@pytest.fixture(scope="module")
def fourbar():
    return ncgen.compile(load("fourbar"), "c")


@pytest.mark.parametrize("how", [{}, {"formalism": "coordinate-partitioning", "engine": "emitted", "integrator": "dop853"}])
def test_a_run_without_rows_inside_takes_the_stages_of_its_steps_alone(fourbar, how):
    """Of dop853 twelve a step, of those whose error is too large as well; an interpolant would take three more."""
    run = ncgen.simulate(fourbar, 1.0, points=2, **how)
    stages = run.statistics.evaluations - BEGUN
    assert stages >= 12 * run.statistics.steps and stages % 12 == 0


def test_rows_inside_change_no_step(fourbar):
    few, many = (ncgen.simulate(fourbar, 1.0, points=points) for points in (2, 101))
    assert few.statistics.steps == many.statistics.steps
    assert few.statistics.evaluations < many.statistics.evaluations
    assert np.array_equal(few.q[-1], many.q[-1])
    assert np.array_equal(many.t, np.linspace(0.0, 1.0, 101))


@pytest.mark.parametrize("integrator", [name for name, entry in INTEGRATORS.items() if entry.in_c and not entry.has_fixed_step])
def test_instants_are_those_that_were_asked_for(fourbar, integrator):
    instants = [0.0, 0.011, 0.5, 0.5 + 1e-12, 1.0]
    run = ncgen.simulate(fourbar, 1.0, integrator=integrator, formalism="lagrange", points=instants, rtol=1e-6)
    assert np.array_equal(run.t, instants)
    beside = ncgen.simulate(fourbar, 0.5, integrator=integrator, formalism="lagrange", points=2, rtol=1e-6)
    assert run.q[2] == pytest.approx(beside.q[-1], abs=1e-4)


def test_where_it_stops_is_between_steps(fourbar):
    """With nothing but the two ends on the grid; energy is told by the state there."""
    whole = ncgen.simulate(fourbar, 1.0, points=2)
    name = fourbar.coordinates[0]
    value = (whole[name][0] + 9 * ncgen.simulate(fourbar, 0.3, points=2)[name][-1]) / 10
    run = ncgen.simulate(fourbar, 1.0, points=2, stop={name: value})
    assert run.stopped and len(run.t) == 2
    assert run[name][-1] == pytest.approx(value, abs=1e-12)
    assert run.energy_drift < 1e-6
