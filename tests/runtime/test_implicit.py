"""Implicit methods in C: the exact Jacobian, Radau on stiff mechanisms, and the reference's motions step for step."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from generic_newton import motion, trapezoidal_residual
from scipy.interpolate import CubicHermiteSpline

import ncgen
from ncgen.errors import ModelError
from ncgen.mechanism.constrained_dynamics import ConstrainedDynamics
from ncgen.solver.engines import partition_dynamics
from ncgen.solver.formalisms import accelerations_by
from ncgen.solver.formalisms.coordinate_partitioning import motion_at
from ncgen.solver.formalisms.dynamics_jacobian import acceleration_jacobians, partitioned_jacobian
from ncgen.solver.formalisms.instant import Baumgarte
from ncgen.solver.formalisms.projection import project
from ncgen.solver.positions.partition import choose_partitions
from ncgen.solver.positions.rank import best_rows, scaled_jacobian, trial_positions

T = 0.05
EXAMPLES = ("fourbar", "robot", "heavytop", "bricard", "disc", "flyball", "suspension")
"""Angles, a redundant row, M(q) and singular M, rolling, springs and dampers."""


@cache
def kernels_of(name):
    return ncgen.compile(ncgen.load(name), backend="c")


def simulate(name, duration, **options):
    kernels = kernels_of(name)
    given = {k: v for k, v in kernels.model.simulation_options.items() if k == "zd0"}
    return ncgen.simulate(kernels, duration, **{**given, **options})


@cache
def exact(name, duration):
    return simulate(name, duration, integrator="dop853", rtol=1e-12, atol=1e-13, points=5, engine="c")


def state(kernels):
    """A consistent motion that is not special."""
    start = ncgen.solve_position(kernels, kernels.q0, T).q
    q = trial_positions(kernels, start, T, kernels.p0)[-1]
    partitions = choose_partitions(kernels, q, T, kernels.p0)
    zd = np.random.default_rng(2).standard_normal(len(partitions.velocity.independent))
    return partitions, motion_at(kernels, partitions.velocity, T, q, zd, kernels.p0)


@pytest.mark.parametrize("name", EXAMPLES)
def test_jacobian_of_independent_coordinates(name):
    kernels = kernels_of(name)
    partitions, now = state(kernels)
    z = partitions.velocity.independent
    found = partition_dynamics.dynamics(kernels, partitions, "dense", now.q, kernels.p0).jacobian(T, now.q, now.qd[z], kernels.p0)
    known = partitioned_jacobian(kernels, partitions, now, kernels.p0)[: len(found), :-1]
    assert len(found) == (len(known.T) if name == "disc" else len(z))  # rolling: positions do not follow from as many velocities
    assert found == pytest.approx(known, abs=1e-10 * np.max(np.abs(known)))


@pytest.mark.parametrize("gains", [None, Baumgarte(10.0, 0.7)], ids=["plain", "baumgarte"])
@pytest.mark.parametrize("formalism", ["lagrange", "null-space"])
@pytest.mark.parametrize("name", EXAMPLES)
def test_jacobian_of_all_coordinates(name, formalism, gains):
    kernels = kernels_of(name)
    partitions, now = state(kernels)
    rows = best_rows(scaled_jacobian(kernels, now.q, T, kernels.p0), len(partitions.velocity.rows))
    now = accelerations_by("lagrange").motion(kernels, now.q, now.qd, T, kernels.p0, {}, rows)
    dynamics = ConstrainedDynamics(kernels)
    dynamics._dynamics.n_dependent = len(rows)
    given = {"frequency": gains.omega, "damping": gains.xi} if gains else {}
    found = dynamics.jacobian(T, now.q, now.qd, kernels.p0, formalism, **given)
    by_q, by_qd = acceleration_jacobians(kernels, now, kernels.p0, rows, gains)
    assert found == pytest.approx(np.hstack([by_qd, by_q]), abs=1e-10 * np.max(np.abs(by_q)))


@cache
def radau(name, duration, formalism, engine):
    return simulate(name, duration, formalism=formalism, integrator="radau", rtol=1e-7, atol=1e-9, points=5, engine=engine)


@pytest.mark.parametrize(
    ("formalism", "engine"), [("coordinate-partitioning", "c"), ("coordinate-partitioning", "emitted"), ("lagrange", "c")]
)
@pytest.mark.parametrize(("name", "duration"), [("flyball", 0.5), ("andrews", 0.02), ("robot", 0.3), ("bricard", 0.5), ("suspension", 0.2)])
def test_radau(name, duration, formalism, engine):
    """As many steps as SciPy's Radau takes with the same Jacobian, and an error of the size of the tolerance."""
    run, python = (radau(name, duration, formalism, e) for e in (engine, "python"))
    assert run.engine == engine and python.engine.startswith("python")
    assert run.statistics.steps == pytest.approx(python.statistics.steps, rel=0.1, abs=2)
    assert run.statistics.evaluations < 1.1 * python.statistics.evaluations
    sizes = np.maximum(np.max(np.abs(exact(name, duration).q), axis=0), kernels_of(name).column_sizes)
    assert np.max(np.abs(run.q - exact(name, duration).q) / sizes) < 1e-6
    assert np.max(run.violation()) < 1e-12


def test_what_radau_is_for():
    """Two masses creep back on an overdamped spring: explicit steps must resolve the rate 1e5/s that has long decayed."""
    model = ncgen.Model("stiff")
    b = model.point("B", (1, 0), fixed="yz")
    end = model.point("E", (2, 0), fixed="yz")
    model.body("slider", points=[b], mass=1.0)
    model.body("end", points=[end], mass=1.0)
    model.distance(b, end)
    wall = model.point("W", (0, 0), fixed=True)
    model.spring(wall, b, stiffness=1e4, damping=2e5, free_length=0.9)
    kernels = ncgen.compile(model, backend="c")
    steps = {i: ncgen.simulate(kernels, 1.0, integrator=i, rtol=1e-6, atol=1e-9, engine="c") for i in ("radau", "dop853")}
    slow = 2e4 / (2e5 + np.sqrt(2e5**2 - 4 * 2.0 * 1e4))  # exp(-slow t): the small root of 2 s² - 2e5 s + 1e4 = 0
    for run in steps.values():
        assert run["B.x"][-1] - 0.9 == pytest.approx(0.1 * np.exp(-slow), abs=1e-6)
    assert 100 * steps["radau"].statistics.evaluations < steps["dop853"].statistics.evaluations


def test_order_of_radau_between_steps():
    """Rows between steps are those of the collocation polynomial: as closed as steps, and as good as the tolerance."""
    run = simulate("fourbar", 0.5, integrator="radau", rtol=1e-8, atol=1e-10, points=201, engine="c")
    known = simulate("fourbar", 0.5, integrator="dop853", rtol=1e-12, atol=1e-13, points=201, engine="c")
    assert run.q == pytest.approx(known.q, abs=1e-6)
    assert np.max(run.violation()) < 1e-12


STEPPED = [
    ("fourbar", 0.1, 1e-3), ("robot", 0.1, 5e-3), ("heavytop", 0.02, 2.5e-4), ("bricard", 0.1, 2.5e-3), ("flyball", 0.02, 5e-4),
    ("disc", 0.1, 5e-3),
]  # fmt: skip
FIXED = [
    ("lagrange", "energy-momentum", 1e-10),
    ("lagrange", "rattle", 1e-9),  # without damping projections end where they are below their tolerance
    ("lagrange", "generalized-alpha", 1e-11),
    ("ali3p", "trapezoidal", 1e-11),
    ("coordinate-partitioning", "trapezoidal", 1e-11),
    ("lagrange", "trapezoidal", 1e-9),  # so do its
]


ORDINARY = [each for each in FIXED if each[1] == "trapezoidal" and each[0] != "ali3p"]
QUICK = ("fourbar", "heavytop")
"""Whose equations are compiled soon."""


@pytest.mark.parametrize(("name", "duration", "step"), [each for each in STEPPED if each[0] not in ("heavytop", "disc")])
def test_the_trapezoidal_rule_is_what_it_says(name, duration, step):
    """With accelerations of Python in its equation; where independent coordinates do not change on the way."""
    count = round(duration / step)
    options = dict(formalism="coordinate-partitioning", integrator="trapezoidal", max_step=step, points=count + 1, engine="c")
    run = simulate(name, duration, **options)
    assert run.statistics.steps == count and run.statistics.partition_changes == 0
    q, qd = trapezoidal_residual(run)
    assert q < 1e-11 and qd < 1e-10
    assert np.max(run.violation()) < 1e-12


@pytest.mark.parametrize(("formalism", "integrator", "tolerance"), [each for each in FIXED if each not in ORDINARY])
@pytest.mark.parametrize(
    ("name", "duration", "step"), [each if each[0] in QUICK else pytest.param(*each, marks=pytest.mark.slow) for each in STEPPED]
)
def test_steps_solve_their_equations(name, duration, step, formalism, integrator, tolerance):
    """One Newton for all methods comes to the same; the work is that of the powers at the ends of steps, or in their middle."""
    if (name, formalism) == ("bricard", "ali3p"):
        pytest.skip("of redundant rows ali3p takes all, whose multipliers the equations leave open")
    count = round(duration / step)
    # A penalty multiplies rounding: with the usual 1e7 what two programs have in common ends at 1e-9.
    options = {"alpha": 1e4} if formalism == "ali3p" else {}
    c = simulate(name, duration, formalism=formalism, integrator=integrator, max_step=step, points=count + 1, engine="c", options=options)
    known = motion(c.kernels, integrator, c.q[0], c.qd[0], duration / count, count, formalism)
    assert c.q == pytest.approx(known.q, abs=tolerance)
    assert c.qd == pytest.approx(known.qd, abs=10 * tolerance * np.max(np.abs(known.qd)))
    assert np.max(c.violation()) < 1e-12
    if integrator != "energy-momentum":
        power = np.array([c.kernels.energy(q, qd, t)[2] for t, q, qd in zip(c.t, c.q, c.qd, strict=True)])
        assert c.work == pytest.approx(np.append(0.0, np.cumsum(duration / count * (power[1:] + power[:-1]) / 2)), abs=tolerance)


@pytest.mark.parametrize(("formalism", "integrator"), [fixed[:2] for fixed in FIXED])
@pytest.mark.parametrize(
    ("name", "duration", "step"), [("fourbar", 0.1, 1e-3), ("robot", 0.1, 5e-3), ("bricard", 0.1, 2.5e-3), ("flyball", 0.02, 5e-4)]
)
def test_order_two(name, duration, step, formalism, integrator):
    options = dict(formalism=formalism, integrator=integrator, points=2, engine="c")
    coarse, fine = (
        np.max(np.abs(simulate(name, duration, max_step=h, **options).q - exact(name, duration).q[[0, -1]])) for h in (step, step / 2)
    )
    assert np.log2(coarse / fine) == pytest.approx(2.0, abs=0.1)


@pytest.mark.parametrize("option", [{"rho": 0.0}, {"hht": 0.2}], ids=str)
def test_numerical_damping_is_an_option(option):
    options = dict(formalism="lagrange", integrator="generalized-alpha", max_step=1e-3, points=2, options=option)
    c, usual = (simulate("fourbar", 0.1, engine="c", **{**options, "options": o}) for o in (option, {}))
    known = motion(c.kernels, "generalized-alpha", c.q[0], c.qd[0], 1e-3, 100, options=option)
    assert c.q[-1] == pytest.approx(known.q[-1], abs=1e-11)
    assert np.max(np.abs(usual.q - c.q)) > 1e-7
    with pytest.raises(ModelError, match="option rho: 2.0 given; it must be a number from 0 to 1"):
        simulate("fourbar", 0.1, engine="c", **{**options, "options": {"rho": 2.0}})


def test_instants_between_steps():
    """The grid does not shape the steps of C either; rows in between are interpolated and closed."""
    options = dict(formalism="lagrange", integrator="generalized-alpha", max_step=1e-3)
    on, between = (simulate("fourbar", 0.1, points=n, engine="c", **options) for n in (101, 38))
    assert between.statistics.steps == on.statistics.steps == 100
    assert between.q[-1] == pytest.approx(on.q[-1], abs=0)
    cubic = CubicHermiteSpline(on.t, on.q, on.qd)
    states = zip(cubic(between.t), cubic(between.t, 1), between.t, strict=True)
    known = [project(on.kernels, q, qd, t, on.kernels.p0) for q, qd, t in states]
    assert between.q == pytest.approx(np.array([each.q for each in known]), abs=1e-10)
    assert between.qd[:-1] == pytest.approx(np.array([each.qd for each in known[:-1]]), abs=1e-8)  # the last row is the end of a step
    assert np.max(between.violation()) < 1e-12


def test_rows_between_trapezoidal_steps_lie_on_the_cubic():
    """Of Hermite, through the ends of steps: positions with their rates, rates with accelerations."""
    options = dict(integrator="trapezoidal", formalism="coordinate-partitioning", max_step=1e-3, z=["psi"], zd0={"psi": 12.0}, engine="c")
    on, between = (simulate("fourbar", 0.1, points=n, **options) for n in (101, 38))
    psi = on.kernels.index["psi"]
    assert between.q[:, psi] == pytest.approx(CubicHermiteSpline(on.t, on.q[:, psi], on.qd[:, psi])(between.t), abs=1e-13)
    assert between.qd[:, psi] == pytest.approx(CubicHermiteSpline(on.t, on.qd[:, psi], on.qdd[:, psi])(between.t), abs=1e-12)


def test_a_cubic_is_foreseen():
    """A particle's velocity is a cubic, as the polynomial of a step is: carried on it is the next step's.

    Newton's method has nothing to do but to see that, by twice three stages and the end of each step; now and then a step is repeated.
    """
    model = ncgen.Model("thrust")
    point = model.point("P", (0.1, 0.2))
    model.body("b", points=[point], mass=2.0)
    model.force(point, (6 * model.time**2, 2 + 4 * model.time - 12 * model.time**2, 0))
    given = {"qd0": {"P.x": 1.0, "P.y": 2.0}, "rtol": 1e-8, "atol": 1e-10, "max_step": 0.1, "points": 2, "formalism": "lagrange"}
    run = ncgen.simulate(ncgen.compile(model), 2.0, integrator="radau", engine="c", **given)
    assert run.q[-1] == pytest.approx([0.1 + 2 + 2**4 / 4, 0.2 + 4 + 2**2 / 2 + 2**3 / 3 - 2**4 / 2], rel=1e-9)
    assert run.statistics.steps > 20 and run.statistics.evaluations < 7.3 * run.statistics.steps


def double_pendulum(length: float) -> ncgen.Model:
    """Two rods and a damped spring, of a length (m), falling as many of these in a second."""
    m = ncgen.Model("swing")
    A, B, C = m.point("A", (0, 0), fixed=True), m.point("B", (length, 0)), m.point("C", (1.6 * length, 0.8 * length))
    m.body("bob", points=[B], mass=2.0)
    m.body("other", points=[C], mass=1.0)
    m.distance(A, B)
    m.distance(B, C)
    m.spring(A, C, stiffness=30.0, free_length=1.5 * length, damping=0.7)
    m.gravity((0, -9.81 * length, 0))
    return m


@pytest.mark.parametrize("formalism", ["coordinate-partitioning", "lagrange"])
def test_a_unit_of_length_changes_nothing(formalism):
    """Of 1,000 km the trapezoidal rule stopped after 0.27 s, since the work in joules was expected to be as exact as the metres."""
    method = {"formalism": formalism, "integrator": "trapezoidal", "max_step": 2e-3, "points": 2}
    runs = {length: ncgen.simulate(ncgen.compile(double_pendulum(length), "c"), 1.0, **method) for length in (1e-6, 1.0, 1e6)}
    for length, run in runs.items():
        assert run.q / length == pytest.approx(runs[1.0].q, abs=1e-10)
        assert run.statistics.evaluations == pytest.approx(runs[1.0].statistics.evaluations, rel=0.05)
