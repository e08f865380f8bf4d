"""A double wishbone suspension with rack steering: points and distances, wheel travel and rack as coordinates.

Hardpoints, masses, inertias, spring and damper: Project Chrono, data/vehicle/generic/suspension/DoubleWishbone.json (BSD-3;
left side, X forward, Y left, Z up). Its wishbones' moments (0.03, 0.03, 0.06276) and (0.4, 0.4, 0.8938) belong to no body:
the last exceeds the sum of the others, so half of the last is taken for the first two. The tyre, the rack's mass and its
control are ours. The chassis is fixed and the wheel does not spin.
"""

from collections.abc import Iterable

import numpy as np
import sympy as sp

from ncgen import Model
from ncgen.model.bodies import Body
from ncgen.model.elements import Point

UPPER = {"UF": (0.160, 0.539, 0.243), "UB": (-0.339, 0.587, 0.249), "U": (-0.088, 0.808, 0.243)}
LOWER = {"LF": (0.199, 0.479, -0.206), "LB": (-0.279, 0.539, -0.200), "L": (-0.040, 0.898, -0.265)}
LOWER |= {"S": (-0.040, 0.718, -0.206)}
UPRIGHT = {"T": (-0.220, 0.898, -0.026), "W": (-0.040, 1.100, -0.026)}
CHASSIS = {"C": (-0.064, 0.659, 0.094), "D": (-0.088, 0.599, 0.393)}
RACK = (-0.279, 0.479, -0.026)
"""Wishbones' front, back and outer joints, S under spring and damper; tie rod's end, wheel centre; tops of spring and damper (m)."""

BODIES = {  # mass (kg), centre of mass (m), moments of inertia (kg m²)
    "upper": (5.813, (-0.196, 0.645, 0.245), (0.03138, 0.03138, 0.06276)),
    "lower": (23.965, (-0.040, 0.639, -0.224), (0.4469, 0.4469, 0.8938)),
    "upright": (19.450, (-0.040, 0.880, -0.026), (0.1656, 0.1934, 0.04367)),
    "spindle": (14.705, (-0.040, 1.100, -0.026), (0.04117, 0.07352, 0.04117)),
}

SPRING, FREE_LENGTH, DAMPER = 369149.0, 0.339, 22459.0
"""N/m, m, N s/m."""

LOAD, TYRE = 6375.0, 2e5
"""What the tyre carries in the initial position (N), and its stiffness (N/m)."""

RACK_MASS, RACK_STIFFNESS, RACK_DAMPING = 3.0, 2e5, 2e3

BUMP, STROKE, PERIOD = 0.05, 0.04, 0.5
"""Height of the road's waves, way of the rack to each side (m), and time of a wave (s)."""


def build() -> Model:
    m = Model("suspension")
    upper = {name: m.point(name, place, fixed=name in ("UF", "UB")) for name, place in UPPER.items()}
    lower = {name: m.point(name, place, fixed=name in ("LF", "LB")) for name, place in LOWER.items()}
    T, W = (m.point(name, place) for name, place in UPRIGHT.items())
    C, D = (m.point(name, place, fixed=True) for name, place in CHASSIS.items())
    R = m.point("R", RACK, fixed="xz")
    axis = m.vector("axis", (0, 1, 0))
    U, L, S = upper["U"], lower["L"], lower["S"]

    heavy(m, "upper", upper.values())
    heavy(m, "lower", lower.values())
    m.extend(heavy(m, "upright", [L, U, T, W]), axis)
    heavy(m, "spindle", [L, U, T, W])  # it shares all points: welded
    m.body("rack", [R], mass=RACK_MASS)
    m.distance(R, T)
    m.independent(W.z, R.y)

    m.gravity((0, 0, -9.81))
    m.spring(C, S, SPRING, free_length=FREE_LENGTH)
    m.spring(D, S, damping=DAMPER)
    wave = sp.sin(2 * sp.pi * m.time / PERIOD)
    m.force(W, (0, 0, LOAD - TYRE * (W.z - W.initial[2] - BUMP * wave**2)), "tyre")
    m.force(R, (0, -RACK_STIFFNESS * (R.y - R.initial[1] - STROKE * wave**3) - RACK_DAMPING * R.y.rate, 0), "rack")
    m.line(upper["UF"], U, upper["UB"])
    m.line(lower["LF"], L, lower["LB"], S, lower["LF"])
    m.line(R, T, L, U, T)
    m.line(U, W, L)
    m.line(C, S, D)
    for start, end, radius in ((upper["UF"], U, 0.014), (upper["UB"], U, 0.014), (lower["LF"], L, 0.02), (lower["LB"], L, 0.02)):
        m.bar(start, end, radius)
    m.bar(L, U, 0.025)
    m.bar(R, T, 0.011)
    m.bar(T, W, 0.02)
    m.telescope(D, S, 0.025)
    m.wheel(m.bodies["spindle"], 0.33, 0.2, W.initial, (0, 1, 0))
    m.arrow(W, axis)
    m.range("C_S.stiffness", 100000, 600000)
    m.range("D_S.damping", 0, 40000)
    m.range("spindle.mass", 5, 40)
    m.simulation(duration=2 * PERIOD)
    return m


def heavy(m: Model, name: str, points: Iterable[Point]) -> Body:
    mass, com, moments = BODIES[name]
    return m.body(name, list(points), mass=mass, com=com, inertia=np.diag(moments))
