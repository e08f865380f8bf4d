"""Positions of open trees of hinges at once from their angles: closed to rounding, and refused where they are not told by angles alone."""

from __future__ import annotations

import numpy as np
import pytest

import ncgen
from ncgen import Model
from ncgen.exchange.examples import example_module, load
from ncgen.program.ir.blocks import Program
from ncgen.program.ir.cost import cost
from ncgen.program.ir.evaluate import evaluate
from ncgen.program.motions.dynamics import DynamicsPrograms, newton
from ncgen.program.motions.motion import RecursiveMotions
from ncgen.program.programs import Split
from ncgen.program.tree.closed_positions import assemble_closed_positions
from ncgen.program.tree.rates import NoRecursion
from ncgen.solver.engines.partition_dynamics import samples, split_of
from ncgen.solver.positions.partition import choose_partitions


def given(model: Model):
    kernels = ncgen.compile(model, "numpy")
    q = ncgen.assemble(kernels)
    split = split_of(choose_partitions(kernels, q, independent=model.chosen_independent).velocity)
    return kernels, (kernels.programs.equations, split, samples(kernels, q, kernels.p0))


def branched() -> Model:
    """Two hinges on one body, one angle measured backwards, one link whose axis is a segment."""
    m = Model("branched")
    O, A, B, C, D = (
        m.point(n, x, fixed=n == "O")
        for n, x in zip("OABCD", [(0, 0, 0), (0.5, 0.1, 0.2), (0.4, -0.6, 0.1), (1.0, 0.3, 0.2), (0.9, -0.7, 0.6)], strict=True)
    )
    z, x = m.vector("z", (0, 0, 1), fixed=True), m.vector("x", (1, 0, 0), fixed=True)
    u, v, w = m.vector("u", (0, 1, 0)), m.vector("v", (1, 0, 0)), m.vector("w", (0, 0, 1))
    m.body("base", [O, A, B], [z, u, v], mass=1.0, inertia=[0.1, 0.2, 0.1])
    m.body("left", [A, C], [u, w], mass=0.5, inertia=[0.01, 0.02, 0.02])
    m.body("right", [B, A, D], mass=0.5, inertia=[0.01, 0.02, 0.02])
    across = m.vector("across", np.cross(B.initial - A.initial, (0, 0, 1)) / np.linalg.norm(np.cross(B.initial - A.initial, (0, 0, 1))))
    m.extend("base", across)
    side = D - B
    ahead = side.initial - (side.initial @ (B - A).initial) / ((B - A).initial @ (B - A).initial) * (B - A).initial
    edge = m.vector("edge", ahead / np.linalg.norm(ahead))
    m.extend("right", edge)
    m.independent(m.angle("first", x, v, z), m.angle("second", w, v, u), m.angle("third", across, edge, B - A))
    return m


def flat() -> Model:
    """Two rods in the plane, both angles measured from what rests, the second one from its end to its start."""
    m = Model("flat")
    A, B, C = (m.point(n, x, fixed=n == "A") for n, x in zip("ABC", [(0, 0), (0.3, 0.4), (1.0, 0.2)], strict=True))
    x, z = m.vector("x", (1, 0), fixed=True), m.vector("z", (0, 0, 1), fixed=True)
    m.body("upper", [A, B], mass=1.0, inertia=0.1)
    m.body("lower", [B, C], mass=1.0, inertia=0.1)
    m.independent(m.angle("first", x, B - A, z), m.angle("second", C - B, x, z))
    return m


@pytest.mark.parametrize("make", [lambda: load("arm"), lambda: example_module("arm").build(2), branched, flat])
def test_positions_close_to_rounding_from_any_angles(make):
    kernels, (equations, split, found) = given(make())
    program = assemble_closed_positions(equations, split, found, kernels.column_sizes).program
    assert cost(program).total < 0.4 * cost(newton(equations, split, found)).total
    rng = np.random.default_rng(4)
    for _ in range(5):
        q = found[0].q.copy()
        q[list(split.independent)] += rng.uniform(-3, 3, len(split.independent))
        places = np.array(evaluate(program, {"t": 0.0, "q": q, "p": kernels.p0}))
        q[list(split.dependent)] = places
        assert np.max(np.abs(kernels.phi(q, 0.0, kernels.p0)) / kernels.row_sizes) < 1e-14


def test_a_motion_closes_by_all_hinges_whichever_coordinates_are_independent():
    kernels, (equations, angles, found) = given(load("arm"))
    others = Split(rows=angles.rows, dependent=angles.independent, independent=angles.dependent[: len(angles.independent)])
    program = assemble_closed_positions(equations, others, found, kernels.column_sizes, range(kernels.n)).program
    rng, measured = np.random.default_rng(5), list(angles.independent)
    q = found[0].q + 1e-3 * rng.uniform(-1, 1, kernels.n)
    q[measured] += rng.uniform(-3, 3, len(measured))
    step, rows = np.split(np.array(evaluate(program, {"t": 0.0, "q": q, "p": kernels.p0})), [kernels.n])
    assert not np.any(step[measured])
    assert not np.any(rows)
    assert np.max(np.abs(kernels.phi(q + step, 0.0, kernels.p0)) / kernels.row_sizes) < 1e-14


def test_velocities_of_an_open_tree_are_those_of_either_recursion():
    """A projection, twice the same, whose rest has no momentum along what the joints allow."""
    kernels, (equations, angles, found) = given(example_module("arm").build(3))
    motions = RecursiveMotions(equations, found, kernels.column_sizes)
    ways = {name: motions.velocities(name) for name in motions.derivatives()}
    assert set(ways) == {"articulated", "composite"}
    q, rng = found[0].q, np.random.default_rng(6)

    def projected(name, qd):
        return np.array(evaluate(ways[name], {"t": 0.0, "q": q, "qd": qd, "p": kernels.p0}))[: kernels.n]

    qd, allowed = (rng.uniform(-1, 1, kernels.n) for _ in range(2))
    once = {name: projected(name, qd) for name in ways}
    assert np.max(np.abs(once["articulated"] - once["composite"])) < 1e-12
    assert np.max(np.abs(kernels.phi_q(q) @ once["articulated"])) < 1e-12
    assert np.max(np.abs(projected("articulated", once["composite"]) - once["composite"])) < 1e-12
    assert abs(projected("composite", allowed) @ kernels.mass(q) @ (qd - once["articulated"])) < 1e-11


@pytest.mark.parametrize(("name", "share"), [("robot", 0.45), ("flyball", 0.7), ("fourbar", 0.9)])
def test_loops_take_a_step_of_newton_over_their_own_coordinates_alone(name, share):
    """The angles stay, and what is left is the square of how far the loops were open, as by a step over all coordinates."""
    kernels, (equations, split, found) = given(load(name))
    program = assemble_closed_positions(equations, split, found, kernels.column_sizes, range(kernels.n)).program
    assert cost(program).total < share * cost(newton(equations, split, found, range(kernels.n))).total
    rng = np.random.default_rng(8)
    q = found[0].q + 1e-5 * rng.uniform(-1, 1, kernels.n)
    step, rows = np.split(np.array(evaluate(program, {"t": 0.0, "q": q, "p": kernels.p0})), [kernels.n])
    assert rows == pytest.approx(kernels.phi(q, 0.0, kernels.p0), rel=1e-9, abs=1e-15)
    assert np.sum(step == 0.0) == len(split.independent)
    assert np.max(np.abs(rows) / kernels.row_sizes) > 1e-6
    assert np.max(np.abs(kernels.phi(q + step, 0.0, kernels.p0)) / kernels.row_sizes) < 1e-8


def test_a_run_of_hinges_closes_every_step_at_once_and_leaves_the_angles():
    """By Newton's method the arm took 1.3 steps, and every step moved the angles back along the constraints."""
    kernels = ncgen.compile(load("arm"))
    angles = [name for name in kernels.coordinates if name.startswith("psi")]
    start = {"zd0": dict(zip(angles, np.random.default_rng(7).uniform(-1, 1, len(angles)).tolist(), strict=True)), "points": 3}
    run = ncgen.simulate(kernels, 0.5, integrator="rk4", max_step=2e-3, **start)
    tight = ncgen.simulate(kernels, 0.5, rtol=1e-12, **start)
    assert run.engine == "emitted"
    assert run.statistics.newton_steps == run.statistics.steps
    assert max(np.max(np.abs(kernels.phi(q, t, kernels.p0)) / kernels.row_sizes) for t, q in zip(run.t, run.q, strict=True)) < 1e-14
    assert np.max(np.abs(run.q[-1] - tight.q[-1]) / kernels.column_sizes) < 1e-5


def test_a_loop_that_follows_from_angles_stays_where_they_are():
    """Moved along the constraints to the nearest position, every step took two of Newton's method and was no nearer to a tight run."""
    kernels = ncgen.compile(load("robot"))
    run, tight = (ncgen.simulate(kernels, 0.5, integrator="dop853", points=2, rtol=rtol, atol=rtol) for rtol in (1e-8, 1e-13))
    trials = (run.statistics.evaluations - 2) // 12
    assert run.engine == "emitted"
    assert run.statistics.newton_steps == trials
    assert np.max(np.abs(run.q[-1] - tight.q[-1]) / kernels.column_sizes) < 3e-8
    assert max(np.max(np.abs(kernels.phi(q, t, kernels.p0)) / kernels.row_sizes) for t, q in zip(run.t, run.q, strict=True)) < 1e-13


def test_fixed_steps_of_loops_close_once_and_stay_where_that_is_near():
    """Moving along the constraints took another Newton step; the energy shows that nothing is lost without it."""
    kernels = ncgen.compile(load("fourbar"))
    run = ncgen.simulate(kernels, 2.0, integrator="rk4", max_step=1e-3, points=5)
    assert run.engine == "emitted"
    assert run.statistics.newton_steps == run.statistics.steps
    assert max(np.max(np.abs(kernels.phi(q, t, kernels.p0)) / kernels.row_sizes) for t, q in zip(run.t, run.q, strict=True)) < 1e-13
    energies = [sum(kernels.energy(q, qd)[:2]) for q, qd in zip(run.q, run.qd, strict=True)]
    assert np.ptp(energies) < 1e-8


@pytest.mark.parametrize(
    "name, why",
    [("stewart", "no independent coordinate is a hinge's angle"), ("pendulum", "no independent coordinate is a hinge's angle")],
)
def test_others_keep_a_step_of_newton(name, why):
    kernels, (equations, split, found) = given(load(name))
    with pytest.raises(NoRecursion, match=why):
        assemble_closed_positions(equations, split, found, kernels.column_sizes)


def test_a_shape_that_depends_on_a_parameter_is_refused():
    """Its constants would be those of the default."""
    m = Model("long")
    A, x, y = m.point("A", (0, 0), fixed=True), m.vector("x", (1, 0), fixed=True), m.vector("z", (0, 0, 1), fixed=True)
    B = m.point("B", (m.parameter("L", 1.0, "m"), 0))
    m.body("rod", [A, B], mass=1.0, inertia=0.1)
    m.independent(m.angle("psi", x, B - A, y))
    kernels, (equations, split, found) = given(m)
    with pytest.raises(NoRecursion, match="the bodies' shapes depend on parameters"):
        assemble_closed_positions(equations, split, found, kernels.column_sizes)


@pytest.mark.parametrize(
    ("found", "steps"), [([7.0, 5.0], [4.0, 3.0]), ([0.5, -0.25, 9.0, 9.0], [0.5, -0.25])], ids=["closed", "a step, and rows"]
)
def test_dependent_coordinates_move_to_what_is_closed_or_by_a_step(found, steps):
    moved, acceleration = (
        Program(name=name, inputs=("q",), output="out", size=size, blocks=())
        for name, size in (("newton", len(found)), ("acceleration", 3))
    )
    programs = DynamicsPrograms(moved, acceleration, Split(independent=(0,), dependent=(2, 1), rows=(0, 1)))
    q = [1.0, 2.0, 3.0]
    assert programs.close(q, found) == steps
    assert q == [1.0, 2.0 + steps[1], 3.0 + steps[0]]
