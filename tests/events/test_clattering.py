"""A rod that falls on both of its ends: they hit in turn ever faster, infinitely often, until the rod lies on the floor and stays there."""

from __future__ import annotations

import numpy as np
import pytest

import ncgen

G, DURATION = 9.81, 1.5


def rod(order: str):
    m = ncgen.Model("rod")
    A, B = m.point("A", (0, 1.0)), m.point("B", (1, 1.0))
    m.body("rod", [A, B], mass=1.0, com=(0.5, 1.0), inertia=1 / 12)
    m.gravity((0, -G))
    for name, end in (("left", A), ("right", B)):
        m.event(name, when=end.y, do=ncgen.impact(restitution=0.5, order=order))
    return ncgen.compile(m)


def starts(seed: int, count: int):
    """Positions (count, 4) above the floor, and rates of the right end (m/s)."""
    rng = np.random.default_rng(seed)
    angle, height, rate = rng.uniform(-0.5, 0.5, count), rng.uniform(0.55, 1.0, count), rng.uniform(-2, 2, count)
    return np.column_stack([0 * angle, height, np.cos(angle), height + np.sin(angle)]), rate


def check(kernels, q, qd, events):
    """It never passes the floor, and lies still on it in the end, where it is: no force acts along the floor."""
    heights = q[:, [kernels.index["A.y"], kernels.index["B.y"]]]
    assert np.min(heights) > -1e-12
    np.testing.assert_allclose(heights[-1], 0.0, atol=1e-12)
    np.testing.assert_allclose(qd[-1, [kernels.index["A.y"], kernels.index["B.y"]]], 0.0, atol=1e-9)
    along = q[:, kernels.index["A.x"]] + q[:, kernels.index["B.x"]]
    np.testing.assert_allclose(
        along, along[0] + (qd[0, kernels.index["A.x"]] + qd[0, kernels.index["B.x"]]) * np.linspace(0, DURATION, len(q)), atol=1e-5
    )
    assert [event.transition for event in events].count("rests") >= 2 and len(events) < 200
    first, last = (float(np.sum(kernels.energy(q[i], qd[i])[:2])) for i in (0, -1))
    assert sum(event.energy_lost for event in events) == pytest.approx(first - last, abs=1e-6)


@pytest.mark.parametrize("order", ["in turn", "simultaneous"])
def test_a_rod_comes_to_rest_on_the_floor(order):
    kernels = rod(order)
    for q, rate in zip(*starts(1, 3), strict=True):
        run = ncgen.simulate(kernels, DURATION, q0=q, qd0={"B.y": rate}, points=151)
        check(kernels, run.q, run.qd, run.events)


@pytest.mark.parametrize("order", ["in turn", "simultaneous"])
def test_many_rods_come_to_rest_on_the_floor(order):
    """The same in C, with the instants of single runs."""
    kernels = rod(order)
    q, rate = starts(2, 24)
    batch = ncgen.simulate(kernels, DURATION, q0=q, qd0={"B.y": rate}, points=151)
    assert not np.any(batch.alone)
    for i, events in enumerate(batch.events):
        check(kernels, batch.q[i], batch.qd[i], events)
    run = ncgen.simulate(kernels, DURATION, q0=q[0], qd0={"B.y": rate[0]}, points=151)
    assert batch.events[0][-1].t == pytest.approx(run.events[-1].t, abs=1e-6)
