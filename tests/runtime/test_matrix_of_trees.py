"""Accelerations by the factored matrix on trees with many redundant rows and masses that differ by many digits.

What is expected comes from a null space by singular values, in NumPy.
"""

from __future__ import annotations

import numpy as np
import pytest
from benchmarks.random_trees import by_null_space

import ncgen
from ncgen.comparisons.hard_cases import CASES
from ncgen.exchange.examples import example_module
from ncgen.mechanism.moving import Moving, Stepping
from ncgen.solver.engines.acceleration_forms import all_coordinates
from ncgen.solver.positions.rank import freedom, scaled_jacobian

TREES = ((24, 3, 1), (40, 7, 2), (27, 2, 4), (21, 38, 6), (12, 5, 0))
"""Bodies, seed and loops. Before each row had a diagonal of its own size the first was wrong in the first digit."""


def by_matrix(bodies: int, seed: int, loops: int):
    """A tree and what moves it by the matrix, at velocities that its constraints allow."""
    kernels = ncgen.compile(example_module("tree").build(bodies, seed, loops, False))
    moving = Moving(Stepping(all_coordinates(kernels, form="dense"), "dop853", freedom(kernels).rank, 1e-6, 1e-6, None, 1e-12))
    moving.p[:], moving.q[:] = kernels.p0, ncgen.assemble(kernels)
    moving.qd[:] = np.random.default_rng(seed).uniform(-0.5, 0.5, kernels.n) * kernels.column_sizes
    assert moving.project_state() == "ok"
    return kernels, moving


def check(bodies: int, seed: int, loops: int, within: float) -> None:
    kernels, moving = by_matrix(bodies, seed, loops)
    q, qd = moving.q.copy(), moving.qd.copy()
    rates = scaled_jacobian(kernels, q) @ (qd / kernels.column_sizes)
    assert np.max(np.abs(rates)) < 1e-10 * np.max(np.abs(qd / kernels.column_sizes))
    assert moving.evaluate() == "ok"
    expected = by_null_space(kernels, q, qd)
    assert np.max(np.abs(moving.qdd - expected)) < within * np.max(np.abs(expected))


@pytest.mark.parametrize("tree", TREES)
def test_accelerations(tree):
    check(*tree, within=1e-10)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(40))
def test_accelerations_of_many_trees(seed):
    rng = np.random.default_rng([11, seed])
    check(int(rng.integers(10, 60)), 100 + seed, int(rng.integers(0, 7)), within=1e-8)


def flat_parallelogram():
    """Three links of 1, 2 and 1 m, stretched flat: of three rows two are independent there."""
    m = ncgen.Model("flat")
    A, D = m.point("A", (0, 0), fixed=True), m.point("D", (2, 0), fixed=True)
    B, C = m.point("B", (1, 0)), m.point("C", (3, 0))
    for name, ends in {"ab": (A, B), "bc": (B, C), "cd": (C, D)}.items():
        m.body(name, list(ends), mass=1.0, inertia="rod")
    return ncgen.compile(m)


@pytest.mark.parametrize(("rates", "status"), [((1, 1), "ok"), ((1, -1), "singular"), ((1, 3), "singular")])
def test_a_flat_parallelogram(rates, status):
    """Cranks that turn alike leave γ = (−1, 0, −1) / 1 s², which can be met; others contradict the coupler's row, which is reported."""
    kernels = flat_parallelogram()
    moving = Moving(Stepping(all_coordinates(kernels, form="dense"), "dop853", kernels.m, 1e-6, 1e-6, None, 1e-12))
    moving.p[:], moving.q[:], moving.qd[:] = kernels.p0, kernels.q0, (0, rates[0], 0, rates[1])
    assert moving.evaluate() == status
    if status == "ok":
        assert moving.qdd == pytest.approx([-1, 0, -1, 0], abs=1e-12)


@pytest.mark.parametrize("formalism", ["lagrange", "null-space", "udwadia-phohomsiri"])
def test_nearly_parallel_vectors_of_a_body(formalism):
    """A body turns as Jacobi's functions say, although two of its vectors are 0.6° apart."""
    case = CASES["near-parallel"]
    given = {"rtol": case.rtol, "points": case.points, "formalism": formalism, "integrator": "dop853"} | case.options
    assert case.error(ncgen.simulate(ncgen.compile(case.build()), case.duration, **given)) < 1e-9


def test_rows_are_chosen_anew_on_the_way_to_a_singular_position():
    """Bennett's linkage passes one at 0.475 s. With the rows of an earlier step projections there move it by 1e-3."""
    found = ncgen.simulate(ncgen.compile(ncgen.load("bennett")), 1.0)
    assert found.statistics.fallbacks
    assert found.statistics.largest_projection < 1e-6
