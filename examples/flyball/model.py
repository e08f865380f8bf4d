"""A flyball governor with very stiff springs and dampers (IFToMM A05): work for an implicit integrator.

Data: benchmark A05 of the IFToMM library of multibody problems (lim.ii.udc.es/mbsbenchmark). Shaft, slider and rods
are boxes of 3000 kg/m3; each rod carries a point mass of 5 kg at its end.
"""

import numpy as np

from ncgen import Model

LOW = np.radians(30)  # how far the rods hang below the horizontal at the start
THIN = 0.01


def build(stiffness=8e5, damping=4e4):
    m = Model("flyball")
    x = m.vector("x", (1, 0, 0), fixed=True)
    z = m.vector("z", (0, 0, 1), fixed=True)
    foot = m.point("foot", (0, 0, 0), fixed=True)
    head = m.point("head", (0, 0, 1), fixed=True)
    S = m.point("S", (0, 0, 0.5), fixed="xy")
    e = m.vector("e", (1, 0, 0), fixed="z")  # turns with the shaft, towards the right rod
    f = m.vector("f", (0, 1, 0), fixed="z")  # turns with the shaft, along the hinges

    shaft = m.body("shaft", [foot, head], [e, f], **box(THIN, THIN, 1))
    slider = m.body("slider", [S], [e, f, z], **box(0.1, 0.1, 0.1))
    turn = m.angle("turn", start=x, end=e, axis=z)
    tilts = [add_rod(m, shaft, slider, head, S, e, f, side, stiffness, damping) for side in ("right", "left")]
    m.independent(turn, S.z, *tilts)
    m.gravity((0, 0, -9.81))
    m.line(foot, S, head)
    m.arrow(S, e)
    m.arrow(S, f)
    m.simulation(duration=1.0, integrator="radau", zd0={"turn": 2 * np.pi})
    return m


def add_rod(m, shaft, slider, head, S, e, f, side, stiffness, damping):
    """One rod with its ball, and the spring and damper from the slider to the middle of the rod; returns its angle."""
    sign = 1 if side == "right" else -1
    hinge = m.attach_point(shaft, f"{side}.hinge", head.initial + 0.05 * sign * e.initial)
    collar = m.attach_point(slider, f"{side}.collar", S.initial + 0.05 * sign * e.initial)
    along = np.array([sign * np.cos(LOW), 0, -np.sin(LOW)])
    end = m.point(f"{side}.end", hinge.initial + along)
    rod = m.body(f"{side}.rod", [hinge, end], [f], **box(1, THIN, THIN, along))
    m.body(f"{side}.ball", [end], mass=5.0)
    m.spring(collar, m.attach_point(rod, f"{side}.middle", hinge.initial + along / 2), stiffness, damping, free_length=0.5)
    m.line(head, hinge, end)
    m.line(S, collar, m.elements[f"{side}.middle"])
    return m.angle(f"{side}.alpha", start=sign * e, end=end - hinge, axis=sign * f)


def box(a, b, c, along=(1, 0, 0)):
    """Mass and inertia tensor of a box of 3000 kg/m3 with side a in the direction `along` of the plane y = 0."""
    mass = 3000.0 * a * b * c
    first, second = np.array(along), np.cross(along, (0, 1, 0))
    squares = a**2 * np.outer(first, first) + b**2 * np.diag([0, 1, 0]) + c**2 * np.outer(second, second)
    return {"mass": mass, "inertia": mass / 12 * ((a**2 + b**2 + c**2) * np.eye(3) - squares)}
