"""What a run says that it cost, where that is known beforehand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import sympy

import ncgen
from ncgen.methods.method import Method
from ncgen.solver.engines import compiled, reference
from ncgen.solver.positions.partition import choose_partitions
from ncgen.solver.runs.path import Path
from ncgen.solver.runs.task import Task
from ncgen.solver.runs.tolerances import Tolerances

STEPS = 20


@pytest.fixture(scope="module")
def fourbar():
    return ncgen.compile(ncgen.load("fourbar"), "c")


@pytest.mark.parametrize("engine", ["c", "python"])
def test_stages_of_rk4_are_all_evaluations(fourbar, engine):
    """Four a step, and one more at the end for the slope there; without position problems nothing else is counted."""
    run = ncgen.simulate(
        fourbar, 0.02, formalism="lagrange", integrator="rk4", max_step=0.02 / STEPS, engine=engine, points=3,
        options={"stabilisation": "none"},
    )  # fmt: skip
    spent = run.statistics
    assert (spent.steps, spent.evaluations) == (STEPS, 4 * STEPS + 1)
    assert spent.newton_steps == spent.partition_changes == spent.repeated_steps == spent.projections == 0
    assert spent.jacobians == spent.fallbacks == 0 and spent.largest_projection == 0.0


@pytest.mark.parametrize(("integrator", "stages"), [("rk23", 3), ("dopri5", 6), ("dop853", 11)])
@pytest.mark.parametrize("formalism", ["lagrange", "coordinate-partitioning"])
def test_engines_count_alike(fourbar, formalism, integrator, stages):
    """At the least the stages of every step; more where one is rejected or where the output is interpolated, for which dop853 takes stages
    of their own: C leaves these out where the energy alone is looked at (test_looked_at.py counts what it takes)."""
    asked = {"formalism": formalism, "integrator": integrator, "points": 3}
    options = {"options": {"stabilisation": "none"}} if formalism == "lagrange" else {}
    c, python = (ncgen.simulate(fourbar, 0.05, engine=engine, **asked, **options).statistics for engine in ("c", "python"))
    assert (c.steps, c.repeated_steps) == (python.steps, python.repeated_steps)
    assert c.evaluations < python.evaluations if integrator == "dop853" else c.evaluations == python.evaluations
    assert c.evaluations >= stages * c.steps
    assert (c.newton_steps >= c.evaluations) == (python.newton_steps >= python.evaluations) == (formalism != "lagrange")


@pytest.mark.parametrize("integrator", ["energy-momentum", "rattle"])
def test_steps_of_constraints_change_no_partition(fourbar, integrator):
    """They have none, and repeat no step; one of Newton's method at least goes into each."""
    spent = ncgen.simulate(fourbar, 0.02, integrator=integrator, max_step=0.02 / STEPS, points=3).statistics
    assert spent.steps == STEPS and spent.newton_steps >= STEPS
    assert spent.partition_changes == spent.repeated_steps == spent.fallbacks == 0


def test_rejected_steps_are_those_of_scipy():
    """A force that jumps 4 times in 0.3 s: steps are rejected there, and those that follow do not grow at once.

    When it jumps depends on a coordinate, which stays 0, so that the jumps are no break times.
    """
    m = ncgen.Model("kicked")
    P = m.point("P", (0, 0, 0))
    m.body("ball", [P], mass=1.0)
    m.force(P, (sympy.sign(sympy.sin(40 * m.time + P.z)) - 30 * P.x, sympy.sin(60 * m.time), 0))
    kernels = ncgen.compile(m, "c")
    asked = {"formalism": "lagrange", "integrator": "rk23", "points": 2, "rtol": 1e-7, "options": {"stabilisation": "none"}}
    c, python = (ncgen.simulate(kernels, 0.3, engine=engine, **asked).statistics for engine in ("c", "python"))
    assert (c.steps, c.evaluations) == (python.steps, python.evaluations)
    assert c.evaluations > 3 * c.steps + 30  # ten are rejected at least


def test_python_goes_on_where_c_came():
    """A path that C filled to its third row is completed by Python: one motion, one work, and the counts of both."""
    kernels = ncgen.compile(ncgen.load("suspension"), "c")  # its dampers do work
    grid = np.linspace(0.0, 0.2, 6)
    partitions = choose_partitions(kernels, kernels.q0, 0.0, kernels.p0)
    rates = np.linspace(0.5, 1.0, len(partitions.velocity.independent))
    paths = []
    for rows in (6, 3):
        path = Path.empty(kernels.n, partitions)
        method, tolerances = Method.of("coordinate-partitioning", "dopri5"), Tolerances(1e-10, 1e-12, False, 0.0)
        task = Task(method=method, grid=grid[:rows], q=kernels.q0, velocities=rates, p=kernels.p0, max_step=np.inf, tolerances=tolerances)
        assert compiled.run(path, kernels, task, "dense") is None
        paths.append((path, task))
    (whole, _), (path, task) = paths
    before = path.counts.copy()
    reference.run(path, kernels, replace(task, grid=grid))
    assert path.q.shape == whole.q.shape
    assert np.max(np.abs(path.q - whole.q)) < 1e-8
    assert np.max(np.abs(path.work - whole.work)) < 1e-8
    assert np.ptp(whole.work) > 1e-3
    assert before[0] < path.counts[0] < 1.5 * whole.counts[0]
