"""Constants that no double holds: refused by name when a model is generated, never written as inf."""

from __future__ import annotations

import pytest

import ncgen
from ncgen import Model, ModelError


def flat(m, length):
    A, B = m.point("A", (0, 0), fixed=True), m.point("B", (length, 0))
    m.body("plate", [A, B], mass=1e100, com=(1e90, 0), inertia=1e80)


def spatial(m, length):
    A, B, u = m.point("A", (0, 0, 0), fixed=True), m.point("B", (length, 0, 0)), m.vector("u", (0, 0, 1))
    m.body("beam", [A, B], [u], mass=1e100, com=(1e90, 0, 0), inertia=[1e80, 1e80, 1e80], constant_mass=True)


def rods(m, length):
    A = m.point("A", (0, 0), fixed=True)
    for k in range(3):
        m.distance(A, m.point(f"B{k}", (1, k)), length * (k + 1))


def hanging(m, mass):
    m.body("bob", [m.point("A", (0, 0))], mass=mass)
    m.gravity((0, -9.81, 0))


BEYOND = {
    "a mass over a short length": (flat, 1e-100, "mass of B.x"),
    "a spatial body": (spatial, 1e-160, "body beam, inertia"),
    "lengths whose reciprocal overflows": (rods, 1e-310, "distance A-B0"),
    "a mass of 1e308": (hanging, 1e308, "body bob, mass: 1e[+]308 is too large"),
    "an integer of 400 digits": (hanging, 10**400, "body bob, mass: a number of 401 digits is not a finite number"),
}


@pytest.mark.parametrize("case", BEYOND)
def test_refused_by_name(case):
    tell, number, words = BEYOND[case]
    m = Model("m")
    with pytest.raises(ModelError, match=words):
        tell(m, number)
        ncgen.generate(m)


def test_the_largest_numbers_are_constants():
    """1e100 kg under 9.81 m/s² is a weight that a double holds."""
    m = Model("m")
    hanging(m, 1e100)
    kernels = ncgen.compile(m, backend="numpy")
    assert kernels.force(kernels.q0, [0.0, 0.0], 0.0, kernels.p0)[1] == -1e100 * 9.81
