"""A thin disc that rolls without slipping: three freedoms of velocity where the position has five.

The dimensions are our own.
"""

import numpy as np

from ncgen import Model

RADIUS = 0.3


def build(lean=20.0, speed=2.0, steer=0.5):
    """The disc at the origin, rolling along x.

    lean: to its right, degrees; speed: of its centre, m/s; steer: rad/s to the left, about the vertical
    """
    m = Model("disc")
    tilt = np.radians(lean)
    axle = np.array([0, np.cos(tilt), -np.sin(tilt)])
    up = np.array([0, np.sin(tilt), np.cos(tilt)])
    C = m.point("C", RADIUS * up)
    u = m.vector("u", axle)
    v = m.vector("v", (1, 0, 0))
    rim = m.point("rim", RADIUS * up + (RADIUS, 0, 0))
    mass = 2.0
    m.body("disc", [C, rim], [u], mass=mass, com=C.initial, inertia=mass * RADIUS**2 / 4 * (np.eye(3) + np.outer(axle, axle)))
    m.rolling(m.bodies["disc"], C, u, v, RADIUS)
    m.independent(C.x, u.x, u.z)
    m.gravity((0, 0, -9.81))
    return m
