"""An excavator's arm: cylinder lengths are coordinates, so cylinder forces are read off and not solved for.

Boom 1.903392 m, stick 1.351485 m, bucket 0.590267 m and their masses 200, 150 and 70 kg: eliasalbag/VolvoExcavator. Where
the cylinders and the bucket's linkage are hinged, the centres of mass and the control are ours; moments of inertia are a
uniform rod's, cylinders and linkage have no mass.
"""

import math
from collections.abc import Sequence

import numpy as np
import sympy as sp

from ncgen import Model
from ncgen.model.elements import Point

BOOM, STICK, BUCKET = 1.903392, 1.351485, 0.590267
MASSES = {"boom": 200.0, "stick": 150.0, "bucket": 70.0}
SPANS = {"boom": BOOM, "stick": STICK, "bucket": BUCKET}

START = {"boom": 0.75, "stick": -0.95, "bucket": -1.4}
"""Angle of every part to the horizontal in the initial position (rad)."""

FOOT = (0.30, -0.30)
"""Where the boom's cylinder stands, from the boom's hinge (m)."""

LUGS = {
    "boom": {"L": (0.80, -0.10), "D": (0.90, 0.22)},
    "stick": {"R": (-0.32, 0.12), "K": (0.15, 0.24), "H": (1.10, 0.05)},
    "bucket": {"F": (0.08, 0.20)},
}
"""Hinges of cylinders and linkage (m): along the part from its own hinge, and across to the left."""

OUTLINES = {
    "boom": [(-0.1, -0.03), (0.8, -0.18), (1.05, -0.12), (1.97, -0.07), (1.99, 0.06), (0.9, 0.3), (-0.04, 0.1)],
    "stick": [(-0.38, 0.08), (-0.05, -0.1), (1.39, -0.05), (1.41, 0.05), (1.1, 0.12), (0.15, 0.31), (-0.34, 0.19)],
    "bucket": [(-0.06, -0.05), (0.59, 0.0), (0.5, 0.12), (0.45, 0.3), (0.3, 0.36), (0.05, 0.27), (-0.07, 0.05)],
}
"""What the parts look like from the side (m), in the same way."""

CENTRES = {"boom": (0.85, 0.05), "stick": (0.50, 0.05), "bucket": (0.28, 0.08)}
"""Centres of mass (m), in the same way."""

ROCKER, LINK = 0.30, 0.28
"""The bucket's linkage (m): from the stick to the cylinder's end, and from there to the bucket."""

STIFFNESS = 1e6
DAMPING = {"lift": 8e4, "crowd": 3e4, "curl": 6e3}
STROKES = {"lift": -0.10, "crowd": 0.12, "curl": 0.08}
PERIOD = 4.0
"""The control of the cylinders (N/m, N s/m), and how far (m) and how fast (s) they move out and back."""


def build() -> Model:
    m = Model("excavator")
    points = {"O": m.point("O", (0, 0), fixed=True), "G": m.point("G", FOOT, fixed=True)}
    for name, hinge, end in (("boom", "O", "B"), ("stick", "B", "C"), ("bucket", "C", "T")):
        points |= part(m, name, points[hinge], end)
    H, F = points["H"], points["F"]
    E = points["E"] = m.point("E", knee(H.initial, F.initial))
    m.distance(H, E)
    m.distance(E, F)
    ends = {"lift": "GL", "crowd": "DR", "curl": "KE"}
    cylinders = [m.length(name, points[start], points[end]) for name, (start, end) in ends.items()]
    m.independent(*cylinders)
    for s in cylinders:
        target = s.initial[0] + STROKES[s.name] * (1 - sp.cos(2 * sp.pi * m.time / PERIOD)) / 2
        m.torque(s, -STIFFNESS * (s - target) - DAMPING[s.name] * s.rate, f"cylinder {s.name}")
    m.gravity((0, -9.81, 0))
    for path in ("OLBDO", "RBHCKR", "CTFC", "HEF", "GL", "DR", "KE"):
        m.line(*(points[name] for name in path))
    for start, end in ends.values():
        m.telescope(points[start], points[end], 0.055)
    m.bar(H, E, 0.035)
    m.bar(E, F, 0.035)
    m.simulation(duration=PERIOD)
    return m


def part(m: Model, name: str, hinge: Point, end: str) -> dict[str, Point]:
    """Boom, stick or bucket: a flat body from its hinge to its end, with its lugs; returns the end and the lugs by their names."""
    start, turn, mass, span = hinge.initial[:2], START[name], MASSES[name], SPANS[name]
    tip = m.point(end, place(start, turn, (span, 0)))
    body = m.body(name, [hinge, tip], mass=mass, com=place(start, turn, CENTRES[name]), inertia=mass * span**2 / 12)
    m.polygon(body, [place(start, turn, corner).tolist() for corner in OUTLINES[name]], 0.06)
    return {end: tip} | {lug: m.attach_point(body, lug, place(start, turn, offset)) for lug, offset in LUGS[name].items()}


def place(start: np.ndarray, turn: float, offset: Sequence[float]) -> np.ndarray:
    """A point of a part (m): `offset` along and across it, from its hinge at `start`."""
    along = np.array([math.cos(turn), math.sin(turn)])
    return start + offset[0] * along + offset[1] * np.array([-along[1], along[0]])


def knee(H: np.ndarray, F: np.ndarray) -> np.ndarray:
    """The upper of the two points at a rocker's length from H and a link's length from F."""
    span = (F - H)[:2]
    square = (span**2).sum()
    share = (square + ROCKER**2 - LINK**2) / (2 * square)
    return H[:2] + share * span + np.sqrt(ROCKER**2 / square - share**2) * np.array([-span[1], span[0]])
