"""The C runtime against the Python reference, which is another program for the same method."""

from __future__ import annotations

import numpy as np
import pytest

import ncgen

RATES = {"psi1": 1.0, "psi2": 0.5, "psi3": -0.7, "psi4": 1.2, "psi5": 0.3, "psi6": -2.0}


@pytest.fixture(scope="module")
def pendulum():
    return ncgen.compile(ncgen.load("pendulum"), backend="c")


@pytest.fixture(scope="module")
def driven():
    """A crank with a driver, a damper and a spring: everything that does work."""
    import sympy

    m = ncgen.Model("driven")
    A, B, C = m.point("A", (0, 0), fixed=True), m.point("B", (0.1, 0)), m.point("C", (0.3, 0.3))
    x, z = m.vector("x", (1, 0, 0), fixed=True), m.vector("z", (0, 0, 1), fixed=True)
    m.body("crank", [A, B], mass=0.5, inertia=1e-3)
    m.body("swing", [B, C], mass=0.5, inertia=0.01)
    m.drive(m.angle("psi", x, B - A, z), 3 * m.time + 0.2 * sympy.sin(5 * m.time))
    m.spring(C, m.point("G", (0.6, 0.0), fixed=True), stiffness=40.0, damping=0.8)
    m.gravity((0, -9.81, 0))
    return ncgen.compile(m, backend="c")


@pytest.fixture(params=["c", "emitted"])
def engine(request):
    return request.param


def both(kernels, engine, duration, **options):
    options = {"formalism": "coordinate-partitioning", "integrator": "dopri5", **options}
    runs = [ncgen.simulate(kernels, duration, engine=e, **options) for e in (engine, "python")]
    assert [run.engine[:6] for run in runs] == [engine[:6], "python"]
    return runs


def test_robot_moves_alike(robot, engine):
    """Spatial motion of the robot: same steps, same numbers to rounding."""
    c, python = both(robot, engine, 0.2, rtol=1e-8, atol=1e-10, zd0=RATES, points=11)
    assert c.statistics.steps == python.statistics.steps
    assert np.max(np.abs(c.q - python.q)) < 1e-10
    assert np.max(np.abs(c.qd - python.qd)) < 1e-9
    assert np.max(c.violation()) < 1e-11


def test_work_of_drivers_and_dampers(driven, engine):
    """Work is integrated alike, and balances the energy."""
    c, python = both(driven, engine, 0.5, rtol=1e-9, atol=1e-11, points=6)
    assert np.max(np.abs(c.work - python.work)) < 1e-9
    assert abs(c.work[-1]) > 0.1
    assert c.energy_drift < 1e-8


def test_fixed_steps(driven, engine):
    """rk4 with the same step, also where it does not divide the grid."""
    c, python = both(driven, engine, 0.3, integrator="rk4", max_step=0.004, points=4)
    assert np.max(np.abs(c.q - python.q)) < 1e-6
    finer = ncgen.simulate(driven, 0.3, integrator="rk4", max_step=0.001, engine="c", points=4)
    assert np.max(np.abs(c.q - finer.q)) < 1e-6


def test_order_of_rk4(driven):
    """Halving the step divides the error by 16: fourth order."""
    fine = ncgen.simulate(driven, 0.4, rtol=1e-12, atol=1e-14, points=2, engine="c")
    errors = [
        np.max(np.abs(ncgen.simulate(driven, 0.4, integrator="rk4", max_step=h, points=2, engine="c").q[-1] - fine.q[-1]))
        for h in (0.01, 0.005)
    ]
    assert 3.8 < np.log2(errors[0] / errors[1]) < 4.3


def test_independent_coordinates_change_in_c(pendulum, engine):
    """The pendulum swings through positions where x or y alone does not determine it; its period is the elliptic one."""
    from scipy.special import ellipk

    period = 4 * ellipk(0.5) / np.sqrt(9.81)
    run = ncgen.simulate(pendulum, period, rtol=1e-11, atol=1e-13, points=3, engine=engine, formalism="coordinate-partitioning")
    assert run.statistics.partition_changes > 1
    assert np.allclose(run.q[-1], [-1.0, 0.0], atol=1e-8)
    assert np.allclose(run.q[1], [1.0, 0.0], atol=1e-8)


def test_grid_times_are_all_there(pendulum, engine):
    """Every instant of the grid is reached once, however the run is cut into pieces."""
    run = ncgen.simulate(pendulum, 1.5, points=301, engine=engine)
    coarse = ncgen.simulate(pendulum, 1.5, points=4, engine=engine, rtol=1e-8)
    assert run.q.shape == (301, 2)
    assert np.max(np.abs(run.q[::100] - coarse.q)) < 1e-6
    assert np.max(np.abs(np.diff(run.q, axis=0))) < 0.05


def test_what_cannot_run_in_c_says_why(robot_numpy, pendulum):
    with pytest.raises(ncgen.ModelError, match="cannot be simulated in C: the kernels are numpy, not compiled"):
        ncgen.simulate(robot_numpy, 0.01, points=2, engine="emitted")
    assert "runs in Python" in ncgen.simulate(pendulum, 0.01, points=2, integrator="bdf").engine
    with pytest.raises(ncgen.ModelError, match="engine 'c': bdf runs in Python; in C there are"):
        ncgen.simulate(pendulum, 0.01, integrator="bdf", engine="c")


def test_a_locked_mechanism_is_reported():
    """A driver pulls a rod further than it reaches: the run ends with the time at which it locks."""
    m = ncgen.Model("locked")
    A, B, C = m.point("A", (0, 0), fixed=True), m.point("B", (0.5, 0.2)), m.point("C", (0.9, 0.0), fixed="yz")
    m.body("first", [A, B], mass=1.0, inertia="point")
    m.body("second", [B, C], mass=1.0, inertia="point")
    m.drive(C.x, 0.9 + 0.5 * m.time)
    with pytest.raises(ncgen.NcgenError, match="t = "):
        ncgen.simulate(ncgen.compile(m, backend="c"), 2.0)
