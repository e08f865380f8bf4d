"""RATTLE and the energy-momentum method in C: their equations solved by a generic Newton, and a million steps without drift."""

from __future__ import annotations

import numpy as np
import pytest
from generic_newton import motion

import ncgen
from ncgen.errors import ModelError

MILLION = 1_000_000


def both(name, integrator, duration, step):
    """The motion in C, and that of the equations of its steps."""
    kernels, count = ncgen.compile(ncgen.load(name), backend="c"), round(duration / step)
    options = {k: v for k, v in kernels.model.simulation_options.items() if k == "zd0"}
    run = ncgen.simulate(kernels, duration, integrator=integrator, max_step=step, points=count + 1, **options)
    assert run.engine == "c"
    return run, motion(kernels, integrator, run.q[0], run.qd[0], step, count)


@pytest.mark.parametrize("integrator", ["rattle", "energy-momentum"])
@pytest.mark.parametrize(("name", "duration", "step"), [("pendulum", 0.05, 1e-3), ("heavytop", 0.01, 2.5e-4), ("bricard", 0.02, 1e-3)])
def test_steps_solve_their_equations(name, integrator, duration, step):
    """Two programs of the same equations: constant inertia, a fast top, and a row that is redundant everywhere."""
    in_c, known = both(name, integrator, duration, step)
    assert in_c.q == pytest.approx(known.q, abs=1e-10)
    assert in_c.qd == pytest.approx(known.qd, abs=1e-9 * np.max(np.abs(known.qd)))
    assert np.max(in_c.violation()) < 1e-12


def test_rattle_keeps_the_direction_of_its_start():
    """A drift that leaves M^-1 Phi_q' of the start is not symplectic: the energy falls, by 6 % here, and its steps are others."""
    runs = both("slidercrank", "rattle", 0.1, 1e-3)
    assert runs[0].q == pytest.approx(runs[1].q, abs=1e-10)
    options = {"zd0": runs[0].kernels.model.simulation_options["zd0"], "points": 1001}
    energy = ncgen.simulate(runs[0].kernels, 1.0, integrator="rattle", max_step=1e-3, **options).energy()
    total = (energy[:, 0] + energy[:, 1]) / (energy[0, 0] + energy[0, 1])
    fifths = total[:1000].reshape(5, 200).mean(axis=1)
    assert fifths == pytest.approx(fifths[0], abs=1e-3)


@pytest.mark.parametrize("integrator", ["rattle", "generalized-alpha", "trapezoidal"])
def test_a_fixed_step_that_fails_is_named(integrator):
    """With its size, and not as steps that become too short. Generalised α made more energy than there was before its step failed."""
    kernels = ncgen.compile(ncgen.load("pendulum"), backend="c")
    fails = r"the step of 0\.3 s from t = [0-9.]+ s does not converge; take smaller steps \(max_step\)"
    diverged = r"the motion has diverged: .* steps of 0\.3 s are too long for generalized-alpha here, take smaller ones \(max_step\)"
    said = f"pendulum: {diverged if integrator == 'generalized-alpha' else fails}"
    with pytest.raises(ncgen.NcgenError, match=said):
        ncgen.simulate(kernels, 18.0, formalism="lagrange", integrator=integrator, max_step=0.3)


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


@pytest.mark.parametrize(("name", "duration", "step"), [
    ("fourbar", 0.1, 1e-3), ("robot", 0.1, 5e-3), ("flyball", 0.02, 5e-4), ("suspension", 0.1, 2e-3), ("jansen", 0.2, 5e-3),
])  # fmt: skip
def test_energy_is_kept_to_rounding(name, duration, step):
    """By energy-momentum in C as well: with angles, M(q), springs, dampers and a driver, whose work is counted."""
    kernels = ncgen.compile(ncgen.load(name), backend="c")
    given = {k: v for k, v in kernels.model.simulation_options.items() if k in ("zd0", "z")}
    options = dict(formalism="lagrange", integrator="energy-momentum", max_step=step, points=round(duration / step) + 1, engine="c")
    run = ncgen.simulate(kernels, duration, **options, **given)
    assert run.energy_drift < 1e-11
    projected = ncgen.simulate(kernels, duration, **options, **given, options={"project_velocities": True})
    gaps = [np.max(np.abs(kernels.jacobian(r.q[-1], duration) @ r.qd[-1] - kernels.nu(r.q[-1], duration))) for r in (run, projected)]
    assert gaps[1] < 1e-9 * np.max(np.abs(run.qd)) and gaps[1] < gaps[0] / 100


def test_a_step_is_needed():
    kernels = ncgen.compile(ncgen.load("pendulum"), backend="c")
    with pytest.raises(ModelError, match="max_step: rattle has a fixed step; give its length in seconds"):
        ncgen.simulate(kernels, 0.1, formalism="lagrange", integrator="rattle")
