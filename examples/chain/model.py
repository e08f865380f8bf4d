"""A chain of rods in space: ball joints are shared points, so n links cost n rows and nothing else.

Dimensions are ours: uniform slender rods, a chain of 1 m and 1 kg whatever the number of links. It starts at rest,
wound up as a helix about the x axis, hangs by its first point and falls.
"""

import math
from itertools import pairwise

import numpy as np

from ncgen import Model

PITCH, TURN = np.radians(35.0), np.radians(40.0)
"""Angle of every link to the plane across the helix' axis, and from one link to the next (rad)."""


def build(n: int = 10, length: float = 1.0, mass: float = 1.0) -> Model:
    """A chain of n equal links, `length` (m) long and `mass` (kg) heavy in all."""
    m = Model("chain")
    size = length / n
    places = np.vstack([np.zeros(3), np.cumsum(size * directions(n), axis=0)])
    points = [m.point(f"P{k}", place, fixed=k == 0) for k, place in enumerate(places)]
    for k, (start, end) in enumerate(pairwise(points), 1):
        m.body(f"link{k}", points=[start, end], mass=mass / n, inertia=rod(mass / n, end.initial - start.initial))
    m.gravity((0, 0, -9.81))
    m.line(*points)
    m.simulation(duration=0.6)
    return m


def directions(n: int) -> np.ndarray:
    """Unit vectors along the links of the helix, shape (n, 3)."""
    along, across = math.sin(PITCH), math.cos(PITCH)
    return np.array([(along, across * math.cos(TURN * k), across * math.sin(TURN * k)) for k in range(n)])


def rod(mass: float, span: np.ndarray) -> np.ndarray:
    """The inertia tensor (kg m²) of a uniform slender rod about its middle, from end to end `span` (m)."""
    return mass / 12 * ((span**2).sum() * np.eye(3) - np.outer(span, span))
