"""Motions with events as a batch, beside a loop of single runs and the batch of the same mechanisms without events.

`python tests/benchmarks/event_batches.py` prints a table. Times of the processor, the least of some pairs in one process, on one thread.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

import ncgen
from ncgen.exchange.examples import example_module

COUNT = 64
PAIRS = 5


@dataclass(frozen=True)
class Scene:
    """A mechanism with events, the same without, seconds, what varies as arguments of a batch, and of single runs."""

    name: str
    eventful: ncgen.Model
    smooth: ncgen.Model
    seconds: float
    together: dict[str, Any]
    alone: list[dict[str, Any]]


def ball(eventful: bool) -> ncgen.Model:
    m = ncgen.Model("ball")
    P = m.point("P", (0, 1), fixed="x")
    m.body("ball", [P], mass=1.0)
    m.gravity((0, -9.81))
    if eventful:
        m.event("floor", when=P.y, do=ncgen.impact(restitution=0.5))
    return m


def four_bar(eventful: bool) -> ncgen.Model:
    m = ncgen.load("fourbar")
    if eventful:
        m.stop(m.elements["psi"], lower=-0.5, upper=0.3, restitution=0.6)
    return m


def oscillator(eventful: bool) -> ncgen.Model:
    m, s = example_module(".", "winch.py").mass_on_x("oscillator", 12.0)
    if eventful:
        m.friction(s, coulomb=1.0)
    return m


def discs(eventful: bool) -> ncgen.Model:
    """Two on one axis, and a clutch that closes and opens."""
    m = ncgen.Model("discs")
    O, x, z = m.point("O", (0, 0), fixed=True), m.vector("x", (1, 0, 0), fixed=True), m.vector("z", (0, 0, 1), fixed=True)
    angles = []
    for name, inertia in (("first", 2.0), ("second", 3.0)):
        P = m.point(name, (1, 0))
        m.body(f"{name}.disc", [O, P], mass=1.0, com=(0, 0), inertia=inertia)
        angles.append(m.angle(f"{name}.angle", x, P - O, z))
    if eventful:
        m.clutch(*angles, when=0.5 - m.time, until=1.0 - m.time, name="clutch")
    return m


def thrown(eventful: bool) -> ncgen.Model:
    """A point that bounces with friction, slides and sticks."""
    m = ncgen.Model("thrown")
    P = m.point("P", (0, 0.5))
    body = m.body("point", [P], mass=1.0)
    m.gravity((0, -9.81))
    if eventful:
        up, O = m.vector("up", (0, 1), fixed=True), m.point("O", (0, 0), fixed=True)
        m.contact("floor", body, P, m.ground, O, normal=up, friction=0.2, restitution=0.4)
    return m


def scenes() -> Iterator[Scene]:
    heights = np.linspace(0.5, 1.5, COUNT)
    yield Scene("balls, 1.3 s", ball(True), ball(False), 1.3, {"q0": heights[:, None]}, [{"q0": {"P.y": h}} for h in heights.tolist()])
    rates = np.linspace(1.0, 6.0, COUNT)
    bars = {"zd0": rates[:, None], "z": ("psi",)}
    yield Scene("four-bars, 1 s", four_bar(True), four_bar(False), 1.0, bars, [{"zd0": {"psi": w}, "z": ("psi",)} for w in rates.tolist()])
    blocks = {"zd0": rates[:, None], "z": ("s",)}
    yield Scene(
        "oscillators, 30 s", oscillator(True), oscillator(False), 30.0, blocks, [{"zd0": {"s": w}, "z": ("s",)} for w in rates.tolist()]
    )
    starts = np.column_stack([rates, np.zeros(COUNT)])
    for name, model, seconds, z in (
        ("discs with a clutch, 1.5 s", discs, 1.5, ("first.angle", "second.angle")),
        ("thrown points, 2 s", thrown, 2.0, ("P.x", "P.y")),
    ):
        alone = [{"zd0": dict(zip(z, start, strict=True)), "z": z} for start in starts.tolist()]
        yield Scene(name, model(True), model(False), seconds, {"zd0": starts, "z": z}, alone)


def spent(call: Callable[[], object]) -> float:
    """Seconds of the processor."""
    begun = time.process_time()
    call()
    return time.process_time() - begun


def main() -> None:
    print("| 64 motions | events | steps | of the smooth batch | one run | batch, a motion | of a loop of runs | of the smooth batch |")
    print("|---|---|---|---|---|---|---|---|")
    for scene in scenes():
        kernels, smooth = ncgen.compile(scene.eventful), ncgen.compile(scene.smooth)

        def together(kernels: ncgen.Kernels = kernels, scene: Scene = scene) -> ncgen.BatchTrajectory:
            return ncgen.simulate(kernels, scene.seconds, points=11, threads=1, **scene.together)

        def loop(kernels: ncgen.Kernels = kernels, scene: Scene = scene) -> None:
            for start in scene.alone:
                ncgen.simulate(kernels, scene.seconds, points=11, integrator="dopri5", **start)

        def without(kernels: ncgen.Kernels = smooth, scene: Scene = scene) -> ncgen.BatchTrajectory:
            return ncgen.simulate(kernels, scene.seconds, points=11, threads=1, **scene.together)

        batch = together()
        assert batch.ok.all(), next(status for status in batch.status if status != "ok")
        loop()
        steps = f"{batch.steps.sum()} | {without().steps.sum()}"
        times = np.array([[spent(each) for each in (together, loop, without)] for _ in range(PAIRS)]).min(axis=0) / COUNT * 1e6
        events, (batched, single, plain) = sum(map(len, batch.events)), times.tolist()
        ratios = f"1/{single / batched:.0f} | {batched / plain:.1f}"
        print(f"| {scene.name} | {events} | {steps} | {single:,.0f} µs | {batched:,.0f} µs | {ratios} |")


if __name__ == "__main__":
    main()
