"""The motion of all coordinates at once, against coordinate partitioning in Python."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

import ncgen
from ncgen.exchange.examples import load
from ncgen.program.algebra.elimination import factor_symmetric, solve_symmetric
from ncgen.program.ir.evaluate import evaluate
from ncgen.program.ir.functions import FUNCTIONS
from ncgen.program.ir.graph import Graph
from ncgen.program.motions.full_motion import REGULARISATION, MotionSizes, assemble_full_motion, assemble_full_tangents
from ncgen.solver.formalisms.coordinate_partitioning import motion_at
from ncgen.solver.positions.partition import choose_partitions
from ncgen.solver.positions.rank import trial_positions


@cache
def kernels_of(name):
    return ncgen.compile(load(name), backend="numpy")


@cache
def programs(name, assembled=assemble_full_motion):
    kernels = kernels_of(name)
    positions = trial_positions(kernels, kernels.q0, 0.0, None)
    sizes = MotionSizes(kernels.column_sizes, *(tuple(map(f, positions)) for f in (kernels.jacobian, kernels.mass_matrix)))
    return assembled(kernels.programs.equations, sizes, kernels.holonomic)


@pytest.mark.parametrize("name", ["andrews", "bennett", "bricard", "disc", "flyball", "jansen", "nfourbar", "panels", "stewart"])
def test_motion_is_that_of_partitioning(name):
    """Redundant rows, drivers, rolling and masses of very different sizes: q̇, q̈, Φ_qᵀλ and power agree."""
    kernels = kernels_of(name)
    built = programs(name)
    q, n, m = ncgen.assemble(kernels, kernels.q0), kernels.n, kernels.m
    part = choose_partitions(kernels, q, 0.0, kernels.p0).velocity
    zd = np.random.default_rng(1).standard_normal(len(part.independent))
    expected = motion_at(kernels, part, 0.0, q, zd, kernels.p0)
    off = expected.qd + kernels.jacobian(q).T @ np.linspace(-1, 1, m)
    inputs = {"t": 0.0, "q": q.tolist(), "qd": expected.qd.tolist(), "p": kernels.p0.tolist(), "e": [REGULARISATION]}
    out = np.array(evaluate(built.motion, inputs))
    qd, qdd, lam, power = np.split(out, [n, 2 * n, 2 * n + m])
    J = kernels.jacobian(q)
    np.testing.assert_allclose(qd, expected.qd, atol=1e-13 * max(1, np.max(np.abs(expected.qd))))
    np.testing.assert_allclose(qdd, expected.qdd, atol=1e-11 * np.max(np.abs(expected.qdd)))
    np.testing.assert_allclose(J.T @ lam, J.T @ expected.lam, atol=1e-11 * max(1, np.max(np.abs(J.T @ expected.lam))))
    assert power[0] == pytest.approx(expected.power, rel=1e-11, abs=1e-11 * max(1, np.max(np.abs(expected.lam))))
    projected = np.array(evaluate(built.motion, inputs | {"qd": off.tolist()}))[:n]
    # one solve without refinement leaves e times the spread of the masses of what was off: 1e5 for the governor
    np.testing.assert_allclose(J @ projected, kernels.nu(q), atol=1e5 * REGULARISATION * np.max(np.abs(off)))


@pytest.mark.parametrize("name", ["bricard", "nfourbar", "suspension"])
def test_closing_closes(name):
    """A position that is off by a hundredth is closed by Newton steps, each with about twice the digits."""
    kernels = kernels_of(name)
    closing = programs(name).closing
    q = kernels.q0 + 0.01 * np.sin(np.arange(kernels.n)) * kernels.length
    for _ in range(5):
        inputs = {"t": 0.0, "q": q.tolist(), "p": kernels.p0.tolist(), "e": [REGULARISATION]}
        q = q + evaluate(closing, inputs)[: kernels.n]
    np.testing.assert_allclose(kernels.phi(q) / kernels.row_sizes, 0, atol=1e-13)


def test_symmetric_elimination():
    """A sparse quasidefinite matrix, solved as by dense elimination, whatever the order."""
    rng = np.random.default_rng(3)
    M, J = np.diag(rng.uniform(1, 2, 12)), rng.standard_normal((5, 12)) * (rng.random((5, 12)) < 0.4)
    H = np.block([[M, J.T], [J, -1e-3 * np.eye(5)]])
    graph = Graph()
    places = [tuple(map(int, place)) for place in np.argwhere(H)]
    factors = factor_symmetric(graph, {place: graph.const(float(H[place])) for place in places}, 17, [{p: H[p] for p in places}])
    right = rng.standard_normal(17)
    x = solve_symmetric(graph, factors, {i: graph.const(float(b)) for i, b in enumerate(right)})
    found = [graph.ops[x[i]].leaf for i in range(17)]  # constants fold, so the solution is one
    np.testing.assert_allclose(found, np.linalg.solve(H, right), rtol=1e-12)
    assert sorted(factors.order) == list(range(17))


def seeds(kernels, count):
    """(count, 1 + 2n + parameters) directions, with coordinates of natural sizes."""
    sizes = np.concatenate([[1.0], kernels.column_sizes, np.ones(kernels.n), 1e-3 * np.abs(kernels.p0)])
    return sizes * np.random.default_rng(5).standard_normal((count, len(sizes)))


COMPLEX = {name: getattr(np, f.numpy) for name, f in FUNCTIONS.items()}


@pytest.mark.parametrize("name", ["andrews", "disc", "nfourbar", "panels"])
def test_tangents_are_complex_steps(name):
    """Off the constraints as well as on them: derivatives of all outputs by everything, against complex steps through the programs."""
    kernels = kernels_of(name)
    built, n = programs(name), kernels.n
    tangents = programs(name, assemble_full_tangents)
    q = ncgen.assemble(kernels, kernels.q0) + 1e-3 * np.cos(np.arange(n)) * kernels.column_sizes
    qd = np.sin(np.arange(n)) * kernels.column_sizes
    at = np.concatenate([[0.3], q, qd, kernels.p0])

    def run(program, x, **more):
        t, q, qd, p = np.split(x, [1, 1 + n, 1 + 2 * n])
        inputs = {"t": t[0], "q": q, "qd": qd, "p": p, "e": [REGULARISATION], **more}
        return np.array(evaluate(program, inputs, functions=COMPLEX if x.dtype == complex else None))

    def energies(x):
        out = run(built.motion, x)
        moving = np.concatenate([x[: 1 + n], out[:n], x[1 + 2 * n :]])
        return np.concatenate([out, run(kernels.programs.programs["energy"], moving)[:2]])

    for seed in seeds(kernels, 2):
        moved = at + 1e-30j * seed
        step = run(built.closing, moved)[:n].imag / 1e-30
        found = run(tangents.closing, at, seed=seed)
        np.testing.assert_allclose(found, step, rtol=0, atol=1e-10 * np.max(np.abs(step)))
        wanted, found = energies(moved).imag / 1e-30, run(tangents.motion, at, seed=seed)
        for part in np.split(np.arange(len(found)), [n, 2 * n, 2 * n + kernels.m]):
            if len(part):
                np.testing.assert_allclose(found[part], wanted[part], rtol=0, atol=1e-10 * np.max(np.abs(wanted)))
