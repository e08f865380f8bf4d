"""Blocks that rest at a stop without a load and are pushed or pulled later by smooth forces: random cases, and where they end.

A block 1 at its stop (s1 = 0), and perhaps a block 2 that touches it from outside. Forces, positive towards the stop, change by smooth
steps of 0.3 s, which follow each other: a force is 0 before the first one, and again wherever its amplitudes add up to 0.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.polynomial import Polynomial

import ncgen

STARTS, LENGTH, END = (0.7, 1.2, 1.7), 0.3, 2.2
MASSES = (1.0, 2.5)
STEP = Polynomial([0, 0, 0, 10, -15, 6])  # smooth_step of s


@dataclass(frozen=True)
class Case:
    """forces: amplitudes (N) of the steps on every block; gap (m), speed (m/s): of block 1 where it begins, 0 for one that is at its stop;
    side: 1 for a stop above, −1 for one below."""

    forces: tuple[tuple[float, ...], ...]
    gap: float = 0.0
    speed: float = 0.0
    side: int = 1

    @property
    def parameters(self) -> dict[str, float]:
        return {f"F{b}{k}": self.side * value for b, row in enumerate(self.forces, 1) for k, value in enumerate(row)}

    @property
    def arguments(self) -> dict[str, dict[str, float]]:
        """Start and parameters of a run."""
        places = {name: -self.side * self.gap for name in ("s1", "A1.x")}
        velocities = {"s1": self.side * self.speed} | ({"s2": 0.0} if len(self.forces) > 1 else {})
        return {"q0": places, "qd0": velocities, "p": self.parameters}

    def places(self, is_held: str = "") -> list[float]:
        """Where the blocks are at the end (m); is_held: as of `blocks`, since what a ratchet holds stays, whatever pulls."""
        if is_held == "ratchet":
            return [0.0, *([-self.side * _left(self.forces[1], MASSES[1]) if not any(self.forces[0]) else 0.0] if self.forces[1:] else [])]
        if len(self.forces) == 1:
            return [-self.side * _left(self.forces[0], MASSES[0])]
        together = _left(tuple(np.sum(self.forces, axis=0)), sum(MASSES)) if any(self.forces[0]) else 0.0
        return [-self.side * together, -self.side * (together if any(self.forces[0]) else _left(self.forces[1], MASSES[1]))]


def blocks(count: int = 1, side: int = 1, is_held: str = "", case: Case | None = None) -> ncgen.Model:
    """is_held: "ratchet" for one that lets block 1 move towards the stop only, "lock" for one that lets it go at 0.5 s

    case: its forces are the defaults of parameters, which are 0 without it
    """
    forces = case.parameters if case else {}
    m = ncgen.Model(f"blocks{count}{'above' if side > 0 else 'below'}{is_held}")
    axis, O, slides = m.vector("axis", (1, 0, 0), fixed=True), m.point("O", (0, 0), fixed=True), []
    for k in range(1, count + 1):
        A = m.point(f"A{k}", (0, 0), fixed="y")
        slides.append(m.slide(f"s{k}", O, A, axis))
        m.body(f"block{k}", [A], mass=MASSES[k - 1])
        m.independent(slides[-1])
        names = [f"F{k}{i}" for i in range(len(STARTS))]
        steps = zip([m.parameter(name, forces.get(name, 0.0)) for name in names], STARTS, strict=True)
        m.torque(slides[-1], sum(force * ncgen.smooth_step(m.time, start, start + LENGTH) for force, start in steps))
    m.stop(slides[0], **{"upper" if side > 0 else "lower": 0.0}, restitution=m.parameter("e", 0.0), order="simultaneous", name="stop")
    if count > 1:
        m.event("between", side * (slides[0] - slides[1]), do=ncgen.impact(restitution=0.0, order="simultaneous"))
    if is_held == "ratchet":
        m.ratchet(slides[0], direction="rising" if side > 0 else "falling", name="pawl")
    if is_held == "lock":
        m.lock(slides[0], until=0.5 - m.time, name="grip")
    return m


def random_case(rng: np.random.Generator, count: int, side: int, hits: bool) -> Case:
    """Forces that push, pull and vanish, and push no more once a block has left; of two blocks one is loaded."""
    rows = [[0.0] * len(STARTS) for _ in range(count)]
    loaded, total = int(rng.integers(count)), 0.0
    for k in range(len(STARTS)):
        wanted = float(rng.choice([0.0, rng.uniform(0.5, 4.0), -rng.uniform(0.5, 4.0)])) if total >= 0 else total
        rows[loaded][k] = wanted - total
        total = wanted
    speed = float(rng.uniform(0.5, 3.0)) if hits else 0.0
    return Case(forces=tuple(map(tuple, rows)), gap=speed * float(rng.uniform(0.05, 0.6)), speed=speed, side=side)


def _left(amplitudes: tuple[float, ...], mass: float) -> float:
    """How far a block is from its stop at the end that these forces push to it as long as they are positive, and pull from it then."""
    before, place, speed, leaves = 0.0, 0.0, 0.0, False
    for start, end, amplitude in zip(STARTS, (*STARTS[1:], END), amplitudes, strict=True):
        now = before + amplitude if abs(before + amplitude) > 1e-12 else 0.0
        rising = before + amplitude * STEP(Polynomial([-start, 1]) / LENGTH)
        for force, a, b in ((rising, start, start + LENGTH), (Polynomial([now]), start + LENGTH, end)):
            if not leaves and now < 0:
                a, leaves = start + LENGTH * _share(before / (before - now)), True
            if leaves:
                velocity = (force / -mass).integ()
                velocity = velocity - velocity(a) + speed
                way = velocity.integ()
                place, speed = place + way(b) - way(a), velocity(b)
        before = now
    return float(place)


def _share(value: float) -> float:
    """Where the step of s has a value."""
    return float(min((STEP - value).roots(), key=lambda root: abs(root.imag)).real) if value > 0 else 0.0  # it rises everywhere
