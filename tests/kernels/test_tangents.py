"""The tangent kernels against complex steps of the kernels that they differentiate, on every kind of mechanism."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
import sympy

import ncgen
from ncgen.mechanism import tangents

MECHANISMS = ["robot", "pendulum", "andrews", "flyball", "disc", "heavytop", "suspension", "panels", "slidercrank3d", "stewart"]
STEP = 1e-100


@pytest.fixture(scope="module", params=MECHANISMS)
def both(request):
    """The same mechanism compiled, and in NumPy, which takes complex numbers."""
    sources = ncgen.generate(ncgen.load(request.param))
    return ncgen.compile(sources, backend="c"), ncgen.compile(sources, backend="numpy")


@pytest.fixture(autouse=True)
def compiled_at_once(monkeypatch):
    """The first calls would come without a compiler."""
    monkeypatch.setattr(tangents, "FEW_CALLS", 0)


@pytest.mark.parametrize("name", ["stiffness", "damping", "phidd_q", "phidd_qd"])
def test_the_first_calls_need_no_compiler(both, state, name, monkeypatch):
    """They are what the library gives, to rounding, and it is not loaded before."""
    q, qd, qdd, lam = state
    given = {"stiffness": (q, qd, qdd, lam), "phidd_q": (q, qd, qdd)}.get(name, (q, qd))
    fresh = pickle.loads(pickle.dumps(both[0]))
    monkeypatch.setattr(tangents, "FEW_CALLS", 1)
    monkeypatch.setattr(tangents, "load", None)
    first = getattr(fresh, name)(*given, 0.3).toarray()
    monkeypatch.undo()
    monkeypatch.setattr(tangents, "FEW_CALLS", 1)
    second = getattr(fresh, name)(*given, 0.3).toarray()
    assert_close(first, second)


def test_what_is_not_finite_is_left_to_the_library(monkeypatch):
    """A torque log(ψ̇) has no derivative at rest: as in C, and no error of Python's."""
    m = ncgen.Model("rod")
    A, B = m.point("A", (0, 0, 0), fixed=True), m.point("B", (1, 0, 0))
    x, z, side = m.vector("x", (1, 0, 0), fixed=True), m.vector("z", (0, 0, 1), fixed=True), m.vector("side", (0, 1, 0))
    m.body("rod", [A, B], [side, z], mass=3.0, com=(0.5, 0, 0), inertia=(0.25, 0.25, 0.25))
    psi = m.angle("psi", x, B - A, z)
    m.torque(psi, sympy.log(psi.rate))
    kernels, found = ncgen.compile(m, backend="c"), []
    for calls in (0, 5):
        monkeypatch.setattr(tangents, "FEW_CALLS", calls)
        found.append(kernels.damping(kernels.q0, np.zeros(kernels.n)).toarray())
    assert np.array_equal(*found, equal_nan=True) and not np.all(np.isfinite(found[0]))


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


def parametric() -> ncgen.Model:
    """A slider-crank-like loop in which lengths, inertia, a spring, a damper, a drive and gravity hold parameters."""
    model = ncgen.Model("parametric")
    length, stiff, heavy, speed = (model.parameter(n, v) for n, v in (("L", 1.2), ("k", 40.0), ("w", 3.0), ("speed", 0.7)))
    A, D = model.point("A", (0, 0, 0), fixed=True), model.point("D", (2, 0, 0), fixed=True)
    z, x = model.vector("z", (0, 0, 1), fixed=True), model.vector("x", (1, 0, 0), fixed=True)
    B, C = model.point("B", (0, 1.2, 0), fixed="z"), model.point("C", (2, 1.5, 0), fixed="z")
    model.distance(A, B, length)
    model.distance(B, C)
    model.distance(C, D)
    psi = model.angle("psi", start=x, end=B - A, axis=z)
    model.drive(psi, sympy.pi / 2 + speed * model.time**2)
    model.spring(B, D, stiffness=stiff, damping=0.1 * stiff, free_length=length / 2)
    model.force(C, (heavy * sympy.sin(model.time), -(heavy**2), 0))
    return model


def test_derivatives_by_parameters():
    """phi_p, phid_p, phidd_p and balance_p against complex steps in the parameters."""
    sources = ncgen.generate(parametric())
    plain = ncgen.compile(sources, backend="numpy")
    rng = np.random.default_rng(5)
    q, qd, qdd, lam = (rng.standard_normal(k) for k in (plain.n, plain.n, plain.n, plain.m))
    q, t = plain.q0 + 0.05 * q, 0.4

    def row_rate(p):
        return plain.jacobian(q, t, p) @ qd - plain.nu(q, t, p)

    def row_acceleration(p):
        return plain.jacobian(q, t, p) @ qdd - plain.values("gamma", t, q, qd, p)

    def forces(p):
        return plain.mass_matrix(q, t, p) @ qdd + plain.jacobian(q, t, p).T @ lam - plain.values("force", t, q, qd, p)

    for kernels in (plain, ncgen.compile(sources, backend="c")):
        assert_close(kernels.phi_p(q, t).toarray(), slope(lambda p: plain.phi(q, t, p), plain.p0))
        assert_close(kernels.phid_p(q, qd, t).toarray(), slope(row_rate, plain.p0))
        assert_close(kernels.phidd_p(q, qd, qdd, t).toarray(), slope(row_acceleration, plain.p0))
        assert_close(kernels.balance_p(q, qd, qdd, lam, t).toarray(), slope(forces, plain.p0))
    assert np.all(np.abs(plain.phi_p(q, t).toarray()).max(axis=0)[[0, 3]] > 0)
    assert np.all(np.abs(plain.balance_p(q, qd, qdd, lam, t).toarray()).max(axis=0)[:3] > 0)
