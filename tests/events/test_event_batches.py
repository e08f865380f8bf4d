"""Events in batches: each row has its own, and is what it is alone."""

from __future__ import annotations

import math

import numpy as np
import pytest
from bouncing import G, ball
from sliding import sliding_block

import ncgen

HEIGHTS = np.array([0.2, 0.5, 1.0, 2.0])


@pytest.fixture(scope="module")
def dropped():
    return ncgen.compile(ball())


def test_each_row_has_its_own_events(dropped):
    """Dropped from h a ball hits the floor at √(2h/g) and comes to rest at three times that."""
    batch = ncgen.simulate(dropped, 1.0, points=11, q0=HEIGHTS[:, None])
    assert batch.ok.all() and [each[0].t for each in batch.events] == pytest.approx(np.sqrt(2 * HEIGHTS / G), rel=1e-12)
    assert [any(each.transition == "rests" for each in row) for row in batch.events] == (3 * np.sqrt(2 * HEIGHTS / G) < 1.0).tolist()
    for i, height in enumerate(HEIGHTS):
        run = ncgen.simulate(dropped, 1.0, points=11, q0={"P.y": height}, integrator="dopri5")
        assert batch.q[i] == pytest.approx(run.q, abs=1e-13) and batch.qd[i] == pytest.approx(run.qd, abs=1e-13)
        assert batch.work[i] == pytest.approx(run.work, abs=1e-12)
        assert [repr(each) for each in batch.events[i]] == [repr(each) for each in run.events]


def test_parameters_of_rows(dropped):
    batch = ncgen.simulate(dropped, 0.7, p={"e": np.array([0.25, 0.5, 0.75])})
    impacts = [each[0] for each in batch.events]
    assert [-each.after[0] / each.before[0] for each in impacts] == pytest.approx([0.25, 0.5, 0.75], rel=1e-12)
    assert batch.q[1, -1, 0] == pytest.approx(0.2474692639735212, rel=1e-12)


def test_a_row_that_an_event_ends():
    """Its status says which one and when; rows from there on are NaN, and the others arrive."""
    m, s = sliding_block("ended")
    m.event("wall", when=s - 0.6, direction="rising", do="stop")
    batch = ncgen.simulate(ncgen.compile(m), 1.0, points=5, zd0=np.array([[0.1], [1.0]]), z=("s",))
    assert batch.status == ("ok", "ended: event wall ended the motion at t = 0.6 s")
    assert batch.q[1, :, 0] == pytest.approx([0.0, 0.25, 0.5, np.nan, np.nan], nan_ok=True)
    assert batch.q[0, -1, 0] == pytest.approx(0.1) and [each.name for each in batch.events[1]] == ["wall"]


def test_a_row_that_cannot_begin(dropped):
    batch = ncgen.simulate(dropped, 0.5, q0=np.array([[1.0], [-0.1]]))
    assert batch.ok.tolist() == [True, False] and "event floor: the gap is -0.1 at the start" in batch.status[1]
    assert batch.events[1] == () and len(batch.events[0]) == 1


def test_simulations_that_go_on_together(dropped):
    """Rows that are moved step by step are those of single ones, also after some are reset."""
    sims = ncgen.start(dropped, 4)
    sims.q[:, 0] = HEIGHTS
    alone = [ncgen.start(dropped, q0={"P.y": height}) for height in HEIGHTS]
    for _ in range(20):
        sims.step(0.05)
        for each in alone:
            each.step(0.05)
        assert np.array_equal(sims.q, [each.q for each in alone]) and np.array_equal(sims.qd, [each.qd for each in alone])
    assert [len(each) for each in sims.events] == [len(each.events) for each in alone]
    assert not sims.stopped.any() and sims.qdd[0, 0] == pytest.approx(alone[0].qdd[0], abs=1e-12)
    kept = sims.states
    first = sims.step(0.3).states
    again = sims.reset(states=kept).step(0.3).states
    assert np.array_equal(first.q, again.q) and [len(p.happened) for p in first.pasts] == [len(p.happened) for p in again.pasts]


def test_a_simulation_that_an_event_ends_stays():
    m, s = sliding_block("ended")
    m.torque(s, m.input("push"))
    m.event("wall", when=s - 0.5, direction="rising", do="stop")
    sims = ncgen.start(ncgen.compile(m), 2)
    sims.step(1.0, push=[0.1, 1.0]).step(1.0)
    assert sims.stopped.tolist() == [False, True] and sims.t == pytest.approx([2.0, 1.0]) and sims["s"] == pytest.approx([0.2, 0.5])
    sims.reset([1]).step(0.5)
    assert sims.t == pytest.approx([2.5, 0.5]) and not sims.stopped.any() and len(sims.events[1]) == 0


def test_simulations_that_cannot_begin(dropped):
    """The others have moved."""
    sims = ncgen.start(dropped, 2)
    sims.q[1] = -0.1
    with pytest.raises(ncgen.ConvergenceError, match="simulation 1 of 2: event floor: the gap is -0.1"):
        sims.step(0.1)
    assert sims.stuck.tolist() == [False, True] and sims.t == pytest.approx([0.1, 0.0])
    assert sims.q[:, 0] == pytest.approx([1 - G / 200, -0.1]) and math.isclose(sims.t[0], 0.1)


def test_simulations_that_cannot_begin_are_counted(dropped):
    sims = ncgen.start(dropped, 3)
    sims.q[1:] = -0.1
    with pytest.raises(ncgen.ConvergenceError, match=r"^simulation 1 of 3 \(and 1 others?\): event floor: the gap is -0.1"):
        sims.step(0.1)


def test_rows_that_stick():
    """T5 from its velocity and from half of it: each row rests at its own time and place, as alone."""
    m, s = sliding_block("oscillator")
    m.torque(s, -s)
    m.friction(s, coulomb=1.0)
    kernels = ncgen.compile(m)
    method = {"rtol": 1e-11, "integrator": "dop853"}
    batch = ncgen.simulate(kernels, 30.0, q0=np.full((2, 2), 12.0), zd0=np.array([[6.0], [3.0]]), z=("s",), **method)
    assert batch.ok.all() and [each[-1].transition for each in batch.events] == ["sticks", "sticks"]
    assert batch.events[0][-1].t == pytest.approx(22.42355635069909, rel=1e-9)
    assert batch.q[0, -1, 0] == pytest.approx(1 - (math.sqrt(205) - 14), abs=1e-10)
    alone = ncgen.simulate(kernels, 30.0, points=2, **method, q0={"s": 12.0, "A.x": 12.0}, qd0={"s": 3.0})
    assert batch.q[1, -1] == pytest.approx(alone.q[-1], abs=1e-13) and len(batch.events[1]) == len(alone.events)


def test_simulations_that_stick():
    """Rows that are moved step by step go into modes of their own."""
    m, s = sliding_block("oscillator")
    m.torque(s, -s)
    m.friction(s, coulomb=1.0)
    sims = ncgen.start(ncgen.compile(m), 2, rtol=1e-11, q0={"s": 12.0, "A.x": 12.0}, qd0={"s": 6.0})
    sims.q[1], sims.qd[1] = 0.5, 0.0
    for _ in range(60):
        sims.step(0.5)
    assert sims["s"] == pytest.approx([1 - (math.sqrt(205) - 14), 0.5], abs=1e-10) and np.max(np.abs(sims.qd)) < 1e-14
    assert sims.qdd == pytest.approx(np.zeros((2, 2)), abs=1e-12)
