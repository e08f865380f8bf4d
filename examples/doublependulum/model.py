"""Two rods that share a point: sharing is the joint. The motion is chaotic.

Dimensions: our own, unequal so that no term of the equations hides another.
"""

from ncgen import Model


def build(lengths: tuple[float, float] = (1.0, 0.8), masses: tuple[float, float] = (1.0, 0.5)) -> Model:
    m = Model("doublependulum")
    A = m.point("A", (0, 0), fixed=True)
    B = m.point("B", (lengths[0], 0))
    C = m.point("C", lengths)
    for name, ends, length, mass in zip(("upper", "lower"), ([A, B], [B, C]), lengths, masses, strict=True):
        m.body(name, points=ends, mass=mass, inertia=mass * length**2 / 12)
    m.gravity((0, -9.81, 0))
    m.line(A, B, C)
    m.range("B.position.x", 0.2, 2)
    m.range("C.position.y", -1.5, 1.5)
    m.range("upper.mass", 0.1, 5)
    m.range("lower.mass", 0.1, 5)
    m.simulation(duration=5.0)
    return m
