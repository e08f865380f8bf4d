"""A rod that swings, with its length and mass as parameters: for the tests of what libraries that differentiate make of motions."""

from __future__ import annotations

import ncgen


def swing() -> ncgen.Model:
    model = ncgen.Model("swing")
    length, mass = model.parameter("length", 1.0), model.parameter("mass", 2.0)
    A, B = model.point("A", (0, 0), fixed=True), model.point("B", (0, -length))
    x, z = model.vector("x", (0, -1, 0), fixed=True), model.vector("z", (0, 0, 1), fixed=True)
    model.body("rod", [A, B], mass=mass, com=(0, -length / 2), inertia=mass * length**2 / 12)
    psi = model.angle("psi", x, B - A, z)
    model.independent(psi)
    model.gravity((0, -9.81, 0))
    return model
