"""Blocks that rest at a stop without a load, and smooth forces later: single runs and batches stay or leave as the closed form says."""

from __future__ import annotations

import numpy as np
import pytest
from pushed_later import END, Case, blocks, random_case

import ncgen
from ncgen.report.precision import time_limit
from ncgen.solver.trajectories.happening import Happening


def both(kernels: ncgen.Kernels, case: Case, e: float) -> list[tuple[np.ndarray, tuple[Happening, ...]]]:
    """(rows of q, events) of a single run, and of one in a batch of two, which C carries."""
    start, p = case.arguments, case.arguments["p"] | {"e": e}
    twice = {key: {name: [value, value] for name, value in start[key].items()} for key in ("q0", "qd0")}
    run = ncgen.simulate(kernels, END, points=3, rtol=1e-9, q0=start["q0"], qd0=start["qd0"], p=p)
    batch = ncgen.simulate(kernels, END, points=3, rtol=1e-9, **twice, p=p)
    assert not batch.alone.any()
    return [(run.q, run.events), (batch.q[0], batch.events[0])]


SOME = [(1, 1, ""), (1, -1, ""), (1, 1, "lock"), (1, -1, "ratchet"), (2, 1, ""), (2, -1, "ratchet")]
OTHERS = [(1, -1, "lock"), (1, 1, "ratchet"), (2, -1, ""), (2, 1, "ratchet")]


@pytest.mark.parametrize(("count", "side", "is_held"), [*SOME, *(pytest.param(*each, marks=pytest.mark.slow) for each in OTHERS)])
def test_blocks_stay_or_leave(count, side, is_held):
    """At the stop from the start on, or after an impact without restitution."""
    rng, kernels = np.random.default_rng(3 + count), ncgen.compile(blocks(count, side, is_held))
    places = [kernels.index[f"s{k}"] for k in range(1, count + 1)]
    for number in range(6):
        hits = number % 2 == 1 and count == 1 and is_held != "lock"
        case = random_case(rng, count, side, hits)
        expected = case.places(is_held)
        for e in (0.0,) if hits else (0.0, 0.5):
            for q, _ in both(kernels, case, e):
                assert q[-1, places] == pytest.approx(expected, abs=1e-8), (case, e)


def test_what_is_pushed_is_caught_where_the_force_begins():
    """The stop bears a block from 0.7 s on: not from the middle of the step in which it was seen to sink, and with no impact."""
    for _, (hit, *others) in both(ncgen.compile(blocks()), Case(forces=((3.0, 0.0, 0.0),), gap=0.5, speed=1.0), 0.0):
        assert hit.t == pytest.approx(0.5, abs=1e-9) and hit.impulse == pytest.approx(1.0, rel=1e-8)
        assert others[-1].transition == "rests" and others[-1].t == pytest.approx(0.7, abs=0.01)
        assert sum(event.impulse for event in others) < 1e-6


def test_a_block_that_is_let_go_at_its_instant_is_caught_again():
    """The force ends at 1.5 s, so that the stop lets the block go with what rounding leaves of its gap, and begins again at 1.7 s."""
    kernels = ncgen.compile(blocks())
    for amplitude in (4.0, 3.7738100243527746):
        for q, _ in both(kernels, Case(forces=((amplitude, -amplitude, 2.0),), gap=0.1, speed=1.0), 0.0):
            assert q[-1] == pytest.approx([0.0, 0.0], abs=1e-9)


@pytest.mark.parametrize("integrator", ["radau", "dopri5"])
def test_rounding_of_a_closed_gap_is_no_event_at_every_step(integrator):
    """Stopped at 5 cm/0.66 m/s, the block rests without a load with what rounding leaves of its gap, until a force pulls it away."""
    kernels = ncgen.compile(blocks())
    case = Case(forces=((0.0, -2.0, 0.0),), gap=0.03519545973061816, speed=0.6628854934252688)
    run = ncgen.simulate(kernels, END, points=3, rtol=1e-9, integrator=integrator, progress=time_limit(60.0), **case.arguments)
    assert run["s1"][-1] == pytest.approx(case.places()[0], abs=1e-8)
    assert run.statistics.steps < 1000
