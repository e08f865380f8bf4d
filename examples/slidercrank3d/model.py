"""A crank, a connecting rod and a slider out of one plane: ball and universal joint close a spatial loop.

Data: the spatial slider-crank of the IFToMM library of multibody problems, as given in Exudyn's
sliderCrank3Dbenchmark.py.
"""

import numpy as np

from ncgen import Model


def build() -> Model:
    m = Model("slidercrank3d")
    O = m.point("O", (0, 0, 0), fixed=True)
    X = m.vector("X", (1, 0, 0), fixed=True)
    Z = m.vector("Z", (0, 0, 1), fixed=True)
    A = m.point("A", (0, 0.1, 0.12), fixed=True)
    B = m.point("B", (0, 0.1, 0.2))
    C = m.point("C", (0.2, 0, 0), fixed="yz")  # the slider's guide is the X axis
    h = m.vector("h", np.array([0, 2, -1]) / np.sqrt(5))  # the rod's pin in the universal joint
    along = (C.initial - B.initial) / 0.3

    m.body("crank", [A, B], [X], mass=0.12, inertia=(1e-4, 1e-4, 1e-5))
    rod = m.body("rod", [B, C], mass=0.5, inertia=0.004 * np.eye(3) - 0.0036 * np.outer(along, along))
    slider = m.body("slider", [C], [X], mass=2.0)
    m.universal(slider, rod, C, X, h)

    psi = m.angle("psi", start=Z, end=B - A, axis=X)
    m.independent(psi)
    m.gravity((0, 0, -9.81))
    m.line(A, B, C, O)
    m.arrow(A, X)
    m.arrow(C, h)
    m.range("slider.mass", 0.5, 10)
    m.range("rod.mass", 0.1, 2)
    m.range("gravity.z", -25, 0)
    m.simulation(duration=5.0, zd0={"psi": 6.0})
    return m
