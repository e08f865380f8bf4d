"""Second derivatives of motions against the second variational equations of a pendulum, against differences of exact gradients, and against
their own transpose: a Hessian that comes by columns, forward and then back, has no reason to be symmetric but being right."""

from __future__ import annotations

import numpy as np
import pytest
import sympy
from scipy.integrate import solve_ivp
from test_sensitivity import DURATION, START, STEPS, linkage, mast, weights

import ncgen
from ncgen.errors import ModelError

OTHERS = {"g": 9.81, "friction": 0.3}
AT = {"length": 0.9, **OTHERS, "psi": 0.4, "rate(psi)": 2.0}
"""The pendulum's parameters and its start."""


def pendulum(power: int = 1) -> ncgen.Model:
    """A uniform rod about a hinge with friction, and a spline of its angle for a torque; its length is a power of the parameter."""
    model = ncgen.Model("rod")
    length = model.parameter("length", AT["length"] ** (1 / power)) ** power
    g, friction = (model.parameter(name, value) for name, value in OTHERS.items())
    end = length * np.sin(AT["psi"]), -length * np.cos(AT["psi"])
    A, B = model.point("A", (0, 0), fixed=True), model.point("B", end)
    x, z = model.vector("x", (0, -1, 0), fixed=True), model.vector("z", (0, 0, 1), fixed=True)
    model.body("rod", [A, B], mass=2.0, com=(end[0] / 2, end[1] / 2), inertia=2.0 * length**2 / 12)
    psi = model.angle("psi", x, B - A, z)
    model.torque(psi, -friction * psi.rate + 3 * sympy.exp(psi.symbol) * sympy.sqrt(1 + psi.symbol**2))
    model.independent(psi)
    model.gravity((0, -g, 0))
    return model


def variational(duration: float, rate: float = AT["rate(psi)"]) -> tuple[np.ndarray, np.ndarray]:
    """ψ and ψ̇ at the end: how they change with AT, (2, 5), and how that does, (2, 5, 5), by Lagrange's equation."""
    L, g, c, x, v = symbols = sympy.symbols("L g c x v")
    J = 2 * L**2 / 3
    force = -2 * g * L / 2 * sympy.sin(x) - c * v + 3 * sympy.exp(x) * sympy.sqrt(1 + x**2)
    f = sympy.Matrix([v, force / J])
    first = f.jacobian(symbols)
    second = [first.diff(s) for s in symbols]
    value = sympy.lambdify(symbols, [f, first, *second], "numpy")
    data = np.array(list(AT.values())[:3])

    def slope(_, y):
        state, by, by_by = y[:2], y[2:12].reshape(2, 5), y[12:].reshape(2, 5, 5)
        rate, A, *B = value(*data, *state)
        whole = np.vstack([np.eye(3, 5), by])  # of data and state, by data and start
        curved = np.einsum("ikj,ka,jb->iab", np.stack(B, axis=-1), whole, whole)
        return np.concatenate([np.ravel(rate), (A @ whole).ravel(), (np.einsum("ij,jab->iab", A[:, 3:], by_by) + curved).ravel()])

    begin = np.concatenate([[AT["psi"], rate], np.hstack([np.zeros((2, 3)), np.eye(2)]).ravel(), np.zeros(50)])
    end = solve_ivp(slope, (0, duration), begin, method="DOP853", rtol=1e-13, atol=1e-14).y[:, -1]
    return end[2:12].reshape(2, 5), end[12:].reshape(2, 5, 5)


def test_against_the_variational_equations():
    """Of ψ and ψ̇ at the end, by a length, gravity, friction and the start: to 1e-10."""
    kernels = ncgen.compile(pendulum())
    first, second = variational(DURATION)
    place = kernels.index["psi"]
    for which in (0, 1):
        weight = np.zeros((2, STEPS + 1, kernels.n))
        weight[which, -1, place] = 1.0
        by_q, by_qd = weight
        found = ncgen.hessian(
            kernels, DURATION, STEPS, lambda q, qd: (0.0, by_q, by_qd, None), integrator="dop853", zd0={"psi": AT["rate(psi)"]}
        )
        assert found.names == tuple(AT)
        assert list(found.derivatives.values()) == pytest.approx(first[which], rel=1e-10, abs=1e-10)
        np.testing.assert_allclose(found.products, second[which], rtol=0, atol=1e-10 * np.max(np.abs(second[which])))


def test_a_start_that_is_no_straight_line_of_a_parameter():
    """From rest, by a root a of the length: ∂²/∂a² = 2 ∂/∂(a²) + 4 a² ∂²/∂(a²)². The start of B.x grows with the square, too."""
    kernels = ncgen.compile(pendulum(power=2))
    first, second = (derivatives[0] for derivatives in variational(DURATION, 0.0))
    root = np.sqrt(AT["length"])
    by_root = np.diag([2 * root, 1.0, 1.0])
    expected = by_root @ second[:3, :3] @ by_root
    expected[0, 0] += 2 * first[0]
    weight = np.zeros((STEPS + 1, kernels.n))
    weight[-1, kernels.index["psi"]] = 1.0
    found = ncgen.hessian(kernels, DURATION, STEPS, lambda q, qd: (0.0, weight, 0 * weight, None), integrator="dop853", z=["B.x"])
    assert found.names[:3] == tuple(AT)[:3]
    np.testing.assert_allclose(found.products[:3, :3], expected, rtol=0, atol=1e-10 * np.max(np.abs(expected)))


@pytest.mark.parametrize("build", [linkage, mast])
def test_loops_and_drivers(build):
    """A number that is no weighted sum, by lengths, inertia, forces and the start: symmetric to rounding, and what gradients differ by."""
    kernels = ncgen.compile(build())
    rates = START[kernels.name]
    a, b = weights(kernels)
    at = {"integrator": "dop853", "z": tuple(rates)}

    def objective(q, qd):
        return np.sum(a * q**3 / 3 + b * qd**2 / 2), a * q**2, b * qd, lambda dq, dqd: (2 * a * q * dq, b * dqd)

    found = ncgen.hessian(kernels, DURATION, STEPS, objective, zd0=rates, **at)
    H = found.products
    np.testing.assert_allclose(H, H.T, rtol=0, atol=1e-12 * np.max(np.abs(H)))

    def gradient(step):
        p, rate = kernels.p0 + step[: len(kernels.p0)], np.array(list(rates.values())) + step[-len(rates) :]
        done = ncgen.gradient(kernels, DURATION, STEPS, lambda q, qd: objective(q, qd)[:3], p=p, zd0=rate, **at)
        return np.array(list(done.derivatives.values()))

    along = np.random.default_rng(3).standard_normal(len(found.names))
    along[len(kernels.p0) : -len(rates)] = 0.0  # where z starts is the model's own
    coarse, middle, fine = ((gradient(h * along) - gradient(-h * along)) / (2 * h) for h in (2e-3, 1e-3, 5e-4))
    wanted = (16 * (4 * fine - middle) - (4 * middle - coarse)) / 45
    np.testing.assert_allclose(H @ along, wanted, rtol=0, atol=2e-9 * np.max(np.abs(wanted)))
    one = ncgen.hessian(kernels, DURATION, STEPS, objective, along[:, None], zd0=rates, **at)
    np.testing.assert_allclose(one.products[:, 0], H @ along, rtol=0, atol=1e-12 * np.max(np.abs(H @ along)))


def test_refusals():
    kernels = ncgen.compile(linkage())
    with pytest.raises(ModelError, match=r"^directions: they have shape \(3,\); give \(12, D\), a row for each of crank, rise"):
        ncgen.hessian(kernels, 0.1, 2, lambda q, qd: (0.0, None, None, None), np.ones(3))
    slow = ncgen.compile(linkage(), "numpy")
    with pytest.raises(ModelError, match="^linkage: its motion is not emitted in C, or .* so it has no second derivatives"):
        ncgen.hessian(slow, 0.1, 2, lambda q, qd: (0.0, None, None, None))


@pytest.mark.parametrize("method", ["trapezoidal", "generalized-alpha"])
def test_implicit_steps_have_no_second_derivatives(method):
    with pytest.raises(ModelError, match=f"^integrator: {method!r} given; second derivatives go through steps of .*rk4, dop853, rk23$"):
        ncgen.hessian(ncgen.compile(linkage(), "numpy"), 0.1, 2, lambda q, qd: (0.0, None, None, None), integrator=method)


@pytest.mark.parametrize("method", ["radau", "bdf"])
def test_implicit_methods_with_error_control_are_refused_at_every_door(method):
    """Their steps are not differentiated; the same words say so, and which ones are, and why."""
    kernels = ncgen.compile(linkage(), "numpy")
    told = (
        f"^integrator: {method!r} given; .*derivatives go through steps of .*rk4.*dop853.*; {method} ends its iterations at the tolerance"
    )
    with pytest.raises(ModelError, match=told):
        ncgen.sensitivities(kernels, 0.1, 2, integrator=method)
    with pytest.raises(ModelError, match=told):
        ncgen.gradient(kernels, 0.1, 2, lambda q, qd: (0.0, None, None), integrator=method)
    with pytest.raises(ModelError, match=told):
        ncgen.hessian(kernels, 0.1, 2, lambda q, qd: (0.0, None, None, None), integrator=method)
