"""The tangent kernels against complex steps of the kernels that they differentiate, on every kind of mechanism."""

from __future__ import annotations

import numpy as np
import pytest

import ncgen

MECHANISMS = ["robot", "pendulum", "andrews", "flyball", "disc", "heavytop", "suspension", "panels", "slidercrank3d", "stewart"]
STEP = 1e-100


@pytest.fixture(scope="module", params=MECHANISMS)
def both(request):
    """The same mechanism compiled, and in NumPy, which takes complex numbers."""
    sources = ncgen.generate(ncgen.load(request.param))
    return ncgen.compile(sources, backend="c"), ncgen.compile(sources, backend="numpy")


@pytest.fixture(scope="module")
def state(both):
    kernels, _ = both
    rng = np.random.default_rng(11)
    n, m = kernels.n, kernels.m
    q = kernels.q0 + 0.05 * kernels.column_sizes * rng.standard_normal(n)
    return q, *(rng.standard_normal(size) for size in (n, n, m))


def slope(function, x):
    """∂function/∂x, columns by complex steps: exact to rounding."""
    columns = []
    for k in range(len(x)):
        moved = x.astype(complex)
        moved[k] += 1j * STEP
        columns.append(function(moved).imag / STEP)
    return np.array(columns).T.reshape(-1, len(x))


def assert_close(found, wanted):
    scale = max(1.0, np.max(np.abs(wanted), initial=0.0))
    assert np.max(np.abs(found - wanted), initial=0.0) <= 1e-13 * scale


def balance(numpy_kernels, q, qd, qdd, lam, t):
    row_forces = numpy_kernels.jacobian(q, t).T @ lam
    return numpy_kernels.mass_matrix(q, t) @ qdd + row_forces - numpy_kernels.values("force", t, q, qd, None)


@pytest.mark.parametrize("which", [0, 1], ids=["c", "numpy"])
def test_against_complex_steps(both, state, which):
    """K, C and the derivatives of the second derivative of the rows, at a position off the constraints."""
    kernels, plain = both[which], both[1]
    q, qd, qdd, lam = state
    t = 0.3
    assert_close(kernels.stiffness(q, qd, qdd, lam, t).toarray(), slope(lambda x: balance(plain, x, qd, qdd, lam, t), q))
    assert_close(kernels.damping(q, qd, t).toarray(), slope(lambda v: -plain.values("force", t, q, v, None) + 0 * v, qd))

    def row_acceleration(x, v):
        return plain.jacobian(x, t) @ qdd - plain.values("gamma", t, x, v, None)

    assert_close(kernels.phidd_q(q, qd, qdd, t).toarray(), slope(lambda x: row_acceleration(x, qd), q))
    assert_close(kernels.phidd_qd(q, qd, t).toarray(), slope(lambda v: row_acceleration(q, v), qd))


def test_made_only_when_asked_for(both):
    """A mechanism that is only simulated explicitly has no tangent kernels compiled."""
    fresh = ncgen.compile(ncgen.load("pendulum"), backend="c")
    fresh.force(fresh.q0, fresh.q0)
    assert "tangents" not in vars(fresh)
    assert fresh.stiffness(fresh.q0, fresh.q0, fresh.q0, np.ones(fresh.m)).shape == (fresh.n, fresh.n)


@pytest.mark.parametrize("emission", ["tabled", "unrolled"])
def test_emissions_agree(emission):
    """Loops and straight lines give the same tangents."""
    kernels, other = (ncgen.compile(ncgen.load("flyball"), backend="c", emission=e) for e in ("auto", emission))
    rng = np.random.default_rng(3)
    q, qd, qdd, lam = (rng.standard_normal(k) for k in (kernels.n, kernels.n, kernels.n, kernels.m))
    assert_close(other.stiffness(q, qd, qdd, lam).toarray(), kernels.stiffness(q, qd, qdd, lam).toarray())
    assert_close(other.phidd_q(q, qd, qdd).toarray(), kernels.phidd_q(q, qd, qdd).toarray())
