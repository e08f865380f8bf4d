"""Andrews' squeezing mechanism (IFToMM A03): seven bodies, millimetres and milliseconds, one degree of freedom.

Dimensions, masses, spring and torque: the multibody benchmark's problem A03, the same as the Andrews squeezer of the
IVP test set, which starts at beta0 = -0.0617138900142764.
"""

import math
from collections.abc import Sequence

import numpy as np

from ncgen import Model
from ncgen.model.elements import Point


def build(beta0: float = -0.0620) -> Model:
    m = Model("andrews")
    origin = m.point("O", (0, 0), fixed=True)
    A = m.point("A", (-0.06934, -0.00227), fixed=True)
    B = m.point("B", (-0.03635, 0.03273), fixed=True)
    C = m.point("C", (0.014, 0.072), fixed=True)
    F = m.point("F", (0.007 * math.cos(beta0), 0.007 * math.sin(beta0)))
    E = m.point("E", meet(F, 0.028, B, 0.035))
    G = m.point("G", meet(A, 0.040, E, 0.020))
    H = m.point("H", meet(E, 0.020, A, 0.040))
    D = m.point("D", local(B, E, (0.018, 0.020)))

    def body(name: str, points: list[Point], mass: float, com: tuple[float, float], inertia: float) -> None:
        m.body(name, points, mass=mass, com=local(points[0], points[1], com), inertia=inertia)

    body("K1", [origin, F], mass=0.04325, com=(0.00092, 0), inertia=2.194e-6)
    body("K2", [F, E], mass=0.00365, com=(0.0115, 0), inertia=4.410e-7)
    body("K3", [B, E, D], mass=0.02373, com=(0.01874, 0.01043), inertia=5.255e-6)
    body("K4", [E, G], mass=0.00706, com=(0.01421, 0), inertia=5.667e-7)
    body("K5", [A, G], mass=0.07050, com=(0.02308, 0.00916), inertia=1.169e-5)
    body("K6", [E, H], mass=0.00706, com=(0.01421, 0), inertia=5.667e-7)
    body("K7", [A, H], mass=0.05498, com=(0.01228, -0.00449), inertia=1.912e-5)
    m.spring(C, D, stiffness=4530.0, free_length=0.07785)

    x = m.vector("x", (1, 0, 0), fixed=True)
    z = m.vector("z", (0, 0, 1), fixed=True)
    beta = m.angle("beta", start=x, end=F - origin, axis=z)
    m.torque(beta, 0.033)
    m.independent(beta)
    m.line(origin, F, E, B, D, E, G, A, H, E)
    m.line(C, D)
    m.simulation(duration=0.05, integrator="dop853")
    return m


def local(start: Point, end: Point, place: Sequence[float]) -> np.ndarray:
    """A place in the frame at a point `start` whose first axis goes to the point `end`."""
    side = (end.initial - start.initial)[:2] / distance(start, end)
    return start.initial[:2] + place[0] * side + place[1] * np.array([-side[1], side[0]])


def distance(start: Point, end: Point) -> float:
    """Between two points (m)."""
    return float(np.sqrt(((end.initial - start.initial) ** 2).sum()))


def meet(start: Point, to_start: float, end: Point, to_end: float) -> np.ndarray:
    """Where two circles about points meet, on the left of the line from `start` to `end`."""
    d = distance(start, end)
    along = (to_start**2 - to_end**2 + d**2) / (2 * d)
    return local(start, end, (along, np.sqrt(to_start**2 - along**2)))
