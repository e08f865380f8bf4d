"""A spinning top on a fixed point: three degrees of freedom in nine coordinates, with a constant mass matrix.

Data (and the spin of 150 rad/s): the heavy top of Terze, Müller and Zlatar, Multibody System Dynamics 38 (2016)
201-225, as given in Exudyn's heavyTop.py.
"""

from ncgen import Model


def build(spin=150.0, precession=-4.61538):
    m = Model("heavytop")
    O = m.point("O", (0, 0, 0), fixed=True)
    G = m.point("G", (0, 1, 0))
    u = m.vector("u", (1, 0, 0))
    v = m.vector("v", (0, 0, 1))
    m.body("top", [O, G], [u, v], mass=15.0, com=(0, 1, 0), inertia=(0.234375, 0.46875, 0.234375))
    m.independent(G.x, G.z, u.z)
    m.gravity((0, 0, -9.81))
    m.line(O, G)
    m.arrow(G, u)
    m.arrow(G, v)
    # An angular velocity (0, spin, precession) moves G by omega x OG, and u by omega x u.
    m.simulation(duration=1.0, integrator="dop853", zd0={"G.x": -precession, "u.z": -spin})
    return m
