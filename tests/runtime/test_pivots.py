"""A pivot of the emitted elimination that vanishes where the mechanism is not singular: the runtime repeats it with row exchanges."""

from __future__ import annotations

import numpy as np
import pytest

import ncgen
from ncgen.solver import compiled
from ncgen.solver.partition import choose_partitions


@pytest.fixture(scope="module")
def square():
    """Three bars; the second stands upright at the start and the third lies flat, so two of the four entries of Φ_q^d are zero."""
    m = ncgen.Model("square")
    A, D = m.point("A", (0, 0), fixed=True), m.point("D", (1.5, 2.0), fixed=True)
    B, C = m.point("B", (0.5, 1.0)), m.point("C", (0.5, 2.0))
    for name, ends in (("first", [A, B]), ("second", [B, C]), ("third", [C, D])):
        m.body(name, ends, mass=1.0)
    m.gravity((0, -9.81, 0))
    return ncgen.compile(m, backend="c")


@pytest.mark.parametrize("method", ["dop853", "radau"])
def test_a_zero_pivot_is_repeated_and_counted(square, method):
    """The order of elimination is chosen for other positions of the same motion, as it is in the course of a run."""
    python = ncgen.simulate(square, 0.1, points=2, z=["B.x"], integrator="dop853", rtol=1e-11, atol=1e-12, engine="python")
    later = python.q[-1]
    partitions = choose_partitions(square, later, 0.1, square.p0, ("B.x",))
    emitted = compiled.emission(square, partitions, "emitted", later, square.p0)
    jacobian = square.jacobian(square.q0)
    assert np.sum(jacobian[np.ix_(partitions.position.rows[1:], [square.index["C.x"], square.index["C.y"]])] == 0.0) == 2
    given = (method, [0.0, 0.1], square.q0, np.zeros(1), square.p0, 1e-9, 1e-11)
    done = emitted.simulate(*given, tolerance=1e-12, growth=1e9)
    assert done.status == "ok" and done.fallbacks > 0
    assert done.q[-1] == pytest.approx(python.q[-1], abs=1e-8)
    kept, emitted._dynamics.rows = emitted._dynamics.rows, emitted._ffi.NULL
    try:
        if method != "radau":
            assert emitted.simulate(*given, tolerance=1e-12, growth=1e9).status != "ok"
    finally:
        emitted._dynamics.rows = kept
