"""A crank, a connecting rod and a slider: a prismatic joint is one row, and an angle becomes the coordinate.

Dimensions, masses and speed: Flores, Leine and Glocker 2010, doi 10.1007/s11044-009-9178-y, Table 1
(as listed in the Siconos example SliderCrank), without the clearance.
"""

from ncgen import Model


def build(crank: float = 0.153, rod: float = 0.306, speed: float = 150.0) -> Model:
    m = Model("slidercrank")
    A = m.point("A", (0, 0), fixed=True)
    B = m.point("B", (crank, 0))
    C = m.point("C", (crank + rod, 0))
    x = m.vector("x", (1, 0, 0), fixed=True)
    z = m.vector("z", (0, 0, 1), fixed=True)
    m.body("crank", points=[A, B], mass=0.038, inertia=7.4e-5)
    m.body("rod", points=[B, C], mass=0.038, inertia=5.9e-4)
    slider = m.body("slider", points=[C], mass=0.076)
    m.prismatic(m.ground, slider, start=A, end=C, axis=x)
    psi = m.angle("psi", start=x, end=B - A, axis=z)
    m.independent(psi)
    m.gravity((0, -9.81, 0))
    m.line(A, B, C)
    m.arrow(C, x)
    m.range("B.position.x", 0.05, 0.3)
    m.range("C.position.x", 0.3, 0.7)
    m.range("slider.mass", 0.01, 0.5)
    m.simulation(duration=0.1, zd0={"psi": speed})
    return m
