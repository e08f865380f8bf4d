"""Theo Jansen's walking leg: rods that share their ends make loops and rigid triangles; the crank is driven.

Lengths: Theo Jansen's own thirteen numbers, taken as centimetres. The rods' 0.5 kg/m and one turn a second are ours.
"""

import numpy as np

from ncgen import Model

LENGTHS = dict(a=38.0, b=41.5, c=39.3, d=40.1, e=55.8, f=39.4, g=36.7, h=65.7, i=49.0, j=50.0, k=61.9, l=7.8, m=15.0)

RODS = dict(m="OM", j="MU", b="PU", e="UW", d="PW", k="ML", c="PL", f="WK", g="LK", h="KT", i="LT")
"""The two points of each rod: the fixed O and P, crank pin M, upper U, outer W, lower L, knee K, and the toe T."""


def build(turns_per_second: float = 1.0, density: float = 0.5, driven: bool = True) -> Model:
    m = Model("jansen")
    points = {name: m.point(name, place, fixed=name in "OP") for name, place in closed_position().items()}
    for letter, ends in RODS.items():
        rod, length = [points[end] for end in ends], LENGTHS[letter] / 100
        m.body(letter, rod, mass=density * length, inertia=density * length**3 / 12)
        m.line(*rod)
    x = m.vector("x", (1, 0, 0), fixed=True)
    z = m.vector("z", (0, 0, 1), fixed=True)
    psi = m.angle("psi", start=x, end=points["M"] - points["O"], axis=z)
    m.gravity((0, -9.81, 0))
    if driven:
        m.drive(psi, 2 * np.pi * turns_per_second * m.time)
    m.range("M.position.x", 0.08, 0.2)
    m.range("P.position.x", -0.45, -0.3)
    m.range("P.position.y", -0.15, 0)
    m.range("T.position.y", -1, -0.8)
    m.simulation(duration=1 / turns_per_second)
    return m


def closed_position() -> dict[str, np.ndarray]:
    """The points (m) while the crank points right: each new one is the corner of a triangle whose sides are known."""
    s = {letter: length / 100 for letter, length in LENGTHS.items()}
    place = dict(O=np.array([0.0, 0.0]), P=np.array([-s["a"], -s["l"]]), M=np.array([s["m"], 0.0]))
    for new, start, to_start, end, to_end in ("UPbMj", "WPdUe", "LMkPc", "KLgWf", "TLiKh"):
        place[new] = corner(place[start], s[to_start], place[end], s[to_end])
    return place


def corner(start: np.ndarray, to_start: float, end: np.ndarray, to_end: float) -> np.ndarray:
    """The corner of a triangle on the left of its side from start to end; to_start, to_end: the other sides' lengths."""
    d = np.sqrt(((end - start) ** 2).sum())
    side = (end - start) / d
    along = (to_start**2 - to_end**2 + d**2) / (2 * d)
    return start + along * side + np.sqrt(to_start**2 - along**2) * np.array([-side[1], side[0]])
