"""Open trees in loops over tables: their accelerations beside those of the factored matrix, and their motion."""

from __future__ import annotations

import pickle
import warnings

import numpy as np
import pytest
from scipy.linalg import null_space

import ncgen
from ncgen.exchange.examples import example_module
from ncgen.mechanism.moving import Moving, Stepping
from ncgen.methods.method import Method
from ncgen.model import Model
from ncgen.solver.engines import acceleration_forms, capabilities
from ncgen.solver.positions.open_tree import open_tree, why_no_tables
from ncgen.solver.positions.rank import freedom, scaled_jacobian
from ncgen.symbolic.tree import Tree, TreeLink, by_depth


def test_loops_have_no_tables():
    assert open_tree(ncgen.compile(ncgen.load("fourbar"))) is None


def test_what_cannot_move_has_none_and_no_warning():
    model = Model("welded")
    A, B = model.point("A", (0, 0)), model.point("B", (1, 0))
    body = model.body("plate", [A, B], mass=1.0, inertia=0.1)
    model.rigid(model.ground, body)
    kernels = ncgen.compile(model)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert open_tree(kernels) is None and "no motion" in why_no_tables(kernels)
        assert ncgen.simulate(kernels, 0.1, points=2).q[-1] == pytest.approx(kernels.q0, abs=1e-14)


def test_a_long_arm_begins_without_dense_matrices(monkeypatch):
    """Neither the choice of accelerations nor the look for massless motions makes one; angles have no inertia of their own."""
    kernels = ncgen.compile(example_module("arm").build(70))
    made = []
    monkeypatch.setattr(type(kernels.phi_q_pattern), "dense", lambda *a: made.append(a))
    for _ in range(2):
        assert ncgen.simulate(kernels, 0.01, points=2).engine == "tree"
    assert acceleration_forms.all_coordinates(kernels, form="tree").singular_mass
    assert not made


def test_a_long_arm_takes_tables_by_itself():
    kernels = ncgen.compile(example_module("arm").build(70))
    assert acceleration_forms.form_of(kernels, Method.of("lagrange", "dop853")) == "tree"
    run = ncgen.simulate(kernels, 0.3, points=4, zd0={"psi1": 0.5, "psi3": -0.4})
    other = ncgen.simulate(kernels, 0.3, points=4, zd0={"psi1": 0.5, "psi3": -0.4}, engine="c")
    assert (run.engine, other.engine) == ("tree", "c")
    assert np.max(np.abs(run.q - other.q) / kernels.column_sizes) < 1e-6
    assert run.violation().max() < 1e-11
    assert run.statistics.fallbacks == 0


def test_more_effort_writes_out_what_has_tables(monkeypatch):
    """The same motion, by kernels that say so after they were pickled, too."""
    model = example_module("arm").build(acceleration_forms.FEW_RATES + 1)
    quick, long = ncgen.compile(model), ncgen.compile(model, effort="most")
    runs = [ncgen.simulate(kernels, 0.1, points=2) for kernels in (quick, long)]
    assert [run.engine for run in runs] == ["tree", "emitted"]
    assert np.max(np.abs(runs[0].q - runs[1].q) / quick.column_sizes) < 1e-7
    again = pickle.loads(pickle.dumps(long))
    assert again.effort == "most" and acceleration_forms.form_of(again, Method.of("lagrange", "dop853")) == "emitted"
    monkeypatch.setattr(acceleration_forms, "MOST_RATES", acceleration_forms.FEW_RATES)
    assert ncgen.simulate(long.driven_by(None), 0.01, points=2).engine == "emitted"


def test_a_tree_of_few_joints_is_written_out():
    assert ncgen.simulate(ncgen.compile(example_module("arm").build(7)), 0.01, points=2).engine == "emitted"


def test_an_effort_that_does_not_exist_is_refused():
    with pytest.raises(ncgen.ModelError, match="effort"):
        ncgen.compile(ncgen.load("fourbar"), effort="all")


@pytest.fixture(scope="module")
def crane():
    """Joints of three, two and one freedoms, turning and sliding, on one another; the last one with an angle and a rotor."""
    m = Model("crane")
    ground, upper, lower = m.point("O", (0, 0, 0), fixed=True), m.point("A", (0.4, 0.1, -0.3)), m.point("B", (0.7, -0.2, -0.6))
    along, way, axle = m.vector("along", (1, 0, 0)), m.vector("way", (0.36, 0.48, 0.8)), m.vector("axle", (0, 0.6, 0.8))
    start, hinge, end = m.point("C", lower.initial + 0.2 * way.initial), m.point("D", (1.2, 0.3, -0.5)), m.point("E", (1.3, 0.1, -0.9))
    inertia = np.diag([0.02, 0.03, 0.04])
    first = m.body("first", [ground, upper], [along], 1.2, inertia=inertia)
    second = m.body("second", [upper, lower], [way], 0.8, inertia=inertia)
    third = m.body("third", [start, hinge], [way], 0.5, inertia=inertia)
    fourth = m.body("fourth", [hinge, end], [axle], 0.7, inertia=inertia)
    m.spherical(m.ground, first, ground)
    m.spherical(first, second, upper)
    m.cylindrical(second, third, lower, start, way)
    m.revolute(third, fourth, hinge, axle)
    m.rotor(m.angle("psi", start=hinge - start, end=end - hinge, axis=axle), 0.1)
    m.gravity((0, 0, -9.81))
    return ncgen.compile(m, backend="c")


def moving(kernels, form):
    dynamics = acceleration_forms.all_coordinates(capabilities.checked_compiled(kernels), form=form)
    found = Moving(Stepping(dynamics, "dop853", freedom(kernels).rank, 1e-8, 1e-10, None, 1e-12))
    found.p[:] = kernels.p0
    return found


def test_a_tree_settles_with_the_least_kinetic_energy(crane):
    """Of a change of velocities or, to first order, of positions what joints allow stays: T (Tᵀ M T)⁻¹ Tᵀ M of it, T spanning that."""
    q, sizes, rng = ncgen.assemble(crane), crane.column_sizes, np.random.default_rng(1)
    T = sizes[:, None] * null_space(scaled_jacobian(crane, q), rcond=1e-9)
    assert T.shape[1] == len(open_tree(crane).screws) == 9
    M = crane.mass(q).toarray()
    allowed = T @ np.linalg.solve(T.T @ M @ T, T.T @ M)
    tree, qd, aside = moving(crane, "tree"), rng.uniform(-1, 1, crane.n) * sizes, 1e-4 * rng.uniform(-1, 1, crane.n) * sizes
    tree.q[:], tree.qd[:] = q, qd
    assert tree.project_state() == "ok"
    assert tree.q == pytest.approx(q, abs=1e-14)
    assert tree.qd == pytest.approx(allowed @ qd, abs=1e-12)
    tree.q[:], tree.qd[:] = q + aside, 0.0
    assert tree.project_state() == "ok"
    assert np.max(np.abs(crane.phi(tree.q) / crane.row_sizes)) < 1e-13
    assert tree.q - q == pytest.approx(allowed @ aside, abs=1e-6)


def test_a_tree_accelerates_and_moves_as_the_matrix_says(crane):
    states = {form: moving(crane, form) for form in ("tree", "dense")}
    start = crane.q0, np.random.default_rng(2).uniform(-1, 1, crane.n) * crane.column_sizes
    states["dense"].q[:], states["dense"].qd[:] = start
    assert states["dense"].project_state() == "ok"
    states["tree"].q[:], states["tree"].qd[:] = states["dense"].q, states["dense"].qd
    for state in states.values():
        assert state.evaluate() == "ok"
    assert states["tree"].qdd == pytest.approx(states["dense"].qdd, abs=1e-10)
    for state in states.values():
        assert state.go_on(0.2) == "ok"
        assert np.max(np.abs(crane.phi(state.q) / crane.row_sizes)) < 1e-13
    assert states["tree"].q == pytest.approx(states["dense"].q, abs=1e-7)
    assert states["tree"].qd == pytest.approx(states["dense"].qd, abs=1e-6)


@pytest.mark.parametrize("integrator", [None, "dop853", "radau"])
def test_stiffness_is_seen_alike_in_both_forms(monkeypatch, integrator):
    """Damped joints, as robots' files have them: every form takes a joint's rate from its angle, so that steps are as many."""
    model = example_module("arm").build(6)
    for angle, damping in zip(model.chosen_independent, (5.0, 5.0, 5.0, 20.0, 50.0, 100.0), strict=True):
        model.torsion_spring(model.elements[angle], damping=damping)
    runs = []
    for most in (0, acceleration_forms.MOST_RATES):
        monkeypatch.setattr(acceleration_forms, "MOST_RATES", most)
        kernels = ncgen.compile(model, backend="c")
        start = {name: 0.5 * (-1) ** i for i, name in enumerate(model.chosen_independent)}
        runs.append(ncgen.simulate(kernels, 0.5, rtol=1e-6, points=6, zd0=start, **({"integrator": integrator} if integrator else {})))
    tree, emitted = runs
    assert (tree.engine, emitted.engine) == ("tree", "emitted")
    assert tree.made_with.replace("tree", "emitted") == emitted.made_with
    assert tree.statistics.steps == pytest.approx(emitted.statistics.steps, rel=0.02)
    assert tree.statistics.evaluations == pytest.approx(emitted.statistics.evaluations, rel=0.02)
    assert tree.statistics.repeated_steps == emitted.statistics.repeated_steps
    assert np.max(np.abs(tree.q[-1] - emitted.q[-1]) / kernels.column_sizes) < 1e-7
    assert (integrator is None) == ("stiff" in emitted.made_with)


def test_one_position_with_other_velocities(crane):
    """What belongs to a position is found once: the second velocities there accelerate as where nothing was evaluated before."""
    rng = np.random.default_rng(4)
    tree, dense = moving(crane, "tree"), moving(crane, "dense")
    for position in (crane.q0, crane.q0 + 0.02 * rng.uniform(-1, 1, crane.n) * crane.column_sizes):
        for _ in range(3):
            dense.q[:], dense.qd[:] = position, rng.uniform(-1, 1, crane.n) * crane.column_sizes
            assert dense.project_state() == "ok"
            fresh = moving(crane, "tree")
            for state in (tree, fresh, dense):
                state.q[:], state.qd[:] = dense.q, dense.qd
                assert state.evaluate() == "ok"
            assert np.array_equal(tree.qdd, fresh.qdd)
            assert tree.qdd == pytest.approx(dense.qdd, abs=1e-10)


def test_links_stand_by_their_distance_from_the_ground():
    """Two arms of three and of two links: the first links come first, and elements stay with theirs."""
    links = [TreeLink(body, parent, ()) for body, parent in zip("abcde", (None, 0, 1, None, 3), strict=True)]
    tree = by_depth(Tree(tuple(links), (), {"x": 2, "y": 3}))
    assert [(link.body, link.parent) for link in tree.links] == [("a", None), ("d", None), ("b", 0), ("e", 1), ("c", 2)]
    assert tree.home == {"x": 4, "y": 1}
