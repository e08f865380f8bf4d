"""The closed-chain robot of the paper, from its own Tables 1-7: redundancy, angle rows, mass that varies.

builder.py says the same model call by call; a test proves the two equal.

Two of the printed tables are mended where the paper contradicts itself (docs/paper.md has the list):
the comma of `1003, 1, 3`, and the senses of psi1, psi2 and psi6, which Table 5 measures the other way
round than section 3.3. `PRINTED_ANGLES` keeps Table 5 as printed.
"""

from collections.abc import Sequence

import numpy as np

from ncgen import Model

# Table 1: coordinates in the initial position (m), and the position in q.
P = np.array(
    [
        [0, 0, 0, 1],
        [0, 0.2088, 0.6683, 4],
        [0, -0.1827, 0.7257, 16],
        [0, 0.2088, 1.7647, 19],
        [0, -0.1827, 1.8221, 22],
        [0, 0.2871, 2.0257, 25],
        [0, 1.4130, 1.3757, 28],
        [0, 1.6427, 1.3757, 34],
    ]
)
U = np.array([[0, 0, 1, 7], [0, 1, 0, 10], [1, 0, 0, 13], [1, 0, 0, 31], [0, 0, 1, 37]])


def length(i: int, j: int) -> float:
    return float(np.sqrt(((P[i - 1, :3] - P[j - 1, :3]) ** 2).sum()))


L12, L23, L13, L24, L35 = length(1, 2), length(2, 3), length(1, 3), length(2, 4), length(3, 5)
L45, L56, L46, L67, L78 = length(4, 5), length(5, 6), length(4, 6), length(6, 7), length(7, 8)
cfi = float((U[0, :3] * (P[0, :3] - P[1, :3])).sum()) / L12

# Table 3: rigid-body rows.
RIGID = [
    # Body 2 (points 1, 2, 3; vectors 1, 3)
    [1000, 1, 2, 0, 0, 0, 0, 0, 0, 0, 0, L12],
    [1000, 2, 3, 0, 0, 0, 0, 0, 0, 0, 0, L23],
    [1000, 3, 1, 0, 0, 0, 0, 0, 0, 0, 0, L13],
    [1001, 3, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0],
    [1002, 3, 1, 2, 0, 0, 0, 0, 0, 0, L12, 0],
    [1002, 3, 2, 3, 0, 0, 0, 0, 0, 0, L23, 0],
    [1003, 1, 3, 0, 0, 0, 0, 0, 0, 0, 0, 0],
    [1002, 1, 1, 2, 0, 0, 0, 0, 0, 0, L12, cfi],
    # Body 3 (points 2, 4; vector 3)
    [1000, 2, 4, 0, 0, 0, 0, 0, 0, 0, 0, L24],
    [1002, 3, 2, 4, 0, 0, 0, 0, 0, 0, L24, 0],
    # Body 4 (points 3, 5; vector 3)
    [1000, 3, 5, 0, 0, 0, 0, 0, 0, 0, 0, L35],
    [1002, 3, 3, 5, 0, 0, 0, 0, 0, 0, L35, 0],
    # Body 5 (points 4, 5, 6; vector 3)
    [1000, 4, 5, 0, 0, 0, 0, 0, 0, 0, 0, L45],
    [1000, 5, 6, 0, 0, 0, 0, 0, 0, 0, 0, L56],
    [1000, 6, 4, 0, 0, 0, 0, 0, 0, 0, 0, L46],
    [1002, 3, 4, 5, 0, 0, 0, 0, 0, 0, L45, 0],
    [1002, 3, 4, 6, 0, 0, 0, 0, 0, 0, L46, 0],
    # Body 6 (points 6, 7; vector 3)
    [1000, 6, 7, 0, 0, 0, 0, 0, 0, 0, 0, L67],
    [1002, 3, 6, 7, 0, 0, 0, 0, 0, 0, L67, 0],
    # Body 7 (points 6, 7; vector 4)
    [1002, 4, 6, 7, 0, 0, 0, 0, 0, 0, L67, 0],
    [1001, 4, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0],
    # Body 8 (points 7, 8; vector 4)
    [1000, 7, 8, 0, 0, 0, 0, 0, 0, 0, 0, L78],
    [1002, 4, 7, 8, 0, 0, 0, 0, 0, 0, L78, 0],
    # Body 9 (points 7, 8; vector 5)
    [1002, 5, 7, 8, 0, 0, 0, 0, 0, 0, L78, 0],
    [1001, 5, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0],
]

# Table 5 as printed: psi1, psi2 and psi6 are counted the other way round than in section 3.3.
PRINTED_ANGLES = [
    [1012, 3, 2, 1, 0, 0, 0, 0, 0, 0, 0, 1],
    [1014, 1, 4, 2, 3, 0, 0, 0, 0, 0, L24, 2],
    [1010, 6, 4, 6, 7, 3, 0, 0, 0, L46, L67, 3],
    [1013, 3, 4, 7, 6, 0, 0, 0, 0, 0, L67, 4],
    [1010, 7, 6, 7, 8, 4, 0, 0, 0, L67, L78, 5],
    [1013, 5, 4, 8, 7, 0, 0, 0, 0, 0, L78, 6],
]

# Table 5 with the senses of section 3.3.
ANGLES = [
    [1012, 2, 3, 1, 0, 0, 0, 0, 0, 0, 0, 1],  # psi1 from u2 to u3 on u1
    [1014, 1, 4, 2, -3, 0, 0, 0, 0, 0, L24, 2],  # psi2 from r4-r2 to u1 on u3, i.e. from u1 to r4-r2 on -u3
    [1010, 6, 4, 6, 7, 3, 0, 0, 0, L46, L67, 3],  # psi3 from r4-r6 to r7-r6 on u3
    [1013, 3, 4, 7, 6, 0, 0, 0, 0, 0, L67, 4],  # psi4 from u3 to u4 on r7-r6
    [1010, 7, 6, 7, 8, 4, 0, 0, 0, L67, L78, 5],  # psi5 from r6-r7 to r8-r7 on u4
    [1013, 4, 5, 8, 7, 0, 0, 0, 0, 0, L78, 6],  # psi6 from u4 to u5 on r8-r7
]


def middle(i: int, j: int, share: float = 0.5) -> np.ndarray:
    return P[i - 1, :3] + share * (P[j - 1, :3] - P[i - 1, :3])


# Table 6 for bodies 2 and 3; the paper leaves out the others, which are ours.
INERTIA = {
    2: dict(m=200.0, cog=[0, 0, 0.45], IT=np.diag([10.396, 10.396, 17.793]), r=[1, 2], u=[1, 3], points=[1, 2, 3]),
    3: dict(m=250.0, cog=[0, 0.2088, 1.2165], IT=np.diag([27.263, 27.263, 4.476]), r=[2, 4], u=[3]),
    4: dict(m=20.0, cog=middle(3, 5), IT=np.diag([2, 2, 0.05]), r=[3, 5], u=[3]),
    5: dict(m=120.0, cog=[0, 0.15, 1.95], IT=np.diag([6, 5, 4]), r=[4, 6, 5], u=[3]),
    6: dict(m=40.0, cog=middle(6, 7, 0.2), IT=np.diag([1.2, 0.9, 0.9]), r=[6, 7], u=[3]),
    7: dict(m=60.0, cog=middle(6, 7, 0.6), IT=np.diag([4, 1.5, 3]), r=[6, 7], u=[4]),
    8: dict(m=15.0, cog=[0, 1.5, 1.3757], IT=np.diag([0.1, 0.08, 0.1]), r=[7, 8], u=[4]),
    9: dict(m=10.0, cog=[0, 1.62, 1.3757], IT=np.diag([0.05, 0.03, 0.05]), r=[7, 8], u=[5]),
}

# Table 7: lines join points; vectors are drawn from points, as (point, vector).
LINES = np.array([[1, 2, 1, 2, 3, 4, 5, 6, 6, 7], [2, 3, 3, 4, 5, 5, 6, 4, 7, 8]]).T
UVECT = np.array([[1, 1, 2, 3, 4, 5, 6, 7, 8], [1, 2, 3, 3, 3, 3, 3, 4, 5]]).T

FIXED = [1, 2, 3, 7, 8, 9, 10, 11, 12]  # section 5: r1, u1 and u2 do not move


def build(angles: Sequence[Sequence[float]] = ANGLES, scale: bool = True, form: str = "smooth") -> Model:
    """The robot; `angles=PRINTED_ANGLES` and `form="paper"` give the paper's own rows."""
    model = Model.from_tables(
        P,
        U,
        [*RIGID, *angles],
        inertia=INERTIA,
        lines=LINES,
        uvect=UVECT,
        fixed=FIXED,
        independent=range(1, 7),
        name="robot",
        scale=scale,
        form=form,
    )
    model.gravity((0, 0, -9.81))
    model.simulation(duration=0.5)  # the fall of Table 9
    show(model)
    return model


def show(m: Model) -> None:
    """What the bodies look like, in the manner of Figure 4; the shapes are ours."""
    r = dict(enumerate(P[:, :3], 1))
    up, across = np.array([0, 0, 1.0]), np.array([1.0, 0, 0])
    m.cylinder(m.ground, 0.3, 0.12, r[1] - 0.06 * up)
    m.cylinder(m.bodies["body2"], 0.22, 0.25, r[1] + 0.125 * up)
    m.polygon(m.bodies["body2"], [(0, -0.16, 0.2), (0, 0.16, 0.2), (0, 0.3, 0.66), (0, 0.2, 0.78), (0, -0.2, 0.82), (0, -0.27, 0.72)], 0.2)
    m.capsule(m.bodies["body3"], 0.09, L24, middle(2, 4), r[4] - r[2])
    m.capsule(m.bodies["body4"], 0.035, L35, middle(3, 5), r[5] - r[3])
    for joint, body in ((2, "body3"), (3, "body4"), (4, "body5"), (5, "body5")):
        m.cylinder(m.bodies[body], 0.11 if joint % 2 == 0 else 0.06, 0.3, r[joint], across)
    m.polygon(
        m.bodies["body5"],
        [(0, 0.3, 1.7), (0, 0.4, 2.0), (0, 0.3, 2.13), (0, 0.15, 2.1), (0, -0.25, 1.88), (0, -0.25, 1.76), (0, 0.1, 1.68)],
        0.2,
    )
    m.capsule(m.bodies["body6"], 0.11, 0.4 * L67, middle(6, 7, 0.2), r[7] - r[6])
    m.cylinder(m.bodies["body7"], 0.075, 0.6 * L67, middle(6, 7, 0.7), r[7] - r[6])
    m.cylinder(m.bodies["body7"], 0.08, 0.2, r[7], across)
    m.box(m.bodies["body8"], (0.12, 0.6 * L78, 0.1), middle(7, 8, 0.3))
    m.cylinder(m.bodies["body9"], 0.06, 0.4 * L78, middle(7, 8, 0.8), r[8] - r[7])
    m.cylinder(m.bodies["body9"], 0.09, 0.03, r[8], r[8] - r[7])
