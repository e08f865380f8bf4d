"""A satellite unfolds its panels: torsion springs push, cable loops couple hinges, the free hub gives way.

Dimensions are ours: a cubic hub of 1.6 m, a yoke and panels that fold flat on its side, all in the plane. Every cable loop
is a gear row: each hinge turns twice as far as the first, to alternate sides.
"""

from itertools import pairwise

import numpy as np

from ncgen import Model
from ncgen.model.elements import Angle, Point, Vector

HALF, YOKE, PANEL = 0.8, 0.8, 1.6
"""From the hub's centre to its side, yoke, panel (m)."""

CORNERS = (1, 1), (-1, 1), (-1, -1), (1, -1)

HUB_MASS, YOKE_MASS, PANEL_MASS = 500.0, 4.0, 12.0

STIFFNESS, DAMPING = 1.5, 4.0
"""Of the spring in every hinge (N m/rad, N m s/rad); it is free when the hinge is straight."""


def build(panels: int = 3, free: bool = True) -> Model:
    """Folded and at rest; free=False holds the hub."""
    m = Model("panels")
    z = m.vector("z", (0, 0, 1), fixed=True)
    H, A = m.point("H", (0, 0), fixed=not free), m.point("A", (HALF, 0), fixed=not free)
    hub = m.body("hub", [H, A], mass=HUB_MASS, com=(0, 0), inertia=HUB_MASS * (2 * HALF) ** 2 / 6) if free else m.ground
    corners = [m.attach_point(hub, f"K{i}", HALF * np.array(sides)) for i, sides in enumerate(CORNERS, 1)]
    ends = [m.point(f"P{i}", (HALF, YOKE if i % 2 == 0 else YOKE - PANEL)) for i in range(panels + 1)]
    chain = [H, A, *ends]
    for i, (start, end) in enumerate(pairwise(chain[1:])):
        mass, length = (PANEL_MASS, PANEL) if i else (YOKE_MASS, YOKE)
        m.body(f"panel{i}" if i else "yoke", [start, end], mass=mass, inertia=mass * length**2 / 12)
    hinges = [hinge(m, i, *neighbours, z) for i, neighbours in enumerate(zip(chain, chain[1:], chain[2:]))]
    for i, (first, second) in enumerate(pairwise(hinges)):
        m.gear(first, second, 1 if i else 2, 1)
    m.independent(hinges[0], *((H.x, H.y, A.y) if free else ()))
    m.line(*chain)
    m.line(*corners, corners[0])
    m.simulation(duration=20.0)
    return m


def hinge(m: Model, i: int, before: Point, point: Point, after: Point, axis: Vector) -> Angle:
    """The angle between two neighbours, folded to alternate sides, with its spring."""
    folded = np.pi / 2 if i == 0 else np.pi * (-1) ** i
    angle = m.angle(f"psi{i}", start=point - before, end=after - point, axis=axis, initial=folded)
    m.torsion_spring(angle, STIFFNESS, DAMPING, free_angle=0.0)
    return angle
