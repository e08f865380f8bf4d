"""Many simulations side by side against one at a time: the same method, written once more with masks for branches."""

from __future__ import annotations

import numpy as np
import pytest
import sympy
from scipy.special import ellipk

import ncgen
from ncgen.solver.coordinate_partitioning import motion_at
from ncgen.solver.position import residual

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
    batch = ncgen.simulate_batch(robot, 0.3, zd0=zd0, rtol=1e-6, atol=1e-8, points=14, threads=threads)
    assert set(batch.status) == {"ok"} and not batch.alone.any()
    assert len(set(batch.steps)) > 1, "all states take the same number of steps: nothing is masked"
    for i in range(COUNT):
        run = ncgen.simulate(robot, 0.3, zd0=zd0[i], rtol=1e-6, atol=1e-8, points=14, engine="emitted")
        assert_as_alone(robot, batch, i, run)


@pytest.mark.parametrize("options", [
    {"rtol": 1e-7, "atol": 1e-9},
    {"integrator": "dop853", "rtol": 1e-9, "atol": 1e-11},
    {"integrator": "rk4", "max_step": 0.004},
    {"max_step": 0.01},
])  # fmt: skip
def test_parameters_as_alone(driven, options):
    """Own parameters for each state: the driver turns at another speed, the spring has another stiffness."""
    p = np.column_stack([np.linspace(20, 60, COUNT), np.linspace(1, 4, COUNT)])
    batch = ncgen.simulate_batch(driven, 0.3, p=p, t0=0.1, points=4, **options)
    assert set(batch.status) == {"ok"}
    for i in np.flatnonzero(~batch.alone):
        assert_as_alone(driven, batch, i, ncgen.simulate(driven, 0.3, p=p[i], t0=0.1, points=4, engine="emitted", **options))


def test_states_whose_coordinates_become_bad_go_on_alone():
    """A pendulum passes positions that x or y alone do not determine; after the elliptic period it is back."""
    kernels = ncgen.compile(ncgen.load("pendulum"), "c")
    period = 4 * ellipk(0.5) / np.sqrt(9.81)
    batch = ncgen.simulate_batch(kernels, period, q0=np.tile(kernels.q0, (9, 1)), rtol=1e-11, atol=1e-13)
    assert batch.alone.all() and batch.ok.all()
    assert np.max(np.abs(batch.q[:, -1] - batch.q[:, 0])) < 1e-8


def test_states_that_cannot_go_on_are_named():
    """A driver pulls a rod further than it reaches: those states say so, the others arrive."""
    m = ncgen.Model("lockedbatch")
    speed = m.parameter("speed", 0.5)
    A, B, C = m.point("A", (0, 0), fixed=True), m.point("B", (0.5, 0.2)), m.point("C", (0.9, 0.0), fixed="yz")
    m.body("first", [A, B], mass=1.0)
    m.body("second", [B, C], mass=1.0)
    D = m.point("D", (0.5, -0.6))
    m.body("hanging", [B, D], mass=1.0)
    m.gravity((0, -9.81, 0))
    m.drive(C.x, 0.9 + speed.symbol * m.time)
    kernels = ncgen.compile(m, "c")
    batch = ncgen.simulate_batch(kernels, 0.5, p=np.array([[0.05], [0.5], [0.1]]), points=6)
    assert batch.ok.tolist() == [True, False, True]
    assert "t = " in batch.status[1] and "\n" not in batch.status[1]
    assert np.isfinite(batch.q[[0, 2]]).all() and np.isnan(batch.q[1, -1]).all()


def test_open_positions_are_closed(robot):
    """A start that violates the constraints is assembled, like that of a single run."""
    q0 = np.array([robot.q0, robot.q0])
    q0[1, 0] += 1e-4
    batch = ncgen.simulate_batch(robot, 0.01, q0=q0, integrator="rk4", max_step=0.005)
    assert np.max(np.abs(robot.batch.phi(batch.q[:, 0]))) < 1e-12


@pytest.mark.parametrize(
    "given, said",
    [
        ({}, "q0, zd0 and p have no rows"),
        ({"zd0": np.zeros((3, 6)), "q0": np.zeros((2, 36))}, r"q0, zd0 and p have \[2, 3\] rows"),
        ({"zd0": np.zeros((3, 5))}, r"zd0 has shape \(3, 5\); \(6,\) or \(3, 6\) is needed"),
        ({"zd0": np.full((3, 6), np.nan)}, "zd0 has numbers that are not finite"),
        ({"zd0": np.zeros((3, 6)), "integrator": "bdf"}, "bdf is not among dopri5, dop853, rk4"),
    ],
)
def test_mistakes_are_named(robot, given, said):
    with pytest.raises(ncgen.ModelError, match=said) as caught:
        ncgen.simulate_batch(robot, 0.1, **given)
    assert "\n" not in str(caught.value)


def test_accelerations_are_those_of_the_reference(robot):
    """Positions that are open by a little are closed first; 21 states leave the last block half empty."""
    rng = np.random.default_rng(3)
    start = ncgen.simulate(robot, 0.001, points=2)
    z = start.partitions.velocity.independent
    q, zd = np.tile(start.q[0], (21, 1)), rng.uniform(-1, 1, (21, len(z)))
    q[:, z] += rng.uniform(-0.01, 0.01, zd.shape)
    found = ncgen.accelerations_batch(robot, q, zd, velocities=True)
    assert found.ok.all() and found.independent == start.independent
    again = ncgen.accelerations_batch(robot, q, zd, out=found)
    assert again.zdd is found.zdd and again.qd is found.qd
    with pytest.raises(ncgen.ModelError, match="out has results of 21 states; 3 are needed"):
        ncgen.accelerations_batch(robot, q[:3], zd[:3], out=found)
    with pytest.raises(ncgen.ModelError, match="leave z or out out"):
        ncgen.accelerations_batch(robot, q, zd, out=found, z=("psi1",))
    for i in range(21):
        assert residual(robot, found.q[i]) < 1e-12 and np.array_equal(found.q[i][z], q[i][z])
        here = motion_at(robot, start.partitions.velocity, 0.0, found.q[i], zd[i], robot.p0)
        np.testing.assert_allclose(found.qd[i], here.qd, atol=1e-12)
        np.testing.assert_allclose(found.zdd[i], here.qdd[z], rtol=0, atol=1e-11 * np.max(np.abs(here.qdd)))


def test_states_may_stay_where_they_are(robot):
    """Positions that are closed in place, without velocities, give the same accelerations to the last bit."""
    start = ncgen.simulate(robot, 0.001, points=2)
    z = start.partitions.velocity.independent
    rng = np.random.default_rng(4)
    q, zd = np.tile(start.q[0], (19, 1)), rng.uniform(-1, 1, (19, len(z)))
    q[:, z] += rng.uniform(-0.01, 0.01, zd.shape)
    apart = ncgen.accelerations_batch(robot, q, zd)
    assert apart.qd is None
    found = ncgen.accelerations_batch(robot, q, zd)
    found.q[:] = q
    there = ncgen.accelerations_batch(robot, found.q, zd, out=found)
    assert there.q is found.q and np.array_equal(there.q, apart.q) and np.array_equal(there.zdd, apart.zdd)


@pytest.mark.parametrize(("wrong", "at"), [("far", 4), ("nan position", 4), ("nan position", 0), ("nan velocity", 4)])
def test_a_state_that_has_no_accelerations_is_not_ok(robot, wrong, at):
    """The others of its block have theirs, even where it is the first, at which independent coordinates would be chosen."""
    start = ncgen.simulate(robot, 0.001, points=2)
    z = start.partitions.velocity.independent
    q, zd = np.tile(start.q[0], (9, 1)), np.zeros((9, len(z)))
    expected = ncgen.accelerations_batch(robot, q, zd).zdd
    if wrong == "far":
        q[at] = 1e9
    else:
        (q if wrong == "nan position" else zd)[at, 0] = np.nan
    found = ncgen.accelerations_batch(robot, q, zd)
    others = [i for i in range(9) if i != at]
    assert found.ok.tolist() == [i != at for i in range(9)] and np.isnan(found.zdd[at]).all()
    assert np.array_equal(found.zdd[others], expected[others])


def test_a_batch_without_a_finite_state_says_so(robot):
    with pytest.raises(ncgen.ModelError, match="robot: no state of the batch has finite q and p"):
        ncgen.accelerations_batch(robot, np.full((3, robot.n), np.nan), np.zeros((3, 6)))
