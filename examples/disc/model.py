"""A disc that rolls without slipping: five degrees of freedom in position, but only three in velocity.

The dimensions are our own: 2 kg, radius 0.3 m.
"""

import math

import numpy as np

from ncgen import Model

MASS, RADIUS = 2.0, 0.3


def build(lean: float = 20.0, speed: float = 1.5, steer: float = 0.5, spokes: int = 6) -> Model:
    """The disc on the plane z = 0, above the origin, rolling along x.

    lean: to its left (degrees); speed: of its centre (m/s); steer: how fast it turns left about the vertical (rad/s);
    spokes: how many are drawn
    """
    m = Model("disc")
    tilt = np.radians(lean)
    axle = np.array([0, math.cos(tilt), -math.sin(tilt)])
    up = np.array([0, math.sin(tilt), math.cos(tilt)])
    C = m.point("C", RADIUS * up)
    u = m.vector("u", axle)
    v = m.vector("v", (1, 0, 0))
    inertia = MASS * RADIUS**2 / 4 * (np.eye(3) + np.outer(axle, axle))
    disc = m.body("disc", [C], [u, v], mass=MASS, inertia=inertia, constant_mass=True)
    m.rolling(disc, C, u, v, RADIUS)
    m.independent(C.x, u.x, u.z)
    m.gravity((0, 0, -9.81))

    angles = 2 * np.pi / max(spokes, 1) * np.arange(spokes)
    places = [RADIUS * (up + math.cos(a) * v.initial - math.sin(a) * up) for a in angles]
    rim = [m.attach_point(disc, f"P{k}", place) for k, place in enumerate(places, 1)]
    for point, following in zip(rim, rim[1:] + rim[:1]):
        m.line(C, point, following)
    m.wheel(disc, RADIUS, 0.1 * RADIUS, C.initial, axle)
    m.arrow(C, u)
    # Turning at `steer` about the vertical carries the axle's tip backwards.
    m.range("disc.mass", 0.5, 10)
    m.range("gravity.z", -25, 0)
    m.simulation(duration=3.0, zd0={"C.x": speed, "u.x": -steer * math.cos(tilt)})
    return m
