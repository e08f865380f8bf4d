"""Motions as functions of arrays, as JAX and PyTorch call them: many at a time are what each is alone, whatever else was asked for."""

from __future__ import annotations

import numpy as np
import pytest
from swing import swing

import ncgen
from ncgen.errors import NcgenError
from ncgen.exchange.motion_functions import MotionFunction

STEPS = 12
P = np.array([[0.9, 1.7], [1.0, 2.0], [1.2, 1.5]])
RATES = np.array([[1.3], [0.4], [-0.8]])


def pushed() -> ncgen.Model:
    model = swing()
    push = model.input("F")
    model.force("B", (push, 0, 0))
    return model


@pytest.fixture(scope="module")
def kernels():
    return ncgen.compile(pushed())


@pytest.mark.parametrize(("integrator", "asked"), [
    ("rk4", {"inputs": {"F": 3.0}}), ("rk4", {"inputs": {"F": ([0.0, 0.4], [0.0, 5.0])}}), ("dopri5", {"rtol": 1e-4}),
    ("rk4", {"q0": {"psi": 0.3}}), ("rk4", {"t0": 0.2, "inputs": {"F": 2.0}}), ("rk4", {"z": ["B.x"], "q0": {"psi": 0.3}}),
    ("generalized-alpha", {"options": {"rho": 0.5}}), ("rattle", {"inputs": {"F": 3.0}}), ("rk4", {}),
])  # fmt: skip
def test_many_are_what_each_is_alone(kernels, integrator, asked):
    """Values and the way back; the reference is `ncgen.sensitivities` of each motion."""
    function = MotionFunction(kernels, "ncgen.jax", (0.4, STEPS), {"integrator": integrator, **asked})
    parameters = np.tile(kernels.p0, (3, 1))
    parameters[:, [kernels.parameters.index("length"), kernels.parameters.index("mass")]] = P
    q, qd = function.forward(parameters, RATES)
    by_q, by_qd = np.zeros_like(q[0]), np.zeros_like(q[0])
    by_q[-1, 0], by_qd[3, 1] = 1.0, 2.0
    by_p, by_rates = function.backward(parameters, RATES, by_q, by_qd)
    for k in range(3):
        alone = ncgen.sensitivities(kernels, 0.4, STEPS, integrator=integrator, p=parameters[k], zd0=RATES[k], **asked)
        assert q[k] == pytest.approx(alone.q, abs=1e-13) and qd[k] == pytest.approx(alone.qd, abs=1e-12)
        slopes = alone.q_by[-1, 0] + 2 * alone.qd_by[3, 1]
        assert by_p[k] == pytest.approx(slopes[: len(kernels.p0)], rel=1e-9, abs=1e-12)
        assert by_rates[k] == pytest.approx(slopes[-1:], rel=1e-9, abs=1e-12)


def test_a_motion_that_fails_is_named(kernels):
    function = MotionFunction(kernels, "ncgen.jax", (0.4, STEPS), {"inputs": {"F": 3.0}})
    parameters = np.tile(kernels.p0, (3, 1))
    parameters[1, kernels.parameters.index("length")] = np.nan
    with pytest.raises(NcgenError, match="motion 1 of 3: "):
        function.forward(parameters, RATES)
