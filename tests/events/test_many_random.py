"""Batches of random mechanisms with locks, clutches, ratchets, friction, impacts, pulses and an input: each state is what it is alone."""

from __future__ import annotations

import numpy as np
import pytest
import sympy
from batched import compare
from oracles.planar_models import Drawn

import ncgen
from ncgen.solver.engines import acceleration_forms

KINDS = ("lock", "clutch", "ratchet", "friction", "impact", "level", "pulse", "speed")

INPUTS = {"u": ([0.0, 0.25, 0.5, 1.0], [0.0, 3.0, -4.0, 2.0])}


def eventful(seed: int) -> ncgen.Model:
    """A random planar mechanism with three kinds of events, some of which depend on v."""
    random, drawn = np.random.default_rng(seed + 1000), Drawn(seed)
    m, points = drawn.model, [each for each in drawn.pins if not each.fixed]
    coordinates = [*drawn.angles, *(each.x for each in points), *(each.y for each in points)]
    v, u = m.parameter("v", 1.0), m.input("u")

    def some() -> object:
        return coordinates[random.integers(len(coordinates))]

    def times() -> dict[str, object]:
        return {"when": random.uniform(0.1, 0.5) * v - m.time, "until": random.uniform(0.5, 0.9) - m.time}

    for kind in random.choice(KINDS, size=3, replace=False):
        if kind == "lock":
            m.lock(some(), **times(), name="locked")
        if kind == "clutch" and len(drawn.angles) > 1:
            m.clutch(*drawn.angles[:2], **times(), name="clutch")
        if kind == "ratchet":
            m.ratchet(some(), direction=str(random.choice(("rising", "falling"))), name="pawl")
        if kind == "friction":
            m.friction(some(), coulomb=float(10 ** random.uniform(-1, 1)), name="rubs")
        if kind == "impact":
            point = points[random.integers(len(points))]
            m.event("wall", point.y - float(point.initial[1]) + random.uniform(0.05, 0.3), do=ncgen.impact(0.5, order="in turn"))
        if kind == "level":
            m.event("level", some() * random.uniform(0.5, 1.0) - some(), "either")
        if kind == "pulse":
            m.force(points[-1], (5 * sympy.Heaviside(m.time - 0.3 * v) - 9 * sympy.Heaviside(m.time - 0.5 * v), u))
        if kind == "speed" and drawn.angles:
            rate = drawn.angles[0].rate
            m.event("fast", rate - 1.0, "either", do={f"rate({drawn.angles[0].name})": 0.5 * rate})
    m.event("tick", m.time - 0.7, "rising")
    return m


SEEDS = [43, 71, 84, 105, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (10, 18, 19, 26, 49, 68, 82, 91, 92, 114))]


@pytest.mark.parametrize("seed", SEEDS)
def test_what_a_random_mechanism_does_is_what_it_does_alone(seed, monkeypatch):
    """With what is held moving by the matrix, as in batches."""
    kernels = ncgen.compile(eventful(seed))
    values, form_of = np.array([1.0, 0.7]), acceleration_forms.form_of
    batch = ncgen.simulate(kernels, 1.0, points=5, p={"v": values}, inputs=INPUTS, rtol=1e-8)
    assert batch.ok.all() and not batch.alone.any()
    by_matrix = lambda each, method: "dense" if each is not kernels and each.m > kernels.m else form_of(each, method)  # noqa: E731
    monkeypatch.setattr(acceleration_forms, "form_of", by_matrix)
    for i, v in enumerate(values.tolist()):
        compare(batch, i, ncgen.simulate(kernels, 1.0, points=5, p={"v": v}, inputs=INPUTS, rtol=1e-8, integrator="dopri5"), 1e-7)
