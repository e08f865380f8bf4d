"""A flyball governor with very stiff springs and dampers (IFToMM A05): work for an implicit integrator.

Data: benchmark A05 of the IFToMM library of multibody problems (lim.ii.udc.es/mbsbenchmark). Shaft, slider and rods
are boxes of 3000 kg/m3; each rod carries a point mass of 5 kg at its end.
"""

import math
from collections.abc import Sequence

import numpy as np

from ncgen import Model
from ncgen.model.bodies import Body
from ncgen.model.elements import Point, Vector

LOW = np.radians(30)  # how far the rods hang below the horizontal at the start
THIN = 0.01


def build(stiffness: float = 8e5, damping: float = 4e4) -> Model:
    m = Model("flyball")
    O = m.point("O", (0, 0, 0), fixed=True)
    T = m.point("T", (0, 0, 1), fixed=True)
    S = m.point("S", (0, 0, 0.5), fixed="xy")  # the slider's centre
    x = m.vector("x", (1, 0, 0), fixed=True)
    z = m.vector("z", (0, 0, 1), fixed=True)
    e = m.vector("e", (1, 0, 0), fixed="z")  # turns with the shaft, towards rod 1
    f = m.vector("f", (0, 1, 0), fixed="z")  # turns with the shaft, along the hinges

    shaft = box(m, "shaft", [O, T], [e, f], (THIN, THIN, 1))
    slider = box(m, "slider", [S], [e, f, z], (0.1, 0.1, 0.1))
    turn = m.angle("turn", start=x, end=e, axis=z)
    tilts = []
    for number, out in (1, 1.0), (2, -1.0):
        aside = 0.05 * out * e.initial
        along = np.array([out * math.cos(LOW), 0, -math.sin(LOW)])
        H = m.attach_point(shaft, f"H{number}", T.initial + aside)
        K = m.attach_point(slider, f"K{number}", S.initial + aside)
        B = m.point(f"B{number}", H.initial + along)
        rod = box(m, f"rod{number}", [H, B], [f], (1, THIN, THIN), along)
        M = m.attach_point(rod, f"M{number}", H.initial + along / 2)
        m.sphere(m.body(f"ball{number}", [B], mass=5.0), 0.0736)
        m.bar(H, B, 0.012)
        m.spring(K, M, stiffness, damping, free_length=0.5)
        tilts.append(m.angle(f"alpha{number}", start=out * e, end=B - H, axis=out * f))
        m.line(T, H, M, B)
        m.line(S, K, M)
    m.independent(turn, S.z, *tilts)
    m.gravity((0, 0, -9.81))
    m.bar(O, T, 0.014)
    m.box(slider, (0.1, 0.1, 0.1))
    m.box(shaft, (0.14, 0.03, 0.03), T.initial)
    m.line(O, S, T)
    m.arrow(O, e)
    m.arrow(O, f)
    m.range("ball1.mass", 1, 10)
    m.range("ball2.mass", 1, 10)
    m.range("slider.mass", 1, 10)
    m.simulation(duration=1.0, integrator="radau", zd0={"turn": 2 * np.pi})
    return m


def box(
    m: Model,
    name: str,
    points: list[Point],
    vectors: list[Vector],
    sides: tuple[float, float, float],
    along: Sequence[float] | np.ndarray = (1, 0, 0),
) -> Body:
    """A body that is a box, with its first side in the direction `along` of the plane y = 0 and its second along y."""
    a, b, c = sides
    mass = 3000.0 * a * b * c
    first, second = np.array(along), np.cross(along, (0, 1, 0))
    squares = a**2 * np.outer(first, first) + b**2 * np.diag([0, 1, 0]) + c**2 * np.outer(second, second)
    return m.body(name, points, vectors, mass=mass, inertia=mass / 12 * ((a**2 + b**2 + c**2) * np.eye(3) - squares))
