"""The arm against Newton's and Euler's equations in joint angles, body by body, integrated by SciPy."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

import ncgen
from ncgen.exchange.examples import example_module

N = 7
EXAMPLE = example_module("arm")
GRAVITY = np.array([0.0, 0.0, -9.81])


def torques(turned, rate, acceleration, gravity=GRAVITY):
    """Torques at the joints, with angles from the start: accelerations outward, forces and moments inward (Luh, Walker, Paul 1980)."""
    turn, origin = Rotation.identity(), np.zeros(3)
    omega, alpha, lift = np.zeros(3), np.zeros(3), -gravity
    axes, places, loads = [], [], []
    for i in range(N):
        axis = turn.apply(EXAMPLE.axis(i))
        alpha = alpha + np.cross(omega, axis) * rate[i] + axis * acceleration[i]
        omega = omega + axis * rate[i]
        turn = turn * Rotation.from_rotvec(turned[i] * EXAMPLE.axis(i))
        step, mass = turn.apply(EXAMPLE.step(i)), EXAMPLE.mass(i, N)
        inertia = turn.as_matrix() @ EXAMPLE.inertia(i, N) @ turn.as_matrix().T
        centre = lift + np.cross(alpha, step / 2) + np.cross(omega, np.cross(omega, step / 2))
        loads.append((mass * centre, inertia @ alpha + np.cross(omega, inertia @ omega), origin + step / 2))
        axes.append(axis)
        places.append(origin)
        lift = lift + np.cross(alpha, step) + np.cross(omega, np.cross(omega, step))
        origin = origin + step
    return np.array([
        axes[i] @ sum(moment + np.cross(centre - places[i], force) for force, moment, centre in loads[i:]) for i in range(N)
    ])  # fmt: skip


def accelerations(turned, rate):
    still, none = np.zeros(N), np.zeros(3)
    mass = np.array([torques(turned, still, unit, none) for unit in np.eye(N)]).T
    return np.linalg.solve(mass, -torques(turned, rate, still))


@cache
def expected(duration: float) -> np.ndarray:
    """Angles from the start after a time (s)."""
    rates = example_module("arm").build(N).simulation_options["zd0"]
    start = np.concatenate([np.zeros(N), list(rates.values())])
    run = solve_ivp(
        lambda t, y: np.concatenate([y[N:], accelerations(y[:N], y[N:])]), (0, duration), start, method="DOP853", rtol=1e-10, atol=1e-12
    )
    return run.y[:N, -1]


@pytest.mark.parametrize("engine", ["c", "emitted"])
def test_motion_is_that_of_newton_and_euler(engine):
    kernels = ncgen.compile(ncgen.load("arm"), "c")
    given = kernels.model.simulation_options["zd0"]
    run = ncgen.simulate(kernels, 0.1, zd0=given, formalism="coordinate-partitioning", rtol=1e-11, engine=engine, points=3)
    turned = [run[name][-1] - run[name][0] for name in given]
    assert turned == pytest.approx(expected(0.1).tolist(), abs=1e-8)
    assert run.engine == engine


def test_coordinates_of_any_number_of_links():
    """Of every link a point, an axis and an angle."""
    for n in (1, 3, 12):
        kernels = ncgen.compile(EXAMPLE.build(n), "numpy")
        assert (kernels.n, kernels.m, ncgen.freedom(kernels).dof) == (7 * n, 6 * n, n)
