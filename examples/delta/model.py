"""A delta robot: hinged parallelograms say twice what keeps the platform level; redundant rows are found.

Dimensions: testbedCIIRC/delta-robot-public (r0 0.330, l1 0.420, l2 1.055, r3 0.125 m). The parallelograms' width, the tool,
the masses and the motors are ours; the mechanism is R. Clavel's (1988).
"""

import math

import numpy as np
import sympy as sp

from ncgen import Model
from ncgen.model.bodies import Body
from ncgen.model.elements import Angle, Point

BASE, ARM, ROD, PLATFORM, WIDTH, TOOL = 0.330, 0.420, 1.055, 0.125, 0.160, 0.080
"""Radius of the motors, upper arm, forearm rod, radius of the platform, width of a parallelogram, tool below the platform (m)."""

TURNS = np.pi / 6 + 2 * np.pi / 3 * np.arange(3)
"""Directions of the motors about the vertical axis (rad)."""

ARM_MASS, ROD_MASS, PLATFORM_MASS = 1.5, 0.15, 1.0
"""kg; arms and rods are slender and uniform, the platform is a disc."""

START = 0.3
"""Every arm's angle below the horizontal in the initial position (rad)."""

STROKES, PERIOD = (0.5, 0.2, -0.2), 0.8
"""How far the motors turn out and back (rad), and in what time (s)."""

STIFFNESS, DAMPING = 400.0, 20.0
"""Of the motors' control (N m/rad, N m s/rad)."""

DOWN = np.array([0.0, 0.0, -1.0])


def build(hinged: bool = True) -> Model:
    """The robot; hinged=False puts ball joints on both ends of the rods instead of parallelograms with four hinges."""
    m = Model("delta")
    reach = BASE + ARM * math.cos(START) - PLATFORM
    centre = DOWN * (ARM * math.sin(START) + np.sqrt(ROD**2 - reach**2))
    motors, elbows = zip(*(arm(m, i, turn) for i, turn in enumerate(TURNS, 1)), strict=True)
    rods = [forearm(m, i, turn, elbow, centre) for i, (turn, elbow) in enumerate(zip(TURNS, elbows, strict=True), 1)]
    platform(m, [rod.points[1] for pair in rods for rod in pair], centre)
    if hinged:
        for i, pair in enumerate(rods, 1):
            parallelogram(m, f"n{i}", *pair)
    m.independent(*motors)
    for motor, stroke in zip(motors, STROKES, strict=True):
        target = START + stroke * (1 - sp.cos(2 * sp.pi * m.time / PERIOD)) / 2
        m.torque(motor, -STIFFNESS * (motor - target) - DAMPING * motor.rate, f"motor of {motor.name}")
    m.gravity((0, 0, -9.81))
    m.simulation(duration=2 * PERIOD)
    return m


def arm(m: Model, i: int, turn: float) -> tuple[Angle, list[Point]]:
    """An upper arm that turns about a fixed axis by its motor's angle, and its end with both elbows of a forearm, which it carries."""
    out, along = np.array([math.cos(turn), math.sin(turn), 0]), np.array([-math.sin(turn), math.cos(turn), 0])
    level, axis = m.vector(f"e{i}", out, fixed=True), m.vector(f"t{i}", along, fixed=True)
    A = m.point(f"A{i}", BASE * out, fixed=True)
    E = m.point(f"E{i}", BASE * out + ARM * (math.cos(START) * out + math.sin(START) * DOWN))
    body = m.body(f"arm{i}", [A, E], [axis], ARM_MASS, inertia=slender(ARM_MASS, E.initial - A.initial), basis=[A, E])
    elbows = [m.attach_point(body, f"E{i}{side}", E.initial + shift * along) for side, shift in (("a", -WIDTH / 2), ("b", WIDTH / 2))]
    m.line(A, E)
    m.line(*elbows)
    m.cylinder(m.ground, 0.06, 0.1, A.initial, along)
    m.bar(A, E, 0.03)
    m.bar(elbows[0], elbows[1], 0.018)
    return m.angle(f"psi{i}", start=level, end=E - A, axis=axis), [E, *elbows]


def forearm(m: Model, i: int, turn: float, elbow: list[Point], centre: np.ndarray) -> list[Body]:
    """Two equal rods from the elbows to the platform; elbow: the arm's end and both elbows."""
    out = np.array([math.cos(turn), math.sin(turn), 0])
    middle, *sides = elbow
    shift = centre + PLATFORM * out - middle.initial
    return [rod(m, f"rod{i}{side}", point, f"P{i}{side}", shift) for side, point in zip("ab", sides, strict=True)]


def rod(m: Model, name: str, elbow: Point, corner: str, span: np.ndarray) -> Body:
    end = m.point(corner, elbow.initial + span)
    m.line(elbow, end)
    m.bar(elbow, end, 0.012)
    return m.body(name, [elbow, end], mass=ROD_MASS, inertia=slender(ROD_MASS, span), basis=[elbow, end])


def platform(m: Model, corners: list[Point], centre: np.ndarray) -> None:
    inertia = PLATFORM_MASS * PLATFORM**2 * np.array([0.25, 0.25, 0.5])
    tip = m.point("C", centre + TOOL * DOWN)
    body = m.body("platform", [*corners, tip], mass=PLATFORM_MASS, com=centre, inertia=inertia)
    m.cylinder(body, PLATFORM, 0.025, centre)
    m.cylinder(body, 0.02, TOOL, centre + TOOL * DOWN / 2)
    m.line(*corners, corners[0])
    for corner in corners[::2]:
        m.line(corner, tip)


def parallelogram(m: Model, name: str, a: Body, b: Body) -> None:
    """Two rods hinged to the elbow and to the platform: one vector stays normal to all four sides."""
    (elbow_a, corner_a), (elbow_b, corner_b) = a.points, b.points
    normal = np.cross(elbow_a.initial - elbow_b.initial, corner_a.initial - elbow_a.initial)
    n = m.vector(name, normal / np.sqrt((normal**2).sum()))
    m.extend(a, n)
    m.extend(b, n)
    m.vector_segment(n, elbow_b - elbow_a)
    m.vector_segment(n, corner_b - corner_a)
    m.arrow(elbow_b, n)


def slender(mass: float, span: np.ndarray) -> np.ndarray:
    """The inertia tensor (kg m²) of a uniform slender rod about its middle, from end to end `span` (m)."""
    return mass / 12 * ((span**2).sum() * np.eye(3) - np.outer(span, span))
