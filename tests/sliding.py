"""A body that slides along x, for laws of time that push it: its motion is the law's integral."""

from __future__ import annotations

import ncgen
from ncgen.model.elements import Relative


def sliding_block(name: str, mass: float = 1.0) -> tuple[ncgen.Model, Relative]:
    """A mass (kg) on a slide along A.x, at rest, and how far it is (m); nothing pushes it yet."""
    m = ncgen.Model(name)
    axis = m.vector("axis", (1, 0, 0), fixed=True)
    O, A = m.point("O", (0, 0), fixed=True), m.point("A", (0, 0), fixed="y")
    s = m.slide("s", O, A, axis)
    m.body("block", [A], mass=mass)
    m.independent(s)
    return m, s
