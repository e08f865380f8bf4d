"""A point mass on a massless bar (IFToMM A01): the smallest mechanism, with a closed-form motion to compare with."""

from ncgen import Model


def build(length: float = 1.0, mass: float = 1.0) -> Model:
    m = Model("pendulum")
    A = m.point("A", (0, 0), fixed=True)
    B = m.point("B", (-length, 0))
    m.body("bob", points=[B], mass=mass)
    m.distance(A, B)
    m.gravity((0, -9.81, 0))
    m.line(A, B)
    m.range("B.position.x", -3, -0.2)
    m.range("bob.mass", 0.1, 5)
    m.range("gravity.y", -25, 0)
    m.simulation(duration=10.0)
    return m
