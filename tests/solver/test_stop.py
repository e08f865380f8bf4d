"""Runs that end where a coordinate or a velocity passes a value: the same instant with every engine and method."""

from __future__ import annotations

from fractions import Fraction

import mpmath
import numpy as np
import pytest
from scipy.special import ellipk

import ncgen
from ncgen.errors import ModelError

QUARTER = ellipk(0.5) / np.sqrt(9.81)
"""A quarter of the period of a pendulum of 1 m that falls from the horizontal: it hangs straight down then."""

ADAPTIVE = [
    ("coordinate-partitioning", "dopri5", "c"),
    ("coordinate-partitioning", "dop853", "emitted"),
    ("coordinate-partitioning", "radau", "c"),
    ("coordinate-partitioning", "dop853", "python"),
    ("coordinate-partitioning", "radau", "python"),
    ("lagrange", "dop853", "c"),
    ("lagrange", "dop853", "python"),
    ("null-space", "dopri5", "c"),
]
FIXED = [
    (formalism, integrator, "c")
    for formalism, integrator in [("lagrange", "rattle"), ("lagrange", "energy-momentum"), ("lagrange", "generalized-alpha"),
                                  ("ali3p", "trapezoidal"), ("coordinate-partitioning", "trapezoidal")]
]  # fmt: skip


@pytest.fixture(scope="module")
def pendulum():
    return ncgen.compile(ncgen.load("pendulum"), backend="c")


def fall(pendulum, stop, formalism="coordinate-partitioning", integrator="dop853", engine="c", **options):
    options = {"rtol": 1e-11, "atol": 1e-13, "points": 21, **options}
    return ncgen.simulate(pendulum, 2.0, formalism=formalism, integrator=integrator, engine=engine, stop=stop, **options)


@pytest.mark.parametrize(("formalism", "integrator", "engine"), ADAPTIVE)
@pytest.mark.parametrize("stop", [{"B.x": 0.0}, {"rate(B.y)": (0.0, "rising")}], ids=str)
def test_lowest_point(pendulum, stop, formalism, integrator, engine):
    """The quarter of the period is the elliptic one, and the speed there is that of the energy."""
    assert "B.x" in pendulum.index
    run = fall(pendulum, stop, formalism, integrator, engine)
    assert run.stopped and run.engine[:6] == engine[:6]
    assert run.t[-1] == pytest.approx(QUARTER, abs=2e-9)
    assert run.q[-1] == pytest.approx([0.0, -1.0], abs=2e-8)
    assert np.linalg.norm(run.qd[-1]) == pytest.approx(np.sqrt(2 * 9.81), abs=1e-8)
    assert run.t[:-1] == pytest.approx(0.1 * np.arange(np.ceil(QUARTER / 0.1)), abs=1e-12)
    assert len(run.t) == len(run.q) == len(run.qd) == len(run.work)


@pytest.fixture(scope="module")
def damped():
    model = ncgen.load("pendulum")
    model.spring("B", model.point("G", (2, 0), fixed=True), stiffness=5.0, damping=0.5, free_length=1.0)
    return ncgen.compile(model, backend="c")


@pytest.mark.parametrize(("formalism", "integrator", "engine"), ADAPTIVE)
def test_the_work_until_then(damped, formalism, integrator, engine):
    """What a damper has taken where the run ends balances the energy, as on the grid."""
    run = fall(damped, {"B.x": 0.0}, formalism, integrator, engine)
    assert run.stopped and run.engine[:6] == engine[:6]
    assert run.work[-1] < run.work[-2] < -0.1
    assert run.energy_drift < 1e-8


@pytest.mark.parametrize(("formalism", "integrator", "engine"), FIXED)
def test_lowest_point_between_fixed_steps(pendulum, formalism, integrator, engine):
    run = fall(pendulum, {"B.x": 0.0}, formalism, integrator, engine, max_step=1e-3)
    assert run.stopped and run.engine[:6] == engine[:6]
    assert run.t[-1] == pytest.approx(QUARTER, abs=1e-5)
    assert abs(run["B.x"][-1]) < 1e-12
    assert np.max(run.violation()) < 1e-12


@pytest.mark.parametrize("engine", ["c", "python"])
def test_direction(pendulum, engine):
    """x passes zero one way after a quarter of the period and the other way after three; either is the first of the two."""
    first = "rising" if pendulum.q0[0] < 0 else "falling"
    other = {"rising": "falling", "falling": "rising"}[first]
    instants = [fall(pendulum, {"B.x": (0.0, way)}, engine=engine).t[-1] for way in (first, "either", other)]
    assert instants == pytest.approx([QUARTER, QUARTER, 3 * QUARTER], abs=1e-8)


@pytest.mark.parametrize("engine", ["c", "python"])
@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_either_way(pendulum, engine, side):
    """From the left x passes zero rising, from the right falling."""
    run = fall(pendulum, {"B.x": 0.0}, engine=engine, q0=[side, 0.0])
    assert run.stopped and run.t[-1] == pytest.approx(QUARTER, abs=1e-8)


@pytest.mark.parametrize("engine", ["c", "python"])
def test_a_run_that_starts_on_the_value_goes_on(pendulum, engine):
    """At rest the rate is zero; the next time at the lowest point."""
    run = fall(pendulum, {"rate(B.y)": 0.0}, engine=engine)
    assert run.stopped and run.t[-1] == pytest.approx(QUARTER, abs=1e-8)


@pytest.mark.parametrize("engine", ["c", "python"])
def test_what_does_not_happen_does_not_stop(pendulum, engine):
    run = fall(pendulum, {"B.y": 0.5}, engine=engine)
    assert not run.stopped and run.t[-1] == 2.0 and len(run.t) == 21


@pytest.mark.parametrize("engine", ["c", "emitted", "python"])
def test_work_until_then(engine):
    """A driver's work ends with the run: the balance of energy holds at the instant of the stop."""
    kernels = ncgen.compile(ncgen.load("suspension"), backend="c")
    name = kernels.coordinates[0]
    whole = ncgen.simulate(kernels, 0.3, points=31, engine=engine)
    value = float(np.mean(whole[name][10:12]))
    run = ncgen.simulate(kernels, 0.3, points=31, engine=engine, stop={name: value})
    assert run.stopped and 0 < run.t[-1] <= 0.11
    assert run[name][-1] == pytest.approx(value, abs=1e-10)
    assert run.energy_drift < 1e-6
    assert run.q[:-1] == pytest.approx(whole.q[: len(run.t) - 1], abs=1e-9)


@pytest.mark.parametrize(
    ("formalism", "integrator", "engine"),
    [
        ("coordinate-partitioning", "dop853", "emitted"),
        ("coordinate-partitioning", "dopri5", "c"),
        ("lagrange", "dop853", "c"),
        ("lagrange", "radau", "c"),
        ("coordinate-partitioning", "dop853", "python"),
        ("lagrange", "dopri5", "python"),
    ],
)
@pytest.mark.parametrize("depth", [1e-2, 1e-3, 1e-4, 1e-6])
def test_there_and_back_within_a_step(pendulum, depth, formalism, integrator, engine):
    """The pendulum comes back to the height that it fell from, and is nearer to it than `depth` for less than a step."""
    with mpmath.workdps(20):
        fallen = float(mpmath.quad(lambda a: 1 / mpmath.sqrt(2 * 9.81 * mpmath.sin(a)), [0, mpmath.asin(depth) / 16, mpmath.asin(depth)]))
    options = {"formalism": formalism, "integrator": integrator, "engine": engine, "atol": None, "rtol": 1e-9}
    run = fall(pendulum, {"B.y": (-depth, "rising")}, **options)
    assert run.stopped and run["B.y"][-1] == pytest.approx(-depth, abs=1e-12)
    assert run.t[-1] == pytest.approx(2 * QUARTER - fallen, abs=1e-5)
    late = fall(pendulum, {"B.y": (-depth, "falling")}, **options)
    assert late.t[-1] == pytest.approx(fallen, abs=1e-5)


@pytest.mark.parametrize("engine", ["c", "python"])
def test_a_ball_that_is_thrown(engine):
    """Its parabola is exact in one step: 10 mm below the apex it is twice."""
    model = ncgen.Model("ball")
    model.body("ball", [model.point("P", (0, 0))], mass=1.0)
    model.gravity((0, -9.81))
    kernels = ncgen.compile(model, backend="c")
    half = np.sqrt(2 * 0.01 / 9.81)
    for way, expected in (("rising", 0.5 - half), ("falling", 0.5 + half)):
        stop = {"P.y": (9.81 / 8 - 0.01, way)}
        run = ncgen.simulate(kernels, 1.0, points=2, qd0={"P.y": 9.81 / 2}, rtol=1e-6, engine=engine, stop=stop)
        assert run.stopped and run.t[-1] == pytest.approx(expected, abs=1e-9)


def test_a_fraction_is_a_number(pendulum):
    """1/3 as a fraction stops where the pendulum's energy says: of rod 1 at the depth 1/3 its speed is √(2 g/3)."""
    run = fall(pendulum, {"B.y": Fraction(-1, 3)})
    assert run.stopped and run["B.y"][-1] == pytest.approx(-1 / 3, abs=1e-9)
    assert np.linalg.norm(run.qd[-1]) == pytest.approx(np.sqrt(2 * 9.81 / 3), rel=1e-7)


REFUSED = [
    ({"B.x": 10**400}, "stop at B.x: a number of 401 digits given"),
    ({"B.x": Fraction(10**400, 3)}, "stop at B.x: "),
    ({"C.x": 0.0}, "stop at C.x: pendulum has no free coordinate C.x; it has B.x"),
    ({"B.x": "0"}, "stop at B.x: '0' given; it must be a number"),
    ({"B.x": (0.0, "up")}, "stop at B.x: direction 'up' is unknown; choose one of falling, either, rising"),
    ({"B.x": 0.0, "B.y": 0.0}, "it is one coordinate and its value"),
    ({"B.x": float("nan")}, "stop at B.x: nan given"),
]


@pytest.mark.parametrize(("stop", "message"), REFUSED, ids=[message for _, message in REFUSED])
def test_refused(pendulum, stop, message):
    with pytest.raises(ModelError, match=message):
        fall(pendulum, stop)
