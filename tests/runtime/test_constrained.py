"""Formalisms over all coordinates in C: against closed forms, the Python reference, and through singular positions."""

from __future__ import annotations

import numpy as np
import pytest
import sympy
from scipy.special import ellipj, ellipk

import ncgen
from ncgen.exchange.examples import example_module
from ncgen.mechanism.run_arguments import InitialState, Monitor
from ncgen.model import Model
from ncgen.solver.runs.stop import StopCondition

FORMALISMS = ("null-space", "lagrange", "augmented-lagrangian", "udwadia-phohomsiri")


def four_bars(N: int):
    return ncgen.compile(example_module("nfourbar").build(N), backend="c")


def turning(kernels) -> dict[str, float]:
    """All tops of N four-bars move with 1 m/s along x."""
    return {name: 1.0 for name in kernels.coordinates if name.endswith(".x")}


def top(N: int, t: float) -> np.ndarray:
    """B0 of N four-bars at time t: x = 2 sn cn, y = 1 - 2 sn² of (t/2 | m = -4c), by Jacobi's imaginary modulus."""
    m = -4 * 9.81 * ((N + 1) / 2 + N) / ((N + 1) / 3 + N)
    mu, u = -m / (1 - m), t / 2 * np.sqrt(1 - m)
    s, c, d, _ = ellipj(u, mu)
    sn, cn = s / d / np.sqrt(1 - m), c / d
    return np.array([2 * sn * cn, 1 - 2 * sn * sn])


def at_rest(kernels):
    """The mechanism's own position, without velocities."""
    return InitialState(kernels.q0, np.zeros(kernels.n), kernels.p0)


def test_published_end_value():
    """The closed form above gives the reference's value for N = 2 at 10 s."""
    assert np.allclose(top(2, 10.0), [0.32845811154081538, 0.94451853817860096], rtol=0, atol=1e-12)


@pytest.mark.parametrize("N", [2, 10, 40])
def test_through_the_singular_position(N):
    """14 times in 10 s all rods lie flat; the motion keeps its branch."""
    kernels = four_bars(N)
    run = ncgen.simulate(
        kernels, 10.0, formalism="lagrange", integrator="dop853", rtol=1e-9, atol=1e-9, qd0=turning(kernels), points=11, engine="c"
    )
    B0 = run.q[:, [kernels.index["B0.x"], kernels.index["B0.y"]]]
    assert np.max(np.abs(B0 - [top(N, t) for t in run.t])) < 1e-6
    assert np.max(run.violation()) < 1e-11
    assert run.energy_drift < 1e-6


@pytest.mark.parametrize("formalism", FORMALISMS)
def test_the_branch_is_kept_by_every_exact_formalism(formalism):
    kernels = four_bars(2)
    run = ncgen.simulate(
        kernels, 10.0, formalism=formalism, integrator="dop853", rtol=1e-9, atol=1e-9, qd0=turning(kernels), points=2, engine="c"
    )
    assert np.max(np.abs(run.q[-1, :2] - top(2, 10.0))) < 1e-6


@pytest.mark.parametrize("formalism", FORMALISMS)
@pytest.mark.parametrize("integrator", ["dopri5", "dop853"])
def test_period_of_the_pendulum(formalism, integrator):
    kernels = ncgen.compile(ncgen.load("pendulum"), backend="c")
    period = 4 * ellipk(0.5) / np.sqrt(9.81)
    options = dict(formalism=formalism, integrator=integrator, engine="c", points=3)
    run = ncgen.simulate(kernels, period, rtol=1e-11, atol=1e-13, **options)
    assert np.allclose(run.q[1:], [[-1.0, 0.0], [1.0, 0.0]][:: 1 if run.q[1, 0] < 0 else -1], atol=1e-9)
    assert run.engine == "c"


@pytest.mark.parametrize("name", ["robot", "bricard", "slidercrank3d", "flyball"])
@pytest.mark.parametrize("formalism", [*FORMALISMS, "penalty"])
def test_both_engines_move_alike(name, formalism):
    """Redundant rows (robot, Bricard), singular masses, loads: C and Python are two programs for one method."""
    kernels = ncgen.compile(ncgen.load(name), backend="c")
    asked = {"formalism": formalism, "integrator": "dopri5", "rtol": 1e-9, "atol": 1e-11, "points": 3}
    c, python = (ncgen.simulate(kernels, 0.02, engine=engine, **asked) for engine in ("c", "python"))
    tolerance = 1e-6 if formalism == "penalty" else 1e-9
    assert np.max(np.abs(c.q - python.q)) < tolerance * max(kernels.length, 1.0)
    assert np.max(np.abs(c.work - python.work)) < tolerance * max(1.0, np.max(np.abs(python.work)))


def test_orders():
    """Fixed steps of rk4 on all coordinates: fourth order, against the closed form of the four-bars."""
    kernels = four_bars(2)
    errors = []
    for h in (0.01, 0.005):
        run = ncgen.simulate(kernels, 0.5, formalism="lagrange", integrator="rk4", max_step=h, qd0=turning(kernels), points=2, engine="c")
        errors.append(np.max(np.abs(run.q[-1, :2] - top(2, 0.5))))
    assert 3.8 < np.log2(errors[0] / errors[1]) < 4.3


def test_rows_of_the_grid_are_as_good_as_steps():
    """Dense output of dop853, brought onto the constraints."""
    kernels = four_bars(2)
    run = ncgen.simulate(
        kernels, 1.0, formalism="lagrange", integrator="dop853", rtol=1e-10, atol=1e-10, qd0=turning(kernels), points=201, engine="c"
    )
    assert np.max(np.abs(run.q[:, :2] - [top(2, t) for t in run.t])) < 1e-7
    assert np.max(run.violation()) < 1e-12


def test_many_healthy_steps_are_not_taken_for_creeping():
    """A force that turns round 589 times a second: the 100,000th step is followed by a refused one, which comes no farther at all.

    Its argument mentions a coordinate, which stays 0, so that its kinks are no break times.
    """
    m = Model("kinks")
    ball = m.point("ball", (0, 0))
    m.body("body", [ball], mass=1.0)
    m.constrain(ball.y, label="line")
    m.force(ball, (sympy.sign(sympy.sin(1850 * m.time + ball.y)), 0, 0))
    run = ncgen.simulate(ncgen.compile(m, "c"), 10.0, formalism="lagrange", integrator="dop853", rtol=1e-8, points=2, engine="c")
    assert run.statistics.steps > 100_000
    half = np.pi / 1850
    assert run["rate(ball.x)"][-1] == pytest.approx(half - abs(10.0 % (2 * half) - half), abs=1e-6)


def test_thousand_links():
    """Work a step grows with the number of links, not with its square: sparse factors."""
    from ncgen.mechanism.constrained_dynamics import ConstrainedDynamics
    from ncgen.methods.table import FORMALISMS, number_in_c

    sizes = {}
    for n in (100, 1000):
        kernels = ncgen.compile(example_module("chain").build(n), backend="c")
        dynamics = ConstrainedDynamics(kernels)
        sizes[n] = dynamics.plan.nonzeros
    assert sizes[1000] < 11 * sizes[100]
    options = dict(rtol=1e-8, atol=1e-10, tolerance=1e-12, formalism=number_in_c(FORMALISMS["lagrange"]), project=1)
    done = dynamics.simulate("dop853", [0.0, 0.05], at_rest(kernels), **options)
    assert done.status == "ok"
    before, after = kernels.energy(kernels.q0, np.zeros(kernels.n)), kernels.energy(done.q[-1], done.qd[-1])
    assert abs(np.sum(after[:2] - before[:2])) < 1e-8 * after[0]
    assert np.max(np.abs(kernels.phi(done.q[-1]) / kernels.row_sizes)) < 1e-12


def test_a_motion_without_inertia_is_reported():
    m = ncgen.Model("light")
    A, B, C = m.point("A", (0, 0), fixed=True), m.point("B", (1, 0)), m.point("C", (2, 0.5))
    m.body("first", [A, B], mass=1.0, inertia="point")
    m.distance(B, C)
    m.gravity((0, -9.81, 0))
    kernels = ncgen.compile(m, backend="c")
    with pytest.raises(ncgen.NcgenError):
        ncgen.simulate(kernels, 0.1, formalism="lagrange")


@pytest.mark.parametrize("integrator", ["dopri5", "dop853", "rk4"])
def test_stop_at_a_position(integrator):
    """The pendulum's x rises through 0 after a quarter of its period, which is the elliptic one."""
    from ncgen.mechanism.constrained_dynamics import ConstrainedDynamics
    from ncgen.methods.table import FORMALISMS, number_in_c

    kernels = ncgen.compile(ncgen.load("pendulum"), backend="c")
    grid = np.linspace(0.0, 2.0, 41)
    options = dict(rtol=1e-11, atol=1e-12, tolerance=1e-12, formalism=number_in_c(FORMALISMS["lagrange"]), project=1)
    if integrator == "rk4":
        options["max_step"] = 1e-3
    dynamics = ConstrainedDynamics(kernels)
    rising, falling = StopCondition(0, 0.0, 1).conditions, StopCondition(0, 0.0, -1).conditions
    done = dynamics.simulate(integrator, grid, at_rest(kernels), monitor=Monitor(conditions=rising), **options)
    quarter = ellipk(0.5) / np.sqrt(9.81)
    assert done.stopped
    assert abs(done.reached - quarter) < 1e-9
    assert abs(done.last[0][0]) < 1e-9
    assert len(done.q) == np.sum(grid < quarter)
    later = dynamics.simulate(integrator, grid, at_rest(kernels), monitor=Monitor(conditions=falling), **options)
    assert later.stopped and abs(later.reached - 3 * quarter) < 1e-9


def test_solutions_are_refined_where_factors_are_not_exact():
    """By a penalty, or by the rounding of float; in double those without a penalty are as good as their equations."""
    from ncgen.mechanism.constrained_dynamics import ConstrainedDynamics
    from ncgen.methods.table import find_formalism, number_in_c

    kernels = ncgen.compile(ncgen.load("pendulum"), backend="c")

    def refinements(number, formalism):
        options = dict(max_step=0.01, tolerance=1e-5, project=1, formalism=number_in_c(find_formalism(formalism)))
        done = ConstrainedDynamics(kernels, number).simulate("rk4", [0.0, 0.05], at_rest(kernels), **options)
        assert done.status == "ok"
        return done.refinements

    assert refinements("double", "lagrange") == 0
    assert refinements("double", "augmented-lagrangian") > 0
    assert refinements("float", "lagrange") > 0


def test_the_largest_projection_is_what_the_one_step_had_left_open():
    """In natural sizes, beside the same step without projection; and what a step of RK4 costs, besides the end."""
    from ncgen.mechanism.constrained_dynamics import ConstrainedDynamics
    from ncgen.methods.table import find_formalism, number_in_c

    kernels = ncgen.compile(ncgen.load("pendulum"), backend="c")
    options = dict(max_step=0.3, tolerance=1e-12, formalism=number_in_c(find_formalism("lagrange")))
    left, closed = (ConstrainedDynamics(kernels).simulate("rk4", [0.0, 0.3], at_rest(kernels), project=p, **options) for p in (0, 1))
    moved = np.max(np.abs(closed.q[-1] - left.q[-1]) / kernels.column_sizes)
    assert 1e-6 < moved < 1e-3
    assert closed.largest_projection == pytest.approx(moved, rel=1e-10)
    assert left.largest_projection == 0
    assert (closed.steps, closed.evaluations, closed.factorisations) == (1, 5, 5)


@pytest.mark.parametrize("formalism", ["null-space", "udwadia-phohomsiri"])
def test_rows_that_are_left_out_are_chosen_anew_in_time(formalism):
    """Bricard's rows imply each other in another way everywhere. Where those that count nearly depend on each other, closing a position
    takes more and more Newton steps: 6 a step when the choice was made anew too late."""
    run = ncgen.simulate(ncgen.compile(ncgen.load("bricard"), backend="c"), 2.0, formalism=formalism, rtol=1e-10, points=2)
    assert run.statistics.newton_steps < 4.5 * run.statistics.steps
