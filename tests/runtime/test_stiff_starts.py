"""Stiffness is seen before the first step: by the fastest decay of velocities there, at the cost of a few evaluations."""

from __future__ import annotations

import numpy as np
import pytest

import ncgen
from ncgen.mechanism.moving import Moving, Stepping
from ncgen.solver.engines import acceleration_forms
from ncgen.solver.positions.rank import freedom

ROD = 1.0
"""kg m²; the moment of inertia m l²/3 about the hinge."""


def rod(damping, stiffness=0.0, law=None):
    """A rod of 3 kg and 1 m on a hinge with a damper (N m s/rad): its velocity decays with c / J = c."""
    m = ncgen.Model("rod")
    A, B = m.point("A", (0, 0, 0), fixed=True), m.point("B", (1, 0, 0))
    x, z = m.vector("x", (1, 0, 0), fixed=True), m.vector("z", (0, 0, 1), fixed=True)
    side = m.vector("side", (0, 1, 0))
    m.body("rod", [A, B], [side, z], mass=3 * ROD, com=(0.5, 0, 0), inertia=(0.25, 0.25, 0.25))
    m.torsion_spring(m.angle("phi", x, B - A, z), damping=damping, stiffness=stiffness)
    m.gravity((0, -9.81, 0))
    return ncgen.compile(m)


def go_on(kernels, stop_when_stiff, duration=1.0, **options):
    """The status, steps and evaluations of an explicit run from rest."""
    dynamics = acceleration_forms.all_coordinates(kernels, form="emitted")
    stepping = Stepping(dynamics, "dop853", freedom(kernels).rank, 1e-8, 1e-10, None, 1e-12, stop_when_stiff=stop_when_stiff, **options)
    state = Moving(stepping)
    state.p[:], state.q[:], state.qd[:] = kernels.p0, kernels.q0, 0.0
    return state.go_on(duration), stepping.statistics.steps, stepping.statistics.evaluations


def test_a_fast_decay_is_seen_before_the_first_step():
    """Its speed decays with 1e4 1/s, it falls with 3.8 1/s: an explicit method would take 1,900 steps for stability."""
    status, steps, evaluations = go_on(rod(1e4), 1)
    assert (status, steps) == ("stiff", 0)
    assert evaluations <= 6


@pytest.mark.parametrize("damping", [1.0, 100.0])
def test_a_slow_decay_costs_a_few_evaluations(damping):
    kernels = rod(damping)
    (status, steps, evaluations), plain = go_on(kernels, 1), go_on(kernels, 0)
    assert (status, steps) == plain[:2] and status == "ok"
    assert plain[2] < evaluations <= plain[2] + 4


@pytest.mark.parametrize("name", ["fourbar", "doublependulum", "bricard", "robot"])
def test_without_dampers_it_costs_nothing(name):
    kernels = ncgen.compile(ncgen.load(name))
    assert go_on(kernels, 1, 0.1) == go_on(kernels, 0, 0.1)


def test_short_runs_and_short_steps_stay_explicit():
    """Less than 200 steps for stability, and steps that the user holds down."""
    kernels = rod(1e4)
    assert go_on(kernels, 1, 0.05)[0] == "ok"
    assert go_on(kernels, 1, 0.2, max_step=1e-4)[0] == "ok"


@pytest.mark.parametrize("speed", [0.0, 2.0])
def test_the_default_call_begins_with_radau(speed):
    """From rest, and with a speed that the damper takes at once, which is no motion that would need short steps."""
    kernels, start = rod(1e5), {"zd0": {"phi": speed}}
    run = ncgen.simulate(kernels, 1.0, points=11, **start)
    alone = ncgen.simulate(kernels, 1.0, points=11, integrator="radau", formalism="lagrange", **start)
    assert run.made_with.startswith("lagrange with radau, emitted: ")
    assert run.statistics.evaluations <= 1.5 * alone.statistics.evaluations
    # c φ' = −(m g l/2) cos φ but for φ'' of 1e-8: gd φ = ln tan(π/4 + φ/2) falls by m g l/(2 c) a second, from 0 after the speed's v J/c
    begun = np.log(np.tan(np.pi / 4 + speed / 1e5 / 2))
    fallen = begun - 3 * 9.81 / 2 / 1e5 * 1.0
    assert run["phi"][-1] == pytest.approx(2 * np.arctan(np.exp(fallen)) - np.pi / 2, abs=2e-9)


@pytest.mark.parametrize("name", ["excavator", "quadruped", "suspension", "stewart", "delta", "cam"])
def test_examples_with_dampers_are_not_stiff(name):
    kernels = ncgen.compile(ncgen.load(name))
    start = {key: value for key, value in kernels.model.simulation_options.items() if key in ("zd0", "qd0", "z0", "q0", "inputs")}
    run = ncgen.simulate(kernels, 1.0, points=2, **start)
    assert run.integrator == "dop853"
