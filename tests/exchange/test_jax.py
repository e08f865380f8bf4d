"""Motions in JAX: values and derivatives are ncgen's own, under jit and vmap too."""

from __future__ import annotations

import gc
import time

import numpy as np
import pytest
import sympy
from sliding import sliding_block
from swing import swing

import ncgen
from ncgen import ModelError
from ncgen.exchange import xla

jax = pytest.importorskip("jax")
STEPS = 20


@pytest.fixture(scope="module")
def kernels():
    jax.config.update("jax_enable_x64", True)
    return ncgen.compile(swing())


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


def test_both_arguments_and_axes(kernels):
    """vmap over rates inside vmap over parameters: every motion once, with its own derivatives by both."""
    motion = ncgen.jax(kernels).motion(0.4, STEPS)
    lengths, rates = np.linspace(0.9, 1.1, 3)[:, None] * P, np.linspace(-1, 1, 4)[:, None]

    def number(p, rate):
        q, qd = motion(p, rate)
        return q[-1, 0] * qd[5, 1]

    both = jax.grad(number, argnums=(0, 1))
    by_p, by_rate = jax.jit(jax.vmap(jax.vmap(both, (None, 0)), (0, None)))(lengths, rates)
    assert by_p.shape == (3, 4, 2) and by_rate.shape == (3, 4, 1)
    for i in range(3):
        for k in range(4):
            alone = both(lengths[i], rates[k])
            np.testing.assert_allclose(by_p[i, k], alone[0], rtol=1e-11)
            np.testing.assert_allclose(by_rate[i, k], alone[1], rtol=1e-11)


def test_of_many_the_one_that_cannot_move_is_named(kernels):
    motion = ncgen.jax(kernels).motion(0.4, STEPS)
    several = np.array([P, [np.nan, 1.0], P])
    with pytest.raises(Exception, match="motion 1 of 3: p: length is nan; it must be a finite number"):
        jax.block_until_ready(jax.vmap(lambda p: motion(p, RATES)[0])(several))


def test_what_is_written_in_place_is_what_is_copied(kernels, monkeypatch):
    """On the processor results are written where XLA wants them; elsewhere it calls Python, and copies: the same bits, the same errors."""
    pytest.importorskip("jax.ffi")
    motion = ncgen.jax(kernels).motion(0.4, STEPS)
    several, rates = np.linspace(0.8, 1.2, 5)[:, None] * P, np.linspace(-1, 1, 3)[:, None]

    def number(p, rate):
        q, qd = motion(p, rate)
        return q[-1, 0] * qd[5, 1], (q, qd)

    def found():  # p and the weights have one axis of the two: what is not mapped is handed on once, and not copied
        both = jax.grad(number, argnums=(0, 1), has_aux=True)
        return jax.tree.leaves(jax.jit(jax.vmap(jax.vmap(both, (None, 0)), (0, None)))(several, rates))

    assert xla._handler() is not None
    in_place = found()
    monkeypatch.setattr(xla, "_handler", lambda: None)
    for mine, copied in zip(in_place, found(), strict=True):
        assert np.array_equal(mine, copied)
    with pytest.raises(Exception, match="motion 1 of 2: p: length is nan; it must be a finite number"):
        jax.block_until_ready(jax.vmap(lambda p: motion(p, RATES)[0])(np.array([P, [np.nan, 1.0]])))


def test_programs_outlive_what_they_were_made_of(kernels):
    end = jax.jit(lambda p: ncgen.jax(kernels).motion(0.4, STEPS)(p, RATES)[0][-1]).lower(P).compile()
    gc.collect()
    assert np.array(end(P)) == pytest.approx(ncgen.sensitivities(kernels, 0.4, STEPS, p=P, zd0=RATES).q[-1], abs=1e-15)


def test_a_program_of_another_process_is_refused(kernels):
    """What JAX has compiled may be written to a file; what it calls may not."""
    pytest.importorskip("jax.ffi")
    serialize = pytest.importorskip("jax.experimental.serialize_executable")
    motion = ncgen.jax(kernels).motion(0.4, STEPS)
    kept = serialize.serialize(jax.jit(lambda p: motion(p, RATES)[0]).lower(P).compile())
    here = serialize.deserialize_and_load(*kept)
    assert np.array_equal(here(P), motion(P, RATES)[0])
    there = dict(xla._functions)
    xla._functions.clear()
    try:
        with pytest.raises(Exception, match="this program was compiled in another process, whose motions are not here"):
            jax.block_until_ready(here(P))
    finally:
        xla._functions.update(there)


def test_without_a_compiler_nothing_is_in_place(monkeypatch):
    def refused(*given):
        raise ncgen.CompileError("no C compiler found")

    monkeypatch.setattr(xla, "load", refused)
    assert xla._handler.__wrapped__() is None


@pytest.mark.slow
def test_vmap_costs_what_a_batch_does():
    """1,000 falls of the robot: at most 1.2 times `simulate` with rows with the same steps; the best of turns."""
    jax.config.update("jax_enable_x64", True)
    robot = ncgen.compile(ncgen.load("robot"))
    functions = ncgen.jax(robot)
    motion, z = functions.motion(0.4, 80), functions.rates_of()
    rates = 0.03 * np.random.default_rng(1).standard_normal((1000, len(z)))
    many = jax.jit(jax.vmap(lambda rates: motion(robot.p0, rates)[0]))

    def theirs():
        ncgen.simulate(robot, 0.4, zd0=rates, z=z, integrator="rk4", max_step=0.005, points=81)

    tools = {"ours": theirs, "vmap": lambda: jax.block_until_ready(many(rates))}
    spent = {name: [] for name in tools}
    for _ in range(9):
        for name, call in tools.items():
            begun = time.perf_counter()
            call()
            spent[name].append(time.perf_counter() - begun)
    assert min(spent["vmap"]) < 1.2 * min(spent["ours"]), spent


def pushed() -> ncgen.Model:
    """1 kg on a slide, at rest, pushed by F (N) from 0.13 s to 0.27 s."""
    m, slide = sliding_block("pushed")
    m.torque(slide, m.parameter("F", 2.0) * (sympy.Heaviside(m.time - 0.13) - sympy.Heaviside(m.time - 0.27)))
    return m


def test_over_breaks(kernels):
    """Steps of 0.1 s end where the push begins and ends: x is exact, and so are its derivatives, of one motion and of many."""
    others = ncgen.compile(pushed())
    motion = ncgen.jax(others).motion(0.4, 4)
    place = list(others.coordinates).index("A.x")

    def x(p, rates):
        return motion(p, rates)[0][-1, place]

    forces, rates, by_force = np.array([[2.0], [-1.0], [0.0]]), np.array([0.5]), 0.14 * (0.4 - 0.2)
    for force in forces:
        assert x(force, rates) == pytest.approx(0.4 * 0.5 + by_force * force[0], abs=1e-14)
    slopes = jax.grad(x, argnums=(0, 1))
    assert np.ravel(slopes(forces[0], rates)) == pytest.approx([by_force, 0.4], abs=1e-14)
    assert np.array(jax.vmap(x, (0, None))(forces, rates)) == pytest.approx(0.2 + by_force * forces[:, 0], abs=1e-14)
    several = jax.vmap(slopes, (0, None))(forces, rates)
    assert np.ravel(several[0]) == pytest.approx([by_force] * 3, abs=1e-14)


def test_refusals(kernels):
    functions = ncgen.jax(kernels)
    assert functions.rates_of() == ("psi",)
    motion = functions.motion(0.4, STEPS)
    with pytest.raises(ModelError, match=r"^swing: p has shape \(3,\); it must be \(2,\)$"):
        motion(np.ones(3), RATES)
    with pytest.raises(ModelError, match=r"^swing: rates has shape \(\); it must be \(1,\)$"):
        motion(P, 1.0)
    with pytest.raises(ModelError, match="^swing: p is of type complex128; it must be real numbers$"):
        motion(P * 1j, RATES)
    with pytest.raises(ModelError, match="^swing: rates is no array of numbers$"):
        motion(P, ["fast"])
    with pytest.raises(ModelError, match="^p: length is nan; it must be a finite number$"):
        motion(np.array([np.nan, 1.0]), RATES)
    with pytest.raises(ModelError, match="^p: with length = 0, body rod, distance A-B: the length is 0 m; "):
        motion(np.array([0.0, 1.0]), RATES)
    with pytest.raises(ModelError, match="^ncgen.jax: p and the initial rates are the motion's own arguments; leave p, zd0 and qd0 out$"):
        functions.motion(0.4, STEPS, p=P)


def test_32_bits_are_refused(kernels):
    jax.config.update("jax_enable_x64", False)
    try:
        with pytest.raises(ModelError, match="^ncgen.jax: JAX computes with 32 bits"):
            ncgen.jax(kernels)
    finally:
        jax.config.update("jax_enable_x64", True)
