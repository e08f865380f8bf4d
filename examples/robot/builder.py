"""The same robot said call by call: points, vectors, bodies, rows and angles by name."""

from collections.abc import Sequence

import numpy as np

from ncgen import Model
from ncgen.model.bodies import Body
from ncgen.model.elements import Point, Spatial, Vector


def build(scale: bool = True, form: str = "smooth") -> Model:
    m = Model("robot", scale=scale, form=form)

    # Coordinates in the order of the paper's q (eq. 9).
    r1 = m.point("r1", (0, 0, 0), fixed=True)
    r2 = m.point("r2", (0, 0.2088, 0.6683))
    u1 = m.vector("u1", (0, 0, 1), fixed=True)
    u2 = m.vector("u2", (0, 1, 0), fixed=True)
    u3 = m.vector("u3", (1, 0, 0))
    r3 = m.point("r3", (0, -0.1827, 0.7257))
    r4 = m.point("r4", (0, 0.2088, 1.7647))
    r5 = m.point("r5", (0, -0.1827, 1.8221))
    r6 = m.point("r6", (0, 0.2871, 2.0257))
    r7 = m.point("r7", (0, 1.4130, 1.3757))
    u4 = m.vector("u4", (1, 0, 0))
    r8 = m.point("r8", (0, 1.6427, 1.3757))
    u5 = m.vector("u5", (0, 0, 1))

    def middle(a: Point, b: Point, share: float = 0.5) -> np.ndarray:
        return a.initial + share * (b.initial - a.initial)

    # Bodies with their inertia: bodies 2 and 3 from Table 6, the others are ours.
    def body(
        name: str,
        points: list[Point],
        vectors: list[Vector],
        mass: float,
        com: Sequence[float] | np.ndarray,
        inertia: Sequence[float],
        basis: list[Spatial] | None = None,
    ) -> Body:
        # The rows that keep it rigid follow below, as in the paper.
        return m.body(name, points, vectors, mass, com, inertia, basis=basis, rigid=False)

    body2 = body("body2", [r1, r2, r3], [u1, u3], 200.0, (0, 0, 0.45), (10.396, 10.396, 17.793), basis=[r1, r2, u1, u3])
    body3 = body("body3", [r2, r4], [u3], 250.0, (0, 0.2088, 1.2165), (27.263, 27.263, 4.476))
    body4 = body("body4", [r3, r5], [u3], 20.0, middle(r3, r5), (2, 2, 0.05))
    body5 = body("body5", [r4, r6, r5], [u3], 120.0, (0, 0.15, 1.95), (6, 5, 4))
    body6 = body("body6", [r6, r7], [u3], 40.0, middle(r6, r7, 0.2), (1.2, 0.9, 0.9))
    body7 = body("body7", [r6, r7], [u4], 60.0, middle(r6, r7, 0.6), (4, 1.5, 3))
    body8 = body("body8", [r7, r8], [u4], 15.0, (0, 1.5, 1.3757), (0.1, 0.08, 0.1))
    body9 = body("body9", [r7, r8], [u5], 10.0, (0, 1.62, 1.3757), (0.05, 0.03, 0.05))

    # Rigid-body rows (eqs 10-34); lengths and cosines are those of the initial position.
    m.distance(r1, r2, owner=body2)
    m.distance(r2, r3, owner=body2)
    m.distance(r3, r1, owner=body2)
    m.unit(u3, owner=body2)
    m.vector_segment(u3, r1 - r2, owner=body2)
    m.vector_segment(u3, r2 - r3, owner=body2)
    m.vector_vector(u1, u3, owner=body2)
    m.vector_segment(u1, r1 - r2, owner=body2)
    m.distance(r2, r4, owner=body3)
    m.vector_segment(u3, r2 - r4, owner=body3)
    m.distance(r3, r5, owner=body4)
    m.vector_segment(u3, r3 - r5, owner=body4)
    m.distance(r4, r5, owner=body5)
    m.distance(r5, r6, owner=body5)
    m.distance(r6, r4, owner=body5)
    m.vector_segment(u3, r4 - r5, owner=body5)
    m.vector_segment(u3, r4 - r6, owner=body5)
    m.distance(r6, r7, owner=body6)
    m.vector_segment(u3, r6 - r7, owner=body6)
    m.vector_segment(u4, r6 - r7, owner=body7)
    m.unit(u4, owner=body7)
    m.distance(r7, r8, owner=body8)
    m.vector_segment(u4, r7 - r8, owner=body8)
    m.vector_segment(u5, r7 - r8, owner=body9)
    m.unit(u5, owner=body9)

    # Relative angles with the senses of section 3.3 (eqs 35-46).
    psi = [
        m.angle("psi1", start=u2, end=u3, axis=u1),
        m.angle("psi2", start=r4 - r2, end=u1, axis=u3),
        m.angle("psi3", start=r4 - r6, end=r7 - r6, axis=u3),
        m.angle("psi4", start=u3, end=u4, axis=r7 - r6),
        m.angle("psi5", start=r6 - r7, end=r8 - r7, axis=u4),
        m.angle("psi6", start=u4, end=u5, axis=r8 - r7),
    ]
    m.independent(*psi)

    m.line(r1, r2, r3)
    m.line(r1, r3)
    m.line(r2, r4)
    m.line(r3, r5)
    m.line(r4, r5)
    m.line(r5, r6)
    m.line(r6, r4)
    m.line(r6, r7)
    m.line(r7, r8)
    for point, vector in [(r1, u1), (r1, u2), (r2, u3), (r3, u3), (r4, u3), (r5, u3), (r6, u3), (r7, u4), (r8, u5)]:
        m.arrow(point, vector)

    m.gravity((0, 0, -9.81))
    m.simulation(duration=0.5)
    return m
