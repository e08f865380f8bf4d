"""Batches with contacts that bounce, slide, stick and roll, in C: each state is what it is alone."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from batched import compare, numbers, together
from bouncing import G

import ncgen
from ncgen.exchange.examples import example_module


def tossed(tilt: float = 0.0) -> ncgen.Model:
    """A point of 1 kg over a plane with friction v, which is tilted (rad)."""
    m = ncgen.Model("tossed")
    P = m.point("P", (0, 0.5))
    body = m.body("point", [P], mass=1.0)
    m.gravity((G * np.sin(tilt), -G * np.cos(tilt)))
    up, O = m.vector("up", (0, 1), fixed=True), m.point("O", (0, 0), fixed=True)
    m.contact("floor", body, P, m.ground, O, normal=up, friction=m.parameter("v", 0.3), restitution=0.4)
    return m


def on_a_slope() -> ncgen.Model:
    return tossed(0.3)


def ball() -> ncgen.Model:
    """A ball of 1 kg and 0.1 m on the floor, with friction v."""
    m = ncgen.Model("ball")
    C, R = m.point("C", (0, 0.1)), m.point("R", (0.1, 0.1))
    body = m.body("ball", [C, R], mass=1.0, com=(0, 0.1), inertia=0.004)
    m.gravity((0, -G))
    up, O = m.vector("up", (0, 1), fixed=True), m.point("O", (0, 0), fixed=True)
    m.contact("floor", body, C, m.ground, O, normal=up, radius=0.1, friction=m.parameter("v", 0.3))
    return m


def thrown() -> ncgen.Model:
    """In space."""
    m = ncgen.Model("thrown")
    P = m.point("P", (0, 0, 1))
    body = m.body("point", [P], mass=1.0)
    m.gravity((0, 0, -G))
    up, O = m.vector("up", (0, 0, 1), fixed=True), m.point("O", (0, 0, 0), fixed=True)
    m.contact("floor", body, P, m.ground, O, normal=up, friction=m.parameter("v", 0.3), restitution=0.5)
    return m


SLIDING = {"C.x": 2.0, "C.y": 0.0, "R.x": 2.0, "R.y": 0.0}

SCENES: dict[str, tuple[Callable[[], ncgen.Model], float, dict[str, float], tuple[float, ...], set[str]]] = {
    "floor": (tossed, 2.0, {"P.x": 2.0, "P.y": 0.0}, (0.1, 0.3), {"", "rests", "sticks"}),
    "slope": (on_a_slope, 2.0, {"P.x": -2.0, "P.y": 0.0}, (0.1, 0.3, 0.5), {"", "rests", "sticks"}),
    "ball": (ball, 1.5, SLIDING, (0.1, 0.4), {"rests", "sticks"}),
    "space": (thrown, 2.5, {"P.x": 2.0, "P.y": 1.0, "P.z": 0.0}, (0.1, 0.3, 0.6), {"", "rests", "sticks"}),
}
"""A model, seconds, velocities, values of v, and what happens in one of the states at least."""


@pytest.mark.parametrize("scene", SCENES)
def test_contacts_are_what_they_are_alone(scene):
    """A ball rolls by a recursion alone, by the matrix in a batch: there within the tolerance."""
    model, seconds, velocities, values, happens = SCENES[scene]
    kernels = ncgen.compile(model())
    batch = together(kernels, seconds, values, qd0=velocities)
    assert {each.transition for events in batch.events for each in events} >= happens
    for i, v in enumerate(values):
        run = ncgen.simulate(kernels, seconds, points=7, p={"v": v}, rtol=1e-9, integrator="dopri5", qd0=velocities)
        compare(batch, i, run, 1e-6 if scene == "ball" else 1e-12)


def test_a_ball_that_slides_and_rolls():
    """Coriolis (1835): it rolls after 2 v₀/(7 μ g) with 5/7 v₀."""
    batch = together(ncgen.compile(ball()), 1.5, (0.1, 0.2, 0.4), qd0=SLIDING)
    rolls = [next(each.t for each in events if each.transition == "sticks") for events in batch.events]
    assert rolls == pytest.approx(4 / 7 / np.array([0.1, 0.2, 0.4]) / G, rel=1e-9)
    assert batch.qd[:, -1, batch.kernels.index["C.x"]] == pytest.approx(10 / 7, rel=1e-8)


def test_a_block_that_rocks():
    """States are those of a single run; impulses of rounding may be noted in one of them only."""
    model, _ = example_module(".", "winch.py").rocking()
    kernels = ncgen.compile(model)
    batch = ncgen.simulate(kernels, 3.0, points=7, q0=np.tile(kernels.q0, (2, 1)), rtol=1e-9)
    run = ncgen.simulate(kernels, 3.0, points=7, rtol=1e-9, integrator="dopri5")
    assert batch.ok.all() and not batch.alone.any() and batch.q[1] == pytest.approx(run.q, abs=1e-9)
    hits = [[each for each in events if each.impulse > 1e-9] for events in (batch.events[0], run.events)]
    assert [each.name for each in hits[0]] == [each.name for each in hits[1]] and len(hits[0]) == 4
    assert [each.t for each in hits[0]] == pytest.approx([each.t for each in hits[1]], abs=1e-9)


def test_neighbours_and_threads_make_no_difference():
    kernels = ncgen.compile(on_a_slope())
    values, start = np.linspace(0.1, 0.9, 19), {"P.x": -2.0, "P.y": 0.0}
    one, two = (together(kernels, 2.0, values, threads=threads, qd0=start) for threads in (1, 2))
    last = together(kernels, 2.0, values[-1:], qd0=start)
    assert one.q.tobytes() == two.q.tobytes() and one.q[-1].tobytes() == last.q[0].tobytes()
    assert [numbers(each).tobytes() for each in one.events] == [numbers(each).tobytes() for each in two.events]


def test_loads_that_are_not_determined_are_reported_as_alone():
    """A rod at 1 rad that slides on its tip against its lean with a friction beyond Painlevé's limit, and with less."""
    m = ncgen.Model("rod")
    along = np.array([np.cos(1.0), np.sin(1.0)])
    A, B = m.point("A", (0, 0)), m.point("B", along)
    rod = m.body("rod", [A, B], mass=1.0, com=along / 2, inertia=1 / 12)
    m.gravity((0, -G))
    up, O = m.vector("up", (0, 1), fixed=True), m.point("O", (0, 0), fixed=True)
    m.contact("tip", rod, A, m.ground, O, normal=up, friction=m.parameter("v", 0.3), order="in turn")
    velocities = {"A.x": -5.0, "A.y": 0.0, "B.x": -5.0, "B.y": 0.0}
    batch = ncgen.simulate(ncgen.compile(m), 0.02, p={"v": np.array([0.3, 5.0])}, qd0=velocities)
    assert batch.ok.tolist() == [True, False] and batch.alone.tolist() == [False, True]
    assert batch.status[1].startswith("rod: at t = 0 s the load of contact tip with friction 5 at (0, 0, 0) m is not determined")


def test_studies_of_contacts():
    result = ncgen.study(ball(), {"v": [0.2, 0.4]}, keep=["first_time(floor sticks)", "rate(C.x)"], duration=1.5, qd0=SLIDING, rtol=1e-10)
    assert "events in C" in result.about["made_with"]
    assert result["first_time(floor sticks)"] == pytest.approx(2 * 2.0 / 7 / result["v"] / G, rel=1e-9)
    assert result["rate(C.x)"] == pytest.approx(10 / 7, rel=1e-9)
