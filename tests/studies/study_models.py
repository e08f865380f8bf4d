"""Models of the tests of studies, in a module of its own so that processes find them."""

from __future__ import annotations

import sympy

import ncgen


def swing() -> ncgen.Model:
    """A rod on a hinge with its length, mass and gravity as parameters, and its kinetic energy's half of ψ̇² as an output."""
    m = ncgen.Model("swing")
    length, mass, g = m.parameter("length", 1.0), m.parameter("mass", 2.0), m.parameter("g", 9.81)
    A, B = m.point("A", (0, 0), fixed=True), m.point("B", (0, -length))
    x, z = m.vector("x", (0, -1, 0), fixed=True), m.vector("z", (0, 0, 1), fixed=True)
    m.body("rod", [A, B], mass=mass, com=(0, -length / 2), inertia=mass * length**2 / 12)
    psi = m.angle("psi", x, B - A, z)
    m.gravity((0, -g, 0))
    m.output("square", psi.rate**2)
    m.independent(psi)
    return m


def fragile() -> ncgen.Model:
    """A slider-crank with a driver that may pull too far, so that it locks, and a length with which it may not close."""
    m = ncgen.Model("fragile")
    speed, reach = m.parameter("speed", 0.05), m.parameter("reach", 0.4)
    A, B, C = m.point("A", (0, 0), fixed=True), m.point("B", (0.5, 0.2)), m.point("C", (0.9, 0.0), fixed="yz")
    m.distance(A, B, 0.29**0.5)
    m.distance(B, C, reach * sympy.sqrt(5) / 2)
    m.body("first", [A, B], mass=1.0, rigid=False, inertia="point")
    m.body("second", [B, C], mass=1.0, rigid=False, inertia="point")
    D = m.point("D", (0.5, -0.6))
    m.body("hanging", [B, D], mass=1.0, inertia="point")
    m.gravity((0, -9.81, 0))
    m.drive(C.x, 0.9 + speed.symbol * m.time)
    return m
