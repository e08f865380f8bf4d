"""Kernels on arrays of their own: what the checked call gives, without the way there."""

from __future__ import annotations

import copy
import gc

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


def refusal(change) -> str:
    """What ncgen says against a change, in one line."""
    with pytest.raises(NcgenError) as caught:
        change()
    assert "\n" not in str(caught.value) and len(str(caught.value)) <= 300
    return str(caught.value)


def test_what_is_assigned_is_copied_into_its_place(robot, moved):
    """The kernel sees it, the arrays stay, and the giver's array is not written to."""
    q, qd = moved
    direct, places = robot.direct("gamma"), {}
    for name in ("q", "qd", "p", "out"):
        places[name] = getattr(direct, name)
    direct.q, direct.qd, direct.p = q.tolist(), qd, np.array(robot.p0, dtype=object)
    direct()
    assert np.array_equal(direct.out, robot.gamma(q, qd))
    direct.q += 0.01
    direct.q *= 2.0
    direct()
    assert np.array_equal(direct.out, robot.gamma(2.0 * (q + 0.01), qd))
    assert all(getattr(direct, name) is place for name, place in places.items())


def test_what_cannot_be_replaced_is_refused(robot):
    direct = robot.direct("phi")
    assert "out cannot be replaced" in refusal(lambda: setattr(direct, "out", np.zeros(robot.m)))
    assert "q has shape (35,); (36,) is needed" in refusal(lambda: setattr(direct, "q", np.zeros(35)))
    assert "q is complex" in refusal(lambda: setattr(direct, "q", 1j * robot.q0))
    assert "t is 'now'; a number is needed" in refusal(lambda: setattr(direct, "t", "now"))
    for name in ("q", "out", "_frame"):
        assert f"{name} cannot be deleted" in refusal(lambda name=name: delattr(direct, name))
        if name != "q":
            refusal(lambda name=name: setattr(direct, name, None))
    assert "is not copied" in refusal(lambda: copy.copy(direct))


def test_memory_stays_with_whoever_looks_at_it(robot, moved):
    """Arrays cannot be resized, and outlive the object that they came from."""
    direct = robot.direct("phi")
    for array in (direct.q, direct.qd, direct.p, direct.out):
        for base in (array, array.base):
            if isinstance(base, np.ndarray):
                with pytest.raises(ValueError, match="does not own its data"):
                    base.resize(10_000, refcheck=False)
    direct.q[:] = moved[0]
    direct()
    q, out, expected = direct.q, direct.out, direct.out.copy()
    del direct
    gc.collect()
    others = [robot.direct("phi") for _ in range(100)]
    for other in others:
        other()
    q[:] = 0.0
    assert np.array_equal(out, expected)


@pytest.mark.parametrize("backend", ["c", "numpy"])
def test_what_the_mechanism_is_stays(backend):
    """Sizes and defaults that solver and C rely on are not written to; neither are members of kernels replaced."""
    kernels = ncgen.compile(ncgen.load("fourbar"), backend)
    for name in ("q0", "p0", "row_sizes", "column_sizes", "holonomic"):
        with pytest.raises(ValueError, match="read-only"):
            getattr(kernels, name)[...] = 2.0
        assert f"kernels.{name} cannot be replaced" in refusal(lambda name=name: setattr(kernels, name, np.zeros(1)))
    kernels.q0.copy()[0] = 2.0
