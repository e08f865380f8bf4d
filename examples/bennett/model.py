"""Four skew hinges in a ring: Grübler's count says −2 degrees of freedom, and it turns all the way round.

Bennett's linkage is a skew quadrilateral with equal opposite sides and a hinge at each corner at right angles to
both its sides; then side/sin(twist) is the same for all sides. The dimensions are our own.
"""

import numpy as np

from ncgen import Model

CORNERS = np.array([(2, -1, 0), (2, 2, 2), (-2, 1, 0), (-2, -2, 2)]) / 10


def build(misplaced: float = 0.0) -> Model:
    """The linkage; `misplaced` (m) lifts corner D out of its place, which is enough to lock it."""
    m = Model("bennett")
    corners = CORNERS + np.outer([0, 0, 0, 1], [0, 0, misplaced])
    A, B, C, D = (m.point(name, r, fixed=name in "AB") for name, r in zip("ABCD", corners))
    a, b, c, d = (m.vector(f"u{name}", u, fixed=name in "AB") for name, u in zip("ABCD", hinges(corners)))
    for name, points, axes in [("BC", [B, C], [b, c]), ("CD", [C, D], [c, d]), ("DA", [D, A], [d, a])]:
        m.body(name, points, axes, mass=1.0, inertia=slender(1.0, points[1].initial - points[0].initial))
    theta = m.angle("theta1", start=A - D, end=B - A, axis=a)
    m.angle("theta2", start=B - A, end=C - B, axis=b)
    m.independent(theta)
    m.gravity((0, 0, -9.81))
    m.line(A, B, C, D, A)
    for corner, axis in [(A, a), (B, b), (C, c), (D, d)]:
        m.arrow(corner, axis)
    m.simulation(duration=2.0, zd0={"theta1": 10.0})
    return m


def hinges(corners: np.ndarray) -> np.ndarray:
    """Unit vectors at right angles to the two sides at each corner; two are reversed to make all twists positive."""
    before, after = corners - np.roll(corners, 1, axis=0), np.roll(corners, -1, axis=0) - corners
    normals = np.cross(before, after) * [[-1], [1], [1], [-1]]
    return normals / np.sqrt((normals**2).sum(axis=1, keepdims=True))


def slender(mass: float, along: np.ndarray) -> np.ndarray:
    """Inertia tensor (kg m²) of a thin bar."""
    return mass / 12 * ((along**2).sum() * np.eye(3) - np.outer(along, along))
