"""A cam lifts a follower: its measured lift is a periodic spline, and the force between them an output.

A motor runs the shaft up to 600 turns a minute, its torque released by a smooth step. A spring presses the follower onto the cam; where
the output `contact` vanished it would lift off, since the constraint holds it there. The numbers are ours.
"""

import math

import ncgen
from ncgen import Model

LIFT = (
    0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.045, 0.625, 2.5, 5.625, 8.705,
    10.0, 8.705, 5.625, 2.5, 0.625, 0.045, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0,
)  # fmt: skip
"""Measured every 15 degrees (mm)."""

BASE, HEIGHT = 0.02, 0.1
"""The cam's base circle, and where the spring is held (m)."""

SHAFT, FOLLOWER = 2e-4, 0.1
"""Moment of inertia of shaft and cam (kg m²), mass of the follower (kg)."""

STIFFNESS, PRELOAD, DAMPING = 2000.0, 15.0, 4.0
"""Of the spring (N/m, N) and of the guide (N s/m)."""

TORQUE, SPEED, RELEASED = 0.3, 20 * math.pi, 0.1
"""The motor's torque at rest (N m), its speed without load (rad/s), and when all of the torque is there (s)."""

GRAVITY = 9.81


def build() -> Model:
    m = Model("cam")
    O, N = m.point("O", (0, 0), fixed=True), m.point("N", (0, -BASE))
    F, H = m.point("F", (0, BASE), fixed="x"), m.point("H", (0, HEIGHT), fixed=True)
    down, z = m.vector("down", (0, -1, 0), fixed=True), m.vector("z", (0, 0, 1), fixed=True)
    m.body("shaft", points=[O, N], mass=0.5, com=(0, 0, 0), inertia=SHAFT)
    m.body("follower", points=[F], mass=FOLLOWER)
    psi = m.angle("psi", start=down, end=N - O, axis=z)

    lift = m.spline("lift", [math.radians(15 * k) for k in range(25)], [x / 1000 for x in LIFT], end="periodic")
    m.constrain(F.y - BASE - lift(psi), label="the follower on the cam")
    m.independent(psi)

    m.gravity((0, -GRAVITY, 0))
    m.spring(F, H, STIFFNESS, DAMPING, free_length=HEIGHT - BASE + PRELOAD / STIFFNESS)
    m.torque(psi, TORQUE * ncgen.smooth_step(m.time, 0, RELEASED) * (1 - psi.rate / SPEED), "motor")
    press = PRELOAD + STIFFNESS * (F.y - BASE) + DAMPING * F.y.rate
    m.output("lift", lift(psi), "m")
    m.output("slope", lift(psi, 1), "m/rad")
    m.output("contact", press + FOLLOWER * (F.y.acceleration + GRAVITY), "N")
    m.line(O, N)
    m.line(F, H)
    m.range("follower.mass", 0.02, 0.5)
    m.range("F_H.stiffness", 500, 8000)
    m.range("F_H.damping", 0, 20)
    m.simulation(duration=0.5)
    return m
