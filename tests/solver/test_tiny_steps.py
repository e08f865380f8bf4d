"""Starts from where steps are first far shorter than the run."""

import numpy as np
import pytest

import ncgen


@pytest.mark.parametrize("rtol", [1e-9, 1e-11])
def test_a_start_where_rounding_is_most_of_the_error(rtol):
    """A top at 471 rad/s: at t = 0 a velocity is 0 and its slope 2e5, so that no step would be short enough for its share of rtol alone."""
    tilt, turn, mass, away = 0.5, 1.7, 1.5, 0.3
    along, across = np.array([np.sin(tilt), 0, np.cos(tilt)]), np.array([np.cos(tilt), 0, -np.sin(tilt)])
    spin = (mass * 9.81 * away + (0.02 + mass * away**2) * turn**2 * np.cos(tilt)) / (0.006 * turn)  # of steady precession
    m = ncgen.Model("fast")
    O = m.point("O", (0, 0, 0), fixed=True)
    axes = {"u": along, "e": across, "f": np.array([0.0, 1.0, 0.0])}
    tensor = 0.006 * np.outer(along, along) + 0.02 * (np.eye(3) - np.outer(along, along))
    m.body("top", [O], [m.vector(name, tuple(axis)) for name, axis in axes.items()], mass=mass, com=tuple(away * along), inertia=tensor)
    m.gravity((0, 0, -9.81))
    omega = np.array([0, 0, turn]) + (spin - turn * np.cos(tilt)) * along
    qd0 = {f"{n}.{x}": float(v) for n, axis in axes.items() for x, v in zip("xyz", np.cross(omega, axis), strict=True)}
    kernels = ncgen.compile(m)

    run = ncgen.simulate(kernels, 0.3, qd0=qd0, rtol=rtol, points=31)
    np.testing.assert_allclose(run["u.z"], np.cos(tilt), rtol=0, atol=10 * rtol)


@pytest.mark.parametrize("rtol", [1e-8, 1e-10])
@pytest.mark.parametrize("mass, force, velocity", [(7.5, 1.8e6, 818.0), (1.0, 1e9, 1e3), (1e3, 1e9, 1.0), (1e3, 1e12, 1.0)])
def test_a_start_under_a_force_of_any_size(mass, force, velocity, rtol):
    """m ẍ = F / (1 + t)². Work begins with 0 and made the first step as short as nothing, from where errors are rounding: 10,000 steps, or
    a refusal."""
    m = ncgen.Model("shot")
    B = m.point("B", (0, 0))
    m.body("ball", points=[B], mass=mass)
    m.force(B, (force / (1 + m.time) ** 2, 0.0))
    run = ncgen.simulate(ncgen.compile(m, "c"), 0.05, qd0={"B.x": velocity}, rtol=rtol)
    expected = velocity * run.t + force / mass * (run.t - np.log1p(run.t))
    np.testing.assert_allclose(run["B.x"], expected, rtol=100 * rtol, atol=0)
    assert run.statistics.evaluations < 1000
