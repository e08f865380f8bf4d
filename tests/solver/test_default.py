"""The default goes through: `simulate(kernels, T)` alone on mechanisms that break methods, at the accuracy that rtol promises."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
from every_example import EVERY

import ncgen
from ncgen.comparisons.hard_cases import CASES
from ncgen.errors import ConvergenceError
from ncgen.exchange.examples import load
from ncgen.model import Model
from ncgen.report.precision import time_limit
from ncgen.solver.runs.simulation_options import simulation_of
from ncgen.solver.trajectories.energy import Instants, drift

QUICK = (
    "robot",
    "bricard",
    "disc",
    "heavy-top",
    "nfourbar-2",
    "equal-crank",
    "massless",
    "pendulum-1e-06",
    "pendulum-1e+06",
    "near-parallel",
)
SLOW = ("nfourbar-40", "free-body", "squeezer", "governor")


def error_of(name: str, rtol: float) -> float:
    case = CASES[name]
    kernels = ncgen.compile(case.build(), "c")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        run = ncgen.simulate(kernels, case.duration, rtol=rtol, points=case.points, **case.options)
    assert run.made_with
    return case.error(run)


@pytest.mark.parametrize("name", [*QUICK, *(pytest.param(name, marks=pytest.mark.slow) for name in SLOW)])
def test_within_a_hundred_tolerances(name):
    assert error_of(name, 1e-8) < 1e-6


def pendulum() -> Model:
    m = Model("swing")
    A, B = m.point("A", (0, 0), fixed=True), m.point("B", (1, 0))
    m.body("bob", points=[B], mass=1.0)
    m.distance(A, B)
    m.gravity((0, -9.81, 0))
    return m


@pytest.fixture(scope="module")
def swing():
    return ncgen.compile(pendulum(), "c")


def test_no_alarm_at_rest(swing):
    """It hangs still: what its velocities are is rounding."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        run = ncgen.simulate(swing, 1.0, q0=[0.0, -1.0])
    assert run.energy_drift < 1e-6


@pytest.mark.parametrize("points", [2, 21])
def test_no_alarm_on_a_stroboscopic_grid(swing, points):
    """At whole periods the pendulum is at rest: the energy is looked at elsewhere, too."""
    from scipy.special import ellipk

    period = 4 * ellipk(0.5) / np.sqrt(9.81)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        ncgen.simulate(swing, 20 * period, points=points)


def test_a_drift_below_a_limit_need_not_be_known(swing):
    """It is 0 only where it is below the limit, and above the limit what it is: of a pendulum that swings, of one that hangs still, and
    with energy that is added bit by bit."""
    rows = np.zeros(2)
    for q0 in ([1.0, 0.0], [0.0, -1.0]):
        run = ncgen.simulate(swing, 1.0, q0=q0, points=12)
        for added in (0.0, 1e-12, 1e-9, 1e-6, 1e-3, 1.0):
            instants = Instants(run.t, run.q, run.qd, run.work + added * np.arange(12))
            whole = drift(swing, instants, run.p)
            for limit in (1e-10, 1e-7, 1e-4, 1e-2):
                known = drift(swing, instants, run.p, limit=limit)
                assert known == whole or (known == 0.0 and whole < limit)
                rows += known == whole, known != whole
    assert np.all(rows > 0)


@pytest.mark.parametrize(
    "method",
    [
        {"integrator": "rk4", "max_step": 0.15},
        {"integrator": "rk4", "max_step": 0.1, "formalism": "coordinate-partitioning"},
        {"integrator": "rk4", "max_step": 0.15, "engine": "python"},
        {"integrator": "rattle", "max_step": 0.1},
        {"integrator": "trapezoidal", "max_step": 0.1, "formalism": "ali3p"},
    ],
    ids=str,
)
@pytest.mark.parametrize("points", [2, 3])
def test_steps_of_a_fixed_length_that_make_energy_are_told(swing, method, points):
    with pytest.warns(UserWarning, match=r"swing: the energy changes by 0\.0?\d of what moves: the steps are too long for"):
        run = ncgen.simulate(swing, 3.0, points=points, **method)
    assert run.energy_drift > 0.01
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        ncgen.simulate(swing, 3.0, points=points, **method | {"max_step": 0.01})


def test_damping_that_is_asked_for_is_not(swing):
    """Generalised α takes energy from what its steps do not resolve."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        run = ncgen.simulate(swing, 3.0, points=11, integrator="generalized-alpha", max_step=0.2)
    assert run.energy_drift > 0.01


def test_the_true_alarm_stays():
    """A method that slides over a singular position is told by its energy: BDF on the slider-crank of equal rods."""
    case = CASES["equal-crank"]
    kernels = ncgen.compile(case.build(), "c")
    with pytest.warns(UserWarning, match="the energy changes by|constraints to"):
        ncgen.simulate(kernels, 0.5, formalism="penalty", integrator="dop853", options={"alpha": 10.0}, rtol=1e-10, **case.options)


def test_what_penalty_keeps_open_is_told(swing):
    with pytest.warns(UserWarning, match=r"penalty holds the constraints to .* only \(relative\), although rtol is 1e-12"):
        ncgen.simulate(swing, 0.5, formalism="penalty", rtol=1e-12)


def test_ctrl_c_keeps_what_was_reached(swing):
    """A KeyboardInterrupt on the way, which a user may catch, has the motion up to there."""

    def press(t):
        if t > 0.0:
            raise KeyboardInterrupt

    with pytest.raises(ncgen.Interrupted) as stopped:
        ncgen.simulate(swing, 1e5, points=100_001, progress=press)
    run = stopped.value.run
    assert run.stopped and 2 <= len(run.t) == len(run.q) and np.isfinite(run.q).all()
    again = ncgen.simulate(swing, run.t[1], points=2)
    assert np.max(np.abs(again.q[-1] - run.q[1])) < 1e-5


@pytest.fixture(scope="module")
def damped():
    """A ball on a rod, pulled by a damper."""
    m = Model("damped")
    A, B, C = m.point("A", (0, 0), fixed=True), m.point("B", (1, 0)), m.point("C", (1, -1), fixed=True)
    m.body("ball", points=[B], mass=1.0)
    m.distance(A, B)
    m.spring(B, C, stiffness=20.0, damping=0.5)
    m.gravity((0, -9.81, 0))
    return ncgen.compile(m, "c")


@pytest.mark.parametrize("formalism", ["lagrange", "coordinate-partitioning"])
@pytest.mark.parametrize("engine", ["c", "python"])
def test_what_was_reached_balances(damped, formalism, engine):
    """Where a run is broken off between two instants, the damper's work up to there is that of the energy that is gone."""

    def press(t):
        if t > 0.55:
            raise KeyboardInterrupt

    with pytest.raises(ncgen.Interrupted) as stopped:
        ncgen.simulate(damped, 1e4, points=100_001, progress=press, formalism=formalism, engine=engine)
    run = stopped.value.run
    energies = [sum(damped.energy(q, qd)[:2]) for q, qd in zip(run.q[[0, -1]], run.qd[[0, -1]])]
    assert run.work[-1] < -0.1
    assert energies[1] - energies[0] == pytest.approx(run.work[-1], abs=1e-5)


@pytest.mark.parametrize("integrator", ["rattle", "energy-momentum", "generalized-alpha"])
def test_what_steps_the_constraints_chooses_the_formalism(swing, integrator):
    run = ncgen.simulate(swing, 0.01, integrator=integrator, max_step=0.005, points=2)
    assert (run.formalism, run.integrator) == ("lagrange", integrator)


def test_a_stiff_mechanism_goes_on_implicitly():
    """A spring of 1e12 N/m: explicit steps would never end."""
    m = Model("stiff")
    A, B, C = m.point("A", (0, 0), fixed=True), m.point("B", (1, 0)), m.point("C", (1, -1))
    m.body("upper", points=[B], mass=1.0)
    m.body("lower", points=[C], mass=1.0)
    m.distance(A, B)
    m.spring(B, C, stiffness=1e8, damping=1e5)
    m.gravity((0, -9.81, 0))
    run = ncgen.simulate(ncgen.compile(m, "c"), 0.2)
    assert run.integrator == "radau" and "stiff" in run.made_with
    assert np.hypot(*(run.q[-1, 2:] - run.q[-1, :2])) == pytest.approx(1.0, abs=1e-6)


def test_a_rolling_disc_is_quick():
    """In C, by default."""
    disc = ncgen.compile(load("disc"), "c")
    run = ncgen.simulate(disc, 0.5, zd0=disc.model.simulation_options["zd0"])
    assert run.engine == "emitted"


def test_a_disc_that_falls_flat_says_so_soon():
    """Without speed it falls over in 0.44 s, and its contact has no place then: not tried again step by step in Python."""
    disc = ncgen.compile(load("disc"), "c")
    with pytest.raises(ConvergenceError, match=r"disc: beyond t = 0\.44 s steps .* become tiny .* singular position"):
        ncgen.simulate(disc, 0.5, progress=time_limit(30.0))


@pytest.mark.parametrize("name", EVERY)
def test_every_example_runs_as_it_says(name):
    """By its own `simulation`, to the end, without a warning and on the constraints."""
    model = load(name)
    kernels = ncgen.compile(model, "c")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        run = ncgen.simulate(kernels, **simulation_of(model))
    assert run.stopped or run.t[-1] == simulation_of(model)["duration"]
    assert max(np.max(np.abs(kernels.phi(q, t, run.p)), initial=0.0) for t, q in zip(run.t[::10], run.q[::10], strict=True)) < 1e-9
