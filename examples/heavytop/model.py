"""A spinning top as four points: three degrees of freedom in nine coordinates, with a constant mass matrix.

A thin disc of 15 kg and radius 0.25 m at the end of a massless rod of 1 m. Data: the heavy top of Terze, Müller and
Zlatar, Multibody System Dynamics 38 (2016) 201-225, as given in Exudyn's heavyTop.py.
"""

import math

import numpy as np

from ncgen import Model

RADIUS, HEIGHT = 0.25, 1.0


def build(spin: float = 150.0, precession: float = -4.61538) -> Model:
    """The top with its axis along y, turning about y and z at the given rates (rad/s)."""
    m = Model("heavytop")
    O = m.point("O", (0, 0, 0), fixed=True)
    angles = np.radians([90, 210, 330])
    P, Q, R = rim = [m.point(name, (RADIUS * math.cos(a), HEIGHT, RADIUS * math.sin(a))) for name, a in zip("PQR", angles)]
    m.body("top", [O, P, Q, R], mass=15.0, com=(0, HEIGHT, 0), inertia=(0.234375, 0.46875, 0.234375))
    m.cylinder(m.bodies["top"], RADIUS, 0.03, (0, HEIGHT, 0), (0, 1, 0))
    m.cylinder(m.bodies["top"], 0.02, HEIGHT, (0, HEIGHT / 2, 0), (0, 1, 0))
    m.box(m.bodies["top"], (0.06, 0.034, 0.4), (0.1, HEIGHT, 0))  # a mark, which tells how it turns
    m.gravity((0, 0, -9.81))
    for point, following in zip(rim, (Q, R, P)):
        m.line(O, point, following)
    m.independent(P.x, P.z, Q.x)
    at_p, at_q = (np.cross((0, spin, precession), point.initial) for point in (P, Q))
    m.range("top.mass", 5, 50)
    m.range("gravity.z", -25, 0)
    m.simulation(duration=1.0, zd0={"P.x": at_p[0], "P.z": at_p[2], "Q.x": at_q[0]})
    return m
