"""Small links far from the rest of a tree: their own inertia is not lost beside that of the lever."""

from __future__ import annotations

from itertools import pairwise

import mpmath
import pytest
import sympy

import ncgen
from ncgen.exchange.examples import example_module
from ncgen.model.elements import Point
from ncgen.program.tree.references import reference_points
from ncgen.symbolic.tree import spanning_tree

LINKS = {"beam": (2.0, 0.3, 0.0), "finger": (1e-4, 1e-12, 1e-3), "upper": (1.0, 0.02, 0.25), "lower": (0.5, 0.01, 0.2)}
"""Mass (kg), moment of inertia about the centre of mass (kg m²), and its distance from the joint along y (m)."""

ANGLES, FORCES = (0.3, -0.7, 0.5, 1.1), (1.0, 1e-8, -2.0, 0.5)


def model() -> ncgen.Model:
    """A beam that turns about its middle, a finger at one end, an arm of two links at the other, far from the finger."""
    m = ncgen.Model("fingered")
    O, A, B = m.point("O", (0, 0), fixed=True), m.point("A", (-1, 0)), m.point("B", (1, 0))
    C, D, E = m.point("C", (-1, 2e-3)), m.point("D", (1, 0.5)), m.point("E", (1, 0.9))
    up, east = m.vector("up", (0, 0, 1), fixed=True), m.vector("east", (1, 0, 0), fixed=True)
    for name, points in {"beam": [O, A, B], "finger": [A, C], "upper": [B, D], "lower": [D, E]}.items():
        mass, inertia, away = LINKS[name]
        x, y, _ = points[0].initial
        m.body(name, points, mass=mass, com=(x, y + away), inertia=inertia)
    m.angle("a", east, B - O, up)
    m.angle("b", B - O, C - A, up)
    m.angle("c", B - O, D - B, up)
    m.angle("d", D - B, E - D, up)
    return m


def accelerations() -> list[float]:
    """M⁻¹ f with 40 digits, M from the kinetic energy."""
    angles, rates = sympy.symbols("a b c d"), sympy.symbols("a_t b_t c_t d_t")
    a, b, c, d = angles

    def along(angle, length):
        return sympy.Matrix([-length * sympy.sin(angle), length * sympy.cos(angle)])  # y of the link's frame

    ends = {"A": sympy.Matrix([-sympy.cos(a), -sympy.sin(a)]), "B": sympy.Matrix([sympy.cos(a), sympy.sin(a)])}
    ends["D"] = ends["B"] + along(a + c, sympy.Rational(1, 2))
    where = {"beam": (sympy.zeros(2, 1), a), "finger": (ends["A"], a + b), "upper": (ends["B"], a + c), "lower": (ends["D"], a + c + d)}
    energy = sympy.Integer(0)
    for name, (start, angle) in where.items():
        mass, inertia, away = (sympy.Rational(repr(x)) for x in LINKS[name])
        v = (start + along(angle, away)).jacobian(angles) * sympy.Matrix(rates)
        energy += (mass * v.dot(v) + inertia * (sympy.Matrix([angle]).jacobian(angles) * sympy.Matrix(rates))[0] ** 2) / 2
    mass = sympy.hessian(energy, rates).subs(dict(zip(angles, map(sympy.Float, map(repr, ANGLES), [40] * 4), strict=True)))
    with mpmath.workdps(40):
        return [float(x) for x in mpmath.lu_solve(mpmath.matrix(mass.evalf(40).tolist()), mpmath.matrix([mpmath.mpf(f) for f in FORCES]))]


def test_a_finger_far_from_the_outermost_link():
    space = ncgen.joint_space(ncgen.compile(model(), "numpy"))
    assert space.rates == tuple("abcd")
    q = space.position(dict(zip(space.rates, space.values(space.kernels.q0) + ANGLES, strict=True)))
    assert space.forward_dynamics(q, forces=FORCES) == pytest.approx(accelerations(), rel=2e-12)


def test_one_point_serves_where_it_can():
    """Of the arm all links share one, the beam too; the finger has its own joint."""
    m = model()
    tree = spanning_tree(m)
    found = {link.body.name: point for link, point in zip(tree.links, reference_points(tree, m.parameters), strict=True)}
    assert found["beam"] is found["upper"] is found["lower"] is not found["finger"] and found["finger"].name == "A"
    assert all(isinstance(point, Point) for point in found.values())


def test_a_long_chain_of_links_is_no_deep_recursion():
    """From the ground to the last of 1,200 links: in order, and each hangs on the one before."""
    tree = spanning_tree(example_module("arm").build(1200))
    chain = tree.chain(1199)
    assert chain == list(range(1200)) and all(tree.links[b].parent == a for a, b in pairwise(chain))
