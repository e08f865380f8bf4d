"""The chain of rods: counts, assembly, energy, and a motion against Lagrange's equations in angles."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import ncgen
from ncgen.exchange.examples import example_module

CHAIN = example_module("chain")
ACCURATE = dict(integrator="dop853", rtol=1e-10, atol=1e-12, points=6)


def kernels(n):
    return ncgen.compile(CHAIN.build(n), backend="numpy")


@pytest.mark.parametrize("n", [1, 3, 10, 20])
def test_freedom(n):
    """Two degrees of freedom a link: a rod on two points has no spin."""
    found = ncgen.freedom(kernels(n))
    assert (found.dof, len(found.redundant), found.is_singular) == (2 * n, 0, False)


def test_assembles_near_the_drawing():
    chain = kernels(10)
    noise = 0.01 * np.random.default_rng(1).standard_normal(chain.n) * chain.length / 10
    q = ncgen.assemble(chain, chain.q0 + noise)
    assert np.max(np.abs(chain.phi(q) / chain.row_sizes)) < 1e-10
    assert np.max(np.abs(q - chain.q0)) < 0.02 * chain.length


def test_energy_of_twenty_links():
    run = ncgen.simulate(kernels(20), 0.2, integrator="dop853", rtol=1e-9, atol=1e-11, points=6)
    assert run.energy_drift < 1e-9
    assert np.max(run.violation()) < 1e-9


def test_motion_of_three_links():
    run = ncgen.simulate(kernels(3), 0.6, **ACCURATE)
    angles = lagrange(3, run.t)
    ends = np.cumsum(directions(angles) / 3, axis=1)
    for k in range(3):
        np.testing.assert_allclose(run.point(f"P{k + 1}"), ends[:, k], atol=1e-9)


# -- Lagrange's equations of n slender rods in two angles each: swing α and tilt β ----------------------


def directions(angles):
    """Links' directions (K, n, 3) from α and β, shape (K, 2, n); singular only where a link lies along y."""
    a, b = angles[:, 0], angles[:, 1]
    return np.stack([np.cos(b) * np.sin(a), np.sin(b), -np.cos(b) * np.cos(a)], axis=-1)


def lagrange(n, times, gravity=9.81):
    """α and β (K, 2, n) of a chain of 1 m and 1 kg that starts at rest in the example's helix.

    T = ½ Σ μ_ij ḋ_i·ḋ_j and V = −Σ w_i d_i·g, where link j moves with ḋ_i of all before it, i < j, and half its own.
    """
    size = mass = 1.0 / n
    order = np.arange(n)
    after = n - 1 - np.maximum.outer(order, order)  # links that hang on both i and j
    mu = mass * size**2 * (after + np.where(np.equal.outer(order, order), 1 / 3, 1 / 2))
    weight = mass * size * (n - 0.5 - order)

    def derivative(_, y):
        a, b, da, db = y.reshape(4, n)
        sa, ca, sb, cb, zero = np.sin(a), np.cos(a), np.sin(b), np.cos(b), np.zeros(n)
        by_a = np.stack([cb * ca, zero, cb * sa])
        by_b = np.stack([-sb * sa, cb, sb * ca])
        bias = np.stack(
            [
                -cb * sa * (da**2 + db**2) - 2 * sb * ca * da * db,
                -sb * db**2,
                cb * ca * (da**2 + db**2) - 2 * sb * sa * da * db,
            ]
        )
        columns = np.concatenate([by_a, by_b], axis=1)  # (3, 2n): links' directions by their own angles
        wide = np.tile(mu, (2, 2))
        matrix = wide * (columns.T @ columns)
        pull = -gravity * np.tile(weight, 2) * columns[2]
        turning = np.sum(columns * np.tile(bias @ mu, 2), axis=0)
        return np.concatenate([da, db, np.linalg.solve(matrix, pull - turning)])

    d = CHAIN.directions(n)
    start = np.concatenate([np.arctan2(d[:, 0], -d[:, 2]), np.arcsin(d[:, 1]), np.zeros(2 * n)])
    found = solve_ivp(derivative, (0, times[-1]), start, "DOP853", times, rtol=1e-12, atol=1e-13)
    return found.y[: 2 * n].T.reshape(-1, 2, n)
