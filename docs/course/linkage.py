"""A four-bar linkage for the lesson in the browser: its lengths, its coupler point and its flywheel are parameters.

ncgen export docs/course/linkage.py --to html -o lesson
"""

from sympy import sqrt

from ncgen import Model


def build() -> Model:
    m = Model("linkage")
    lengths = {"crank": 0.1, "coupler": 0.3, "rocker": 0.25, "base": 0.3}
    a, b, c, d = (m.parameter(name, value, "m") for name, value in lengths.items())
    along, across = m.parameter("along", 0.15, "m"), m.parameter("across", 0.1, "m")
    flywheel = m.parameter("flywheel", 0.0, "kg m²")

    # The crank stands upright; C is where the circles about B and D meet, P lies along and across the coupler.
    diagonal = a**2 + d**2
    t = (diagonal + b**2 - c**2) / (2 * diagonal)
    h = sqrt(b**2 / diagonal - t**2)
    x, y = t * d + h * a, -t * a + h * d  # from B to C
    A, D = m.point("A", (0, 0), fixed=True), m.point("D", (d, 0), fixed=True)
    B, C = m.point("B", (0, a)), m.point("C", (x, a + y))
    P = m.point("P", ((along * x - across * y) / b, a + (along * y + across * x) / b))

    m.body("crank", [A, B], mass=0.2, inertia="rod")
    m.body("coupler", [B, C, P], mass=0.6, com=(x / 2, a + y / 2, 0), inertia=0.6 * b**2 / 12)
    m.body("rocker", [C, D], mass=0.5, inertia="rod")
    right, normal = m.vector("right", (1, 0, 0), fixed=True), m.vector("normal", (0, 0, 1), fixed=True)
    psi = m.angle("psi", start=right, end=B - A, axis=normal)
    m.angle("theta", start=right, end=C - D, axis=normal)
    m.rotor(psi, flywheel)
    m.independent(psi)
    m.gravity((0, -9.81, 0))
    m.line(A, B, C, D)
    m.line(B, P, C)
    m.simulation(duration=3.0, zd0={"psi": 10.0})
    return m
