"""Many simulations side by side against one at a time: the same method, written once more with masks for branches."""

from __future__ import annotations

import signal
import time
import warnings
from dataclasses import replace

import numpy as np
import pytest
import sympy
from scipy.special import ellipk

import ncgen
from ncgen.exchange.examples import example_module
from ncgen.mechanism.run_arguments import InitialState
from ncgen.solver.engines.partition_dynamics import dynamics
from ncgen.solver.formalisms.coordinate_partitioning import motion_at
from ncgen.solver.positions.partition import choose_partitions
from ncgen.solver.positions.position import residual

COUNT = 11
"""No multiple of the lanes, so that the last block is not full."""


@pytest.fixture(scope="module")
def driven():
    """A driven crank with a swing on a spring with a damper: everything that does work, and two parameters."""
    m = ncgen.Model("drivenbatch")
    stiffness, speed = m.parameter("stiffness", 40.0), m.parameter("speed", 3.0)
    A, B, C = m.point("A", (0, 0), fixed=True), m.point("B", (0.1, 0)), m.point("C", (0.3, 0.3))
    x, z = m.vector("x", (1, 0, 0), fixed=True), m.vector("z", (0, 0, 1), fixed=True)
    m.body("crank", [A, B], mass=0.5, inertia=1e-3)
    m.body("swing", [B, C], mass=0.5, inertia=0.01)
    m.drive(m.angle("psi", x, B - A, z), speed.symbol * m.time + 0.2 * sympy.sin(5 * m.time))
    m.spring(C, m.point("G", (0.6, 0.0), fixed=True), stiffness=stiffness, damping=0.8)
    m.gravity((0, -9.81, 0))
    return ncgen.compile(m, "c")


def assert_as_alone(kernels, batch, i, run):
    """State i of a batch has the steps of a run of its own, and its motion to rounding."""
    assert batch.steps[i] == run.statistics.steps
    for ours, own in ((batch.q[i], run.q), (batch.qd[i], run.qd), (batch.work[i], run.work)):
        assert np.max(np.abs(ours - own)) < 1e-10 * max(1.0, np.max(np.abs(own)))


@pytest.mark.parametrize("threads", [1, 2])
def test_robot_falls_as_alone(robot, threads):
    """Own velocities and own steps for each state; rows inside the steps, too."""
    zd0 = np.random.default_rng(1).uniform(-2, 2, (COUNT, 6))
    batch = ncgen.simulate(robot, 0.3, zd0=zd0, rtol=1e-6, atol=1e-8, points=14, threads=threads)
    assert set(batch.status) == {"ok"} and not batch.alone.any()
    assert len(set(batch.steps)) > 1, "all states take the same number of steps: nothing is masked"
    for i in range(COUNT):
        run = ncgen.simulate(robot, 0.3, zd0=zd0[i], rtol=1e-6, atol=1e-8, points=14, engine="emitted", integrator="dopri5")
        assert_as_alone(robot, batch, i, run)


def test_positions_that_close_at_once():
    """An arm's positions follow from its angles without a residual to look at; its motion is that of one arm, and right."""
    arm = ncgen.compile(ncgen.load("arm"), "c")
    zd0 = np.random.default_rng(0).uniform(-1, 1, (3, 7))
    batch = ncgen.simulate(arm, 0.3, zd0=zd0, rtol=1e-8, points=3)
    names = batch.independent
    for i, rates in enumerate(zd0):
        start = dict(zip(names, rates.tolist(), strict=True))
        matrix = ncgen.simulate(arm, 0.3, zd0=start, rtol=1e-11, points=3, engine="c", formalism="lagrange", integrator="dop853")
        assert batch.q[i] == pytest.approx(matrix.q, abs=1e-6)


@pytest.mark.parametrize("options", [
    {"rtol": 1e-7, "atol": 1e-9},
    {"integrator": "dop853", "rtol": 1e-9, "atol": 1e-11},
    {"integrator": "rk4", "max_step": 0.004},
    {"max_step": 0.01},
])  # fmt: skip
def test_parameters_as_alone(driven, options):
    """Own parameters for each state: the driver turns at another speed, the spring has another stiffness."""
    p = np.column_stack([np.linspace(20, 60, COUNT), np.linspace(1, 4, COUNT)])
    batch = ncgen.simulate(driven, 0.1, p=p, t0=0.1, points=4, **options)
    assert set(batch.status) == {"ok"} and not batch.alone.any()
    for i in range(COUNT):
        own = ncgen.simulate(driven, 0.1, p=p[i], t0=0.1, points=4, engine="emitted", **{"integrator": "dopri5", **options})
        assert_as_alone(driven, batch, i, own)


@pytest.mark.parametrize("rtol", [1e-5, 1e-9])
def test_eighth_order_steps_as_alone(robot, rtol):
    """Its error is estimated twice, and the first step tried: with another weight there would be another number of steps."""
    zd0 = np.random.default_rng(2).uniform(-2, 2, (3, 6))
    options = {"integrator": "dop853", "rtol": rtol, "atol": rtol, "points": 2}
    batch = ncgen.simulate(robot, 0.3, zd0=zd0, **options)
    assert not batch.alone.any()
    for i in range(3):
        assert_as_alone(robot, batch, i, ncgen.simulate(robot, 0.3, zd0=zd0[i], engine="emitted", **options))


def test_coordinates_without_an_order_of_elimination(driven):
    """A run goes on with coordinates for which nothing can be written out: their elimination exchanges rows."""
    options = {"p": [20.0, 1.0], "points": 5}
    run = ncgen.simulate(driven, 2.0, engine="emitted", integrator="dop853", rtol=1e-4, atol=1e-4, **options)
    exact = ncgen.simulate(driven, 2.0, engine="c", formalism="lagrange", integrator="dop853", rtol=1e-11, **options)
    assert np.max(np.abs(run.q - exact.q)) < 1e-3


def test_states_whose_coordinates_become_bad_go_on_alone():
    """A pendulum passes positions that x or y alone do not determine; after the elliptic period it is back."""
    kernels = ncgen.compile(ncgen.load("pendulum"), "c")
    period = 4 * ellipk(0.5) / np.sqrt(9.81)
    told = []
    batch = ncgen.simulate(kernels, period, q0=np.tile(kernels.q0, (9, 1)), rtol=1e-11, atol=1e-13, progress=told.append)
    assert batch.alone.all() and batch.ok.all()
    assert told[-10:] == pytest.approx(np.arange(10) / 9)
    assert np.max(np.abs(batch.q[:, -1] - batch.q[:, 0])) < 1e-8


def test_states_that_cannot_go_on_are_named():
    """A driver pulls a rod further than it reaches: those states say so, the others arrive."""
    m = ncgen.Model("lockedbatch")
    speed = m.parameter("speed", 0.5)
    A, B, C = m.point("A", (0, 0), fixed=True), m.point("B", (0.5, 0.2)), m.point("C", (0.9, 0.0), fixed="yz")
    m.body("first", [A, B], mass=1.0, inertia="point")
    m.body("second", [B, C], mass=1.0, inertia="point")
    D = m.point("D", (0.5, -0.6))
    m.body("hanging", [B, D], mass=1.0, inertia="point")
    m.gravity((0, -9.81, 0))
    m.drive(C.x, 0.9 + speed.symbol * m.time)
    kernels = ncgen.compile(m, "c")
    batch = ncgen.simulate(kernels, 0.5, p=np.array([[0.05], [0.5], [0.1]]), points=6)
    assert batch.ok.tolist() == [True, False, True]
    assert "t = " in batch.status[1] and "\n" not in batch.status[1]
    assert np.isfinite(batch.q[[0, 2]]).all() and np.isnan(batch.q[1, -1]).all()


def test_open_positions_are_closed(robot):
    """A start that violates the constraints is assembled, like that of a single run."""
    q0 = np.array([robot.q0, robot.q0])
    q0[1, 0] += 1e-4
    batch = ncgen.simulate(robot, 0.01, q0=q0, integrator="rk4", max_step=0.005)
    assert np.max(np.abs(robot.batch.phi(batch.q[:, 0]))) < 1e-12


@pytest.mark.parametrize(
    "given, said",
    [
        ({"zd0": np.zeros((3, 6)), "engine": "c"}, "simulate: engine is given, and it has no effect with rows of states; leave it out"),
        ({"zd0": np.zeros((3, 6)), "stop": {"psi1": 1.0}}, "simulate: stop is given with rows of states; define an event"),
        ({"threads": 2}, "simulate: threads is for a batch, and no argument has rows; leave it out, or give rows of states"),
        ({"zd0": np.zeros((1, 3, 6))}, r"zd0: array.* given; give numbers in the order of z or {name: rate}"),
        ({"zd0": np.zeros((3, 6)), "q0": np.zeros((2, 36))}, "q0 has 2, zd0 has 3 rows; a batch has one number of them"),
        ({"zd0": np.zeros((3, 5))}, r"zd0 has shape \(3, 5\); \(6,\) or \(3, 6\) is needed"),
        ({"zd0": np.full((3, 6), np.nan)}, "zd0 has numbers that are not finite"),
        ({"zd0": np.zeros((3, 6)), "integrator": "rk4"}, "max_step: rk4 has a fixed step; give its length in seconds"),
        ({"zd0": np.zeros((3, 6)) * 1j}, "zd0 is complex"),
        ({"q0": np.full((3, 36), np.nan)}, "no state of the batch has finite q and p"),
        ({"p": {"k": 1.0}, "zd0": np.zeros((3, 6))}, "p: the mechanism has no parameter k; it has none"),
        ({"zd0": {"nothing": np.zeros(3)}}, "zd0: the mechanism has no free coordinate nothing; "),
        ({"zd0": {"r2.x": np.zeros(3)}}, "initial velocity of r2.x: it is not independent; the independent coordinates are"),
        ({"zd0": {"psi1": np.zeros((3, 2))}}, r"zd0 has arrays of shapes \[\(3, 2\)\]; give each name a number, or one for every state"),
        ({"zd0": np.zeros((3, 6)), "integrator": "bdf"}, "bdf is not among dopri5, rk4, dop853, rk23"),
    ],
)
def test_mistakes_are_named(robot, given, said):
    with pytest.raises(ncgen.ModelError, match=said) as caught:
        ncgen.simulate(robot, 0.1, **given)
    assert "\n" not in str(caught.value) and len(str(caught.value)) <= 300


@pytest.fixture(scope="module")
def fragile():
    """A slider-crank with a driver that may pull too far, and a force that is a number up to a height only."""
    m = ncgen.Model("fragile")
    speed, height, shake = m.parameter("speed", 0.05), m.parameter("height", 5.0), m.parameter("shake", 0.0)
    A, B, C = m.point("A", (0, 0), fixed=True), m.point("B", (0.5, 0.2)), m.point("C", (0.9, 0.0), fixed="yz")
    m.body("first", [A, B], mass=1.0, inertia="point")
    m.body("second", [B, C], mass=1.0, inertia="point")
    D = m.point("D", (0.5, -0.6))
    m.body("hanging", [B, D], mass=1.0, inertia="point")
    m.gravity((0, -9.81, 0))
    m.drive(C.x, 0.9 + speed.symbol * m.time + 1e-3 * sympy.sin(shake.symbol * m.time))
    m.force(D, (sympy.sqrt(D.y.symbol + height.symbol), 0, 0))
    return ncgen.compile(m, "c")


DURATION = 0.4


@pytest.fixture(scope="module")
def good(fragile):
    """Parameters of states that arrive, and the batch of these alone."""
    p = np.tile(fragile.p0, (COUNT, 1))
    p[:, 0] = np.linspace(0.02, 0.1, COUNT)
    return p, ncgen.simulate(fragile, DURATION, p=p, points=5)


BAD = {
    "nan parameter": ("p", (np.nan, 5.0, 0.0), "p: speed is nan; it must be a finite number"),
    "locks": ("p", (0.5, 5.0, 0.0), "t = "),
    "no number at the start": ("p", (0.05, 0.1, 0.0), "is not a number at t = 0 s"),
    "no number on the way": ("p", (0.05, 0.6005, 0.0), "t = 0.00"),
    "does not close": ("q0", 40.0, "does not close"),
    "nan position": ("q0", np.nan, "q0: B.x is nan; it must be a finite number"),
    "infinite velocity": ("zd0", np.inf, "zd0"),
}


@pytest.mark.parametrize("at", [0, 4, COUNT])
@pytest.mark.parametrize("wrong", BAD)
def test_a_bad_state_costs_nothing_but_itself(fragile, good, wrong, at):
    """Its status is a sentence, its rows are NaN from where it ended, and the others have the bits that they have without it."""
    array, value, said = BAD[wrong]
    p, expected = good
    given = {"p": np.insert(p, at, fragile.p0, axis=0), "q0": np.tile(fragile.q0, (COUNT + 1, 1)), "zd0": np.zeros((COUNT + 1, 1))}
    given[array][at] = value
    batch = ncgen.simulate(fragile, DURATION, points=5, z=expected.independent, **given)
    others = [i for i in range(COUNT + 1) if i != at]
    assert all(batch.status[i] == "ok" for i in others) and not batch.ok[at]
    assert said in batch.status[at] and "\n" not in batch.status[at] and len(batch.status[at]) <= 300
    assert np.isnan(batch.q[at, -1]).all() and np.isnan(batch.work[at, -1])
    for name in ("q", "qd", "work", "steps"):
        assert np.array_equal(getattr(batch, name)[others], getattr(expected, name)), name


def test_the_others_are_as_alone(fragile, good):
    p, batch = good
    for i in range(COUNT):
        assert_as_alone(fragile, batch, i, ncgen.simulate(fragile, DURATION, p=p[i], points=5, engine="emitted", integrator="dopri5"))


def test_a_first_state_that_is_singular():
    """A four-bar whose links lie in one line has no independent coordinates there; the others have."""
    m = ncgen.Model("square")
    A, D = m.point("A", (0, 0), fixed=True), m.point("D", (1, 0), fixed=True)
    B, C = m.point("B", (0.0, 1.0)), m.point("C", (1.0, 1.0))
    for name, points in {"crank": [A, B], "coupler": [B, C], "rocker": [C, D]}.items():
        m.body(name, points, mass=1.0, inertia="point")
    kernels = ncgen.compile(m, "c")
    flat = {"B.x": 1.0, "B.y": 0.0, "C.x": 2.0, "C.y": 0.0}
    q0 = np.array([[flat[name] for name in kernels.coordinates], kernels.q0, kernels.q0])
    batch = ncgen.simulate(kernels, 0.1, q0=q0, zd0=np.ones(1))
    assert batch.ok.tolist() == [False, True, True] and "singular" in batch.status[0]
    with pytest.raises(ncgen.SingularError, match="square: the position is singular"):
        ncgen.simulate(kernels, 0.1, q0=q0[:1])


def test_a_batch_in_which_nothing_closes_says_so(fragile):
    with pytest.raises(ncgen.ModelError, match="no state of the batch has a start; the first: fragile: the mechanism does not close"):
        ncgen.simulate(fragile, 0.1, q0=np.full((3, fragile.n), 40.0))


def test_an_angle_on_its_mirror_root_is_refused(robot):
    """Half a turn off its elements, where the rows are zero as well."""
    q0 = np.tile(robot.q0, (3, 1))
    q0[1, robot.index["psi1"]] += np.pi
    batch = ncgen.simulate(robot, 0.01, q0=q0)
    assert batch.ok.tolist() == [True, False, True] and "angle psi1: the position found is the mirror root" in batch.status[1]


def test_names_are_numbers_for_all_or_for_each(driven):
    """Parameters and velocities by name, as arrays give them."""
    speeds = np.linspace(1, 4, COUNT)
    by_name = ncgen.simulate(driven, 0.1, p={"speed": speeds}, zd0={})
    p = np.column_stack([np.full(COUNT, 40.0), speeds])
    assert np.array_equal(by_name.q, ncgen.simulate(driven, 0.1, p=p).q)
    (name,) = by_name.independent
    rates = np.linspace(-1, 1, COUNT)
    by_name = ncgen.simulate(driven, 0.1, p={"speed": 2.0}, zd0={name: rates}, z=(name,))
    in_rows = ncgen.simulate(driven, 0.1, p=np.array([40.0, 2.0]), zd0=rates[:, None], z=(name,))
    assert np.array_equal(by_name.q, in_rows.q) and by_name.ok.all()
    found = ncgen.accelerations(driven, driven.q0, {name: rates}, p={"speed": 2.0}, z=(name,))
    assert np.array_equal(found.zdd, ncgen.accelerations(driven, driven.q0, rates[:, None], p=np.array([40.0, 2.0]), z=(name,)).zdd)


def test_a_state_that_takes_for_ever_is_given_up(fragile, good, monkeypatch):
    """After a number of steps, and is not begun again alone."""
    monkeypatch.setattr("ncgen.solver.motions.batch.MOST_STEPS", 500)
    monkeypatch.setattr("ncgen.solver.motions.batch.simulate_one", None)
    p, expected = good
    batch = ncgen.simulate(fragile, DURATION, p=np.vstack([[0.05, 5.0, 1e5], p]), points=5, z=expected.independent)
    assert batch.steps[0] == 500 and not batch.alone[0] and "fragile: 500 steps came no further than t = 0.0" in batch.status[0]
    assert np.array_equal(batch.q[1:], expected.q)


@pytest.mark.parametrize("threads", [1, 2])
@pytest.mark.parametrize("slow", [0, -1])
@pytest.mark.usefixtures("signals_may_raise")
def test_ctrl_c_ends_a_batch(fragile, good, threads, slow):
    """Soon, also where the calling thread has nothing to do but wait; what was finished is kept."""
    p = np.tile(good[0][0], (64, 1))
    p[slow, 2] = 1e6
    told, pressed = [], []

    def press(share):
        told.append(share)
        if len(told) == 1:
            pressed.append(time.perf_counter())
            signal.raise_signal(signal.SIGINT)

    before = signal.signal(signal.SIGINT, signal.default_int_handler)  # who runs the tests in the background may ignore it
    try:
        with pytest.raises(KeyboardInterrupt) as caught:
            ncgen.simulate(fragile, 100 * DURATION, p=p, threads=threads, progress=press)
    finally:
        signal.signal(signal.SIGINT, before)
    assert time.perf_counter() - pressed[0] < 1.0
    found = caught.value.trajectory
    assert found.status[slow] == "interrupted" and np.isnan(found.q[slow, -1]).all()
    assert told == sorted(told) and 0 <= told[0] and told[-1] < 1


def test_progress_is_told_and_may_end_a_batch(robot):
    """The share of states that are done, in order, up to the whole; what it raises is raised, with what was found."""
    zd0, told = np.random.default_rng(1).uniform(-2, 2, (3000, 6)), []
    ncgen.simulate(robot, 0.5, zd0=zd0, threads=1, progress=told.append)
    assert told == sorted(told) and told[-1] == 1.0 and len(told) > 3

    def enough(share):
        if share > 0.1:
            raise ArithmeticError("enough")

    with pytest.raises(ArithmeticError, match="enough") as caught:
        ncgen.simulate(robot, 0.5, zd0=zd0, threads=2, progress=enough)
    found = caught.value.trajectory
    assert set(found.status) == {"ok", "interrupted"} and 0.1 < np.mean(found.ok) < 0.9
    assert np.isfinite(found.q[found.ok]).all() and np.isnan(found.q[~found.ok, -1]).all()


def test_warnings_of_states_alone_are_summed_up(monkeypatch):
    """One for all of them."""

    def simulate(*args, **options):
        warnings.warn("the energy changes", stacklevel=2)
        return ncgen.simulate(*args, **options)

    monkeypatch.setattr("ncgen.solver.motions.batch.simulate_one", simulate)
    kernels = ncgen.compile(ncgen.load("pendulum"), "c")
    with pytest.warns(UserWarning) as said:
        batch = ncgen.simulate(kernels, 2.0, q0=np.tile(kernels.q0, (9, 1)))
    (only,) = said
    assert batch.alone.all() and str(only.message) == "pendulum: 9 of 9 states simulated alone had warnings; state 0: the energy changes"
    assert only.filename == __file__


def test_fixed_steps_without_a_length_are_refused_in_c(robot):
    """By the runtime itself, which would take a step a row."""
    q = ncgen.assemble(robot, robot.q0)
    partitions = choose_partitions(robot, q, independent=robot.model.chosen_independent)
    lanes, single = (dynamics(robot, partitions, form, q, robot.p0) for form in ("lanes", "emitted"))
    zd = np.zeros(6)
    for times, max_step in (([0.0, 1.0], 0.0), ([0.0, 1.0], 1e-300), ([1.0, 1.0], 0.1)):
        with pytest.raises(ncgen.NcgenError, match="rk4 cannot step over these times"):
            lanes.simulate("rk4", times, InitialState(q[None], zd[None], robot.p0), max_step=max_step, tolerance=1e-12, max_growth=2.0)
    assert single.simulate("rk4", [0.0, 1.0], InitialState(q, zd, robot.p0), tolerance=1e-12, max_growth=2.0).status == "argument"


def test_accelerations_are_those_of_the_reference(robot):
    """Positions that are open by a little are closed first; 21 states leave the last block half empty."""
    rng = np.random.default_rng(3)
    start = ncgen.simulate(robot, 0.001, points=2, formalism="coordinate-partitioning")
    z = start.partitions.velocity.independent
    q, zd = np.tile(start.q[0], (21, 1)), rng.uniform(-1, 1, (21, len(z)))
    q[:, z] += rng.uniform(-0.01, 0.01, zd.shape)
    found = ncgen.accelerations(robot, q, zd, velocities=True)
    assert found.ok.all() and found.independent == start.independent
    again = ncgen.accelerations(robot, q, zd, out=found)
    assert again.zdd is found.zdd and again.qd is found.qd
    with pytest.raises(ncgen.ModelError, match="out has results of 21 states; 3 are needed"):
        ncgen.accelerations(robot, q[:3], zd[:3], out=found)
    with pytest.raises(ncgen.ModelError, match="leave z or out out"):
        ncgen.accelerations(robot, q, zd, out=found, z=("psi1",))
    with pytest.raises(ncgen.NcgenError, match=r"out\.q must be a contiguous array of \(21, 36\) doubles that may be written to"):
        ncgen.accelerations(robot, q, zd, out=replace(found, q=np.zeros((21, 35))))
    with pytest.raises(ncgen.NcgenError, match=r"out\.zdd shares memory with an argument"):
        ncgen.accelerations(robot, q, found.zdd, out=found)
    with pytest.raises(ncgen.NcgenError, match=r"out\.qd shares memory with an argument"):
        ncgen.accelerations(robot, q, zd, out=replace(found, qd=found.q))
    for i in range(21):
        assert residual(robot, found.q[i]) < 1e-12 and np.array_equal(found.q[i][z], q[i][z])
        here = motion_at(robot, start.partitions.velocity, 0.0, found.q[i], zd[i], robot.p0)
        np.testing.assert_allclose(found.qd[i], here.qd, atol=1e-12)
        np.testing.assert_allclose(found.zdd[i], here.qdd[z], rtol=0, atol=1e-11 * np.max(np.abs(here.qdd)))


@pytest.fixture(scope="module")
def short_arm():
    """An open tree, whose dependent coordinates are found in closed form and follow one another."""
    return ncgen.compile(example_module("arm").build(3), backend="c")


@pytest.mark.parametrize("name", ["robot", "short_arm"])
def test_states_may_stay_where_they_are(name, request):
    """Positions that are closed in place, without velocities, give the same accelerations to the last bit."""
    robot = request.getfixturevalue(name)
    start = ncgen.simulate(robot, 0.001, points=2, formalism="coordinate-partitioning")
    z = start.partitions.velocity.independent
    rng = np.random.default_rng(4)
    q, zd = np.tile(start.q[0], (19, 1)), rng.uniform(-1, 1, (19, len(z)))
    q[:, z] += rng.uniform(-0.01, 0.01, zd.shape)
    apart = ncgen.accelerations(robot, q, zd)
    assert apart.qd is None
    found = ncgen.accelerations(robot, q, zd)
    found.q[:] = q
    there = ncgen.accelerations(robot, found.q, zd, out=found)
    assert there.q is found.q and np.array_equal(there.q, apart.q) and np.array_equal(there.zdd, apart.zdd)


@pytest.mark.parametrize(("wrong", "at"), [("far", 4), ("nan position", 4), ("nan position", 0), ("nan velocity", 4)])
def test_a_state_that_has_no_accelerations_is_not_ok(robot, wrong, at):
    """The others of its block have theirs, even where it is the first, at which independent coordinates would be chosen."""
    start = ncgen.simulate(robot, 0.001, points=2, formalism="coordinate-partitioning")
    z = start.partitions.velocity.independent
    q, zd = np.tile(start.q[0], (9, 1)), np.zeros((9, len(z)))
    expected = ncgen.accelerations(robot, q, zd).zdd
    if wrong == "far":
        q[at] = 1e9
    else:
        (q if wrong == "nan position" else zd)[at, 0] = np.nan
    found = ncgen.accelerations(robot, q, zd)
    others = [i for i in range(9) if i != at]
    assert found.ok.tolist() == [i != at for i in range(9)] and np.isnan(found.zdd[at]).all()
    assert [status != "ok" for status in found.status] == [i == at for i in range(9)]
    assert found.status[at] == ("not converged" if wrong == "far" else "domain")
    assert np.array_equal(found.zdd[others], expected[others])


def test_time_is_zero_unless_it_is_said():
    """A pendulum hangs from a carriage that is driven as t³ and accelerates by 6 t."""
    m = ncgen.Model("carried")
    A, B = m.point("A", (0.0, 0.0), fixed="y"), m.point("B", (0.0, -1.0))
    m.distance(A, B, 1.0)
    m.drive(A.x, m.time**3)
    m.body("bob", points=[B], mass=2.0)
    x, z = m.vector("x", (1, 0, 0), fixed=True), m.vector("z", (0, 0, 1), fixed=True)
    m.angle("phi", start=x, end=B - A, axis=z)
    kernels = ncgen.compile(m, backend="c")
    q = np.tile(kernels.q0, (3, 1))
    assert ncgen.accelerations(kernels, q, np.zeros((3, 1)), z="phi").zdd == pytest.approx(np.zeros((3, 1)), abs=1e-14)
    later = ncgen.accelerations(kernels, q, np.zeros((3, 1)), z="phi", t=0.5)
    assert later.q[:, kernels.index["A.x"]] == pytest.approx([0.125] * 3)
    assert later.zdd == pytest.approx(np.full((3, 1), -3.0))  # −ẍ over the length, where it hangs


def test_a_batch_without_a_finite_state_says_so(robot):
    with pytest.raises(ncgen.ModelError, match="robot: no state of the batch has finite q and p"):
        ncgen.accelerations(robot, np.full((3, robot.n), np.nan), np.zeros((3, 6)))


def test_accelerations_where_their_positions_stay():
    """A cart with a pendulum, whose dependent coordinates stand between the others, in new places and in their own: against Lagrange."""
    model, length, cart, bob = ncgen.Model("cart"), 0.6, 2.0, 0.5
    S, B = model.point("S", (0.3, 0), fixed="y"), model.point("B", (0.3, -length))
    model.body("cart", points=[S], mass=cart)
    model.body("bob", points=[B], mass=bob)
    model.distance(S, B)
    down, z = model.vector("down", (0, -1, 0), fixed=True), model.vector("z", (0, 0, 1), fixed=True)
    psi = model.angle("psi", start=down, end=B - S, axis=z)
    model.gravity((0, -9.81, 0))
    model.independent(S.x, psi)
    kernels = ncgen.compile(model)
    assert kernels.coordinates == ("S.x", "B.x", "B.y", "psi")
    rng = np.random.default_rng(4)
    x, angle, zd = rng.uniform(-1, 1, 21), rng.uniform(-2, 2, 21), rng.uniform(-1, 1, (21, 2))
    sine, cosine = np.sin(angle), np.cos(angle)
    right = np.column_stack([x, x + length * sine, -length * cosine, angle])
    mass = np.moveaxis(np.array([[np.full(21, cart + bob), bob * length * cosine], [cosine, np.full(21, length)]]), 2, 0)
    zdd = np.linalg.solve(mass, np.stack([bob * length * zd[:, 1] ** 2 * sine, -9.81 * sine], axis=1)[..., None])[..., 0]
    q = right + rng.uniform(-1e-3, 1e-3, (21, 4)) * [0, 1, 1, 0]
    apart = ncgen.accelerations(kernels, q, zd, velocities=True)
    there = ncgen.accelerations(kernels, q, zd, out=replace(apart, q=q, qd=np.empty((21, 4)), zdd=np.empty((21, 2))))
    assert there.q is q
    for found in (apart, there):
        assert found.ok.all()
        np.testing.assert_allclose(found.q, right, rtol=0, atol=1e-14)
        np.testing.assert_allclose(
            found.qd[:, [1, 2]], np.column_stack([zd[:, 0] + length * cosine * zd[:, 1], length * sine * zd[:, 1]]), atol=1e-13
        )
        np.testing.assert_allclose(found.zdd, zdd, rtol=0, atol=1e-12)


@pytest.mark.parametrize("name", ["andrews", "suspension"])
def test_a_position_is_closed_whichever_row_is_open(name):
    """A state a row, in which that row alone is open: one step of Newton's method leaves far more than is allowed."""
    kernels, states = ncgen.compile(ncgen.load(name)), []
    start = ncgen.assemble(kernels)
    part = choose_partitions(kernels, start, independent=kernels.model.chosen_independent).velocity
    assert not dynamics(kernels, choose_partitions(kernels, start), "lanes", start, kernels.p0)._dynamics.closed_form
    for wanted in 0.01 * np.diag(kernels.row_sizes):
        q = start.copy()
        for _ in range(20):
            q[part.dependent] -= np.linalg.solve(kernels.jacobian(q)[:, part.dependent], kernels.phi(q) - wanted)
        np.testing.assert_allclose(kernels.phi(q), wanted, rtol=0, atol=1e-12 * np.max(kernels.row_sizes))
        states.append(q)
    zd = np.zeros((kernels.m, len(part.independent)))
    found = ncgen.accelerations(kernels, states, zd, z=part.names(kernels))
    assert found.ok.all()
    left = np.abs([kernels.phi(q) / kernels.row_sizes for q in found.q])
    assert np.max(left) < 1e-12


def moving(driven, count):
    """Positions of the swing (count, n) that are open, and velocities (count, n), of which the constraints allow few."""
    rng = np.random.default_rng(7)
    q0 = driven.q0 + np.where(np.isin(driven.coordinates, ["C.x", "C.y"]), rng.uniform(-0.02, 0.02, (count, driven.n)), 0.0)
    return q0, rng.uniform(-1.0, 1.0, (count, driven.n))


def test_velocities_of_all_coordinates_as_alone(driven):
    """`qd0` starts a batch where it starts `simulate`: projected where the constraints do not allow it, which one warning says of all."""
    q0, qd0 = moving(driven, 5)
    with pytest.warns(UserWarning, match=r"^drivenbatch: qd0 of 5 of 5 states is not what they start with; state 0: .* contradict"):
        batch = ncgen.simulate(driven, 0.05, q0=q0, qd0=qd0, points=5, rtol=1e-6, atol=1e-8)
    assert not batch.alone.any()
    options = dict(points=5, rtol=1e-6, atol=1e-8, engine="emitted", integrator="dopri5", z=batch.independent)
    for i in range(5):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            run = ncgen.simulate(driven, 0.05, q0=q0[i], qd0=qd0[i], **options)
        assert_as_alone(driven, batch, i, run)


@pytest.mark.parametrize("given", [{"C.y": 1.5}, {"C.y": np.linspace(0.5, 1.5, 4)}, {"C.x": np.linspace(0.5, 1.0, 4), "rows": 4}])
def test_velocities_by_name_leave_the_others_free(robot, driven, given):
    """A number for all or one a state; what is not named moves with the least kinetic energy, as in `simulate`."""
    qd0 = {name: value for name, value in given.items() if name != "rows"}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        batch = ncgen.simulate(driven, 0.1, q0=np.tile(driven.q0, (4, 1)), qd0=qd0, points=3, rtol=1e-6, atol=1e-8)
        for i in range(4):
            own = {name: float(np.broadcast_to(value, 4)[i]) for name, value in qd0.items()}
            run = ncgen.simulate(
                driven, 0.1, qd0=own, points=3, rtol=1e-6, atol=1e-8, engine="emitted", integrator="dopri5", z=batch.independent
            )
            assert_as_alone(driven, batch, i, run)


@pytest.mark.parametrize(
    "given, said",
    [
        ({"zd0": {"C.x": 1.0}, "qd0": {"C.x": 1.0}}, "^zd0 and qd0 are both given; give the initial velocities once$"),
        ({"qd0": {"nobody": [1.0, 2.0]}}, "^qd0: the mechanism has no free coordinate nobody"),
        ({"qd0": np.zeros((3, 2))}, r"^drivenbatch: qd0 has shape \(3, 2\); \(5,\) or \(3, 5\) is needed$"),
        ({"qd0": np.zeros((3, 5)), "p": np.zeros((2, 2))}, r"^drivenbatch: qd0 has 3, p has 2 rows"),
        ({"qd0": np.full((3, 5), np.nan)}, "^drivenbatch: qd0 has numbers that are not finite in every state"),
        ({"qd0": {"C.x": 1j * np.ones(3)}}, "^drivenbatch: qd0, C.x is complex"),
    ],
)
def test_wrong_velocities_are_named(driven, given, said):
    """As those of `zd0` are."""
    with pytest.raises(ncgen.ModelError, match=said):
        ncgen.simulate(driven, 0.1, **given)


def test_a_velocity_that_is_no_number_costs_one_state(driven):
    """The others start and arrive."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        batch = ncgen.simulate(driven, 0.05, qd0={"C.y": [0.5, np.nan, 1.0]})
    assert batch.ok.tolist() == [True, False, True]
