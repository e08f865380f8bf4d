"""Open trees in loops over tables: their accelerations beside those of the factored matrix, and their motion."""

from __future__ import annotations

import numpy as np

import ncgen
from ncgen.exchange.examples import example_module
from ncgen.methods.method import Method
from ncgen.solver import compiled
from ncgen.solver.open_tree import open_tree


def test_loops_have_no_tables():
    assert open_tree(ncgen.compile(ncgen.load("fourbar"))) is None


def test_a_long_arm_begins_without_dense_matrices(monkeypatch):
    """Neither the choice of accelerations nor the look for massless motions makes one; angles have no inertia of their own."""
    kernels = ncgen.compile(example_module("arm").build(70))
    made = []
    monkeypatch.setattr(type(kernels), "_dense", lambda *a: made.append(a))
    for _ in range(2):
        assert ncgen.simulate(kernels, 0.01, points=2).engine == "tree"
    assert compiled.all_coordinates(kernels, form="tree").singular_mass
    assert not made


def test_a_long_arm_takes_tables_by_itself():
    kernels = ncgen.compile(example_module("arm").build(70))
    assert compiled.form_of(kernels, Method.of("lagrange", "dop853")) == "tree"
    run = ncgen.simulate(kernels, 0.3, points=4, zd0={"psi1": 0.5, "psi3": -0.4})
    other = ncgen.simulate(kernels, 0.3, points=4, zd0={"psi1": 0.5, "psi3": -0.4}, engine="c")
    assert (run.engine, other.engine) == ("tree", "c")
    assert np.max(np.abs(run.q - other.q) / kernels.column_sizes) < 1e-6
    assert run.violation().max() < 1e-11
    assert run.statistics.fallbacks == 0
