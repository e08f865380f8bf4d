"""Multipliers as compiled functions, and their derivatives by inputs."""

from __future__ import annotations

import math

import numpy as np
import pytest

import ncgen
from ncgen.mechanism.program_functions import functions
from ncgen.program.lines import Lines
from ncgen.program.motions.multipliers import STATE, AccelerationNodes
from ncgen.solver.formalisms import accelerations_by
from ncgen.solver.loads.constraint_loads import motion_sizes, refusal_of_multipliers


def multipliers_of(kernels, rows, by=()):
    """`multipliers` of some constraints, and `multipliers_by`, their derivatives by inputs, as compiled functions of t, q, q̇ and p."""

    def programs():
        lines = Lines(kernels.programs.equations)
        graph, motion = lines.graph, AccelerationNodes(lines, motion_sizes(kernels))
        changes = [motion.along({graph.load("p", kernels.parameters.index(name)): graph.const(1.0)})[1] for name in by]
        nodes = {"multipliers": [motion.lam[r] for r in rows], "multipliers_by": [change[r] for r in rows for change in changes]}
        return {name: lines.program(name, STATE, nodes[name]) for name in sizes}

    sizes = {"multipliers": len(rows)} | ({"multipliers_by": len(rows) * len(by)} if by else {})
    counts = {"q": kernels.n, "qd": kernels.n, "p": len(kernels.p0)}
    return functions(kernels, f"multipliers{len(rows)}", dict.fromkeys(sizes, STATE), sizes, counts, programs)


def pushed_pendulum():
    """A mass of 2 kg on a rod of 1 m, and a force F along x."""
    m = ncgen.Model("pushed")
    O, P = m.point("O", (0, 0), fixed=True), m.point("P", (0, -1))
    m.body("bob", [P], mass=2.0)
    m.gravity((0, -9.81))
    F = m.input("F")
    m.force(P, (F, 0))
    m.constrain(m.length("r", O, P) - 1, "rod")
    return m


def test_the_tension_of_a_pendulum_and_its_derivative():
    """At the angle a from the bottom with the rate w the rod pulls with m (g cos a + w²) + F sin a."""
    kernels = ncgen.compile(pushed_pendulum())
    last, a, w = kernels.m - 1, 0.3, 0.7
    found = multipliers_of(kernels, [last], ["F"])
    place = {"P.x": math.sin(a), "P.y": -math.cos(a), "r": 1.0}
    rates = {"P.x": w * math.cos(a), "P.y": w * math.sin(a), "r": 0.0}
    q, qd = (np.array([values[name] for name in kernels.coordinates]) for values in (place, rates))
    pull = 2 * (9.81 * math.cos(a) + w**2) + 3 * math.sin(a)
    p = np.where(np.array(kernels.parameters) == "F", 3.0, kernels.p0)
    assert found("multipliers", 0.0, q, qd, p) == pytest.approx([pull], rel=1e-14)
    assert found("multipliers_by", 0.0, q, qd, p) == pytest.approx([math.sin(a)], rel=1e-14)


@pytest.mark.parametrize("name", ["fourbar", "robot", "disc"])
def test_they_are_those_of_the_equations(name):
    """Where constraints are redundant multipliers differ, their forces do not."""
    kernels = ncgen.compile(ncgen.load(name))
    run = ncgen.simulate(kernels, 0.1, points=3)
    found = multipliers_of(kernels, range(kernels.m))
    for t, q, qd in zip(run.t, run.q, run.qd, strict=True):
        lam = accelerations_by("lagrange").motion(kernels, q, qd, t, kernels.p0, {}).lam
        J = kernels.jacobian(q, t, kernels.p0)
        assert found("multipliers", t, q, qd, kernels.p0) @ J == pytest.approx(lam @ J, rel=1e-9, abs=1e-9 * np.max(np.abs(lam)))


def test_python_functions_have_none():
    m = pushed_pendulum()
    m.callback(lambda t, q, qd, kernels: np.zeros(kernels.n))
    kernels = ncgen.compile(m)
    assert refusal_of_multipliers(kernels).startswith("the model calls a Python function")
