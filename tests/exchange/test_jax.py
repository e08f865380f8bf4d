"""Motions in JAX: values and derivatives are ncgen's own, under jit and vmap too."""

from __future__ import annotations

import numpy as np
import pytest

import ncgen
from ncgen import ModelError

jax = pytest.importorskip("jax")
STEPS = 20


@pytest.fixture(scope="module")
def kernels():
    jax.config.update("jax_enable_x64", True)
    model = ncgen.Model("swing")
    length, mass = model.parameter("length", 1.0), model.parameter("mass", 2.0)
    A, B = model.point("A", (0, 0), fixed=True), model.point("B", (0, -length))
    x, z = model.vector("x", (0, -1, 0), fixed=True), model.vector("z", (0, 0, 1), fixed=True)
    model.body("rod", [A, B], mass=mass, com=(0, -length / 2), inertia=mass * length**2 / 12)
    psi = model.angle("psi", x, B - A, z)
    model.independent(psi)
    model.gravity((0, -9.81, 0))
    return ncgen.compile(model)


P, RATES = np.array([0.9, 1.7]), np.array([1.3])


def test_values_and_gradient(kernels):
    motion = ncgen.jax(kernels).motion(0.4, STEPS)
    expected = ncgen.sensitivities(kernels, 0.4, STEPS, p=P, zd0=RATES)
    q, qd = jax.jit(motion)(P, RATES)
    assert np.array(q) == pytest.approx(expected.q, abs=1e-15)
    assert np.array(qd) == pytest.approx(expected.qd, abs=1e-14)

    def objective(p, rates):
        q, qd = motion(p, rates)
        return q[-1, 0] * qd[3, 1] + (qd[-1] ** 2).sum()

    by_p, by_rates = jax.jit(jax.grad(objective, argnums=(0, 1)))(P, RATES)
    by_q, by_qd = np.zeros_like(expected.q), np.zeros_like(expected.q)
    by_q[-1, 0], by_qd[3, 1] = expected.qd[3, 1], expected.q[-1, 0]
    by_qd[-1] += 2 * expected.qd[-1]
    slopes = np.einsum("kn,knc->c", by_q, expected.q_by) + np.einsum("kn,knc->c", by_qd, expected.qd_by)
    assert np.array(by_p) == pytest.approx(slopes[:2], rel=1e-11)
    assert np.array(by_rates) == pytest.approx(slopes[-1:], rel=1e-11)


def test_many(kernels):
    """Under vmap every motion, and every derivative, is that of its own arguments."""
    motion = ncgen.jax(kernels).motion(0.4, STEPS)
    several = np.linspace(0.8, 1.2, 5)[:, None] * P
    end = jax.vmap(lambda p: motion(p, RATES)[0][-1, 0])(several)
    slopes = jax.vmap(jax.grad(lambda p: motion(p, RATES)[0][-1, 0]))(several)
    for k, p in enumerate(several):
        alone = ncgen.sensitivities(kernels, 0.4, STEPS, p=p, zd0=RATES)
        assert end[k] == pytest.approx(alone.q[-1, 0], abs=1e-15)
        assert np.array(slopes[k]) == pytest.approx(alone.q_by[-1, 0, :2], rel=1e-11)


def test_refusals(kernels):
    functions = ncgen.jax(kernels)
    assert functions.rates_of() == ("psi",)
    motion = functions.motion(0.4, STEPS)
    with pytest.raises(ModelError, match=r"^swing: p has shape \(3,\); it must be \(2,\)$"):
        motion(np.ones(3), RATES)
    with pytest.raises(ModelError, match=r"^swing: rates has shape \(\); it must be \(1,\)$"):
        motion(P, 1.0)
    with pytest.raises(ModelError, match="^ncgen.jax: p and the initial rates are the motion's own arguments; leave p, zd0 and qd0 out$"):
        functions.motion(0.4, STEPS, p=P)


def test_32_bits_are_refused(kernels):
    jax.config.update("jax_enable_x64", False)
    try:
        with pytest.raises(ModelError, match="^ncgen.jax: JAX computes with 32 bits"):
            ncgen.jax(kernels)
    finally:
        jax.config.update("jax_enable_x64", True)
