"""Random lines and circles across a thrown ball: every crossing is found, and no other, against roots with 30 digits.

The parabola of the ball is exact in one step of any length, so lines are polynomials of degree 2 and circles of degree 4 in time, and many
graze.
"""

from __future__ import annotations

import mpmath
import numpy as np
import pytest

import ncgen

G, SECONDS = 9.81, 1.5

UNSEEN = 5e-11
"""What parts two crossings, over the sizes of the terms, below which a polynomial is not compared: ten times what rounding leaves."""


@pytest.fixture(scope="module")
def kernels():
    m = ncgen.Model("thrown")
    P = m.point("P", (0, 0))
    m.body("ball", [P], mass=1.0)
    m.gravity((0, -G))
    a, b, c, x, y, r = (m.parameter(name, 1.0) for name in ("a", "b", "c", "x0", "y0", "r"))
    m.event("line", when=a * P.x + b * P.y + c, direction="either")
    m.event("circle", when=(P.x - x) ** 2 + (P.y - y) ** 2 - r.symbol**2, direction="either")
    return ncgen.compile(m)


def expected(coefficients: list) -> tuple[list[float], float]:
    """Roots in the run, of a polynomial in time with the highest power first, and how clearly they are seen, over the largest value."""
    with mpmath.workdps(30):
        end = mpmath.mpf(SECONDS)
        roots = mpmath.polyroots(coefficients, maxsteps=500, extraprec=400)
        real = sorted(mpmath.re(z) for z in roots if abs(mpmath.im(z)) < mpmath.mpf(10) ** -20)
        bends = mpmath.polyroots(mpmath_derivative(coefficients), maxsteps=500, extraprec=400) if len(coefficients) > 2 else []
        places = [mpmath.mpf(0), end, *(mpmath.re(z) for z in bends if abs(mpmath.im(z)) < 1e-15 and 0 < mpmath.re(z) < end)]
        values = [abs(mpmath.polyval(coefficients, s)) for s in places]
        size = max(sum(abs(c) * end**k for k, c in enumerate(reversed(coefficients))), 1)
        return [float(s) for s in real if 0 < s < end], float(min(values) / size)


def mpmath_derivative(coefficients: list) -> list:
    degree = len(coefficients) - 1
    return [c * (degree - k) for k, c in enumerate(coefficients[:-1])]


def square(p: list) -> list:
    found = [mpmath.mpf(0)] * (2 * len(p) - 1)
    for i, u in enumerate(p):
        for j, v in enumerate(p):
            found[i + j] += u * v
    return found


def compare(kernels, seed: int, count: int) -> tuple[int, int]:
    """How many conditions were compared, and how many crossings they have."""
    random, compared, crossings = np.random.default_rng(seed), 0, 0
    for _ in range(count):
        vx, vy, a, b, x, y = random.uniform(-5, 5, 6).tolist()
        apex = random.uniform(0, SECONDS)  # line and circle touch the path near its point at this time, half of them by hardly anything
        near = float(random.choice([0.1, 10.0 ** random.uniform(-10, -3)]) * random.choice([-1, 1]))
        px, py = vx * apex, vy * apex - G * apex**2 / 2
        if random.random() < 0.5:
            a, b = vy - G * apex, -vx  # along the path
        c, r = -(a * px + b * py) + near, float(np.hypot(px - x, py - y)) + near
        if not r > 0:
            continue
        p = dict(zip(("a", "b", "c", "x0", "y0", "r"), (a, b, c, x, y, r), strict=True))
        run = ncgen.simulate(kernels, SECONDS, points=2, p=p, qd0={"P.x": vx, "P.y": vy}, rtol=1e-10)
        with mpmath.workdps(30):
            X, Y = [mpmath.mpf(0), mpmath.mpf(vx), mpmath.mpf(0)], [-mpmath.mpf(G) / 2, mpmath.mpf(vy), mpmath.mpf(0)]
            line = [a * u + b * v for u, v in zip(X, Y, strict=True)]
            line[-1] += mpmath.mpf(c)
            circle = [u + v for u, v in zip(square([*X[:2], -mpmath.mpf(x)]), square([*Y[:2], -mpmath.mpf(y)]), strict=True)]
            circle[-1] -= mpmath.mpf(r) ** 2
        for name, polynomial in (("line", line), ("circle", circle)):
            roots, clear = expected(polynomial)
            if clear < UNSEEN:
                continue
            found = [each.t for each in run.events if each.name == name]
            assert len(found) == len(roots), (name, p, vx, vy, found, roots)
            assert found == pytest.approx(roots, abs=1e-5), (name, p, vx, vy)
            compared, crossings = compared + 1, crossings + len(roots)
    return compared, crossings


def test_random_conditions(kernels):
    compared, crossings = compare(kernels, 1, 25)
    assert compared > 30 and crossings > 15


@pytest.mark.slow
def test_many_random_conditions(kernels):
    compared, crossings = compare(kernels, 2, 10_000)
    print(f"{compared} conditions with {crossings} crossings: none missed, none false")
    assert compared > 15_000 and crossings > 10_000
