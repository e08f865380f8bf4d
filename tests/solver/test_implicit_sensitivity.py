"""Derivatives of implicit steps against complex steps through an independent solution of their equations on the NumPy kernels."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
import sympy
from driven_models import mass_on_a_slide
from test_sensitivity import START, fourbar, mast

import ncgen
from ncgen.errors import ConvergenceError, ModelError
from ncgen.solver.positions.partition import choose_partitions

STEP = 1e-30
DURATION, STEPS = 0.06, 3
NEWTON = 4
METHODS = {
    "rattle": {},
    "generalized-alpha": {"rho": 0.6},
    "energy-momentum": {},
    "energy-momentum, projected": {"project_velocities": True},
    "trapezoidal": {},
}


def root(function: Callable[[np.ndarray], np.ndarray], guess: np.ndarray) -> np.ndarray:
    """x of function(x) = 0 in complex numbers, by Newton's method with a Jacobian of complex steps at real ones."""
    x = guess.astype(complex)
    for _ in range(NEWTON):
        here = np.imag(function(x.real))  # what the function's own arguments change by
        J = np.array([(np.imag(function(x.real + 1j * STEP * e)) - here) / STEP for e in np.eye(len(x))]).T
        x = x - np.linalg.solve(J, function(x))
    return x


class Steps:
    """Steps of one method as equations, in complex numbers."""

    def __init__(self, plain, method: str, options: dict, rows, partition, p: np.ndarray) -> None:
        self.plain, self.method, self.options, self.rows, self.partition, self.p = plain, method, options, rows, partition, p
        self.n, self.m = plain.n, len(rows)

    def phi(self, q, t):
        return self.plain.phi(q, t, self.p)[self.rows]

    def phi_q(self, q, t):
        return self.plain.jacobian(q, t, self.p)[self.rows]

    def nu(self, q, t):
        return self.plain.nu(q, t, self.p)[self.rows]

    def force(self, q, v, t):
        return self.plain.values("force", t, q, v, self.p)

    def mass(self, q, t):
        return self.plain.mass_matrix(q, t, self.p)

    def accelerations(self, q, v, t):
        J, zero = self.phi_q(q, t), np.zeros((self.m, self.m))
        matrix = np.block([[self.mass(q, t), J.T], [J, zero]])
        right = np.concatenate([self.force(q, v, t), self.plain.values("gamma", t, q, v, self.p)[self.rows]])
        return np.linalg.solve(matrix, right)[: self.n]

    def closed(self, z, zd, guess, t):
        """(q, v) at independent coordinates and their rates."""
        d, i = self.partition.dependent, self.partition.independent
        q, v = guess.astype(complex), np.zeros(self.n, dtype=complex)
        q[i], v[i] = z, zd
        for _ in range(NEWTON):
            q[d] -= np.linalg.solve(self.phi_q(q, t)[:, d], self.phi(q, t))
        v[d] = np.linalg.solve(self.phi_q(q, t)[:, d], self.nu(q, t) - self.phi_q(q, t)[:, i] @ zd)
        return q, v

    def run(self, z, zd):
        q, v = self.closed(z, zd, self.plain.q0, 0.0)
        history, h = [(q, v)], DURATION / STEPS
        self.a = self.qdd = self.accelerations(q, v, 0.0)
        step = getattr(self, self.method.split(",")[0].replace("-", "_"))
        for k in range(STEPS):
            q, v = step(q, v, DURATION * k / STEPS, h)
            history.append((q, v))
        return np.array([q for q, _ in history]), np.array([v for _, v in history])

    def rattle(self, q, v, t, h):
        def first(x):
            w, lam = x[: self.n], x[self.n :]
            kick = self.mass(q, t) @ (w - v) - h / 2 * (self.force(q, w, t) - self.phi_q(q, t).T @ lam)
            return np.concatenate([kick, self.phi(q + h * w, t + h)])

        w = root(first, np.concatenate([v, np.zeros(self.m)]))[: self.n]
        end, t = q + h * w, t + h

        def second(x):
            kick = self.mass(end, t) @ (x[: self.n] - w) - h / 2 * (self.force(end, w, t) - self.phi_q(end, t).T @ x[self.n :])
            return np.concatenate([kick, self.phi_q(end, t) @ x[: self.n] - self.nu(end, t)])

        return end, root(second, np.concatenate([w, np.zeros(self.m)]))[: self.n]

    def generalized_alpha(self, q, v, t, h):
        rho = self.options["rho"]
        am, af = (2 * rho - 1) / (rho + 1), rho / (rho + 1)
        gamma = 0.5 - am + af
        beta, n = (gamma + 0.5) ** 2 / 4, self.n

        def ends(qdd):
            a = ((1 - af) * qdd + af * self.qdd - am * self.a) / (1 - am)
            return a, q + h * v + h**2 * ((0.5 - beta) * self.a + beta * a), v + h * ((1 - gamma) * self.a + gamma * a)

        def equations(x):
            _, q1, v1 = ends(x[:n])
            balance = self.mass(q1, t + h) @ x[:n] + self.phi_q(q1, t + h).T @ x[n:] - self.force(q1, v1, t + h)
            return np.concatenate([balance, self.phi(q1, t + h)])

        qdd = root(equations, np.concatenate([self.qdd, np.zeros(self.m)]))[:n]
        a, q, v = ends(qdd)
        self.a, self.qdd = a, qdd
        return q, v

    def energy_momentum(self, q, v, t, h):
        n, half, D = self.n, t + h / 2, self.plain.column_sizes**-2.0

        def equations(x):
            v1, lam = x[:n], x[n:]
            rate = (v + v1) / 2
            q1, at, moved = q + h * rate, q + h / 2 * rate, h * rate
            along = D * moved / (moved @ (D * moved))
            A, Q, M = self.phi_q(at, half), self.force(at, rate, half), self.mass(at, half)
            energy = lambda *state: self.plain.energy(*state, self.p)  # noqa: E731
            (T0, V0, _), (_, _, power), (T1, V1, _) = energy(q, v, t), energy(at, rate, half), energy(q1, v1, t + h)
            A = A + np.outer(self.phi(q1, t + h) - self.phi(q, t) + h * self.nu(at, half) - A @ moved, along)
            Q = Q + (V0 - V1 + h * power + rate @ M @ (v1 - v) - (T1 - T0) - Q @ moved) * along
            return np.concatenate([M @ (v1 - v) - h * (Q - A.T @ lam), self.phi(q1, t + h)])

        v1 = root(equations, np.concatenate([v, np.zeros(self.m)]))[:n]
        q1 = q + h * (v + v1) / 2
        if self.options:
            J = self.phi_q(q1, t + h)
            matrix = np.block([[self.mass(q1, t + h), J.T], [J, np.zeros((self.m, self.m))]])
            v1 = v1 + np.linalg.solve(matrix, np.concatenate([np.zeros(n), self.nu(q1, t + h) - J @ v1]))[:n]
        return q1, v1

    def trapezoidal(self, q, v, t, h):
        i = self.partition.independent
        k, before = len(i), np.concatenate([self.accelerations(q, v, t)[i], v[i]])
        y = np.concatenate([v[i], q[i]])

        def equations(x):
            q1, v1 = self.closed(x[k:], x[:k], q, t + h)
            return x - y - h / 2 * (before + np.concatenate([self.accelerations(q1, v1, t + h)[i], v1[i]]))

        x = root(equations, y + h * before)
        return self.closed(x[k:], x[:k], q, t + h)


@pytest.fixture(scope="module", params=[fourbar, pytest.param(mast, marks=pytest.mark.slow)], ids=lambda build: build.__name__)
def mechanism(request):
    sources = ncgen.generate(request.param())
    return ncgen.compile(sources, backend="c"), ncgen.compile(sources, backend="numpy")


def wanted(plain, rates: dict[str, float], method: str, options: dict) -> dict[str, np.ndarray]:
    """{column: (2, K, n) complex motions}, whose imaginary parts are derivatives times `STEP`."""
    z = tuple(rates)
    partition = choose_partitions(plain, plain.q0, independent=z).position
    z0, zd0, follows = plain.q0[partition.independent], np.array(list(rates.values())), plain.start_p()[partition.independent]
    columns = {}
    for k, name in enumerate((*plain.parameters, *z, *(f"rate({x})" for x in z))):
        p, start, speed = plain.p0.astype(complex), z0.astype(complex), zd0.astype(complex)
        if name in plain.parameters:
            p[k] += 1j * STEP
            start += 1j * STEP * follows[:, k]
        elif name in z:
            start[z.index(name)] += 1j * STEP
        else:
            speed[k - len(p) - len(z)] += 1j * STEP
        columns[name] = np.array(Steps(plain, method, options, partition.rows, partition, p).run(start, speed))
    return columns


@pytest.mark.parametrize("method", METHODS)
def test_implicit_steps_against_complex_steps(mechanism, method):
    """Every coordinate and velocity at every instant, by every parameter and initial value, to 1e-9 of the largest; and back to 1e-11."""
    kernels, plain = mechanism
    rates, options = START[kernels.name], METHODS[method]
    at = {"integrator": method.split(",")[0], "options": options or None, "zd0": rates, "z": tuple(rates)}
    found = ncgen.sensitivities(kernels, DURATION, STEPS, **at)
    columns = wanted(plain, rates, method, options)
    assert found.names == tuple(columns)
    for k, motion in enumerate(columns.values()):
        for own, by, (seen, change) in zip(
            (found.q, found.qd), (found.q_by, found.qd_by), zip(motion.real, motion.imag, strict=True), strict=True
        ):
            np.testing.assert_allclose(own, seen, rtol=0, atol=1e-8)
            assert np.max(np.abs(by[:, :, k] - change / STEP)) <= 1e-9 * max(1.0, np.max(np.abs(change)) / STEP), found.names[k]
    a, b = np.random.default_rng(2).standard_normal((2, STEPS + 1, kernels.n))
    back = ncgen.gradient(kernels, DURATION, STEPS, lambda q, qd: (np.sum(a * q + b * qd), a, b), **at)
    forward = np.einsum("kn,knd->d", a, found.q_by) + np.einsum("kn,knd->d", b, found.qd_by)
    np.testing.assert_allclose(list(back.derivatives.values()), forward, rtol=0, atol=1e-12 * np.max(np.abs(forward)))


def height(q, qd):
    """The first coordinate at the end."""
    by_q = 0 * q
    by_q[-1, 0] = 1.0
    return q[-1, 0], by_q, None


@pytest.mark.parametrize("method", ["rattle", "generalized-alpha", "trapezoidal"])
def test_gradients_of_a_stiff_governor_are_of_order_two(method):
    """Springs of 8e5 N/m, on which rk4 does not get on by 5 ms: against fine explicit steps, a sixteenth of the error by a quarter,
    once steps are short enough for that."""
    kernels = ncgen.compile(ncgen.load("flyball"))
    truth = ncgen.gradient(kernels, 0.1, 4000, height, integrator="dop853").derivatives
    with pytest.raises(ConvergenceError):
        ncgen.gradient(kernels, 0.1, 20, height, integrator="rk4")
    coarse, fine = (
        max(abs(slope - truth[name]) for name, slope in ncgen.gradient(kernels, 0.1, steps, height, integrator=method).derivatives.items())
        for steps in (80, 320)
    )
    assert coarse < 1e-4
    assert 14 < coarse / fine < 18


def test_steps_that_went_on_with_other_coordinates_are_refused():
    """At the lowest point the height of a pendulum says nothing of its position: the run goes on with the other coordinate."""
    pendulum = ncgen.compile(ncgen.load("pendulum"))
    said = r"the step to t = 0\.515 s went on with other independent coordinates than B\.y; choose some that last \(z\)"
    with pytest.raises(ModelError, match=said):
        ncgen.sensitivities(pendulum, 1.0, 200, integrator="trapezoidal")


@pytest.mark.parametrize("method", ["rattle", "generalized-alpha", "energy-momentum"])
def test_a_rolling_disc_by_its_rates(method):
    """By differences of its own steps; only the column that is asked for."""
    kernels = ncgen.compile(ncgen.load("disc"))
    at = {"duration": 0.1, "steps": 10, "integrator": method}
    found = ncgen.sensitivities(kernels, **at, by="rate(u.x)")
    assert found.names == ("rate(u.x)",)
    rates = {name: found.qd[0, kernels.index[name]] for name in ("C.x", "u.x", "u.z")}
    ends = [ncgen.sensitivities(kernels, **at, zd0=rates | {"u.x": rates["u.x"] + step}, by=()).q for step in (1e-5, -1e-5)]
    np.testing.assert_allclose(found.q_by[:, :, 0], (ends[0] - ends[1]) / 2e-5, rtol=0, atol=1e-8)


@pytest.fixture(scope="module")
def cart():
    """A carriage that is driven along x, a rod that hangs on it, and a point on a spring whose velocity along z follows that along y."""
    m = ncgen.Model("cart")
    a, g, k, fast = (m.parameter(name, value) for name, value in (("a", 0.7), ("g", 9.81), ("k", 20.0), ("fast", 2.0)))
    O, x, z = m.point("O", (0, 0), fixed=True), m.vector("x", (1, 0, 0), fixed=True), m.vector("z", (0, 0, 1), fixed=True)
    A, B, P = m.point("A", (0.1, 0), fixed="yz"), m.point("B", (0.1, -0.3), fixed="z"), m.point("P", (0.2, 0.1, 0.3))
    m.body("rod", [A, B], mass=2.0, inertia=0.02)
    m.body("ball", [P], mass=0.5)
    m.angle("psi", x, B - A, z)
    m.drive(A.x, 0.1 + 0.1 * sympy.sin(fast * m.time))
    m.constrain_velocity(P.z.rate - a * P.x * P.y.rate)
    m.spring(P, O, stiffness=k, damping=0.3, free_length=0.2)
    m.gravity((0, -g, 0))
    return ncgen.compile(m, "numpy")


@pytest.mark.parametrize("method", ["rattle", "generalized-alpha", "energy-momentum"])
def test_implicit_steps_of_a_driven_cart_by_differences(cart, method):
    """Coordinates of several sizes, one that is driven, and a velocity constraint: by parameters and initial values."""
    rates = {"psi": 3.0, "P.x": 0.5, "P.y": -0.4}
    by = (*cart.parameters, "P.x", "P.y", "P.z", *(f"rate({name})" for name in rates))
    found = ncgen.sensitivities(cart, 0.09, 3, zd0=rates, by=by, integrator=method)
    for k, name in enumerate(by):
        ends = []
        for step in (1e-4, -1e-4):
            p, q0, zd0 = (
                dict(zip(*pair, strict=True)) for pair in ((cart.parameters, cart.p0), (cart.coordinates, cart.q0), (rates, rates.values()))
            )
            values = p if name in p else q0 if name in q0 else zd0
            values[name.removeprefix("rate(").removesuffix(")")] += step
            ends.append(ncgen.sensitivities(cart, 0.09, 3, by=(), p=p, q0=q0, zd0=zd0, integrator=method))
        for derivative, one, other in ((found.q_by, ends[0].q, ends[1].q), (found.qd_by, ends[0].qd, ends[1].qd)):
            np.testing.assert_allclose(derivative[:, :, k], (one - other) / 2e-4, rtol=0, atol=1e-7, err_msg=name)


@pytest.mark.parametrize("method", METHODS)
def test_what_rests_by_its_start(method):
    """A mass that nothing pushes: s(T) = s₀ + T ṡ₀, also where steps move nothing and so correct no energy."""
    kernels = ncgen.compile(mass_on_a_slide(), "numpy")
    name, options = method.split(",")[0], METHODS[method]
    found = ncgen.sensitivities(kernels, 0.3, 3, integrator=name, options=options, by=("s", "rate(s)"))
    s = kernels.index["s"]
    np.testing.assert_allclose(found.q_by[-1, s], [1.0, 0.3], rtol=1e-13)
    np.testing.assert_allclose(found.qd_by[-1, s], [0.0, 1.0], atol=1e-13)


def test_what_implicit_steps_refuse():
    kernels = ncgen.compile(fourbar(), "numpy")
    with pytest.raises(ModelError, match="^by: the mechanism has no parameter or initial value weight; it has crank, coupler"):
        ncgen.sensitivities(kernels, 0.1, 2, integrator="rattle", by="weight")
    with pytest.raises(ModelError, match="^options: rk4 has none"):
        ncgen.sensitivities(kernels, 0.1, 2, options={"rho": 0.5})
    with pytest.raises(ModelError, match="^option rho: lagrange with rattle has no such option"):
        ncgen.sensitivities(kernels, 0.1, 2, integrator="rattle", options={"rho": 0.5})
