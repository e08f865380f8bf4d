"""Closing a mechanism whose initial position is only approximately known."""

from __future__ import annotations

import re

import numpy as np
import pytest

import ncgen
from ncgen import Model
from ncgen.errors import ConvergenceError


def triangle(base=2.0):
    """Two rods of 1.25 m over a base: their joint is where two circles meet."""
    m = ncgen.Model("triangle")
    A, B = m.point("A", (0, 0), fixed=True), m.point("B", (base, 0), fixed=True)
    C = m.point("C", (0.9, 0.7))
    m.distance(A, C, 1.25)
    m.distance(C, B, 1.25)
    return ncgen.compile(m, backend="numpy")


@pytest.mark.parametrize("side", [1, -1])
def test_the_branch_is_the_near_one(side):
    """Of the two points where the circles meet, (1, ±0.75), the one on the side of the guess is found."""
    kernels = triangle()
    q = ncgen.assemble(kernels, [0.9, 0.7 * side])
    assert q == pytest.approx([1.0, 0.75 * side], abs=1e-12)


def test_what_is_closed_stays_to_the_last_bit(robot):
    assert np.array_equal(ncgen.assemble(robot), robot.q0)


def test_a_disturbed_robot_closes_nearby(robot):
    disturbance = 0.03 * np.random.default_rng(2).standard_normal(robot.n)
    q = ncgen.assemble(robot, robot.q0 + disturbance)
    assert np.max(np.abs(robot.phi(q))) < 1e-12
    assert np.max(np.abs(q - robot.q0)) < 4 * np.max(np.abs(disturbance))


def test_weights_say_what_should_stay():
    """On a line of points with one free length either end may give way: the dear one does not."""
    m = ncgen.Model("rod")
    A, B = m.point("A", (0, 0)), m.point("B", (1, 0))
    m.distance(A, B, 1.2)
    kernels = ncgen.compile(m, backend="numpy")
    q = ncgen.assemble(kernels, weights={"A.x": 1e4})
    assert q[0] == pytest.approx(0.0, abs=1e-6)
    assert q[2] == pytest.approx(1.2, abs=1e-6)


def test_what_cannot_close_is_named():
    with pytest.raises(ncgen.ConvergenceError, match=r"does not close: constraints? [12] \(distance (A-C|C-B), user model\)"):
        ncgen.assemble(triangle(base=3.0))


def test_the_worst_rows_are_named_first():
    """Of a disc that rolls, a triangle that closes, and two that gape by 0.1 m and by 0.5 m: the rows of the two, the wider one's first."""
    m = Model("gaping")
    centre, axle, across = m.point("M", (0, 9, 1)), m.vector("u", (0, 1, 0)), m.vector("v", (1, 0, 0))
    disc = m.body("disc", [centre], [axle, across], mass=1.0, inertia=np.eye(3), constant_mass=True)
    m.rolling(disc, centre, axle, across, 1.0)
    for name, gap in (("S", 0.1), ("T", -0.5), ("W", 0.5)):
        left, right = (m.point(f"{name}{i}", (x, 0, 0), fixed=True) for i, x in enumerate((0.0, 2.5 + gap)))
        top = m.point(name, (1.2, 0.3, 0), fixed="z")
        m.distance(left, top, 1.25)
        m.distance(top, right, 1.25)
    kernels = ncgen.compile(m, backend="numpy")
    first = next(i for i, row in enumerate(kernels.rows) if "S0" in row.label) + 1
    with pytest.raises(ConvergenceError) as caught:
        ncgen.assemble(kernels)
    named = re.findall(r"(\d+) \(distance (\w+)-(\w+),", str(caught.value))
    assert {(int(n), a, b) for n, a, b in named[:2]} == {(first + 4, "W0", "W"), (first + 5, "W", "W1")}
    assert {(int(n), a, b) for n, a, b in named[2:]} == {(first, "S0", "S"), (first + 1, "S", "S1")}


def test_measured_rows_are_counted(robot):
    """The robot's lengths are given in its tables; a four-bar's are measured, and inspect says so."""
    fourbar = ncgen.compile(ncgen.load("fourbar"), backend="numpy")
    assert ncgen.inspect(fourbar)["measured_constraints"] == 3
    assert ncgen.inspect(robot)["measured_constraints"] == 0


def test_a_paper_angle_whose_choices_disagree_is_refused():
    """The bar is drawn 60° from the axis: its cosine says 60°, its sine something else; a run would jump where the choice changes."""
    m = Model("bar", form="paper")
    A, B = m.point("A", (0, 0, 0), fixed=True), m.point("B", (0.5 * 3**0.5, 0, 0.5))
    m.body("bob", [B], mass=1.0)
    m.distance(A, B)
    x, z = m.vector("x", (1, 0, 0), fixed=True), m.vector("z", (0, 0, 1), fixed=True)
    m.angle("psi", x, B - A, z)
    with pytest.raises(ConvergenceError, match="bar: .*psi.*: its sine and its cosine contradict each other by .*form='smooth'"):
        ncgen.simulate(ncgen.compile(m, "numpy"), 0.1)
