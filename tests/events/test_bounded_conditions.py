"""Conditions that are no polynomials, on the way of a thrown ball: every crossing is found, and no other, against 30 digits.

The parabola of the ball is exact in one step of any length. Of every condition the places where it turns round are known, and half of
the levels graze one of them.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import mpmath
import numpy as np
import pytest
import sympy as sp

import ncgen

G, SECONDS = 9.81, 1.5

UNSEEN = 1e-10
"""What parts a level from the value at a bend, over the size of the condition, below which they are not compared."""


class Way(NamedTuple):
    """x and y of the ball as polynomials in time, highest power first, less a and b."""

    x: list
    y: list

    def at(self, t):
        return mpmath.polyval(self.x, t), mpmath.polyval(self.y, t)


class Condition(NamedTuple):
    """when: less a level, for the model; value: the same with 30 digits; crossings: of (way, level) polynomials whose roots are those of
    the condition, or more; bends: those whose roots are where it may turn round; jumps: the same where it may jump"""

    when: Callable
    value: Callable
    crossings: Callable
    bends: Callable
    jumps: Callable = lambda w: []


def times(p: list, q: list) -> list:
    product = [mpmath.mpf(0)] * (len(p) + len(q) - 1)
    for i, u in enumerate(p):
        for j, v in enumerate(q):
            product[i + j] += u * v
    return product


def plus(p: list, q: list, factor=1) -> list:
    size = max(len(p), len(q))
    return [u + factor * v for u, v in zip([0] * (size - len(p)) + list(p), [0] * (size - len(q)) + list(q), strict=True)]


def slope(p: list) -> list:
    return [c * (len(p) - 1 - k) for k, c in enumerate(p[:-1])]


def _waves(w: Way, level) -> list[list]:
    """sin(3 x + y) + ... = level at multiples of 2 pi."""
    u, first = plus([3 * c for c in w.x], w.y), mpmath.asin(level) if abs(level) <= 1 else None
    if first is None:
        return []
    return [plus(u, [start + 2 * mpmath.pi * k], -1) for start in (first, mpmath.pi - first) for k in range(-12, 13)]


def _squares(w: Way) -> list:
    return plus(times(w.x, w.x), times(w.y, w.y))


CONDITIONS = {
    "direction": Condition(
        lambda x, y: sp.atan2(y, x),
        lambda x, y: mpmath.atan2(y, x),
        lambda w, c: [plus([mpmath.cos(c) * u for u in w.y], [mpmath.sin(c) * u for u in w.x], -1)],
        lambda w: [plus(times(w.x, slope(w.y)), times(w.y, slope(w.x)), -1)],
        lambda w: [w.y],
    ),
    "distance": Condition(
        lambda x, y: sp.sqrt(x**2 + y**2),
        lambda x, y: mpmath.sqrt(x * x + y * y),
        lambda w, c: [plus(_squares(w), [c * c], -1)],
        lambda w: [slope(_squares(w))],
    ),
    "wave": Condition(
        lambda x, y: sp.sin(3 * x + y),
        lambda x, y: mpmath.sin(3 * x + y),
        _waves,
        lambda w: [slope(plus([3 * c for c in w.x], w.y)), *_waves(w, mpmath.mpf(1)), *_waves(w, mpmath.mpf(-1))],
    ),
    "ratio": Condition(
        lambda x, y: y / (x + 20),
        lambda x, y: y / (x + 20),
        lambda w, c: [plus(w.y, [c * u for u in plus(w.x, [20])], -1)],
        lambda w: [plus(times(slope(w.y), plus(w.x, [20])), times(w.y, slope(w.x)), -1)],
    ),
    "cubic": Condition(
        lambda x, y: x * y**2 - y,
        lambda x, y: x * y**2 - y,
        lambda w, c: [plus(plus(times(w.x, times(w.y, w.y)), w.y, -1), [c], -1)],
        lambda w: [slope(plus(times(w.x, times(w.y, w.y)), w.y, -1))],
    ),
    "kink": Condition(
        lambda x, y: sp.Abs(x) + y / 2,
        lambda x, y: abs(x) + y / 2,
        lambda w, c: [plus(plus([side * u for u in w.x], [u / 2 for u in w.y]), [c], -1) for side in (1, -1)],
        lambda w: [w.x, *(slope(plus([side * u for u in w.x], [u / 2 for u in w.y])) for side in (1, -1))],
    ),
    "growth": Condition(
        lambda x, y: sp.exp(x - y),
        lambda x, y: mpmath.exp(x - y),
        lambda w, c: [plus(plus(w.x, w.y, -1), [mpmath.log(c)], -1)] if c > 0 else [],
        lambda w: [slope(plus(w.x, w.y, -1))],
    ),
}


@pytest.fixture(scope="module")
def kernels():
    m = ncgen.Model("bounded")
    P = m.point("P", (0, 0))
    m.body("ball", [P], mass=1.0)
    m.gravity((0, -G))
    a, b = m.parameter("a", 1.0), m.parameter("b", 1.0)
    for name, condition in CONDITIONS.items():
        m.event(name, when=condition.when(P.x - a, P.y - b) - m.parameter(f"{name}.level", 1e3), direction="either")
    return ncgen.compile(m)


def roots_in_run(polynomials: list[list]) -> list:
    """Different real roots in the run."""
    found: list = []
    for p in polynomials:
        while p and abs(p[0]) < mpmath.mpf(10) ** -25:
            p = p[1:]
        roots = _quadratic(*p) if len(p) == 3 else mpmath.polyroots(p, maxsteps=500, extraprec=400) if len(p) > 1 else []
        found += [mpmath.re(z) for z in roots if abs(mpmath.im(z)) < mpmath.mpf(10) ** -18 and 0 < mpmath.re(z) < SECONDS]
    found.sort()
    return [t for k, t in enumerate(found) if k == 0 or t - found[k - 1] > mpmath.mpf(10) ** -18]


def _quadratic(a, b, c) -> list:
    with mpmath.workdps(60):
        root = mpmath.sqrt(mpmath.mpf(b) ** 2 - 4 * mpmath.mpf(a) * c)
        return [(-b + root) / (2 * a), (-b - root) / (2 * a)]


def compare(kernels, seed: int, count: int) -> tuple[int, int]:
    """How many conditions were compared, and how many crossings they have."""
    random, compared, crossings = np.random.default_rng(seed), 0, 0
    for _ in range(count):
        with mpmath.workdps(30):
            vx, vy, a, b = random.uniform(-4, 4, 4).tolist()
            way = Way([mpmath.mpf(vx), -mpmath.mpf(a)], [-mpmath.mpf(G) / 2, mpmath.mpf(vy), -mpmath.mpf(b)])
            bends = {name: roots_in_run(each.bends(way)) for name, each in CONDITIONS.items()}
            levels = {name: _level(random, CONDITIONS[name], way, bends[name]) for name in CONDITIONS}
        p = {"a": a, "b": b} | {f"{name}.level": level for name, level in levels.items()}
        run = ncgen.simulate(kernels, SECONDS, points=2, p=p, qd0={"P.x": vx, "P.y": vy}, rtol=1e-10)
        assert {event.search for event in run.events} <= {"interval"}
        for name, condition in CONDITIONS.items():
            with mpmath.workdps(30):
                level = mpmath.mpf(levels[name])
                values = [condition.value(*way.at(mpmath.mpf(t))) - level for t in (0, *bends[name], SECONDS)]
                if min(map(abs, values)) < UNSEEN * max(1, abs(level), *map(abs, values)):
                    continue
                candidates = roots_in_run(condition.crossings(way, level))
                expected = [float(t) for t in candidates if abs(condition.value(*way.at(t)) - level) < mpmath.mpf(10) ** -15]
                expected = sorted(expected + _jumps(condition, way, level))
            found = [event.t for event in run.events if event.name == name]
            assert len(found) == len(expected), (name, p, vx, vy, found, expected)
            assert found == pytest.approx(expected, abs=2e-5), (name, p, vx, vy)
            compared, crossings = compared + 1, crossings + len(expected)
    return compared, crossings


def _jumps(condition: Condition, way: Way, level) -> list[float]:
    """Where a condition passes its level by a jump, as an angle does at pi."""
    sides = mpmath.mpf(10) ** -15
    return [
        float(t)
        for t in roots_in_run(condition.jumps(way))
        if (condition.value(*way.at(t - sides)) - level) * (condition.value(*way.at(t + sides)) - level) < 0
        and abs(condition.value(*way.at(t - sides)) - condition.value(*way.at(t + sides))) > 1
    ]


def _level(random, condition: Condition, way: Way, bends: list) -> float:
    """A value on the way; half of them next to a value at a bend."""
    near = float(random.choice([-1, 1]) * 10.0 ** random.uniform(-9.5, -2))
    if bends and random.random() < 0.5:
        return float(condition.value(*way.at(bends[random.integers(len(bends))])) + near)
    return float(condition.value(*way.at(mpmath.mpf(random.uniform(0, SECONDS)))))


def test_bounded_conditions(kernels):
    compared, crossings = compare(kernels, 1, 25)
    assert compared > 120 and crossings > 120


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(2, 8))
def test_many_bounded_conditions(kernels, seed):
    compared, crossings = compare(kernels, seed, 300)
    print(f"{compared} conditions with {crossings} crossings: none missed, none false")
    assert compared > 1700 and crossings > 1700
