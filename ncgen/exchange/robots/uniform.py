"""Mass, centre and moments of inertia of shapes of one density: spheres, boxes and others with a formula, and closed surfaces.

Formulas are those of every textbook's table; of a surface they are sums over tetrahedra from the origin to its triangles (Mirtich 1996).
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from ncgen.exchange.robots.robot import Mass
from ncgen.view.triangles import Mesh


def uniform(kind: str, sizes: Sequence[float], density: float) -> Mass | None:
    """Of a shape about its centre, axes along x, y, z (a round one's along z); None where nothing is known of its kind.

    sizes: (x, y, z) of a box, (radius,) of a sphere, three radii of an ellipsoid, (radius, length) of a cylinder, a capsule, whose length
        is that between its half spheres, and a cone, whose centre is the middle of its axis and whose tip is up
    density: kg/m³
    """
    match kind:
        case "box":
            x, y, z = sizes
            return _diagonal(density * x * y * z, [(y * y + z * z) / 12, (x * x + z * z) / 12, (x * x + y * y) / 12])
        case "sphere":
            return uniform("ellipsoid", (*sizes, *sizes, *sizes), density)
        case "ellipsoid":
            a, b, c = sizes
            return _diagonal(density * 4 / 3 * math.pi * a * b * c, [(b * b + c * c) / 5, (a * a + c * c) / 5, (a * a + b * b) / 5])
        case "cylinder":
            r, h = sizes
            across = (3 * r * r + h * h) / 12
            return _diagonal(density * math.pi * r * r * h, [across, across, r * r / 2])
        case "cone":
            r, h = sizes
            across = 3 / 80 * (4 * r * r + h * h)
            return _diagonal(density * math.pi * r * r * h / 3, [across, across, 3 / 10 * r * r], -h / 4)
        case "capsule":
            r, h = sizes
            return _capsule(r, h, density)
        case _:
            return None


def _capsule(r: float, h: float, density: float) -> Mass:
    """A cylinder, and two half spheres whose centres of mass are 3 r/8 beyond its ends."""
    middle, ball = density * math.pi * r * r * h, density * 4 / 3 * math.pi * r**3
    across = middle * (3 * r * r + h * h) / 12 + ball * (2 / 5 * r * r + h * h / 4 + 3 / 8 * r * h)
    along = middle * r * r / 2 + ball * 2 / 5 * r * r
    return Mass(middle + ball, np.zeros(3), np.diag([across, across, along]))


def _diagonal(mass: float, squares: Sequence[float], height: float = 0.0) -> Mass:
    return Mass(mass, np.array([0.0, 0.0, height]), mass * np.diag(squares))


def enclosed(mesh: Mesh, density: float) -> Mass | None:
    """Of what a closed surface encloses; None where it encloses nothing, or turns its inside out.

    mesh: vertices (V, 3) (m), triangles (T, 3) counter-clockwise from outside; density: kg/m³
    """
    middle = mesh.vertices.mean(axis=0)  # so that volumes do not cancel where the surface is far from the origin
    a, b, c = ((mesh.vertices - middle)[mesh.triangles[:, k]] for k in range(3))
    volumes = np.einsum("ij,ij->i", a, np.cross(b, c)) / 6
    volume = float(volumes.sum())
    if not volume > 0.0:
        return None
    sums = a + b + c
    com = (volumes @ sums) / (4 * volume)
    second = np.einsum("t,tij->ij", volumes, sum(p[:, :, None] * p[:, None, :] for p in (a, b, c, sums))) / 20
    about = density * (second - volume * np.outer(com, com))
    return Mass(density * volume, middle + com, np.trace(about) * np.eye(3) - about)
