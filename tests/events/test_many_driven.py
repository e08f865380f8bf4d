"""Batches with events under inputs that change with time and laws with breaks, in C: each state is what it is alone."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import sympy
from batched import compare, numbers, together
from bouncing import G
from sliding import sliding_block

import ncgen
from ncgen.solver.events.many_runs import CHUNK


def braked() -> ncgen.Model:
    """A block with a brake that an input pulls, which a force pushes from 2 v on."""
    m, s = sliding_block("braked")
    pull, v = m.input("pull"), m.parameter("v", 1.0)
    m.torque(s, 5 * sympy.Max(0, m.time - 2 * v))
    m.friction(s, coulomb=pull, name="brake")
    return m


def lifted() -> ncgen.Model:
    """A weight on a ratchet that an input lifts."""
    m = ncgen.Model("lifted")
    P = m.point("P", (0, 0), fixed="x")
    m.body("weight", [P], mass=1.0)
    m.gravity((0, -G))
    m.force(P, (0, m.parameter("v", 1.0) * m.input("lift")))
    m.ratchet(P.y, name="pawl")
    return m


def blown() -> ncgen.Model:
    """A ball with an upward wind, whose velocity an event watches."""
    m = ncgen.Model("blown")
    P, wind = m.point("P", (0, 1), fixed="x"), m.input("wind")
    m.body("ball", [P], mass=1.0)
    m.gravity((0, -G))
    m.force(P, (0, wind))
    m.event("floor", when=P.y, do=ncgen.impact(restitution=m.parameter("v", 0.5)))
    m.event("strong", when=wind - 5, direction="either")
    return m


def pushed(sticks: bool = True) -> ncgen.Model:
    """A block between stops, pushed to one from v to 2 v and back from 3 v on."""
    m, s = sliding_block("pushed")
    v, step = m.parameter("v", 1.0), sympy.Heaviside
    m.torque(s, 10 * step(m.time - v) - 10 * step(m.time - 2 * v) - 3 * step(m.time - 3 * v))
    m.stop(s, lower=-0.5, upper=2.0, restitution=0.5)
    if sticks:
        m.friction(s, coulomb=0.2)
    return m


def pushed_and_stopped() -> ncgen.Model:
    """With events at the very times of breaks, and at the end."""
    m = pushed(sticks=False)
    m.event("at", m.time - 2 * m.parameters["v"], "rising", do={"rate(s)": 0.0})
    m.event("end", m.time - 5.0, "rising")
    return m


SCENES: dict[str, tuple[Callable[[], ncgen.Model], float, dict[str, Any], tuple[float, ...]]] = {
    "table": (braked, 4.0, {"qd0": {"s": 1.0, "A.x": 1.0}, "inputs": {"pull": ([0.0, 1.0, 2.0, 4.0], [0.3, 2.0, 4.0, 8.0])}}, (0.5, 1.0)),
    "function": (braked, 4.0, {"qd0": {"s": 1.0, "A.x": 1.0}, "inputs": {"pull": lambda t: 2 * t}}, (0.5, 1.0)),
    "steps": (lifted, 5.0, {"qd0": {"P.y": 2.0}, "inputs": {"lift": ([0, 1, 2, 3, 3.5], [0, 2 * G, 0, G, -G], "zero")}}, (0.5, 2.0)),
    "spline": (blown, 2.0, {"inputs": {"wind": ([0.0, 0.5, 1.0, 1.5, 2.0], [0.0, 20.0, -3.0, 15.0, 0.0], "cubic")}}, (0.3, 0.8)),
    "pulses": (pushed, 5.0, {}, (0.5, 0.7, 1.0)),
    "events at breaks": (pushed_and_stopped, 5.0, {}, (0.5, 0.7, 2.5)),
}  # fmt: skip
"""A model, seconds, its start and inputs, and values of v."""


@pytest.mark.parametrize("scene", SCENES)
def test_what_time_drives_is_what_it_is_alone(scene):
    model, seconds, arguments, values = SCENES[scene]
    kernels = ncgen.compile(model())
    batch = together(kernels, seconds, values, **arguments)
    assert all(batch.events)
    for i, v in enumerate(values):
        run = ncgen.simulate(kernels, seconds, points=7, p={"v": v}, rtol=1e-9, integrator="dopri5", **arguments)
        compare(batch, i, run, 1e-12)


def test_a_brake_that_an_input_pulls():
    """By 2 t: from 1 m/s it stops at 1 s, and the force of 5 (t − 2 v) exceeds 2 t at 10 v/3."""
    kernels = ncgen.compile(braked())
    for pull in (lambda t: 2 * t, ([0.0, 9.0], [0.0, 18.0])):
        batch = together(kernels, 4.0, (0.9, 1.1), qd0={"s": 1.0, "A.x": 1.0}, inputs={"pull": pull})
        for events, v in zip(batch.events, (0.9, 1.1), strict=True):
            seen = [(each.transition, each.t) for each in events if each.t > 0]
            assert [transition for transition, _ in seen] == ["sticks", "slips"]
            assert [t for _, t in seen] == pytest.approx([1.0, 10 * v / 3], rel=1e-9)


def test_a_push_that_jumps_beyond_static_friction_starts_a_joint_and_nothing_else():
    """10 N against 0.2 N from v on: 1 kg comes to the stop at 2 m after √(4/9.8); alone, too."""
    kernels = ncgen.compile(pushed())
    batch = together(kernels, 1.9, (1.0,))
    run = ncgen.simulate(kernels, 1.9, p={"v": 1.0}, rtol=1e-9)
    expected = [("s.friction", "sticks", 0.0), ("s.friction", "slips", 1.0), ("s.stop.upper", "", 1.0 + math.sqrt(4 / 9.8))]
    for events in (batch.events[0], run.events):
        assert [(each.name, each.transition, pytest.approx(each.t, rel=1e-9)) for each in events[:3]] == expected


def test_neighbours_and_threads_make_no_difference():
    """Breaks are those of each state."""
    kernels = ncgen.compile(pushed())
    values = np.linspace(0.3, 1.2, CHUNK + 3)
    one, two = (together(kernels, 5.0, values, threads=threads) for threads in (1, 2))
    last = together(kernels, 5.0, values[-1:])
    assert one.q.tobytes() == two.q.tobytes() and one.q[-1].tobytes() == last.q[0].tobytes()
    assert [numbers(each).tobytes() for each in one.events] == [numbers(each).tobytes() for each in two.events]


def test_drivers_whose_velocity_jumps_are_left_to_single_runs():
    """A driver of v max(0, t − 1/2) has no jump for v = 0."""
    m, s = sliding_block("driven")
    B = m.point("B", (1, 0), fixed="y")
    m.body("other", [B], mass=1.0)
    m.drive(s, m.parameter("v", 1.0) * sympy.Max(0, m.time - 0.5))
    m.event("hit", when=B.x - m.elements["A"].x - 0.2, do=ncgen.impact(0.5))
    batch = ncgen.simulate(ncgen.compile(m), 2.0, p={"v": np.array([0.0, 1.0, 0.0])})
    assert batch.ok.all() and batch.alone.tolist() == [False, True, False] and list(map(len, batch.events)) == [0, 1, 0]
    assert batch.events[1][0].t == pytest.approx(1.3, rel=1e-12)


def test_a_function_that_fails_is_reported_as_alone():
    kernels = ncgen.compile(lifted())
    batch = ncgen.simulate(kernels, 1.0, p={"v": np.array([1.0])}, inputs={"lift": lambda t: math.nan if t > 0.5 else 0.0})
    assert not batch.ok.any() and batch.alone.all() and "the input lift is nan" in batch.status[0]

    def failing(t: float) -> float:
        if t > 0.5:
            raise LookupError("no value")
        return 0.0

    with pytest.raises(LookupError, match="no value"):
        ncgen.simulate(kernels, 1.0, p={"v": np.array([1.0])}, inputs={"lift": failing})


def test_studies_with_inputs():
    """The weight that is lifted by G t is released at 1 s/v, and its outputs read the input at the end."""
    m = lifted()
    m.output("force", m.parameters["v"] * m.inputs["lift"])
    result = ncgen.study(
        m, {"v": [1.0, 2.0]}, keep=["first_time(pawl releases)", "P.y", "force", "energy_drift"], duration=3.0,
        inputs={"lift": ([0.0, 3.0], [0.0, 3 * G])}, rtol=1e-10,
    )  # fmt: skip
    assert "events in C" in result.about["made_with"] and result["first_time(pawl releases)"] == pytest.approx(1 / result["v"], rel=1e-9)
    assert result["P.y"] == pytest.approx(G * result["v"] * (3 - 1 / result["v"]) ** 3 / 6, rel=1e-9)
    assert result["force"] == pytest.approx(3 * G * result["v"], rel=1e-12) and np.max(result["energy_drift"]) < 1e-8
