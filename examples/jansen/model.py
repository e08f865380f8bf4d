"""Theo Jansen's walking leg: eleven rods, many loops, one crank; rods that share their ends are rigid triangles.

Lengths: Theo Jansen's own thirteen numbers, here in centimetres. Rods of 0.5 kg/m and the speed of one turn a second are ours.
"""

import numpy as np

from ncgen import Model

LENGTHS = dict(a=38.0, b=41.5, c=39.3, d=40.1, e=55.8, f=39.4, g=36.7, h=65.7, i=49.0, j=50.0, k=61.9, l=7.8, m=15.0)
RODS = dict(m="OM", j="MU", b="PU", e="UW", d="PW", k="ML", c="PL", f="WK", g="LK", h="KT", i="LT")
"""Which points each rod joins: O, P fixed; M the crank pin, U upper, W outer, L lower, K knee, T the toe on the ground."""


def build(turns_per_second=1.0, density=0.5, driven=True):
    m = Model("jansen")
    points = {name: m.point(name, place, fixed=name in "OP") for name, place in positions().items()}
    for letter, ends in RODS.items():
        rod = [points[end] for end in ends]
        length = LENGTHS[letter] / 100
        m.body(letter, rod, mass=density * length, inertia=density * length**3 / 12)
        m.line(*rod)
    x = m.vector("x", (1, 0, 0), fixed=True)
    z = m.vector("z", (0, 0, 1), fixed=True)
    psi = m.angle("psi", start=x, end=points["M"] - points["O"], axis=z)
    m.gravity((0, -9.81, 0))
    if driven:
        m.drive(psi, 2 * np.pi * turns_per_second * m.time)
    else:
        m.independent(psi)
    m.simulation(duration=1 / turns_per_second)
    return m


def positions():
    """All points (m) with the crank to the right; each is the corner of a triangle on two points known before."""
    s = {letter: length / 100 for letter, length in LENGTHS.items()}
    O, P, M = np.array([0, 0]), np.array([-s["a"], -s["l"]]), np.array([s["m"], 0])
    U = corner(P, s["b"], M, s["j"])
    W = corner(P, s["d"], U, s["e"])
    L = corner(M, s["k"], P, s["c"])
    K = corner(L, s["g"], W, s["f"])
    T = corner(L, s["i"], K, s["h"])
    return dict(O=O, P=P, M=M, U=U, W=W, L=L, K=K, T=T)


def corner(start, to_start, end, to_end):
    """The corner of a triangle on the left of its side from start to end, from the lengths of the other two sides."""
    side = end - start
    d = np.hypot(*side)
    along = (to_start**2 - to_end**2 + d**2) / (2 * d)
    across = np.sqrt(to_start**2 - along**2)
    return start + (along * side + across * np.array([-side[1], side[0]])) / d
