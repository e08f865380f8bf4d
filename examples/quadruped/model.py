"""A four-legged robot whose legs are closed loops: a tree of twenty-one bodies, and four feet that close it.

Legs after Minitaur (Kenneally, De, Koditschek 2016): two motors on one axis turn two upper links of 0.1 m, whose lower links of 0.2 m
meet in the foot; here a third motor swings each leg sideways. Trunk, masses, control and ground are ours.
"""

import math

import numpy as np
import sympy as sp

from ncgen import Model
from ncgen.model.bodies import Body
from ncgen.model.elements import Point, Vector

UPPER, LOWER = 0.1, 0.2
"""Links of a leg (m)."""

HIPS = ((0.2, 0.1), (0.2, -0.1), (-0.2, -0.1), (-0.2, 0.1))
"""Where the legs are, forward and to the left of the trunk's middle (m), one after the other around it."""

TRUNK, HIP, LINKS = 4.0, 0.4, {UPPER: 0.1, LOWER: 0.06}
"""Masses (kg), of links by their length."""

OPEN, LIFT = np.radians(50.0), np.radians(35.0)
"""The angle of the upper links to either side of straight down, and by how much it grows when a foot is lifted."""

STIFFNESS, DAMPING = 30.0, 0.4
"""Of the motors' control (N m/rad, N m s/rad)."""

SOFTNESS, SLOWNESS = 4e-3, 0.4
"""The ground's force grows by e over this depth (m), and as a foot sinks at this speed (m/s) it doubles."""

FRICTION, SLIPPING = 0.8, 0.1
"""Of the ground, and the speed (m/s) at which three quarters of it act."""

PERIOD = 0.5
"""Of the trot (s)."""


def build(ground: bool = True) -> Model:
    """The robot above its ground, or without it falling freely while the motors work."""
    m = Model("quadruped")
    height = UPPER * math.cos(OPEN) + math.sqrt(LOWER**2 - (UPPER * math.sin(OPEN)) ** 2)
    ahead, left, up = (m.vector(name, axis) for name, axis in zip(("ahead", "left", "up"), np.eye(3), strict=True))
    middle = m.point("T", (0, 0, height))
    trunk = m.body("trunk", [middle], [ahead, left, up], TRUNK, inertia=box(TRUNK, 0.4, 0.2, 0.1))
    m.box(trunk, (0.4, 0.14, 0.08))
    hips = [m.attach_point(trunk, f"H{i}", (*place, height)) for i, place in enumerate(HIPS, 1)]
    for i, hip in enumerate(hips, 1):
        foot = leg(m, i, hip, ahead, left)
        if ground:
            stand(m, foot)
    m.line(*hips, hips[0])
    m.gravity((0, 0, -9.81))
    m.simulation(duration=2 * PERIOD)
    return m


def leg(m: Model, i: int, hip: Point, ahead: Vector, left: Vector) -> Point:
    """Leg number i at a hip point, and its foot; even legs are lifted while odd ones stand."""
    axle = m.vector(f"u{i}", (0, 1, 0))
    body = m.body(f"hip{i}", [hip], [ahead, axle], HIP, inertia=box(HIP, 0.08, 0.06, 0.08))
    m.cylinder(body, 0.035, 0.06, axis=(0, 1, 0))
    foot_place = hip.initial - [0, 0, UPPER * math.cos(OPEN) + np.sqrt(LOWER**2 - (UPPER * math.sin(OPEN)) ** 2)]
    foot = m.point(f"F{i}", foot_place)
    swing = sp.sin(2 * sp.pi * m.time / PERIOD) * (-1) ** i
    lifted = LIFT * ((swing + sp.sqrt(swing**2 + 0.01)) / 2 - 0.05)  # smooth, and next to nothing while the foot stands
    motor(m, m.angle(f"alpha{i}", left, axle, ahead), 0)
    for end, sign in (("a", 1), ("b", -1)):
        knee = m.point(f"K{i}{end}", hip.initial + UPPER * np.array([sign * math.sin(OPEN), 0, -math.cos(OPEN)]))
        link(m, f"upper{i}{end}", hip, knee, axle, UPPER)
        link(m, f"lower{i}{end}", knee, foot, axle, LOWER)
        theta = m.angle(f"theta{i}{end}", ahead, knee - hip, axle)
        motor(m, theta, sp.pi / 2 - sign * (OPEN + lifted))
        m.line(hip, knee, foot)
        m.bar(hip, knee, 0.014)
        m.bar(knee, foot, 0.009)
        m.sphere(m.bodies[f"upper{i}{end}"], 0.017, knee.initial)
    m.sphere(m.bodies[f"lower{i}a"], 0.016, foot.initial)
    return foot


def link(m: Model, name: str, start: Point, end: Point, axle: Vector, length: float) -> Body:
    """A slender link on hinges."""
    mass = LINKS[length]
    along = (end.initial - start.initial) / length
    tensor = mass * length**2 / 12 * (np.eye(3) - np.outer(along, along)) + 1e-6 * np.outer(along, along)
    return m.body(name, [start, end], [axle], mass, inertia=tensor)


def motor(m: Model, angle, target) -> None:
    """Torque of a motor that holds an angle where it should be."""
    m.torque(angle, -STIFFNESS * (angle - target) - DAMPING * angle.rate, f"motor of {angle.name}")


def stand(m: Model, foot: Point) -> None:
    """The ground under a foot: its force grows as the foot sinks, and its friction with that force."""
    weight = 9.81 * (TRUNK + 4 * (HIP + 2 * sum(LINKS.values()))) / 4
    force = weight * sp.exp(-foot.z.symbol / SOFTNESS - foot.z.rate / SLOWNESS)
    m.force(
        foot, (-force * sp.tanh(foot.x.rate / SLIPPING) * FRICTION, -force * sp.tanh(foot.y.rate / SLIPPING) * FRICTION, force), "ground"
    )


def box(mass: float, x: float, y: float, z: float) -> np.ndarray:
    """The tensor of a box about its middle (kg m²)."""
    return mass / 12 * np.diag([y**2 + z**2, x**2 + z**2, x**2 + y**2])
