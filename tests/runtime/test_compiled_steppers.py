"""RATTLE and the energy-momentum method in C: the reference's motions, and a million steps without drift."""

from __future__ import annotations

import numpy as np
import pytest

import ncgen
from ncgen.errors import ModelError

MILLION = 1_000_000


def both(name, integrator, duration, step, **options):
    kernels = ncgen.compile(ncgen.load(name), backend="c")
    options |= {k: v for k, v in kernels.model.simulation_options.items() if k == "zd0"}
    given = dict(formalism="lagrange", integrator=integrator, max_step=step, points=5, **options)
    return [ncgen.simulate(kernels, duration, engine=engine, **given) for engine in ("c", "python")]


@pytest.mark.parametrize("integrator", ["rattle", "energy-momentum"])
@pytest.mark.parametrize(("name", "duration", "step"), [("pendulum", 0.4, 1e-3), ("heavytop", 0.01, 2.5e-4), ("bricard", 0.2, 1e-3)])
def test_both_engines(name, integrator, duration, step):
    """Two programs of the same equations: constant inertia, a fast top, and a row that is redundant everywhere."""
    in_c, in_python = both(name, integrator, duration, step)
    assert in_c.engine == "c"
    assert in_c.q == pytest.approx(in_python.q, abs=1e-10)
    assert in_c.qd == pytest.approx(in_python.qd, abs=1e-9 * np.max(np.abs(in_python.qd)))
    assert np.max(in_c.violation()) < 1e-12


@pytest.mark.parametrize(("integrator", "allowed"), [("rattle", 5e-6), ("energy-momentum", 1e-9)])
def test_a_million_steps(integrator, allowed):
    """A thousand seconds of a pendulum: the energy error of the end is that of the beginning, constraints are at rounding."""
    kernels = ncgen.compile(ncgen.load("pendulum"), backend="c")
    run = ncgen.simulate(kernels, 1e-3 * MILLION, formalism="lagrange", integrator=integrator, max_step=1e-3, points=4001)
    assert run.engine == "c" and run.statistics.steps == pytest.approx(MILLION, abs=4000)
    energy = run.energy()
    error = (energy[:, 0] + energy[:, 1]) / np.max(energy[:, 0])
    first, last = np.mean(error[:400]), np.mean(error[-400:])
    assert np.max(np.abs(error - error[0])) < allowed
    assert abs(last - first) < allowed / 10
    assert np.max(run.violation()) < 1e-13


@pytest.mark.parametrize(("name", "why"), [("suspension", "where forces have no potential"), ("robot", "unless constraints are quadratic")])
def test_what_runs_in_python_says_why(name, why):
    """Where energy-momentum needs corrections to be exact it is left to the reference."""
    kernels = ncgen.compile(ncgen.load(name), backend="c")
    with pytest.raises(ModelError, match=f"energy-momentum runs in Python {why}"):
        ncgen.simulate(kernels, 0.1, formalism="lagrange", integrator="energy-momentum", max_step=1e-3, engine="c")


def test_a_step_is_needed():
    kernels = ncgen.compile(ncgen.load("pendulum"), backend="c")
    with pytest.raises(ModelError, match="rattle has a fixed step: give max_step"):
        ncgen.simulate(kernels, 0.1, formalism="lagrange", integrator="rattle")
