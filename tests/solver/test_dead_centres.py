"""A mechanism that is asked to go beyond a dead centre: reported as such, with the value asked for, the value reached and what was found.

The rocker of a four-bar turns back where coupler and output are in one line: |BD| = b + c, so cos ψ = (a² + d² − (b + c)²)/(2 a d).
"""

from __future__ import annotations

import math

import numpy as np
import pytest

import ncgen
from ncgen import Model
from ncgen.errors import ConvergenceError, DeadCentreError

a, b, c, d = 2.0, 1.0, 2.0, 4.0
BEGIN = 0.5
DEAD = math.acos((a**2 + d**2 - (b + c) ** 2) / (2 * a * d))
"""The greatest angle of the rocker (rad)."""


def linkage(law=None):
    """A four-bar whose link AB turns no further than DEAD to either side; law(t): the angle that a driver asks for."""
    m = Model("rocker")
    A, D = m.point("A", (0, 0), fixed=True), m.point("D", (d, 0), fixed=True)
    x, z = m.vector("x", (1, 0, 0), fixed=True), m.vector("z", (0, 0, 1), fixed=True)
    start = np.array([a * math.cos(BEGIN), a * math.sin(BEGIN)])
    to_d = np.array([d, 0]) - start
    r = float(np.linalg.norm(to_d))
    along = (r**2 + b**2 - c**2) / (2 * r)
    across = math.sqrt(b**2 - along**2)
    end = start + along * to_d / r + across * np.array([-to_d[1], to_d[0]]) / r
    B, C = m.point("B", tuple(start)), m.point("C", tuple(end))
    m.body("driving", [B], mass=1.0)
    m.body("driven", [C], mass=1.0)
    m.distance(A, B), m.distance(B, C), m.distance(C, D)
    psi = m.angle("psi", start=x, end=B - A, axis=z)
    if law is not None:
        m.drive(psi, law(m.time))
    return ncgen.compile(m, "numpy")


@pytest.fixture(scope="module")
def rocker():
    return linkage()


def test_a_displacement_beyond_it(rocker):
    with pytest.raises(DeadCentreError) as stopped:
        ncgen.move(rocker, None, {"psi": 1.2}, steps=4)
    assert str(stopped.value).startswith(f"rocker: psi = 1.2 is beyond a dead centre at psi = {DEAD:.6g}"[:-1])
    found = stopped.value.positions
    psi = found[:, rocker.index["psi"]]
    assert psi[0] == BEGIN and psi[-1] == pytest.approx(DEAD, abs=1e-8) and np.all(np.diff(psi) > 0)
    assert np.max(np.abs([rocker.phi(q) for q in found])) < 1e-10


def test_values_beyond_it(rocker):
    """What was found for the values before is not lost."""
    values = np.linspace(0.5, 1.0, 11)
    with pytest.raises(DeadCentreError, match=r"psi = 0\.85 is beyond a dead centre at psi = 0\.812755") as stopped:
        ncgen.sweep(rocker, "psi", values)
    psi = stopped.value.positions[:, rocker.index["psi"]]
    np.testing.assert_allclose(psi[:-1], values[values < DEAD], atol=1e-15)
    assert psi[-1] == pytest.approx(DEAD, abs=1e-8)
    np.testing.assert_allclose(stopped.value.positions[:-1], ncgen.sweep(rocker, "psi", values[values < DEAD]), atol=1e-14)


def test_a_driver_beyond_it():
    """ψ = 0.5 + t: the time of the dead centre is known, too."""
    driven, times = linkage(lambda t: BEGIN + t), np.linspace(0.0, 0.5, 11)
    words = r"psi = 0\.85 at t = 0\.35 s is beyond a dead centre at psi = 0\.812755\d*, t = 0\.312755"
    with pytest.raises(DeadCentreError, match=words) as stopped:
        ncgen.driven_positions(driven, times)
    psi = stopped.value.positions[:, driven.index["psi"]]
    np.testing.assert_allclose(psi[:-1], BEGIN + times[times < DEAD - BEGIN], atol=1e-12)
    assert psi[-1] == pytest.approx(DEAD, abs=1e-8)


def test_what_is_no_dead_centre(rocker):
    """Two coordinates to values that contradict each other: no position is there, and none is singular on the way."""
    with pytest.raises(ConvergenceError) as stopped:
        ncgen.move(rocker, None, {"psi": 0.6, "B.x": 0.0})
    assert not isinstance(stopped.value, DeadCentreError)
    assert "psi = 0.6, B.x = 0 is not reached, the way ends at psi = 0.5" in str(stopped.value)


def test_just_before_it_is_reached(rocker):
    found = ncgen.move(rocker, None, {"psi": DEAD - 1e-7}, steps=4)
    assert found.residual <= 1e-12 and found.q[rocker.index["psi"]] == DEAD - 1e-7
