"""Derivatives of a motion by the samples of what drives it: closed forms of an oscillator, and differences on a mechanism."""

from __future__ import annotations

import numpy as np
import pytest
import sympy
from driven_models import pendulum

import ncgen
from ncgen import Model
from ncgen.mechanism import taped

OMEGA, MASS, END, STEPS = 3.0, 2.0, 1.2, 240


def oscillator(backend="c"):
    """A block on a slide with a spring, pushed by an input."""
    m = Model("pushed")
    x = m.vector("x", (1, 0, 0), fixed=True)
    O, A, B = m.point("O", (0, 0), fixed=True), m.point("A", (0, 0), fixed="y"), m.point("B", (0.1, 0), fixed="y")
    s = m.slide("s", O, A, x)
    m.body("block", [A, B], mass=MASS, inertia="point")
    m.torque(s, m.input("F", "N") - MASS * OMEGA**2 * s)
    m.independent(s)
    return ncgen.compile(m, backend)


def end_of(q, qd):
    """x at the end."""
    by_q = 0 * q
    by_q[-1, 0] = 1.0  # A.x
    return q[-1, 0], by_q, None


TIMES = np.linspace(0.0, END, 7)
VALUES = np.array([3.0, -1.0, 2.0, 0.5, -2.0, 1.0, 4.0])


def answers(hold: str) -> np.ndarray:
    """How x at the end changes with every sample: ∫ sin ω(T − t)/(m ω) b(t) dt with b what one sample makes."""
    from scipy.integrate import quad
    from scipy.interpolate import CubicSpline

    if hold == "zero":
        edges = np.cos(OMEGA * (END - TIMES)) / (MASS * OMEGA**2)
        return np.append(np.diff(edges), 0.0)
    found = []
    for row in np.eye(len(TIMES)):
        basis = CubicSpline(TIMES, row) if hold == "cubic" else lambda t, row=row: np.interp(t, TIMES, row)
        parts = [
            quad(lambda t: np.sin(OMEGA * (END - t)) / (MASS * OMEGA) * basis(t), a, b)[0] for a, b in zip(TIMES, TIMES[1:], strict=False)
        ]
        found.append(sum(parts))
    return np.array(found)


@pytest.mark.parametrize(
    ("integrator", "close"), [("dop853", 1e-12), ("rk4", 1e-8), ("generalized-alpha", 3e-4), ("rattle", 3e-4), ("trapezoidal", 3e-4)]
)
@pytest.mark.parametrize("hold", ["zero", "linear", "cubic"])
def test_an_oscillator_by_every_sample(hold, integrator, close):
    """Against the convolution with its own response: to the error of the steps."""
    found = ncgen.gradient(oscillator(), END, STEPS, end_of, integrator=integrator, inputs={"F": (TIMES, VALUES, hold)})
    np.testing.assert_allclose(found.by_inputs["F"], answers(hold), rtol=0, atol=close * np.max(np.abs(answers(hold))))
    assert found.derivatives["F"] == pytest.approx(found.by_inputs["F"].sum(), rel=1e-12)
    lift = (1 - np.cos(OMEGA * END)) / (MASS * OMEGA**2)
    assert found.derivatives["F"] == pytest.approx(lift, abs=close)


@pytest.mark.parametrize("integrator", ["dop853", "rk4", "generalized-alpha", "rattle", "energy-momentum", "trapezoidal"])
@pytest.mark.parametrize("backend", ["c", "numpy"])
def test_a_linear_motion_is_its_derivatives_times_the_samples(integrator, backend):
    """Of few steps, between whose ends samples lie: what is differentiated are the steps, and they are linear in the samples."""
    kernels, times = oscillator(backend), TIMES + 0.013
    if backend == "numpy" and integrator == "dop853":
        return

    def end(values, hold):
        return ncgen.gradient(kernels, END, 10, end_of, integrator=integrator, inputs={"F": (times, values, hold)})

    for hold in ("zero", "linear", "cubic"):
        found = end(VALUES, hold)
        ends = [end(unit, hold).value for unit in np.eye(len(times))]
        np.testing.assert_allclose(found.by_inputs["F"], ends, rtol=0, atol=1e-12)


def test_a_nonlinear_motion_by_samples_and_by_functions():
    """A driven rod, two ways: against differences of its own steps; forward by a shift of the whole input."""
    kernels = ncgen.compile(pendulum())
    values, at = np.array([1.0, -2.0, 4.0, 0.5]), {"zd0": {"psi": 0.3}}

    def run(values, **more):
        return ncgen.gradient(kernels, END, 20, end_of, integrator="dop853", inputs={"tau": (TIMES[::2], values, "linear")}, **at, **more)

    found = run(values)
    ends = [(run(values + 1e-5 * e).value - run(values - 1e-5 * e).value) / 2e-5 for e in np.eye(4)]
    np.testing.assert_allclose(found.by_inputs["tau"], ends, rtol=0, atol=1e-9)
    forward = ncgen.sensitivities(kernels, END, 20, integrator="dop853", inputs={"tau": (TIMES[::2], values)}, **at)
    assert forward.q_by[-1, 0, forward.names.index("tau")] == pytest.approx(found.by_inputs["tau"].sum(), rel=1e-12)
    for method in ("rk4", "rattle"):
        told = {"integrator": method, "inputs": {"tau": lambda t: 3 * np.sin(5 * t)}, **at}
        back, forward = ncgen.gradient(kernels, END, 20, end_of, **told), ncgen.sensitivities(kernels, END, 20, **told)
        assert not back.by_inputs
        assert list(back.derivatives.values()) == pytest.approx(forward.q_by[-1, 0], rel=1e-11)
    held = ncgen.gradient(kernels, END, 20, end_of, inputs={"tau": 2.0}, **at)
    assert held.value == ncgen.gradient(kernels, END, 20, end_of, p={"tau": 2.0}, **at).value


def test_a_long_driven_run_is_taped_in_segments(monkeypatch):
    kernels = ncgen.compile(pendulum())
    at = {"zd0": {"psi": 0.3}, "inputs": {"tau": (TIMES + 0.013, VALUES, "cubic")}}
    whole = ncgen.gradient(kernels, END, 40, end_of, **at)
    monkeypatch.setattr(taped, "SEGMENT", 7 * 8 * taped.step_size("rk4", kernels.n))
    parts = ncgen.gradient(kernels, END, 40, end_of, **at)
    np.testing.assert_allclose(parts.by_inputs["tau"], whole.by_inputs["tau"], rtol=0, atol=1e-13)
    assert parts.derivatives == pytest.approx(whole.derivatives, rel=1e-11)


def test_second_derivatives_of_a_driven_motion():
    """By differences of the gradient, inputs held."""
    kernels = ncgen.compile(pendulum())
    told = {"tau": (TIMES, VALUES)}
    found = ncgen.hessian(kernels, END, 40, lambda q, qd: (*end_of(q, qd), None), inputs=told, zd0={"psi": 0.3})
    assert found.names == ("tau", "psi", "rate(psi)")
    ends = [ncgen.gradient(kernels, END, 40, end_of, inputs=told, zd0={"psi": 0.3 + step}).derivatives for step in (1e-5, -1e-5)]
    wanted = [(ends[0][name] - ends[1][name]) / 2e-5 for name in found.names]
    np.testing.assert_allclose(found.products[:, 2], wanted, rtol=0, atol=1e-8)
    np.testing.assert_allclose(found.products, found.products.T, rtol=0, atol=1e-12)


def test_steps_by_tolerance_end_where_a_table_jumps():
    found = ncgen.gradient(oscillator(), END, 1, end_of, integrator="dop853", rtol=1e-11, inputs={"F": (TIMES, VALUES, "zero")})
    np.testing.assert_allclose(found.by_inputs["F"], answers("zero"), rtol=0, atol=1e-10)


def test_a_stiffness_that_is_an_input_beside_parameters():
    """F and K constant: s = F/K + (s₀ − F/K) cos √(K/m) t, by all samples of K or of F together, and by m."""
    model = Model("springy")
    x = model.vector("x", (1, 0, 0), fixed=True)
    O, A, B = model.point("O", (0, 0), fixed=True), model.point("A", (0.4, 0), fixed="y"), model.point("B", (0.5, 0), fixed="y")
    s = model.slide("s", O, A, x)
    model.body("block", [A, B], mass=model.parameter("m", MASS), inertia="point")
    model.torque(s, model.input("F", "N") - model.input("K", "N/m") * s)
    model.independent(s)
    K, F, m, t = sympy.symbols("K F m t")
    closed = F / K + (sympy.Rational(2, 5) - F / K) * sympy.cos(sympy.sqrt(K / m) * t)
    at = {K: MASS * OMEGA**2, F: 5.0, m: MASS, t: END}
    inputs = {name: (TIMES, np.full(len(TIMES), at[symbol])) for name, symbol in (("F", F), ("K", K))}
    found = ncgen.gradient(ncgen.compile(model), END, 40, end_of, integrator="dop853", inputs=inputs)
    assert found.value == pytest.approx(float(closed.subs(at)), rel=1e-11)
    slopes = [found.by_inputs["F"].sum(), found.by_inputs["K"].sum(), found.derivatives["m"]]
    assert slopes == pytest.approx([float(closed.diff(symbol).subs(at)) for symbol in (F, K, m)], rel=1e-10)
