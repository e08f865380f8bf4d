"""A planar four-bar linkage turned by its crank: one degree of freedom, a relative angle, nothing out of the plane."""

from ncgen import Model
from ncgen.model.elements import Point


def build() -> Model:
    m = Model("fourbar")
    A = m.point("A", (0.0, 0.0), fixed=True)
    B = m.point("B", (0.1, 0.0))
    C = m.point("C", (0.35, 0.3))
    D = m.point("D", (0.4, 0.0), fixed=True)
    x = m.vector("x", (1, 0, 0), fixed=True)
    z = m.vector("z", (0, 0, 1), fixed=True)

    def bar(name: str, start: Point, end: Point, mass: float) -> None:
        length = ((start.initial - end.initial) ** 2).sum() ** 0.5
        m.body(name, points=[start, end], mass=mass, inertia=mass * length**2 / 12)

    bar("crank", A, B, 0.2)
    bar("coupler", B, C, 0.8)
    bar("rocker", C, D, 0.6)
    psi = m.angle("psi", start=x, end=B - A, axis=z)
    m.independent(psi)
    m.gravity((0, -9.81, 0))
    m.line(A, B, C, D)
    m.range("B.position.x", 0.03, 0.3)
    m.range("C.position.x", 0.2, 0.45)
    m.range("C.position.y", 0.15, 0.4)
    m.range("D.position.x", 0.25, 0.5)
    m.range("crank.mass", 0.05, 5)
    m.simulation(duration=2.0, zd0={"psi": 12.0})
    return m
