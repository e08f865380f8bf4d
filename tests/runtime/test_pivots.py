"""A pivot of the emitted elimination that vanishes where the mechanism is not singular: the runtime repeats it with row exchanges."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

import ncgen
from ncgen.mechanism.run_arguments import InitialState
from ncgen.program.algebra.elimination import factor, solve, solve_refined
from ncgen.program.ir.blocks import Program, Store, Straight
from ncgen.program.ir.evaluate import evaluate
from ncgen.program.ir.graph import Graph
from ncgen.solver.engines import partition_dynamics
from ncgen.solver.positions.partition import choose_partitions


@pytest.fixture(scope="module")
def square():
    """Three bars; the second stands upright at the start and the third lies flat, so two of the four entries of Φ_q^d are zero."""
    m = ncgen.Model("square")
    A, D = m.point("A", (0, 0), fixed=True), m.point("D", (1.5, 2.0), fixed=True)
    B, C = m.point("B", (0.5, 1.0)), m.point("C", (0.5, 2.0))
    for name, ends in (("first", [A, B]), ("second", [B, C]), ("third", [C, D])):
        m.body(name, ends, mass=1.0, inertia="point")
    m.gravity((0, -9.81, 0))
    return ncgen.compile(m, backend="c")


@pytest.mark.parametrize("method", ["dop853", "radau"])
def test_a_zero_pivot_is_repeated_and_counted(square, method):
    """The order of elimination is chosen for other positions of the same motion, as it is in the course of a run."""
    python = ncgen.simulate(square, 0.1, points=2, z=["B.x"], integrator="dop853", rtol=1e-11, atol=1e-12, engine="python")
    later = python.q[-1]
    partitions = choose_partitions(square, later, 0.1, square.p0, ("B.x",))
    emitted = partition_dynamics.dynamics(square, partitions, "emitted", later, square.p0)
    jacobian = square.jacobian(square.q0)
    assert np.sum(jacobian[np.ix_(partitions.position.rows[1:], [square.index["C.x"], square.index["C.y"]])] == 0.0) == 2
    given = (method, [0.0, 0.1], InitialState(square.q0, np.zeros(1), square.p0))
    done = emitted.simulate(*given, rtol=1e-9, atol=1e-11, tolerance=1e-12, max_growth=1e25)
    assert done.status == "ok" and done.fallbacks > 0
    assert done.q[-1] == pytest.approx(python.q[-1], abs=1e-8)
    kept, emitted._dynamics.rows = emitted._dynamics.rows, emitted._ffi.NULL
    try:
        if method != "radau":
            assert emitted.simulate(*given, rtol=1e-9, atol=1e-11, tolerance=1e-12, max_growth=1e25).status != "ok"
    finally:
        emitted._dynamics.rows = kept


def test_refinement_gives_back_the_digits_of_an_unlucky_order():
    """x of A x = b, where the first pivot in the fixed order is small: the exact solution is known, as that of fractions."""
    samples = [{(0, 0): 1.0, (0, 1): 1.0, (1, 0): 1.0, (1, 1): 3.0}]
    numbers = {(0, 0): 1e-9, (0, 1): 1.0, (1, 0): 1.0, (1, 1): 3.0}
    expected = _solved(Fraction, samples, numbers, solve)
    plain, refined = (_solved(float, samples, numbers, way) for way in (solve, solve_refined))
    assert max(abs(x - e) for x, e in zip(plain, expected, strict=True)) > 1e-9
    assert refined == pytest.approx([float(e) for e in expected], rel=1e-15)


def _solved(number, samples, numbers, way):
    """The solution by an emitted elimination whose pivots were chosen for other numbers."""
    graph = Graph()
    matrix = {place: graph.load("a", k) for k, place in enumerate(numbers)}
    right = {i: graph.load("b", i) for i in range(2)}
    factors = factor(graph, matrix, 2, samples)
    found = solve(graph, factors, right) if way is solve else way(graph, matrix, factors, right)
    block = Straight(tuple(graph.ops), tuple(Store(array="x", index=k, node=found[k]) for k in range(2)))
    a, b = [number(x) for x in numbers.values()], [number(1), number(2)]
    return evaluate(Program(name="x", inputs=("a", "b"), output="x", size=2, blocks=(block,)), {"a": a, "b": b}, number=number)


def test_refined_accelerations_are_those_of_the_reference(square):
    """The whole run by the refined state derivative, against Python with row exchanges."""
    runs = [ncgen.simulate(square, 0.1, points=2, z=["B.x"], rtol=1e-11, atol=1e-12, engine=engine) for engine in ("refined", "python")]
    assert runs[0].engine == "refined" and runs[0].q[-1] == pytest.approx(runs[1].q[-1], abs=1e-9)
    with pytest.raises(ncgen.ModelError, match="emitted for coordinate-partitioning, not for lagrange"):
        ncgen.simulate(square, 0.1, formalism="lagrange", engine="refined")


@pytest.fixture(scope="module")
def fourbar():
    """Kernels, a start, and the dynamics that are written out for it."""
    kernels = ncgen.compile(ncgen.load("fourbar"), backend="c")
    q = ncgen.assemble(kernels)
    return kernels, q, partition_dynamics.dynamics(kernels, choose_partitions(kernels, q, independent=("psi",)), "emitted", q, kernels.p0)


@pytest.mark.parametrize("method", ["dop853", "radau"])
def test_pivots_that_serve_are_used(fourbar, method):
    """Where none vanishes nothing is done with row exchanges."""
    kernels, q, emitted = fourbar
    start = InitialState(q, np.ones(1), kernels.p0)
    done = emitted.simulate(method, [0.0, 0.05], start, rtol=1e-6, atol=1e-8, tolerance=1e-12, max_growth=1e25)
    assert done.status == "ok" and done.evaluations > 0 and done.fallbacks == 0


STEPS = {"dop853": {"rtol": 1e-9, "atol": 1e-11}, "radau": {"rtol": 1e-9, "atol": 1e-11}, "trapezoidal": {"max_step": 5e-4}}


@pytest.mark.parametrize("missing", [(), ("rows",), ("tangents",), ("rows", "tangents")], ids=str)
@pytest.mark.parametrize("method", STEPS)
def test_implicit_steps_without_what_they_need_are_refused(fourbar, method, missing, monkeypatch):
    """Tangents, and rows for the solutions with row exchanges that a Jacobian is made of; explicit steps need neither."""
    kernels, q, emitted = fourbar
    start = InitialState(q, np.ones(1), kernels.p0)
    whole = ncgen.simulate(kernels, 0.05, q0=q, zd0=[1.0], z="psi", points=2, rtol=1e-10, engine="python")
    kept = emitted._dynamics.rows
    if "tangents" in missing:
        monkeypatch.setattr(type(emitted), "_take_tangents", lambda self: setattr(self._dynamics, "tangents", self._ffi.NULL))
    try:
        if "rows" in missing:
            emitted._dynamics.rows = emitted._ffi.NULL
        done = emitted.simulate(method, [0.0, 0.05], start, **STEPS[method], tolerance=1e-12, max_growth=1e25)
    finally:
        emitted._dynamics.rows = kept
    assert done.status == ("argument" if missing and method != "dop853" else "ok")
    if done.status == "ok":
        assert done.q[-1] == pytest.approx(whole.q[-1], abs=1e-6)
