"""Batches with events in C: each motion is what it is alone, whatever its neighbours, threads and chunks are."""

from __future__ import annotations

import math

import numpy as np
import pytest
import sympy
from batched import compare, numbers, told
from bouncing import G, ball
from oracles.planar_models import Drawn
from sliding import sliding_block

import ncgen
from ncgen.model.elements import Point
from ncgen.solver.events.many_runs import CHUNK, refusal_in_c

COUNT = 6


def between_floors(seed: int) -> ncgen.Kernels:
    """A random mechanism that hits a floor and a roof, counts how often it passes a level, and may be ended."""
    random, model = np.random.default_rng(seed), Drawn(seed).model
    A = [each for each in model.elements.values() if isinstance(each, Point) and not each.name.startswith("L")][-1]
    y = ncgen.simulate(ncgen.compile(model), 1.0, points=200).point(A.name)[:, 1]
    e, passed = model.parameter("e", 0.5), model.parameter("passed", 0.0)
    floor, roof = y[0] - random.uniform(0.1, 0.6) * np.ptp(y), y[0] + random.uniform(0.2, 0.6) * np.ptp(y)
    model.event("floor", when=A.y - floor, do=ncgen.impact(restitution=e, order="simultaneous"))
    model.event("roof", when=roof - A.y, do=ncgen.impact(restitution=e, order="simultaneous"))
    model.event("seen", when=A.y - 0.9 * floor - 0.1 * roof, direction="either", do={"passed": passed + 1})
    model.event("late", when=model.time - 0.9, direction="rising", do="stop" if seed % 2 else None)
    return ncgen.compile(model)


@pytest.mark.parametrize("seed", [10, 14, 43, *(pytest.param(k, marks=pytest.mark.slow) for k in (5, 9, 11, 18, 19, 34, 40, 42))])
def test_random_mechanisms_are_what_they_are_alone(seed):
    kernels = between_floors(seed)
    restitution = np.random.default_rng(seed).uniform(0.0, 0.9, COUNT)
    batch = ncgen.simulate(kernels, 1.0, points=7, p={"e": restitution}, rtol=1e-9)
    assert not batch.alone.any() and sum(map(len, batch.events)) > COUNT
    for i, e in enumerate(restitution.tolist()):
        run = ncgen.simulate(kernels, 1.0, points=7, p={"e": e}, rtol=1e-9, integrator="dopri5")
        compare(batch, i, run, 1e-8)
        assert batch.steps[i] == run.statistics.steps and (batch.status[i] == "ok") == (run.t[-1] == 1.0)


def test_neighbours_and_threads_make_no_difference():
    kernels = ncgen.compile(ball())
    heights = np.linspace(0.1, 2.0, 2 * CHUNK + 5)
    one, two = (ncgen.simulate(kernels, 1.5, points=5, q0=heights[:, None], threads=threads) for threads in (1, 2))
    last = ncgen.simulate(kernels, 1.5, points=5, q0=heights[-1:, None])
    assert one.q.tobytes() == two.q.tobytes() and one.qd.tobytes() == two.qd.tobytes() and one.work.tobytes() == two.work.tobytes()
    assert one.q[-1].tobytes() == last.q[0].tobytes()
    for a, b in zip(one.events, two.events, strict=True):
        assert told(a) == told(b) and numbers(a).tobytes() == numbers(b).tobytes()
    assert numbers(one.events[-1]).tobytes() == numbers(last.events[0]).tobytes()


def test_gaps_that_rest_and_leave():
    """Lifted by 4 t each ball leaves the floor at G/4, however it came to rest."""
    m = ball()
    m.force(m.elements["P"], (0, 4 * m.time))
    batch = ncgen.simulate(ncgen.compile(m), 4.0, p={"e": np.array([0.0, 0.3, 0.5])})
    assert batch.ok.all() and not batch.alone.any()
    for events in batch.events:
        rests, leaves = (each for each in events if each.transition)
        assert (rests.transition, leaves.transition, leaves.search) == ("rests", "leaves", "sampled") and rests.limit is not None
        assert leaves.t == pytest.approx(G / 4, rel=1e-9)
    assert batch.q[:, -1, 0] == pytest.approx(2 * (4.0 - G / 4) ** 3 / 3, rel=1e-7)


def test_thousands_of_events_of_one_motion():
    """More than C has room for at a time: bounces without loss from 1 mm."""
    m = ball(1.0)
    first, seconds = math.sqrt(2e-3 / G), 60.0
    batch = ncgen.simulate(ncgen.compile(m), seconds, q0=np.array([[1e-3], [1.0]]), rtol=1e-10)
    times = np.array([each.t for each in batch.events[0]])
    assert len(times) == int((seconds / first + 1) / 2) > 2000
    assert times == pytest.approx(first * (2 * np.arange(len(times)) + 1), rel=1e-9)
    assert len(batch.events[1]) == int((seconds / math.sqrt(2 / G) + 1) / 2)


def test_a_progress_that_ends_a_batch():
    """Those that were done are there; the others are interrupted."""
    kernels = ncgen.compile(ball())

    def stop(share: float) -> None:
        if share > 0.2:
            raise RuntimeError("enough")

    with pytest.raises(RuntimeError, match="enough") as raised:
        ncgen.simulate(kernels, 1.0, q0=np.linspace(0.5, 1.0, 4 * CHUNK)[:, None], progress=stop, threads=1)
    found = raised.value.trajectory
    assert found.status.count("ok") == CHUNK and found.status.count("interrupted") == 3 * CHUNK
    assert np.isfinite(found.q[0]).all() and np.isnan(found.q[-1]).all() and found.events[0] and not found.events[-1]


def test_what_is_not_in_c_runs_alone():
    m = ball()
    m.event("seen", when=m.elements["P"].y - 0.5, do=lambda at, kernels: None)
    kernels = ncgen.compile(m)
    batch = ncgen.simulate(kernels, 0.5, q0=np.array([[1.0], [0.8]]))
    assert batch.ok.all() and batch.alone.all() and "no table" in refusal_in_c(kernels)
    assert refusal_in_c(ncgen.compile(ball())) is None


def belt() -> ncgen.Model:
    """1 kg on a spring of 1 N/m and a belt, in the frame of the belt."""
    m, u = sliding_block("belt")
    m.torque(u, -(u + m.parameter("v", 3.0) * m.time))
    m.friction(u, coulomb=3.0, static=5.0, name="belt")
    return m


def pushed() -> ncgen.Model:
    """A block with friction that is pushed to stops, and back."""
    m, s = sliding_block("pushed")
    m.torque(s, 3 * m.time - 2.0)
    m.friction(s, coulomb=m.parameter("v", 1.0))
    m.stop(s, lower=-0.5, upper=1.0, restitution=0.4)
    return m


def hanging() -> ncgen.Model:
    """Two bars with friction in both hinges, one of which sticks where the other moves."""
    m = ncgen.Model("hanging")
    O, P, Q = m.point("O", (0, 0), fixed=True), m.point("P", (1, 0)), m.point("Q", (2, 0))
    x, z = m.vector("x", (1, 0, 0), fixed=True), m.vector("z", (0, 0, 1), fixed=True)
    m.body("upper", [O, P], mass=1.0, inertia="rod")
    m.body("lower", [P, Q], mass=1.0, inertia="rod")
    a, b, v = m.angle("a", x, P - O, z), m.angle("b", x, Q - P, z), m.parameter("v", 1.0)
    m.gravity((0, -G))
    m.friction(a, coulomb=v)
    m.friction(b, coulomb=2 * v, other=a)
    return m


@pytest.mark.parametrize(
    ("model", "seconds", "values", "close"),
    [(belt, 12.0, (1.0, 2.0, 3.0), 1e-12), (pushed, 2.5, (0.5, 1.5, 2.5), 1e-12), (hanging, 3.0, (0.3, 1.0, 20.0), 1e-6)],
    ids=["belt", "pushed", "hanging"],
)
def test_joints_that_stick_are_what_they_are_alone(model, seconds, values, close):
    """What sticks moves by the matrix in C, alone by a recursion where there is one: then within the tolerance."""
    kernels = ncgen.compile(model())
    batch = ncgen.simulate(kernels, seconds, points=7, p={"v": np.array(values)}, rtol=1e-9)
    assert batch.ok.all() and not batch.alone.any()
    for i, v in enumerate(values):
        run = ncgen.simulate(kernels, seconds, points=7, p={"v": v}, rtol=1e-9, integrator="dopri5", z=batch.independent)
        assert told(batch.events[i]) == told(run.events) and any(each.transition for each in run.events)
        assert numbers(batch.events[i]) == pytest.approx(numbers(run.events), rel=close, abs=close)
        assert batch.q[i] == pytest.approx(run.q, abs=close) and batch.work[i] == pytest.approx(run.work, abs=close)


def test_a_failure_is_reported_as_alone():
    """The message is that of a single run, and the other motion arrives."""
    m = ball()
    m.event("kick", when=m.elements["P"].y - 0.5, do={"rate(P.y)": m.parameter("square", 4.0) ** 0.5})
    kernels = ncgen.compile(m)
    batch = ncgen.simulate(kernels, 0.4, p={"square": np.array([4.0, -1.0])})
    assert batch.ok.tolist() == [True, False] and batch.alone.tolist() == [False, True]
    assert batch.q[0, -1, 0] > 0.5
    with pytest.raises(ncgen.NcgenError) as raised:
        ncgen.simulate(kernels, 0.4, p={"square": -1.0}, integrator="dopri5")
    assert batch.status[1] == str(raised.value) and "event kick" in batch.status[1]


def test_conditions_found_by_bounds():
    """A bar on a pin passes sin 3a = 1/5, as alone."""
    m = ncgen.Model("bar")
    O, P = m.point("O", (0, 0), fixed=True), m.point("P", (1, 0))
    x, z = m.vector("x", (1, 0, 0), fixed=True), m.vector("z", (0, 0, 1), fixed=True)
    m.body("bar", [O, P], mass=1.0, inertia="rod")
    a = m.angle("a", x, P - O, z)
    m.gravity((0, -G))
    m.event("passes", when=sympy.sin(3 * a) - 0.2, direction="either")
    kernels = ncgen.compile(m)
    batch = ncgen.simulate(kernels, 2.0, zd0=np.array([[0.5], [1.0], [2.0]]), z=("a",))
    assert not batch.alone.any()
    for i, rate in enumerate((0.5, 1.0, 2.0)):
        run = ncgen.simulate(kernels, 2.0, zd0={"a": rate}, z=("a",), integrator="dopri5")
        assert told(batch.events[i]) == told(run.events) and {each.search for each in batch.events[i]} == {"interval"}
        assert [each.t for each in batch.events[i]] == pytest.approx([each.t for each in run.events], rel=1e-13)
