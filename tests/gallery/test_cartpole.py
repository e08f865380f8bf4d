"""The cart and its pole against Lagrange's equations, free and under the controller of the example."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import numpy as np
import pytest
import scipy.integrate

import ncgen

CART, POLE, LENGTH, GRAVITY = 1.0, 0.2, 0.8, 9.81
HALF, INERTIA = LENGTH / 2, POLE * LENGTH**2 / 12


def rates(t, y, F):
    """[s, φ, ṡ, φ̇] with φ against the clock: (M + m) s̈ − m c (φ̈ cos φ − φ̇² sin φ) = F, (J + m c²) φ̈ − m c s̈ cos φ = m g c sin φ."""
    _, phi, v, w = y
    coupling = -POLE * HALF * np.cos(phi)
    M = [[CART + POLE, coupling], [coupling, INERTIA + POLE * HALF**2]]
    right = [F - POLE * HALF * w**2 * np.sin(phi), POLE * GRAVITY * HALF * np.sin(phi)]
    return [v, w, *np.linalg.solve(M, right)]


@pytest.fixture(scope="module")
def controller():
    path = Path(__file__).parents[2] / "examples/cartpole/controller.py"
    spec = importlib.util.spec_from_file_location("controller", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def kernels():
    return ncgen.compile(ncgen.load("cartpole"))


def test_it_falls(kernels):
    run = ncgen.simulate(kernels, 1.0, zd0={"phi": 0.1}, rtol=1e-11, points=11)
    exact = scipy.integrate.solve_ivp(rates, (0, 1), [0, 0, 0, 0.1], args=(0.0,), method="DOP853", rtol=1e-12, atol=1e-13, t_eval=run.t)
    for row, name in enumerate(("s", "phi", "rate(s)", "rate(phi)")):
        np.testing.assert_allclose(run[name], exact.y[row], rtol=0, atol=2e-8)
    np.testing.assert_allclose(run["tip height"], LENGTH * np.cos(exact.y[1]), atol=2e-8)


@pytest.mark.parametrize("integrator", ["auto", "rk4"])
def test_it_is_held(controller, kernels, integrator):
    found = controller.balance(kernels, integrator=integrator)
    k = controller.gains(kernels)
    y = np.array([0.0, controller.LEAN, 0.0, 0.0])
    for i in range(1000):
        assert np.allclose(y, [found[name][i] for name in ("s", "phi", "rate(s)", "rate(phi)")], rtol=0, atol=1e-8), i
        y = scipy.integrate.solve_ivp(rates, (0, controller.PERIOD), y, args=(float(-k @ y),), method="DOP853", rtol=1e-12, atol=1e-14).y[
            :, -1
        ]
    assert abs(found["phi"][-1]) < 1e-3
    assert abs(found["s"][-1]) < 1e-2
