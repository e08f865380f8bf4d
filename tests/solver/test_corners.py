"""Tables over time: steps end at their knots, so that errors are those of smooth motions."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.integrate
import sympy

import ncgen
from ncgen.mechanism.corners import corners

KNOTS, VALUES = np.array([0.0, 0.3, 0.5, 1.0]), np.array([0.0, 2.0, -1.0, 0.0])
SPEED, SHIFT = 3.0, 0.2


def block(argument) -> ncgen.Model:
    """1 kg on a spring of 4 N/m, pushed by 10 law(argument(m, w)), a periodic table."""
    m = ncgen.Model("block")
    axis = m.vector("axis", (1, 0, 0), fixed=True)
    O, A, B = m.point("O", (0, 0), fixed=True), m.point("A", (0, 0), fixed="y"), m.point("B", (0.1, 0), fixed="y")
    s = m.slide("s", O, A, axis)
    m.body("block", [A, B], mass=1.0)
    m.independent(s)
    law = m.table("law", KNOTS, VALUES, periodic=True)
    m.torque(s, 10 * law(argument(m, m.parameter("w", 1.0))) - 4 * s)
    return m


def ends(seconds: float) -> list[float]:
    """When SPEED t + SHIFT passes a knot."""
    passed = ((turn + knot - SHIFT) / SPEED for turn in range(int(SPEED * seconds) + 2) for knot in KNOTS[:-1])
    return sorted(t for t in passed if 0 < t < seconds)


def exact(seconds: float) -> np.ndarray:
    """Place and speed, from corner to corner by SciPy."""
    y, places = np.zeros(2), [0.0, *ends(seconds), seconds]
    for a, b in zip(places, places[1:], strict=False):
        turn = np.floor(SPEED * (a + b) / 2 + SHIFT)

        def rates(t, y, turn=turn):
            return [y[1], 10 * np.interp(SPEED * t + SHIFT - turn, KNOTS, VALUES) - 4 * y[0]]

        y = scipy.integrate.solve_ivp(rates, (a, b), y, "DOP853", rtol=1e-13, atol=1e-13).y[:, -1]
    return y


@pytest.mark.parametrize(
    "options", [{}, {"engine": "c"}, {"engine": "python"}, {"formalism": "coordinate-partitioning", "integrator": "dop853"}], ids=str
)
def test_steps_end_at_corners(options):
    """Three orders better than asked for, in a few steps from corner to corner."""
    kernels = ncgen.compile(block(lambda m, w: w * m.time + SHIFT))
    run = ncgen.simulate(kernels, 2.0, rtol=1e-8, points=2, p={"w": SPEED}, **options)
    np.testing.assert_allclose([run["s"][-1], run["rate(s)"][-1]], exact(2.0), atol=2e-11)
    assert run.statistics.steps < 5 * len(ends(2.0))


def test_where_corners_are():
    kernels = ncgen.compile(block(lambda m, w: w * m.time + SHIFT), "numpy")
    assert corners(kernels, np.array([SPEED]), 0.0, 2.0) == pytest.approx(ends(2.0), abs=1e-14)
    assert corners(kernels, np.array([-SPEED]), 0.0, 1.0) == pytest.approx(
        sorted((SHIFT - k + n) / SPEED for k in KNOTS[:-1] for n in range(4) if 0 < SHIFT - k + n < 3)
    )
    assert not len(corners(kernels, np.array([0.0]), 0.0, 2.0)) and not len(corners(kernels, np.array([1e9]), 0.0, 2.0))


@pytest.mark.parametrize("argument", [lambda m, w: sympy.sin(m.time), lambda m, w: m.elements["s"] + m.time, lambda m, w: w + 0.0])
def test_what_is_no_straight_line_over_time_is_left_to_error_control(argument):
    kernels = ncgen.compile(block(argument), "numpy")
    assert not len(corners(kernels, kernels.p0, 0.0, 2.0))


def test_a_driver_by_a_spline_has_corners_in_its_second_derivative():
    m = ncgen.Model("driven")
    axis = m.vector("axis", (1, 0, 0), fixed=True)
    O, A = m.point("O", (0, 0), fixed=True), m.point("A", (0, 0), fixed="y")
    s = m.slide("s", O, A, axis)
    m.body("block", [A], mass=1.0)
    m.drive(s, m.spline("profile", (0.0, 0.4, 1.0, 1.5), (0.0, 1.0, 0.5, 0.0))(m.time))
    kernels = ncgen.compile(m, "numpy")
    assert corners(kernels, kernels.p0, 0.0, 1.2).tolist() == [0.4, 1.0]
