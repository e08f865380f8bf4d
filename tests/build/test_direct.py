"""Kernels on arrays of their own: what the checked call gives, without the way there."""

from __future__ import annotations

import numpy as np
import pytest

import ncgen
from ncgen.errors import NcgenError


@pytest.fixture(scope="module")
def moved(robot):
    """A position and velocities with no zeros in them."""
    rng = np.random.default_rng(3)
    return robot.q0 + rng.uniform(-0.1, 0.1, robot.n), rng.uniform(-1, 1, robot.n)


def test_every_kernel_gives_what_the_checked_call_gives(robot, moved):
    """The same function on the same numbers: equal to the last bit."""
    for name in robot.programs.programs:
        direct = robot.direct(name)
        direct.q[:], direct.qd[:] = moved
        direct()
        assert np.array_equal(direct.out, robot.values(name, 0.0, *moved, None)), name


def test_time_and_parameters_enter():
    """Φ = r·s − L cos(ω t) for a driven length: its own time and parameter, not those of another object."""
    import sympy

    m = ncgen.Model("direct")
    length = m.parameter("L", 2.0)
    B = m.point("B", (1, 0), fixed="yz")
    m.constrain(B.x - length * sympy.cos(m.time))
    kernels = ncgen.compile(m, "c")
    first, second = kernels.direct("phi"), kernels.direct("phi")
    first.t, first.p[0], first.q[0] = 0.5, 3.0, 0.25
    first(), second()
    assert first.t == 0.5
    assert abs(first.out[0]) == pytest.approx(abs(0.25 - 3 * np.cos(0.5)), rel=1e-15)
    assert abs(second.out[0]) == pytest.approx(1.0, rel=1e-15)


def test_what_is_not_there_is_named(robot):
    with pytest.raises(NcgenError, match=r"robot\.nu: there is no such kernel here; there are phi"):
        robot.direct("nu")


def test_forces_in_python_are_refused():
    """A force that Python computes cannot be in the result, so the object is not made."""
    m = ncgen.Model("called")
    B = m.point("B", (1, 0))
    m.distance(m.point("A", (0, 0), fixed=True), B)
    m.body("rod", points=[B], mass=1.0)
    m.gravity((0, -9.81, 0))
    m.callback(lambda t, q, qd, kernels: np.zeros(2))
    with pytest.raises(NcgenError, match=r"called\.force: the model calls a Python function"):
        ncgen.compile(m, "c").direct("force")
