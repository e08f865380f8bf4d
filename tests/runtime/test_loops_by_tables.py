"""Trees with loops, and with joints whose motions are coupled, in loops over tables: as the factored matrix has it."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import null_space

import ncgen
from ncgen.exchange.examples import example_module
from ncgen.mechanism.moving import Moving, Stepping
from ncgen.methods.method import Method
from ncgen.report.derivative import matrix
from ncgen.solver.engines import acceleration_forms
from ncgen.solver.positions.open_tree import open_tree, tree_with_loops, why_no_tables
from ncgen.solver.positions.rank import freedom, scaled_jacobian

TREE = example_module("tree").build


@pytest.fixture(scope="module", params=[(10, 1, 2), (10, 8, 2), (12, 5, 0), (10, 3, 2), (12, 17, 4)], ids=str)
def kernels(request):
    """Bodies, seed, loops; universal joints and screws have a row more than their motions. In the last two, bodies share elements at the
    ends of loops, in the last with mass between them and with measured joints."""
    made = ncgen.compile(TREE(*request.param, False), backend="c")
    assert open_tree(made) is None and tree_with_loops(made).closing
    return made


def moving(kernels, form):
    dynamics = acceleration_forms.all_coordinates(kernels, form=form)
    found = Moving(Stepping(dynamics, "dop853", freedom(kernels).rank, 1e-8, 1e-10, None, 1e-12))
    found.p[:] = kernels.p0
    return found


def allowed(kernels, q):
    """T (Tᵀ M T)⁻¹ Tᵀ M, which leaves of a change what the constraints allow, T spanning that."""
    T = kernels.column_sizes[:, None] * null_space(scaled_jacobian(kernels, q), rcond=1e-9)
    M = kernels.mass(q).toarray()
    return T @ np.linalg.solve(T.T @ M @ T, T.T @ M)


def test_velocities_are_projected_with_the_least_kinetic_energy(kernels):
    q = ncgen.assemble(kernels)
    tree, qd = moving(kernels, "tree"), np.random.default_rng(1).uniform(-1, 1, kernels.n) * kernels.column_sizes
    tree.q[:], tree.qd[:] = q, qd
    assert tree.project_state() == "ok"
    assert tree.qd == pytest.approx(allowed(kernels, tree.q) @ qd, abs=1e-10)


def test_accelerations_and_motion_are_those_of_the_matrix(kernels):
    states = {form: moving(kernels, form) for form in ("tree", "dense")}
    states["dense"].q[:] = ncgen.assemble(kernels)
    states["dense"].qd[:] = np.random.default_rng(2).uniform(-1, 1, kernels.n) * kernels.column_sizes
    assert states["dense"].project_state() == "ok"
    states["tree"].q[:], states["tree"].qd[:] = states["dense"].q, states["dense"].qd
    for state in states.values():
        assert state.evaluate() == "ok"
    assert states["tree"].qdd == pytest.approx(states["dense"].qdd, rel=1e-8, abs=1e-8)
    for state in states.values():
        assert state.go_on(0.02) == "ok"
        assert np.max(np.abs(kernels.phi(state.q) / kernels.row_sizes)) < 1e-12
    assert states["tree"].q == pytest.approx(states["dense"].q, abs=1e-7)


def test_positions_are_closed_by_the_joints(kernels):
    """A position a little off comes back onto all constraints by tables alone."""
    tree, q = moving(kernels, "tree"), ncgen.assemble(kernels)
    aside = 1e-4 * np.random.default_rng(3).uniform(-1, 1, kernels.n) * kernels.column_sizes
    tree.q[:], tree.qd[:] = q + aside, 0.0
    assert tree.project_state() == "ok"
    assert np.max(np.abs(kernels.phi(tree.q) / kernels.row_sizes)) < 1e-12
    assert np.max(np.abs(tree.q - q) / kernels.column_sizes) < 1e-2


def test_a_large_tree_of_all_joints_takes_tables_by_itself():
    kernels = ncgen.compile(TREE(40, 2, 0, False))
    run, other = (ncgen.simulate(kernels, 0.05, points=3, **asked) for asked in ({}, {"engine": "c"}))
    assert (run.engine, other.engine) == ("tree", "c")
    assert run.statistics.fallbacks == 0
    assert np.max(np.abs(run.q - other.q) / kernels.column_sizes) < 1e-7
    assert run.violation().max() < 1e-12


def damped(bodies, seed, loops, damping):
    """A random tree with a damper (N m s/rad) at every hinge, whose angle is measured."""
    m = TREE(bodies, seed, loops, False)
    level = m.vector("level", (0.6, 0.48, 0.64), fixed=True)
    for joint in [fact.arguments for fact in m.facts if fact.word == "revolute"]:
        parent, body = joint["a"], joint["b"]
        start = level if parent is m.ground else parent.points[1] - parent.points[0]
        angle = m.angle(f"angle.{body.name}", start, body.points[1] - body.points[0], joint["axis"])
        m.torsion_spring(angle, damping=damping)
    return m


def test_explicit_and_implicit_methods_take_tables():
    kernels = ncgen.compile(TREE(40, 2, 0, False))
    methods = [Method.of("lagrange", name) for name in ("dop853", "radau")]
    assert [acceleration_forms.form_of(kernels, method) for method in methods] == ["tree", "tree"]
    assert [acceleration_forms.why_matrix(kernels, method) for method in methods] == ["", ""]


def by_null_space(kernels, duration, q, qd):
    """The end of a motion by SciPy's Radau on accelerations T (Tᵀ M T)⁻¹ Tᵀ (Q − M a) + a, T spanning what the constraints allow."""
    n, sizes = kernels.n, kernels.column_sizes

    def derivative(t, state):
        q, qd = state[:n], state[n:]
        force, gamma = (kernels.values(name, t, q, qd, kernels.p0) for name in ("force", "gamma"))
        left, values, right = np.linalg.svd(scaled_jacobian(kernels, q))
        rank = np.sum(values > 1e-9 * values[0])
        T, M = sizes[:, None] * right[rank:].T, kernels.mass(q).toarray()
        a = sizes * (right[:rank].T @ (left[:, :rank].T @ (gamma / kernels.row_sizes) / values[:rank]))
        return np.concatenate([qd, a + T @ np.linalg.solve(T.T @ M @ T, T.T @ (force - M @ a))])

    done = solve_ivp(derivative, (0.0, duration), np.concatenate([q, qd]), method="Radau", rtol=1e-7, atol=1e-9)
    assert done.success
    return done.y[:n, -1]


@pytest.mark.parametrize("damping", [pytest.param(300.0, marks=pytest.mark.slow), 1e4])
@pytest.mark.parametrize("tree", [(12, 5, 0), pytest.param((12, 17, 4), marks=pytest.mark.slow), (10, 3, 2)], ids=str)
def test_radau_with_dampers_of_hinges_moves_by_tables(monkeypatch, tree, damping):
    """Up to 1e6 1/s. In a basis of what loops allow the first tree took 5,159 and 9,228 evaluations: dampers saw how it turns."""
    for limit in ("FEW_RATES", "MOST_RATES"):
        monkeypatch.setattr(acceleration_forms, limit, 0)
    kernels = ncgen.compile(damped(*tree, damping))
    run = ncgen.simulate(kernels, 0.1, points=2, rtol=1e-6, formalism="lagrange", integrator="radau")
    assert run.engine == "tree"
    assert (run.statistics.fallbacks, run.statistics.repeated_steps) == (0, 0)
    assert run.statistics.evaluations < 700
    expected = by_null_space(kernels, 0.1, run.q[0], run.qd[0])
    assert np.max(np.abs(run.q[-1] - expected) / kernels.column_sizes) < 3e-6
    assert np.max(np.abs(run.q[-1] - run.q[0])) > 1e-3


@pytest.mark.parametrize("seed", [5, 14, 55])
def test_where_closing_rows_depend_on_each_other_others_take_their_place(monkeypatch, seed):
    """Rows independent of each other in the first position are not so in one on the way, though the rank stays: with these alone, 95,
    15 and 36 evaluations were made by the matrix."""
    for limit in ("FEW_RATES", "MOST_RATES"):
        monkeypatch.setattr(acceleration_forms, limit, 0)
    kernels = ncgen.compile(TREE(8, seed, 4, False))
    run, other = (ncgen.simulate(kernels, 1.0, points=11, rtol=1e-8, **asked) for asked in ({}, {"engine": "c"}))
    assert (run.engine, other.engine) == ("tree", "c")
    assert run.statistics.fallbacks == 0
    assert np.max(np.abs(run.q - other.q) / kernels.column_sizes) < 1e-6


def test_small_pivots_of_closing_rows_keep_their_digits(monkeypatch):
    """Pivots of closing rows are as small as 1e-8 of their rows' own, while the matrix of all constraints is regular: a step of refinement
    brings back what they lose. Until it was measured, 2,317 of 2,874 evaluations were made by the matrix."""
    for limit in ("FEW_RATES", "MOST_RATES"):
        monkeypatch.setattr(acceleration_forms, limit, 0)
    kernels = ncgen.compile(TREE(6, 1, 4, False))
    run, other = (ncgen.simulate(kernels, 2.0, points=11, rtol=rtol, **asked) for rtol, asked in ((1e-8, {}), (1e-11, {"engine": "c"})))
    assert run.engine == "tree" and run.statistics.fallbacks == 0
    assert run.statistics.evaluations < 5_000  # 4,001 by the matrix
    assert np.max(np.abs(run.q - other.q) / kernels.column_sizes) < 1e-6
    state, q = moving(kernels, "tree"), run.q[5]
    state.q[:], state.qd[:] = q, run.qd[5]
    assert state.evaluate() == "ok"
    T = kernels.column_sizes[:, None] * null_space(scaled_jacobian(kernels, q), rcond=1e-9)
    M = kernels.mass(q).toarray()
    force, gamma = (kernels.values(name, 0.0, q, run.qd[5], kernels.p0) for name in ("force", "gamma"))
    a = kernels.column_sizes * np.linalg.lstsq(scaled_jacobian(kernels, q), gamma / kernels.row_sizes, rcond=1e-9)[0]
    expected = a + T @ np.linalg.solve(T.T @ M @ T, T.T @ (force - M @ a))
    assert state.qdd == pytest.approx(expected, rel=1e-8, abs=1e-8 * np.max(np.abs(expected)))


def test_the_default_call_goes_on_by_tables_where_loops_are_stiff():
    kernels = ncgen.compile(damped(40, 2, 3, 600.0))
    run = ncgen.simulate(kernels, 0.2, points=2)
    assert run.made_with.startswith("lagrange with radau, tree: ")
    assert run.statistics.evaluations < 4000
    exact = ncgen.simulate(kernels, 0.2, points=2, rtol=1e-9, integrator="dop853")
    assert exact.statistics.evaluations > 5 * run.statistics.evaluations
    assert np.max(np.abs(run.q - exact.q) / kernels.column_sizes) < 1e-6


@pytest.mark.parametrize("number", range(12))
def test_random_trees_with_loops_have_tables(number):
    """Whatever their bodies share at the ends of loops; all links are closed by their rows, and closing rows imply the others."""
    rng = np.random.default_rng([6, number])
    kernels = ncgen.compile(TREE(int(rng.integers(10, 60)), number, int(rng.integers(1, 7)), False), "numpy")
    tree = tree_with_loops(kernels)
    assert tree is not None, why_no_tables(kernels)
    assert set(tree.closing) <= set(tree.opposed)
    joints = len(tree.screws) - len(tree.coupled.leaders)
    assert joints - len(tree.closing) == kernels.n - np.linalg.matrix_rank(scaled_jacobian(kernels, kernels.q0), tol=1e-7)


def test_shared_mass_is_that_of_the_matrix_where_loops_are_closed():
    """By links and by the matrix: the same energy at all velocities that loops allow, though not at others."""
    kernels = ncgen.compile(TREE(16, 38, 6, False), "numpy")
    tree = tree_with_loops(kernels)
    assert any(share != 1 for share in tree.masses.pair_shares) and any(share != 1 for share in tree.masses.single_shares)
    q, unit = kernels.q0, np.eye(len(tree.screws))
    masses, links = kernels.values("mass", 0.0, q, None, kernels.p0), np.zeros((len(unit), len(unit)))
    for (link, a, b, value), share in zip(tree.masses.pairs, tree.masses.pair_shares, strict=True):
        first, second = (tree.carried(q, unit, np.array([e]), [link])[:, 0] for e in (a, b))
        links += share * masses[value] * (first @ second.T if a == b else first @ second.T + second @ first.T)
    for (link, a, x, b, y, value), share in zip(tree.masses.singles, tree.masses.single_shares, strict=True):
        first, second = (tree.carried(q, unit, np.array([e]), [link])[:, 0, axis] for e, axis in ((a, x), (b, y)))
        product = share * masses[value] * np.outer(first, second)
        links += product if (a, x) == (b, y) else product + product.T
    for screw, value, gear in tree.masses.rotors:
        links[screw, screw] += gear * masses[value]
    T = tree.velocities(q, unit)[:, : kernels.n].T
    matrix = T.T @ kernels.mass(q) @ T
    allowed = null_space(kernels.phi_q(q).toarray()[tree.opposed] @ T, rcond=1e-9)
    assert allowed.T @ links @ allowed == pytest.approx(allowed.T @ matrix @ allowed, abs=1e-12)
    assert np.max(np.abs(links - matrix)) > 1e-3
    assert np.linalg.eigvalsh(links)[0] > 0


def test_a_body_whose_elements_all_stand_with_others_is_named():
    """A coupler shares both its points, the second at the end of the loop."""
    kernels = ncgen.compile(ncgen.load("fourbar"), "numpy")
    assert tree_with_loops(kernels) is None
    assert why_no_tables(kernels) == "what shows how body coupler moves stands with bodies at the other end of a loop"


def test_a_run_by_the_matrix_says_why():
    """A planar chain of bars on the ground at both ends, too large to be emitted: each bar shares its two points."""
    kernels = ncgen.compile(example_module("nfourbar").build(70))
    run = ncgen.simulate(kernels, 0.01, points=2)
    assert run.engine == "c"
    assert run.made_with.endswith(f"; {matrix(kernels)}")
    assert matrix(kernels).startswith("the matrix, since what shows how body ")
    assert matrix(ncgen.compile(TREE(40, 2, 0, False), "numpy")) is None
