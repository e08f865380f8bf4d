"""Positions and velocities of large mechanisms by sparse algebra, judged by the dense formulas they stand for."""

from __future__ import annotations

import numpy as np
import pytest

import ncgen
from ncgen.exchange.examples import example_module
from ncgen.mechanism.kernels import Kernels
from ncgen.solver.formalisms.projection import project_velocity
from ncgen.solver.positions.open_tree import open_tree
from ncgen.solver.positions.partition import choose_partition
from ncgen.solver.positions.position import residual, solve_position
from ncgen.solver.positions.rank import freedom, scaled_jacobian, trial_positions
from ncgen.solver.positions.sparse_rows import DENSE, independent_rows
from ncgen.solver.runs.start import given_velocity, velocity_from_rates

LINKS = DENSE + 10


@pytest.fixture(scope="module")
def chain() -> Kernels:
    return ncgen.compile(example_module("chain").build(LINKS), "numpy")


@pytest.fixture(scope="module")
def arm() -> Kernels:
    """Forty joints: 240 rows."""
    return ncgen.compile(example_module("arm").build(40), "numpy")


def aside(kernels: Kernels) -> np.ndarray:
    return kernels.q0 + 1e-3 * kernels.column_sizes * np.cos(np.arange(kernels.n))


def test_a_step_of_newtons_method_is_the_smallest(chain):
    q = aside(chain)
    jacobian = chain.jacobian(q) / chain.row_sizes[:, None]
    dense = np.linalg.lstsq(jacobian, -chain.phi(q) / chain.row_sizes, rcond=1e-10)[0]
    rows = independent_rows(chain.phi_q(q).multiply(1 / chain.row_sizes[:, None]).tocsr())
    assert rows is not None
    assert np.max(np.abs(rows.least(-chain.phi(q) / chain.row_sizes) - dense)) < 1e-12 * np.max(np.abs(dense))


def test_positions_close(chain):
    found = solve_position(chain, aside(chain))
    assert residual(chain, found.q) < 1e-12 and found.iterations < 8
    assert residual(chain, ncgen.assemble(chain, aside(chain))) < 1e-12


def test_trial_positions_are_closed_and_apart(chain):
    found = trial_positions(chain, chain.q0)
    assert len(found) == 7 and max(residual(chain, q) for q in found) < 1e-12
    assert all(np.max(np.abs(q - chain.q0) / chain.column_sizes) > 0.01 for q in found[1:])


def test_velocities_are_projected_by_the_least_kinetic_energy(chain):
    """min (v − q̇)ᵀ M (v − q̇) with Φ_q v = 0."""
    qd = np.sin(np.arange(chain.n))
    M, J = chain.mass_matrix(chain.q0), chain.jacobian(chain.q0)
    X = np.linalg.solve(M, J.T)
    dense = qd - X @ np.linalg.solve(J @ X, J @ qd)
    assert np.max(np.abs(project_velocity(chain, chain.q0, qd) - dense)) < 1e-9


def test_rates_by_name_keep_their_values(chain):
    name = chain.coordinates[20]
    found = given_velocity(chain, {name: 0.3}, chain.q0, 0.0, chain.p0)
    assert abs(found[20] - 0.3) < 1e-10
    assert np.max(np.abs(chain.jacobian(chain.q0) @ found)) < 1e-9


def test_an_arm_takes_its_angles_and_their_rates(arm):
    """Its own rows say the freedoms, link by link; the tree's velocities are those of the rows."""
    tree = open_tree(arm)
    assert tree is not None and freedom(arm).dof == 40
    part = choose_partition(arm, arm.q0)
    assert part.names(arm) == tuple(f"psi{i + 1}" for i in range(40))
    rates = np.cos(np.arange(40.0))
    qd = velocity_from_rates(arm, part, rates, arm.q0, 0.0, arm.p0)
    assert np.max(np.abs(qd - tree.velocities(arm.q0, rates)[: arm.n])) < 1e-9
    assert np.linalg.matrix_rank(scaled_jacobian(arm, arm.q0)) == arm.m
