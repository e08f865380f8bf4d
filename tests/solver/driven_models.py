"""Mechanisms with an input, whose motions have closed forms or equations of their own."""

import ncgen

MASS, GRAVITY, LENGTH = 2.0, 9.81, 0.7


def mass_on_a_slide() -> ncgen.Model:
    m = ncgen.Model("slider")
    x = m.vector("x", (1, 0, 0), fixed=True)
    O, A, B = m.point("O", (0, 0), fixed=True), m.point("A", (0, 0), fixed="y"), m.point("B", (0.1, 0), fixed="y")
    s = m.slide("s", O, A, x)
    m.body("block", [A, B], mass=MASS, inertia="point")
    F, c = m.input("F", "N"), m.parameter("c", 0.0, "N s/m")
    m.torque(s, F - c * s.rate)
    m.output("place", 10 * s + 1, "dm")
    m.output("pull", F * s.rate + s.acceleration, "W")
    m.independent(s)
    return m


def pendulum() -> ncgen.Model:
    """A rod of 1 kg, driven by a couple about O."""
    m = ncgen.Model("driven")
    O, A, z = m.point("O", (0, 0), fixed=True), m.point("A", (LENGTH, 0)), m.vector("z", (0, 0, 1), fixed=True)
    x = m.vector("x", (1, 0, 0), fixed=True)
    psi = m.angle("psi", x, A - O, z)
    m.body("rod", [O, A], mass=1.0, inertia=LENGTH**2 / 12)
    m.gravity((0, -GRAVITY, 0))
    m.torque(psi, m.input("tau", "N m"))
    m.independent(psi)
    return m
