"""A Stewart-Gough platform: six leg lengths are coordinates, so both kinematics and leg forces come for free.

Geometry: base radius 3 m, platform radius 1 m, height 2 m, legs in pairs 2.5 and 10 degrees off their middles, from the
MathWorks demo mech_stewart_control_setup.m (2002). Legs are massless; the platform's mass and the legs' springs are ours.
"""

import math

import numpy as np

from ncgen import Model

BASE_RADIUS, TOP_RADIUS, HEIGHT = 3.0, 1.0, 2.0
BASE = BASE_RADIUS, np.array([-2.5, 2.5, 117.5, 122.5, 237.5, 242.5])
TOP = TOP_RADIUS, np.array([-50, 50, 70, 170, 190, 290])
"""Radius (m) and directions (degrees) of the feet and of the heads of legs 1 to 6."""

MASS = 1000.0
INERTIA = MASS * TOP_RADIUS**2 * np.array([0.25, 0.25, 0.5])
"""A thin disc of the platform's radius (kg, kg m²)."""


def build(stiffness: float = 2e5, damping: float = 4e3) -> Model:
    """The platform on six springs with dampers that carry its weight in the initial position."""
    m = Model("stewart")
    feet = [m.point(f"B{i}", place, fixed=True) for i, place in enumerate(circle(*BASE, 0.0), 1)]
    heads = [m.point(f"P{i}", place) for i, place in enumerate(circle(*TOP, HEIGHT), 1)]
    normal = m.vector("n", (0, 0, 1))
    m.body("platform", heads, [normal], mass=MASS, com=(0, 0, HEIGHT), inertia=INERTIA)
    legs = [m.length(f"s{i}", foot, head) for i, (foot, head) in enumerate(zip(feet, heads, strict=True), 1)]
    m.independent(*legs)
    for leg in legs:
        m.torsion_spring(leg, stiffness, damping, free_angle=leg.initial[0] * (1 + MASS * 9.81 / (6 * stiffness * HEIGHT)))
    m.gravity((0, 0, -9.81))
    m.line(*feet, feet[0])
    m.line(*heads, heads[0])
    for foot, head in zip(feet, heads, strict=True):
        m.line(foot, head)
        m.telescope(foot, head, 0.07)
    m.polygon(m.bodies["platform"], [head.initial.tolist() for head in heads], 0.12)
    m.polygon(m.ground, [foot.initial.tolist() for foot in feet], 0.06)
    m.arrow(heads[0], normal)
    m.simulation(duration=3.0, zd0={"s1": 0.6, "s2": -0.3, "s4": 0.4})
    return m


def circle(radius: float, degrees: np.ndarray, height: float) -> np.ndarray:
    """Points (m) on a horizontal circle, shape (len(degrees), 3)."""
    return np.array([(radius * math.cos(turn), radius * math.sin(turn), height) for turn in np.radians(degrees)])
