"""Stiff mechanisms are found by explicit methods in C, which say so or end; others are not."""

from __future__ import annotations

import numpy as np
import pytest

import ncgen
from ncgen.methods.method import Method
from ncgen.model import Model
from ncgen.solver.engines.compiled import STIFFNESS_REASON, run, run_constrained
from ncgen.solver.positions.partition import choose_partitions
from ncgen.solver.runs.path import Path
from ncgen.solver.runs.task import Task
from ncgen.solver.runs.tolerances import Tolerances


def hanging(stiffness, damping):
    """A rod of 1 m and a mass on a spring below it: what moves is a double pendulum, whatever the spring."""
    m = Model("hanging")
    A = m.point("A", (0, 0), fixed=True)
    B, C = m.point("B", (1, 0)), m.point("C", (1, -1))
    m.body("upper", points=[B], mass=1.0)
    m.body("lower", points=[C], mass=1.0)
    m.distance(A, B)
    m.spring(B, C, stiffness=stiffness, damping=damping)
    m.gravity((0, -9.81, 0))
    return ncgen.compile(m, backend="c")


def fill(kernels, formalism, integrator, grid, stop_when_stiff, rtol=1e-8, velocities=None, path=None):
    """A path filled by the engine in C, and the reason that it returned."""
    q, p = kernels.q0, kernels.p0
    partitions = choose_partitions(kernels, q, 0.0, p, kernels.model.chosen_independent)
    path = path or Path.empty(kernels.n, partitions)
    qd = np.zeros(kernels.n) if velocities is None else velocities
    tolerances, alone = Tolerances(rtol, rtol / 100, False, 0.0), formalism == "coordinate-partitioning"
    velocities = qd[partitions.velocity.independent] if alone else qd
    task = Task(
        method=Method.of(formalism, integrator),
        grid=grid,
        q=q,
        velocities=velocities,
        p=p,
        max_step=np.inf,
        tolerances=tolerances,
        stop_when_stiff=stop_when_stiff,
    )
    return path, run(path, kernels, task, "dense") if alone else run_constrained(path, kernels, task)


@pytest.mark.parametrize("formalism", ["coordinate-partitioning", "lagrange"])
@pytest.mark.parametrize("integrator", ["dopri5", "dop853"])
@pytest.mark.parametrize(("stiffness", "damping"), [(1e8, 1e6), (1e8, 1e5), (1e10, 0.0)])
def test_a_stiff_spring_is_found(stiffness, damping, integrator, formalism):
    """The run ends soon, with rows of the grid, and radau goes on from the last of them to where radau alone comes. (Over all
    coordinates radau itself does not get through at these tolerances.)"""
    kernels, grid = hanging(stiffness, damping), np.linspace(0.0, 0.5, 501)
    path, reason = fill(kernels, formalism, integrator, grid, True)
    assert reason == STIFFNESS_REASON and path.stiff == 1 and path.stopped is None
    assert 1 <= len(path.q) < len(grid)
    assert path.counts[0] < 20_000
    if formalism != "coordinate-partitioning":
        return
    path, reason = fill(kernels, formalism, "radau", grid, False, path=path)
    assert reason is None and len(path.q) == len(grid)
    alone, _ = fill(kernels, formalism, "radau", grid, False, rtol=1e-9)
    assert np.allclose(path.q, alone.q, atol=1e-5)


@pytest.mark.parametrize("formalism", ["coordinate-partitioning", "lagrange"])
def test_a_spring_whose_rounding_is_a_force(formalism):
    """1e12 N/m times 1e-16 m: steps are tiny, though no eigenvalue is seen."""
    path, reason = fill(hanging(1e12, 0.0), formalism, "dop853", np.linspace(0.0, 0.5, 5001), True, rtol=1e-11)
    assert reason == STIFFNESS_REASON and path.counts[0] < 100_000


def test_it_is_counted_where_the_run_goes_on():
    path, reason = fill(hanging(1e8, 1e6), "lagrange", "dopri5", np.linspace(0.0, 0.02, 3), False)
    assert reason is None and len(path.q) == 3
    assert path.stiff >= 2


@pytest.mark.parametrize("formalism", ["coordinate-partitioning", "lagrange"])
@pytest.mark.parametrize("rtol", [1e-4, 1e-8, 1e-11])
@pytest.mark.parametrize("integrator", ["dopri5", "dop853"])
@pytest.mark.parametrize(("name", "duration"), [("robot", 1.0), ("fourbar", 10.0), ("heavytop", 2.0), ("doublependulum", 10.0)])
def test_examples_are_not_stiff(name, duration, integrator, rtol, formalism):
    """Up to 40,000 steps. The robot comes to a singular position at 1.015 s, where partitioning ends."""
    model = ncgen.load(name)
    kernels = ncgen.compile(model, backend="c")
    start = ncgen.simulate(kernels, 1e-6, points=2, **{k: v for k, v in model.simulation_options.items() if k == "zd0"})
    path, reason = fill(kernels, formalism, integrator, np.linspace(0.0, duration, 11), True, rtol, start.qd[0])
    assert reason != STIFFNESS_REASON and path.stiff == 0
