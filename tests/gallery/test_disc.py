"""The rolling disc against its equations of motion in lean, heading and spin."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import ncgen
from ncgen.comparisons.hard_tops import disc_centre, rolling_disc
from ncgen.errors import ModelError
from ncgen.exchange.examples import example_module
from ncgen.solver.positions.position import residual

MASS, RADIUS, GRAVITY = 2.0, 0.3, 9.81
ACROSS, ALONG = MASS * RADIUS**2 / 4, MASS * RADIUS**2 / 2
"""Moments of inertia of a thin disc about a diameter and about its axle."""


def roll(duration, points, rtol=1e-10, **options):
    """A run of the disc, drawn without spokes."""
    model = example_module("disc").build(spokes=0, **options)
    kernels = ncgen.compile(model, backend="numpy")
    start = model.simulation_options["zd0"]
    return ncgen.simulate(kernels, duration, integrator="dop853", points=points, rtol=rtol, atol=rtol, zd0=start)


def axle(y):
    lean, heading = y[:2]
    return np.transpose([-np.cos(lean) * np.sin(heading), np.cos(lean) * np.cos(heading), -np.sin(lean)])


@pytest.fixture(scope="module")
def wobble():
    return roll(0.6, points=7)


def test_three_velocities_are_free_and_five_coordinates(wobble):
    disc = wobble.kernels
    assert ncgen.freedom(disc).dof == 3
    assert len(ncgen.freedom(disc).redundant) == 0
    assert disc.n - len(disc.holonomic) == 5


def test_spokes_add_nothing_to_the_freedom():
    disc = ncgen.compile(ncgen.load("disc"), backend="numpy")
    found = ncgen.freedom(disc)
    assert (found.dof, len(found.redundant)) == (3, 0)


def test_it_closes_from_a_perturbed_start(wobble):
    disc = wobble.kernels
    noise = 0.01 * disc.length * np.random.default_rng(0).standard_normal(disc.n)
    q = ncgen.assemble(disc, disc.q0 + noise)
    assert residual(disc, q) < 1e-11
    assert np.max(np.abs(q - disc.q0)) < 0.05


def test_energy(wobble):
    assert wobble.energy_drift < 1e-8
    assert np.max(wobble.violation()) < 1e-11


def test_against_newton_and_euler(wobble):
    """Released at 20 degrees, rolling at 1.5 m/s and turning at 0.5 rad/s."""
    lean, turning = np.radians(20.0), 0.5
    start = [lean, 0, 0, 0, 0, turning, 1.5 / RADIUS]
    y = solve_ivp(rolling_disc, (0, wobble.t[-1]), start, method="DOP853", t_eval=wobble.t, rtol=1e-12, atol=1e-12).y
    assert np.allclose(wobble.point("C"), disc_centre(y), rtol=0, atol=1e-8)
    assert np.allclose(wobble.vector("u"), axle(y), rtol=0, atol=1e-8)
    assert np.allclose(np.sum(wobble.angular_velocity("disc") * wobble.vector("u"), axis=1), y[6], rtol=0, atol=1e-7)


def test_upright_it_rolls_straight_ahead():
    run = roll(0.5, points=3, rtol=1e-9, lean=0.0, speed=2.0, steer=0.0)
    assert np.allclose(run.point("C"), np.outer(2.0 * run.t, [1, 0, 0]) + [0, 0, RADIUS], rtol=0, atol=1e-9)
    assert np.allclose(run.angular_velocity("disc"), [0, 2.0 / RADIUS, 0], rtol=0, atol=1e-7)


def test_leaning_it_rolls_in_a_circle():
    """Where lean, speed and turning balance, all three stay as they are."""
    lean, turning = np.radians(15.0), 1.2
    s, c = np.sin(lean), np.cos(lean)
    spin = (MASS * GRAVITY * RADIUS * s - ACROSS * turning**2 * s * c) / ((ALONG + MASS * RADIUS**2) * turning * c)
    run = roll(0.5, points=3, rtol=1e-9, lean=15.0, speed=RADIUS * spin, steer=turning)
    size = RADIUS * spin / turning
    expected = [size * np.sin(turning * run.t), RADIUS * s + size * (1 - np.cos(turning * run.t)), RADIUS * c + 0 * run.t]
    assert np.allclose(run.point("C"), np.transpose(expected), rtol=0, atol=1e-8)


def test_ten_seconds_in_c_against_newton_and_euler():
    """By default: over all coordinates, by recursion; no coordinate of the disc, which turn with it, is better than the others."""
    kernels = ncgen.compile(example_module("disc").build(spokes=0), backend="c")
    zd0 = kernels.model.simulation_options["zd0"]
    run = ncgen.simulate(kernels, 10.0, integrator="dop853", rtol=1e-10, atol=1e-11, points=11, zd0=zd0)
    assert run.engine == "emitted"
    start = [np.radians(20.0), 0, 0, 0, 0, 0.5, 1.5 / RADIUS]
    y = solve_ivp(rolling_disc, (0, run.t[-1]), start, method="DOP853", t_eval=run.t, rtol=1e-12, atol=1e-12).y
    assert np.allclose(run.point("C"), disc_centre(y), rtol=0, atol=1e-6)
    assert np.allclose(run.vector("u"), axle(y), rtol=0, atol=1e-6)


def test_a_disc_that_lies_flat_is_refused():
    with pytest.raises(ModelError, match="rolling of disc: the disc lies flat, its axle u is along the normal"):
        example_module("disc").build(lean=90.0, spokes=0)


def test_a_start_that_lies_flat_is_refused(wobble):
    """The contact row is closed there, but has no slope."""
    disc = wobble.kernels
    flat = dict.fromkeys(disc.coordinates, 0.0) | {"u.z": -1.0, "v.x": 1.0}
    q0 = np.array([flat[name] for name in disc.coordinates])
    q0[[disc.index[name] for name in disc.coordinates if name.startswith("disc.aux")]] = [0.0, -1.0, 0.0]
    for ask in (lambda: ncgen.simulate(disc, 0.1, q0=q0), lambda: ncgen.freedom(disc, q0)):
        with pytest.raises(ModelError, match=r"disc: .*constraint .*\(.*joint rolling of disc\) is not a number at t = 0 s"):
            ask()
