"""The motion of all coordinates by recursion, judged by [M Φ_qᵀ; Φ_q 0] and by the rows themselves."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from every_example import long_ones_slow
from scipy.linalg import null_space

import ncgen
from ncgen.exchange.examples import example_names, load
from ncgen.program.ir.cost import cost
from ncgen.program.ir.evaluate import evaluate
from ncgen.program.motions.dynamics import assemble_motion
from ncgen.solver.engines.acceleration_forms import all_coordinates, own_positions
from ncgen.solver.formalisms import accelerations_by
from ncgen.symbolic.tree import spanning_tree

WITH_TREES = long_ones_slow(name for name in example_names() if spanning_tree(load(name)).links)


class Case:
    """A mechanism, the programs of its motion and consistent states."""

    def __init__(self, name: str) -> None:
        self.kernels = k = ncgen.compile(load(name), "numpy")
        self.split, self.samples = own_positions(k)
        self.programs = assemble_motion(k.programs.equations, self.split, self.samples, k.column_sizes)
        self.generator = np.random.default_rng(5)

    def consistent(self, sample) -> np.ndarray:
        """Random velocities that the rows allow."""
        k = self.kernels
        jacobian, nu = k.jacobian(sample.q, sample.t, sample.p), k.nu(sample.q, sample.t, sample.p)
        free = null_space(jacobian, rcond=1e-9)
        qd = free @ self.generator.standard_normal(free.shape[1])
        return qd + np.linalg.lstsq(jacobian, nu - jacobian @ qd, rcond=1e-9)[0]

    def values(self, program, sample, **state) -> np.ndarray:
        given = {"t": sample.t, "q": sample.q, "p": sample.p} | state
        return np.array(evaluate(program, given))


@cache
def case(name: str) -> Case:
    return Case(name)


@pytest.mark.parametrize("name", WITH_TREES)
def test_derivative(name):
    """q̇ is what was given, where it is consistent; q̈ solves the equations of all coordinates."""
    here, k = case(name), case(name).kernels
    for sample in here.samples:
        qd = here.consistent(sample)
        found = here.values(here.programs.derivative, sample, qd=qd)
        right = accelerations_by("lagrange").motion(k, sample.q, qd, sample.t, sample.p, {})
        size = np.max(np.abs(right.qdd) / k.column_sizes)
        assert np.allclose(found[: k.n], qd, rtol=0.0, atol=1e-10 * np.max(np.abs(qd)))
        assert np.max(np.abs(found[k.n : 2 * k.n] - right.qdd) / k.column_sizes) < 1e-11 * max(size, 1.0)
        assert found[-2] == pytest.approx(right.power, rel=1e-9, abs=1e-9 * size)


@pytest.mark.parametrize("name", WITH_TREES)
def test_velocities_are_brought_onto_the_constraints(name):
    here, k = case(name), case(name).kernels
    for sample in here.samples:
        qd = here.consistent(sample)
        off = 1e-3 * here.generator.standard_normal(k.n) * k.column_sizes
        found = here.values(here.programs.velocities, sample, qd=qd + off)[:-1]
        violation = k.jacobian(sample.q, sample.t, sample.p) @ found - k.nu(sample.q, sample.t, sample.p)
        assert np.max(np.abs(violation) / k.row_sizes) < 1e-10 * max(np.max(np.abs(qd) / k.column_sizes), 1.0)
        assert np.max(np.abs(found - qd) / k.column_sizes) < 0.2  # nothing is multiplied by much


@pytest.mark.parametrize("name", WITH_TREES)
def test_projected_velocities_and_the_derivative_there(name):
    """One program gives what two of them give one after the other, for fewer operations."""
    here, k = case(name), case(name).kernels
    programs = here.programs
    for sample in here.samples:
        off = 1e-3 * here.generator.standard_normal(k.n) * k.column_sizes
        both = here.values(programs.projected, sample, qd=here.consistent(sample) + off)
        qdd, qd, power, growth = both[: k.n], both[k.n : -2], both[-2], both[-1]
        velocities = here.values(programs.velocities, sample, qd=qd)
        derivative = here.values(programs.derivative, sample, qd=qd)
        speed, size = np.max(np.abs(qd) / k.column_sizes), np.max(np.abs(qdd) / k.column_sizes)
        assert np.max(np.abs(velocities[: k.n] - qd) / k.column_sizes) < 1e-10 * speed
        assert np.max(np.abs(derivative[: k.n] - qd) / k.column_sizes) < 1e-10 * speed
        assert np.max(np.abs(derivative[k.n : -2] - qdd) / k.column_sizes) < 1e-10 * max(size, 1.0)
        assert power == pytest.approx(derivative[-2], rel=1e-9, abs=1e-9 * size)
        assert growth == derivative[-1]
    assert cost(programs.projected).total < cost(programs.derivative).total + cost(programs.velocities).total


@pytest.mark.parametrize("name", ["arm", "robot", "fourbar", "tree"])
def test_velocities_are_the_beginning_of_the_projected_derivative_in_c(name):
    """To the bit, and nothing is written behind them."""
    kernels = ncgen.compile(load(name), "c")
    made = all_coordinates(kernels, form="emitted")
    ffi, motion, n = made._ffi, made._dynamics.motion, kernels.n
    q, qd = (ffi.new("double[]", list(x)) for x in (kernels.q0, np.random.default_rng(2).standard_normal(n)))
    p = ffi.new("double[]", list(made.with_prepared(kernels.p0)) or 1)
    both, alone = (ffi.new("double[]", [-7.0] * (2 * n + 3)) for _ in range(2))
    assert motion.projected(0.0, q, qd, p, both) == motion.velocities(0.0, q, qd, p, alone) == 0
    assert list(alone) == [*[-7.0] * n, *both[n : 2 * n], -7.0, both[2 * n + 1], -7.0]
    assert both[2 * n + 2] == -7.0
    again, there = ffi.new("double[]", 2 * n + 2), ffi.new("double[]", list(both)[n : 2 * n])
    assert motion.derivative(0.0, q, there, p, again) == 0
    sizes = np.concatenate([kernels.column_sizes, kernels.column_sizes, [1.0, 1.0]])
    scaled = [np.array(list(x)[: 2 * n + 2]) / sizes for x in (both, again)]
    assert np.max(np.abs(scaled[0] - scaled[1])) < 1e-10 * np.max(np.abs(scaled[0]))


@pytest.mark.parametrize("name", WITH_TREES)
def test_closing_leaves_the_independent_coordinates(name):
    """Or the angles of all hinges where these are enough, of the arm ψ1 … ψ7 and of the robot ψ1 … ψ6, though others are independent."""
    here, k = case(name), case(name).kernels
    angles = [c for c, component in enumerate(k.coordinates) if component.startswith("psi")]
    left = angles if name in ("arm", "robot") else list(here.split.independent)
    sample = here.samples[0]
    start = sample.q + 1e-5 * here.generator.standard_normal(k.n) * k.column_sizes
    q = start.copy()
    for _ in range(4):
        q += here.values(here.programs.closing, sample._replace(q=q))[: k.n]
    assert np.max(np.abs(k.phi(q, sample.t, sample.p)[k.holonomic]) / k.row_sizes[k.holonomic], initial=0.0) < 1e-13
    assert len(left) == len(here.split.independent)
    assert np.array_equal(q[left], start[left])


@pytest.mark.parametrize("name, most", [("robot", 3500), ("arm", 3000), ("suspension", 1800)])
def test_operations(name, most):
    """Hardly more than accelerations with independent coordinates take, and no Newton step is needed in between."""
    assert cost(case(name).programs.derivative).total < most


@pytest.mark.parametrize("name, grows", [("arm", False), ("tree", True), ("fourbar", True), ("heavytop", False)])
def test_only_loops_can_have_a_bad_order(name, grows):
    """On an open tree no order of elimination is a bad one, however many joints there are: the last output is 0 wherever it moves.

    With loops it is about 1 in the samples, and changes with the position.
    """
    here = case(name)
    for program in (here.programs.derivative, here.programs.velocities):
        seen = {float(here.values(program, sample, qd=here.consistent(sample))[-1]) for sample in here.samples}
        assert (len(seen) > 1 and 0.5 < max(seen) < 1.5) if grows else seen == {0.0}
