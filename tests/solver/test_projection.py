"""States brought onto the constraints."""

from __future__ import annotations

import pytest

import ncgen
from ncgen.model import Model
from ncgen.solver.formalisms.projection import project, project_velocity


def test_a_driven_velocity_is_that_of_its_driver():
    """x = 1 + t²/2 at t = 3 s: x = 5.5 m, 3 m/s, whatever was there before; y is free and stays."""
    m = Model("driven")
    A = m.point("A", (1, 0))
    m.body("ball", points=[A], mass=1.0)
    m.drive(A.x, 1 + m.time**2 / 2)
    kernels = ncgen.compile(m, "numpy")
    assert project_velocity(kernels, [5.5, 0.0], [0.0, 0.7], 3.0) == pytest.approx([3.0, 0.7], abs=1e-15)
    found = project(kernels, [5.4, 0.2], [1.0, 0.7], 3.0)
    assert found.q == pytest.approx([5.5, 0.2], abs=1e-14)
    assert found.qd == pytest.approx([3.0, 0.7], abs=1e-14)
