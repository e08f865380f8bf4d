"""A ball that bounces, the problem T1 of these tests: dropped from 1 m, its bounces are shorter by the restitution each."""

from __future__ import annotations

import ncgen

G = 9.81


def ball(restitution: float = 0.5, **options: str) -> ncgen.Model:
    """1 kg, dropped from 1 m onto the floor."""
    m = ncgen.Model("ball")
    P = m.point("P", (0, 1), fixed="x")
    m.body("ball", [P], mass=1.0)
    m.gravity((0, -G))
    m.event("floor", when=P.y, do=ncgen.impact(restitution=m.parameter("e", restitution), **options))
    return m
