"""Events that change parameters of constraints: positions never jump, velocities do, and derivatives go through them."""

from __future__ import annotations

import numpy as np
import pytest
from test_lock_gradients import GIVEN, check_sweep, slopes_of
from test_locks import two_discs

import ncgen

G = 9.81


def pendulum(longer):
    """A pendulum whose length an event sets."""
    m = ncgen.Model("pendulum")
    length = m.parameter("length", 1.0)
    O, P = m.point("O", (0, 0), fixed=True), m.point("P", (1, 0))
    m.body("bob", [P], mass=1.0)
    m.distance(O, P, length)
    m.gravity((0, -G))
    m.event("grow", P.y + 0.5, do={"length": longer})
    return ncgen.compile(m)


def block(name):
    """A block on a slide, and how far it is."""
    m = ncgen.Model(name)
    axis, O, A = m.vector("axis", (1, 0, 0), fixed=True), m.point("O", (0, 0), fixed=True), m.point("A", (0, 0), fixed="y")
    m.body("block", [A], mass=1.0)
    return m, m.slide("s", O, A, axis)


def test_positions_do_not_jump():
    """A length that an event changes is refused: the energy of such a jump is nobody's."""
    with pytest.raises(
        ncgen.ModelError,
        match=r"event grow at t = 0.328[0-9]* s: with length = 1.1 positions would jump, constraint .* is off by 0.[0-9]* of its size; "
        "change it over time, by an expression of m.time",
    ):
        ncgen.simulate(pendulum(1.1), 1.0)
    run = ncgen.simulate(pendulum(1.0), 1.0)
    assert run.energy_drift < 1e-6 and run.events[0].name == "grow"


def test_derivatives_of_a_length_that_does_not_change_by_chance():
    """At any other length than 1 positions would jump."""
    with pytest.raises(ncgen.ModelError, match="grow, which at t = 0.328[0-9]* s would make positions jump at other parameters"):
        ncgen.sensitivities(pendulum(1.0), 0.4, 100, by=["length"])


def test_a_velocity_that_an_event_prescribes():
    """A disc turns at v up to the angle a, and then at b v: the impulse of its constraint shows at the event, and in derivatives."""
    m, (_, psi) = two_discs()
    v, a, b = m.parameter("v", 2.0), m.parameter("a", 0.5), m.parameter("b", 3.0)
    m.constrain_velocity(psi.rate - v, "speed")
    m.event("there", when=a - psi, do={"v": b * v})
    kernels, by, start = ncgen.compile(m), ["v", "a", "b"], {"psi1": 0.0}
    run = ncgen.simulate(kernels, 1.0, points=5, qd0=start)
    column = kernels.index["psi2"]
    (there,) = run.events
    assert there.before[column] == pytest.approx(2.0, rel=1e-12) and there.after[column] == pytest.approx(6.0, rel=1e-12)
    assert there.energy_lost == pytest.approx(1.5 * (2.0**2 - 6.0**2), rel=1e-12) and run.energy_drift < 1e-8
    found = ncgen.sensitivities(kernels, 1.0, 10, by=by, qd0=start, **GIVEN)
    mine = np.vstack([found.events[0].t_by, found.q_by[-1, column], found.qd_by[-1, column]])
    expected = slopes_of(lambda v, a, b: np.array([a / v, a + b * v * (1 - a / v), b * v]), [2.0, 0.5, 3.0])
    assert mine == pytest.approx(expected, rel=1e-9, abs=1e-9)
    check_sweep(kernels, 1.0, 10, found, by, qd0=start, **GIVEN)


def test_a_driver_that_turns_back_where_it_is():
    """s = s₀ + v (t − t₀) until s = a, where an event sets s₀, t₀ and −v: positions agree at all parameters."""
    m, s = block("driven")
    v, a = m.parameter("v", 2.0), m.parameter("a", 0.5)
    begin, place = m.parameter("begin", 0.0), m.parameter("place", 0.0)
    m.constrain(s - place - v * (m.time - begin), "drive")
    m.event("there", when=a - s, do={"v": -v, "begin": m.time, "place": s})
    kernels, by = ncgen.compile(m), ["v", "a"]
    found = ncgen.sensitivities(kernels, 1.0, 10, by=by)
    column = kernels.index["s"]
    expected = slopes_of(lambda v, a: np.array([a / v, a - v * (1 - a / v)]), [2.0, 0.5])
    mine = np.vstack([found.events[0].t_by, found.q_by[-1, column]])
    assert found.q[-1, column] == pytest.approx(-1.0, rel=1e-12) and mine == pytest.approx(expected, rel=1e-9, abs=1e-10)
