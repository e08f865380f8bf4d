"""A serial arm of any number of hinges, with motors' torques at the joints.

Dimensions are ours: links of 0.3 m, each hinge at right angles to the one before and a little beside it, boxes with their mass in
the middle, heavier at the base. It leans over as it starts, and falls.
"""

import math

import numpy as np

from ncgen import Model

LENGTH, ASIDE, WIDTH = 0.3, 0.05, 0.1
"""Of a link: from hinge to hinge, sideways in turns to either side (half as much forward), and its width (m)."""

LEAN = np.radians(12.0)
"""How much farther every link leans over than the one before (rad)."""


def build(n: int = 7) -> Model:
    """An arm of n links; the joints' angles psi1 to psin are its coordinates, the torques at them parameters."""
    m = Model("arm")
    places = np.vstack([np.zeros(3), np.cumsum([step(i) for i in range(n)], axis=0)])
    points = [m.point(f"r{i}", place, fixed=i == 0) for i, place in enumerate(places)]
    axes = [m.vector(f"u{i}", axis(i), fixed=i == 0) for i in range(n + 1)]
    before, angles = m.vector("y", axis(-1), fixed=True), []
    for i in range(n):
        m.body(f"link{i + 1}", points[i : i + 2], axes[i : i + 2], mass=mass(i, n), inertia=inertia(i, n))
        show(m, i)
        angles.append(m.angle(f"psi{i + 1}", before, axes[i + 1], axes[i]))
        m.torque(angles[i], m.parameter(f"tau{i + 1}", 0.0, "N m"))
        m.arrow(points[i], axes[i])
        before = axes[i]
    m.independent(*angles)
    m.gravity((0, 0, -9.81))
    m.line(*points)
    m.simulation(duration=0.5, zd0={angle.name: 0.5 * (-1) ** i for i, angle in enumerate(angles)})
    return m


def show(m: Model, i: int) -> None:
    """Link i (from 0) as a box and the drum of its hinge."""
    width, before, after = WIDTH * max(0.3, 1 - 0.05 * i), m.elements[f"r{i}"].initial, m.elements[f"r{i + 1}"].initial
    m.box(m.bodies[f"link{i + 1}"], (0.8 * width, 0.8 * width, 0.95 * LENGTH), (before + after) / 2, (0, i * LEAN, 0))
    m.cylinder(m.bodies[f"link{i + 1}"], 0.6 * width, 1.3 * width, before, axis(i))


def frame(i: int) -> np.ndarray:
    """Directions of link i (from 0) as columns: forward, sideways, along."""
    c, s = math.cos(i * LEAN), math.sin(i * LEAN)
    return np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])


def step(i: int) -> np.ndarray:
    """From hinge i to the next (m)."""
    forward, sideways, along = frame(i).T
    return ASIDE / 2 * forward + ASIDE * (-1) ** i * sideways + LENGTH * along


def axis(i: int) -> np.ndarray:
    """The direction of hinge i: along its link, sideways, and so on in turns."""
    return frame(i)[:, 1 if i % 2 else 2]


def mass(i: int, n: int) -> float:
    return 3.0 - 2.5 * i / n


def inertia(i: int, n: int) -> np.ndarray:
    """The tensor (kg m²) of link i about its middle, along the global axes."""
    moments = WIDTH**2 + LENGTH**2, WIDTH**2 + LENGTH**2, 2 * WIDTH**2
    return sum((moment * np.outer(e, e) for moment, e in zip(moments, frame(i).T)), np.zeros((3, 3))) * mass(i, n) / 12
