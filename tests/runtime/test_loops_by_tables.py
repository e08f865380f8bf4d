"""Trees with loops, and with joints whose motions are coupled, in loops over tables: as the factored matrix has it."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import null_space

import ncgen
from ncgen.exchange.examples import example_module
from ncgen.mechanism.moving import Moving, Stepping
from ncgen.methods.method import Method
from ncgen.solver.engines import acceleration_forms
from ncgen.solver.positions.open_tree import open_tree, tree_with_loops
from ncgen.solver.positions.rank import freedom, scaled_jacobian

TREE = example_module("tree").build


@pytest.fixture(scope="module", params=[(10, 1, 2), (10, 8, 2), (12, 5, 0)], ids=str)
def kernels(request):
    """Bodies, seed, loops; universal joints and screws have a row more than their motions."""
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


def test_implicit_methods_take_the_matrix():
    """They need the degrees of freedom that loops leave."""
    kernels = ncgen.compile(TREE(40, 2, 0, False))
    forms = [acceleration_forms.form_of(kernels, Method.of("lagrange", name)) for name in ("dop853", "radau")]
    assert forms == ["tree", "dense"]


def test_a_mass_between_two_ends_of_a_loop_has_no_tables():
    assert tree_with_loops(ncgen.compile(TREE(10, 3, 2, False), "numpy")) is None
