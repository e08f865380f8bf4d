"""A serial arm of any number of hinges, with motors' torques at the joints.

Dimensions are ours: links of 0.3 m, each hinge at right angles to the one before and a little beside it, boxes with their mass in
the middle, heavier at the base. It stands up, leans as it starts, and falls.
"""

import numpy as np

from ncgen import Model

Y, Z = (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
STEP = np.array([0.05, 0.02, 0.3])
"""From one hinge to the next (m); sideways in turns to either side."""

WIDTH = 0.1
"""Of the links (m)."""


def build(n: int = 7) -> Model:
    """An arm of n links; the joints' angles psi1 to psin are its coordinates, the torques at them parameters."""
    m = Model("arm")
    places = np.vstack([np.zeros(3), np.cumsum([STEP * ((-1) ** i, 1, 1) for i in range(n)], axis=0)])
    points = [m.point(f"r{i}", place, fixed=i == 0) for i, place in enumerate(places)]
    axes = [m.vector(f"u{i}", (Z, Y)[i % 2], fixed=i == 0) for i in range(n + 1)]
    before, angles = m.vector("x", Y, fixed=True), []
    for i in range(n):
        heavy = 3.0 - 2.5 * i / n
        m.body(f"link{i + 1}", points[i : i + 2], axes[i : i + 2], mass=heavy, inertia=box(heavy))
        angle = m.angle(f"psi{i + 1}", before, axes[i + 1], axes[i])
        m.torque(angle, m.parameter(f"tau{i + 1}", 0.0, "N m"))
        angles.append(angle)
        before = axes[i]
    m.independent(*angles)
    m.gravity((0, 0, -9.81))
    m.line(*points)
    m.simulation(duration=0.5, zd0={f"psi{i + 1}": 0.5 * (-1) ** i for i in range(n)})
    return m


def box(mass: float) -> np.ndarray:
    """The inertia (kg m²) of a link about its middle, along the global axes."""
    return mass / 12 * np.array([WIDTH**2 + STEP[2] ** 2, WIDTH**2 + STEP[2] ** 2, 2 * WIDTH**2])
