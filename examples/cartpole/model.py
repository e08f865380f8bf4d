"""An inverted pendulum on a cart: what a controller is for. The cart is pushed, the pole is not.

Dimensions: those of a laboratory's, our own.
"""

from ncgen import Model


def build(cart: float = 1.0, pole: float = 0.2, length: float = 0.8) -> Model:
    """cart, pole: kg; length of the pole: m"""
    m = Model("cartpole")
    x, y, z = (m.vector(name, axis, fixed=True) for name, axis in (("x", (1, 0, 0)), ("y", (0, 1, 0)), ("z", (0, 0, 1))))
    O = m.point("O", (0, 0), fixed=True)
    C, D = m.point("C", (0, 0), fixed="y"), m.point("D", (0.2, 0), fixed="y")
    B = m.point("B", (0, length))
    s = m.slide("s", O, C, x)
    phi = m.angle("phi", y, B - C, z)
    m.body("cart", [C, D], mass=cart)
    m.body("pole", [C, B], mass=pole, inertia=pole * length**2 / 12)
    m.gravity((0, -9.81, 0))
    m.torque(s, m.input("F", "N"), label="motor")
    m.output("tip height", B.y, "m")
    m.output("cart acceleration", s.acceleration, "m/s2")
    m.independent(s, phi)
    m.line(C, B)
    m.line(C, D)
    m.polygon(m.bodies["cart"], [(-0.08, -0.05), (0.28, -0.05), (0.28, 0.05), (-0.08, 0.05)], 0.1)
    m.bar(C, B, 0.012)
    m.range("F", -10, 10)
    m.range("B.position.y", 0.3, 2)
    m.range("cart.mass", 0.2, 5)
    m.range("pole.mass", 0.05, 2)
    m.simulation(duration=1.0, zd0={"phi": 0.1})
    return m
