"""The cam against its one equation of motion, with SciPy's periodic spline and its derivatives."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline

import ncgen
from ncgen.exchange.examples import example_module

CAM = example_module("cam")
LIFT = CubicSpline(np.radians(15 * np.arange(25)), np.array(CAM.LIFT) / 1000, bc_type="periodic")


def press(psi, rate):
    """What spring, guide and weight press with onto the cam (N)."""
    return CAM.PRELOAD + CAM.STIFFNESS * LIFT(psi) + CAM.DAMPING * LIFT(psi, 1) * rate + CAM.FOLLOWER * CAM.GRAVITY


def acceleration(t, psi, rate):
    """(J + m f'²) ψ̈ + m f' f'' ψ̇² = τ − f' (what presses), f the lift."""
    s = np.clip(t / CAM.RELEASED, 0, 1)
    torque = CAM.TORQUE * (6 * s**5 - 15 * s**4 + 10 * s**3) * (1 - rate / CAM.SPEED)
    slope = LIFT(psi, 1)
    load = slope * (press(psi, rate) + CAM.FOLLOWER * LIFT(psi, 2) * rate**2)
    return (torque - load) / (CAM.SHAFT + CAM.FOLLOWER * slope**2)


@pytest.fixture(scope="module")
def exact():
    """Angle and rate (2, 51) in half a second, from knot to knot by short steps."""
    found = solve_ivp(
        lambda t, y: [y[1], acceleration(t, *y)], (0, 0.5), [0, 0], "DOP853", np.linspace(0, 0.5, 51), rtol=1e-12, atol=1e-12, max_step=1e-3
    )
    return found.y


@pytest.mark.parametrize(("backend", "points"), [("c", 51), ("numpy", 6)])
def test_motion(exact, backend, points):
    """Over three turns in C, and where they begin in NumPy."""
    run = ncgen.simulate(ncgen.compile(ncgen.load("cam"), backend), 0.01 * (points - 1), rtol=1e-10, points=points)
    psi, rate = exact[:, :points]
    assert exact[0, -1] > 6 * np.pi
    np.testing.assert_allclose(run["psi"], psi, atol=2e-9)
    np.testing.assert_allclose(run["rate(psi)"], rate, atol=5e-8)
    np.testing.assert_allclose(run["F.y"], CAM.BASE + LIFT(psi), atol=2e-11)


def test_outputs(exact):
    """Lift, slope, and the force between cam and follower, by Newton's law; it never lets go."""
    run = ncgen.simulate(ncgen.compile(ncgen.load("cam")), 0.5, rtol=1e-10, points=51)
    psi, rate = exact
    up = LIFT(psi, 2) * rate**2 + LIFT(psi, 1) * np.array([acceleration(*each) for each in zip(run.t, psi, rate, strict=True)])
    np.testing.assert_allclose(run["lift"], LIFT(psi), atol=2e-11)
    np.testing.assert_allclose(run["slope"], LIFT(psi, 1), atol=2e-11)
    contact = press(psi, rate) + CAM.FOLLOWER * up
    np.testing.assert_allclose(run["contact"], contact, atol=1e-7)
    assert np.min(contact) > 10
