"""Integrators by all their names, and what a simulation refuses."""

from __future__ import annotations

import sys

import numpy as np
import pytest
import scipy.integrate
from scipy.special import ellipj, ellipk

import ncgen
from ncgen.errors import ConvergenceError, ModelError, SingularError
from ncgen.methods.table import INTEGRATORS, find_integrator, other_names
from ncgen.solver.integrators.shared_tolerance import sharing
from ncgen.solver.integrators.solvers import ODE_SOLVERS

ERROR = {"rk4": 1e-8, "trapezoidal": 1e-6}
ERROR |= {"rk23": 1e-5, "adams": 1e-5, "bdf": 1e-5, "lsoda": 1e-5, "radau": 1e-7, "dopri5": 1e-7, "dop853": 1e-7}
ERROR |= {"cvode-adams": 1e-5, "cvode-bdf": 1e-5}
"""What each method should reach in 0.2 s of the pendulum's fall at rtol 1e-8."""


@pytest.fixture(scope="module")
def pendulum():
    return ncgen.compile(ncgen.load("pendulum"), backend="c")


def falling(t):
    """x and y of the pendulum, by elliptic functions."""
    sn, _, dn, _ = ellipj(ellipk(0.5) - np.sqrt(9.81) * t, 0.5)
    half = np.sqrt(0.5) * sn
    return np.stack([-2 * half * dn, 2 * half**2 - 1], axis=1)


def _needed(name):
    """Skip what is not installed: an extra."""
    if name.startswith("cvode"):
        pytest.importorskip("sksundae")


@pytest.mark.parametrize("name", ERROR)
def test_every_method_follows_the_fall(pendulum, name):
    _needed(name)
    step = {"max_step": 1e-3} if name in ("rk4", "trapezoidal") else {}
    run = ncgen.simulate(pendulum, 0.2, integrator=name, points=11, **step)
    assert np.max(np.abs(run.q - falling(run.t))) < ERROR[name]
    assert np.max(run.violation()) <= 1e-11
    assert run.integrator == name


@pytest.mark.parametrize("name", ["adams", "bdf", "lsoda", "cvode-adams", "cvode-bdf"])
def test_the_grid_is_as_good_as_the_end(pendulum, name):
    """Between steps the methods interpolate, and not by less than they integrate."""
    _needed(name)
    run = ncgen.simulate(pendulum, 0.2, integrator=name, points=101)
    error = np.max(np.abs(run.q - falling(run.t)), axis=1)
    assert np.max(error) < 100 * max(error[-1], 1e-9)


def test_what_is_not_installed_is_said(pendulum, monkeypatch):
    monkeypatch.setitem(sys.modules, "sksundae.cvode", None)
    with pytest.raises(ModelError, match="pip install 'ncgen\\[sundials\\]'"):
        ncgen.simulate(pendulum, 0.1, integrator="cvode-bdf")


def test_cvode_goes_with_coordinate_partitioning_alone(pendulum):
    with pytest.raises(ModelError, match="cvode-adams does not go with lagrange"):
        ncgen.simulate(pendulum, 0.1, integrator="cvode-adams", formalism="lagrange")


@pytest.mark.parametrize("name", ["cvode-adams", "cvode-bdf"])
def test_problems_inside_cvode_come_out(name):
    """A mechanism that locks says so, although the position problem fails below C code."""
    _needed(name)
    kernels = ncgen.compile(ncgen.load("nfourbar"), "c")
    with pytest.raises((ConvergenceError, SingularError), match="cannot continue beyond t = 0.7"):
        ncgen.simulate(kernels, 1.0, integrator=name, zd0={"B0.x": 1.0})


def test_all_names_are_tested():
    assert set(ERROR) == {name for name, entry in INTEGRATORS.items() if entry.is_ordinary}


@pytest.mark.parametrize(("other", "name"), [*other_names().items(), ("RK45", "dopri5"), ("DOP853", "dop853"), ("Radau", "radau")])
def test_other_names(other, name):
    """SciPy's and Matlab's names, in any case, are the same methods."""
    assert find_integrator(other) is INTEGRATORS[name]
    assert find_integrator(other.upper()) is INTEGRATORS[name]


def test_matlabs_names():
    """The paper's Table 9 uses ode113, ode45 and ode15s: Adams, Dormand-Prince and backward differences."""
    assert [other_names()[name] for name in ("ode113", "ode45", "ode15s")] == ["adams", "dopri5", "bdf"]


def test_unknown_integrator(pendulum):
    with pytest.raises(ModelError, match="'euler' is unknown; choose one of auto, dopri5, rk4, .*ode15s"):
        ncgen.simulate(pendulum, 0.1, integrator="euler")


def test_unknown_formalism(pendulum):
    with pytest.raises(ModelError, match="'magic' is unknown; choose one of auto, coordinate-partitioning"):
        ncgen.simulate(pendulum, 0.1, formalism="magic")


@pytest.fixture(scope="module")
def angled():
    """A rod at rest to the right, with an angle that nobody chose: pivoting chooses B.y."""
    m = ncgen.Model("angled")
    O, B = m.point("O", (0, 0), fixed=True), m.point("B", (1, 0))
    x, z = m.vector("x", (1, 0, 0), fixed=True), m.vector("z", (0, 0, 1), fixed=True)
    m.body("rod", [O, B], mass=1.0, inertia=1 / 12)
    m.angle("phi", x, B - O, z)
    m.gravity((0, -9.81, 0))
    return ncgen.compile(m, "numpy")


def test_a_coordinate_whose_velocity_is_given_is_independent(angled):
    """Unless others are asked for; a rod that begins at 2 rad/s has energy ½ (1/3) 2² and, at the angle φ, φ̇² = 4 − 3 g sin φ."""
    run = ncgen.simulate(angled, 0.1, zd0={"phi": 2.0}, rtol=1e-10)
    np.testing.assert_allclose(run["rate(phi)"] ** 2, 4 - 3 * 9.81 * np.sin(run["phi"]), rtol=1e-8)
    with pytest.raises(ncgen.NcgenError, match="initial velocity of phi: it is not independent; .* are B.y; choose others by z"):
        ncgen.simulate(angled, 0.1, zd0={"phi": 2.0}, z=["B.y"])


REFUSED = [
    ({"zd0": {"B.x": 1.0}}, "initial velocity of B.x: it is not independent; the independent coordinates are B.y; "),
    ({"zd0": {"nothing": 1.0}}, "zd0: the mechanism has no free coordinate nothing; it has B.x, B.y"),
    ({"zd0": [1.0, 2.0]}, "zd0: 2 numbers given, 1 needed for the independent coordinates B.y"),
    ({"zd0": [np.nan]}, "zd0: "),
    ({"points": 1}, "points: 1 given"),
    ({"z": ("B.z",)}, "z: the mechanism has no free coordinate B.z; it has B.x, B.y"),
    ({"z": ("B.x", "B.y")}, "2 independent coordinates chosen, but the mechanism has 1 degree of freedom"),
    ({"q0": [1.0, 2.0, 3.0]}, "q0: 3 numbers given, 2 needed: B.x, B.y"),
    ({"p": [1.0]}, "p: 1 number given, the mechanism has no parameter"),
]


@pytest.mark.parametrize(("options", "message"), REFUSED, ids=[str(options) for options, _ in REFUSED])
def test_refused(pendulum, options, message):
    with pytest.raises(ncgen.NcgenError, match=message):
        ncgen.simulate(pendulum, 0.1, **options)


@pytest.mark.parametrize("duration", [0.0, -1.0, np.nan, np.inf])
def test_durations_are_positive(pendulum, duration):
    with pytest.raises(ModelError, match="duration: .* positive"):
        ncgen.simulate(pendulum, duration)


def test_a_coordinate_that_determines_nothing(pendulum):
    """At the start the bar is level: x cannot tell where the mass goes."""
    with pytest.raises(SingularError, match="B.x do not determine the position"):
        ncgen.simulate(pendulum, 0.1, z=("B.x",), formalism="coordinate-partitioning")


LOOSE = [
    {"zd0": {"B.y": np.nan}},
    {"zd0": {"B.y": "fast"}},
    {"atol": -1.0},
    {"atol": np.nan},
    {"rtol": -1.0},
    {"rtol": np.nan},
    {"max_step": 0.0},
    {"points": 2.5},
    {"t0": np.nan},
    {"integrator": None},
]


@pytest.mark.filterwarnings("ignore:At least one element of `rtol`")
@pytest.mark.parametrize("options", LOOSE, ids=str)
def test_refused_one_day(pendulum, options):
    with pytest.raises(ModelError):
        ncgen.simulate(pendulum, 0.01, **options)


def test_progress_goes_forward(pendulum):
    """Once a step, with the time reached, up to the end; trajectory and progress have nothing to do with each other."""
    seen = []
    run = ncgen.simulate(pendulum, 0.5, progress=seen.append, points=2, engine="python")
    assert len(seen) == run.statistics.steps > 5
    assert all(a < b for a, b in zip(seen, seen[1:], strict=False))
    assert seen[-1] == 0.5


def test_points_do_not_change_the_motion(pendulum):
    """The grid is read off the steps; it does not shape them."""
    few, many = (ncgen.simulate(pendulum, 0.5, points=n) for n in (3, 41))
    assert many.q[::20] == pytest.approx(few.q, abs=0)
    assert few.statistics.steps == many.statistics.steps
    assert many.t == pytest.approx(np.linspace(0, 0.5, 41), abs=0)


def test_points_cost_no_evaluations(pendulum):
    """DOP853's interpolant takes three evaluations a step, however many points are read off it."""
    few, many = (ncgen.simulate(pendulum, 0.5, integrator="dop853", points=n) for n in (2, 201))
    assert many.statistics.evaluations <= few.statistics.evaluations + 3 * few.statistics.steps


def test_longest_step(pendulum):
    run = ncgen.simulate(pendulum, 0.1, max_step=1e-3, points=2)
    assert run.statistics.steps >= 100


def test_runs_leave_no_trace(pendulum):
    """The paper keeps the last position between calls; here the second run repeats the first bit by bit."""
    first = ncgen.simulate(pendulum, 0.3, points=4)
    ncgen.simulate(pendulum, 0.2, q0=[0.6, -0.8], points=2)
    second = ncgen.simulate(pendulum, 0.3, points=4)
    assert np.array_equal(first.q, second.q)
    assert np.array_equal(first.qdd, second.qdd)


def test_a_run_in_two_parts(pendulum):
    """Going on from the end of a run, at its own time, is the same motion."""
    options = {"rtol": 1e-11, "atol": 1e-13, "points": 2}
    whole = ncgen.simulate(pendulum, 0.4, **options)
    half = ncgen.simulate(pendulum, 0.2, **options)
    rates = {name: half[f"rate({name})"][-1] for name in half.independent}
    rest = ncgen.simulate(pendulum, 0.2, t0=0.2, q0=half.q[-1], z=half.independent, zd0=rates, **options)
    assert rest.q[-1] == pytest.approx(whole.q[-1], abs=1e-9)
    assert rest.t[-1] == pytest.approx(0.4)


@pytest.mark.parametrize("solver", [scipy.integrate.RK45, scipy.integrate.DOP853], ids=lambda solver: solver.__name__)
def test_hopeless_steps_are_given_up_as_soon_at_zero_as_later(solver):
    """At t = 0 the spacing of numbers is 5e-324: a thousand refused steps away, where at t = 1 it is fifty."""
    counts = []
    for start in (0.0, 1.0):
        calls = []

        def noise(t, y, calls=calls):
            calls.append(t)
            return np.array([1e9 * np.sin(1e9 * len(calls))])

        steps = sharing(solver, 0.0)(noise, start, np.zeros(1), start + 1.0, rtol=1e-8, atol=1e-10)
        assert "step size" in steps.step() and steps.status == "failed"
        counts.append(len(calls))
    assert counts[0] < 1.5 * counts[1]


@pytest.mark.parametrize("beginning", [0.1, -1.0], ids=["later", "at once"])
@pytest.mark.parametrize("name", ["adams", "lsoda"])
def test_what_raises_is_told_by_itself(name, beginning):
    """Also where a tracer, such as a debugger's, runs Python between the exception and its end: the library must not go on calling."""

    def broken(t: float, y: np.ndarray) -> np.ndarray:
        if t > beginning:
            raise ValueError(f"beyond {len(y)}")
        return -y

    before = sys.gettrace()
    sys.settrace(lambda *event: None)
    try:
        with pytest.raises(ValueError, match="beyond 3"):
            solver = ODE_SOLVERS[name](broken, 0.0, np.ones(3), 1.0, rtol=1e-6)
            while solver.status == "running":
                solver.step()
    finally:
        sys.settrace(before)
