"""Mechanisms in motion, to be looked at."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from turning import HOSTILE, TurningRun

from ncgen.model import Model
from ncgen.model.drawing import Drawing
from ncgen.model.elements import Component, Point, Vector


@pytest.fixture(scope="session")
def flat_model():
    """A planar four-bar linkage with one vector in its plane, one normal to it, and a drawing of both."""
    m = Model("flat")
    A, D = m.point("A", (0, 0), fixed=True), m.point("D", (2, 0), fixed=True)
    B, C, E = m.point("B", (0.3, 0.9)), m.point("C", (2.2, 1.3)), m.point("E", (1.4, 2.0))
    u, w = m.vector("u", (0.6, 0.8)), m.vector("w", (0, 0, 1), fixed=True)
    m.body("crank", points=[A, B])
    m.body("coupler", points=[B, C, E])
    m.body("rocker", points=[C, D], vectors=[u])
    m.line(A, B, C, D)
    m.arrow(C, u)
    m.arrow(A, w)
    return m


@pytest.fixture(scope="session")
def flat_run(flat_model):
    return TurningRun(flat_model, np.linspace(0, 2, 41))


@pytest.fixture(scope="session")
def robot_run(robot_model):
    return TurningRun(robot_model, np.linspace(0, 2, 41))


@pytest.fixture(scope="session")
def hostile_run():
    """A run whose every name tries to leave its place in the HTML. A model refuses such names, so it is made by hand."""
    start = Point(f"p{HOSTILE}", tuple(Component(f"p.{axis}", True, 0.0, 0.0) for axis in "xyz"))
    end = Point(f"q{HOSTILE}", tuple(Component(f"q.{axis}", False, 1.0, 1.0) for axis in "xyz"))
    arrow = Vector(f"u{HOSTILE}", tuple(Component(f"u.{axis}", False, v, v) for axis, v in zip("xyz", (0.0, 0.6, 0.8))))
    elements = {element.name: element for element in (start, end, arrow)}
    drawing = Drawing(lines=[(start, end)], arrows=[(end, arrow)])
    return TurningRun(SimpleNamespace(name=HOSTILE, elements=elements, drawing=drawing, bodies={}, rows=[]), np.linspace(0, 1, 5))
