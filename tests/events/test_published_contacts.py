"""Mechanisms with contacts that others have published: a slider with clearance, a woodpecker toy, a walker."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import ncgen
from examples.contacts import woodpecker
from examples.impacts import clearance, turning_crank, walker


def arms(values: np.ndarray, kernels: ncgen.Kernels) -> np.ndarray:
    """Of crank, rod and slider, from one end to the other: of positions (m) or velocities (m/s); (3, 2)."""
    at = {name: values[kernels.index[f"{name}.x"] :][:2] for name in ("A", "B", "P1", "P2")}
    return np.array([at["A"], at["B"] - at["A"], at["P2"] - at["P1"]])


def angles(q: np.ndarray, kernels: ncgen.Kernels) -> np.ndarray:
    """Of crank, rod and slider (rad)."""
    return np.arctan2(*arms(q, kernels).T[::-1])


def angular_velocities(q: np.ndarray, qd: np.ndarray, kernels: ncgen.Kernels) -> np.ndarray:
    """Of crank, rod and slider (rad/s)."""
    (x, y), (u, v) = arms(q, kernels).T, arms(qd, kernels).T
    return (x * v - y * u) / (x * x + y * y)


def test_the_first_contact_of_a_slider_with_clearance():
    kernels = ncgen.compile(clearance())
    run = ncgen.simulate(kernels, 0.05, qd0=turning_crank(), rtol=1e-12)
    first = run.events[0]
    assert first.name == "corner1" and first.t == pytest.approx(0.00269090364841, rel=1e-10)
    assert angles(first.q, kernels) == pytest.approx([0.355129243, -0.171430644, -2.69090365e-5], rel=1e-8)
    assert angular_velocities(first.q, first.before, kernels) == pytest.approx([109.580168, -49.3457894, -0.01], rel=5e-9)
    assert len(run.events) > 10 and run.energy_drift < 1e-8


def test_a_woodpecker_goes_down_its_pole():
    """Events of the first period, and the limit cycle (Glocker and Studer, ASME DETC2001/VIB-21608; digits by event-driven integration)."""
    m, start = woodpecker()
    run = ncgen.simulate(ncgen.compile(m), 20.0, qd0=start, rtol=1e-11, points=2)
    seen = [(each.name, each.transition) for each in run.events[1:6]]
    assert seen == [("lower", "sticks"), ("lower", "slips"), ("lower", "leaves"), ("upper", ""), ("beak", "")]
    expected = [0.021636314053, 0.061213931248, 0.067023398145, 0.077877992290, 0.080988805419]
    assert [each.t for each in run.events[1:6]] == pytest.approx(expected, rel=1e-10)
    sticks = [each for each in run.events if (each.name, each.transition) == ("lower", "sticks")]
    periods = np.diff([each.t for each in sticks])
    assert periods[-1] == pytest.approx(0.145976065, abs=1e-9)
    assert 1e3 * (sticks[-2].q[0] - sticks[-1].q[0]) == pytest.approx(19.4453, abs=1e-4)
    changes = np.diff(periods)
    assert changes[46] / changes[45] == pytest.approx(-0.8392, abs=5e-5)
    assert run.energy_drift < 1e-8


def steps(kernels: ncgen.Kernels, theta: float, rate: float, count: int) -> list[tuple[float, float, float]]:
    """(time, angle and velocity of the leg that begins to stand) of some steps, after the first strike from such a leg."""
    start = {"A1.x": rate, "A2.x": math.cos(2 * theta) * rate}
    run = ncgen.simulate(kernels, 4.0 * (count + 0.1), q0={"A1.x": theta - 1e-9, "A2.x": -theta}, qd0=start, rtol=1e-11, points=2)
    strikes = [each for each in run.events if np.any(each.before != each.after)][:count]
    places = [1 - k % 2 for k in range(len(strikes))]
    return [(each.t, float(each.q[k]), float(each.after[k])) for each, k in zip(strikes, places, strict=True)]


@pytest.mark.parametrize(
    ("slope", "cycle"),
    [(0.009, (0.2003109005443, -0.1998324730050, 3.882463752851)), (0.004, (0.1533895648762, -0.1560801466757, 3.852613461751))],
)
def test_the_simplest_walker_walks(slope, cycle):
    """To its limit cycle from beside it."""
    kernels = ncgen.compile(walker(slope))
    (before, _, _), (t, theta, rate) = steps(kernels, cycle[0] + 1e-3, cycle[1] - 1e-3, 55)[-2:]
    assert [theta, rate, t - before] == pytest.approx(cycle, rel=1e-9)


def stride(theta: complex, rate: complex, slope: float) -> np.ndarray:
    """The next (θ, θ̇) after a strike by Garcia's equations of θ and the angle φ between the legs; imaginary parts are first changes."""

    def changes(_: float, y: np.ndarray) -> np.ndarray:
        theta, phi, rate, opening = y
        lean = np.sin(theta - slope)
        return np.array([rate, opening, lean, lean + (rate**2 - np.cos(theta - slope)) * np.sin(phi)])

    def strikes(_: float, y: np.ndarray) -> float:
        return (y[1] - 2 * y[0]).real

    strikes.terminal, strikes.direction = True, 1.0
    kept = np.cos(2 * theta)
    start = np.array([theta, 2 * theta, rate, (1 - kept) * rate], dtype=complex)
    away = solve_ivp(changes, (0.0, 2.5), start, method="DOP853", rtol=1e-13, atol=1e-14).y[:, -1]
    y = solve_ivp(changes, (2.5, 6.0), away, method="DOP853", rtol=1e-13, atol=1e-14, events=strikes).y_events[0][0]
    slopes = changes(0.0, y)
    y = y - slopes * 1j * (y[1] - 2 * y[0]).imag / (slopes[1] - 2 * slopes[0]).real  # at the time at which it strikes
    return np.array([-y[0], np.cos(2 * y[0]) * y[2]])


def test_the_multipliers_of_the_simplest_walker():
    """Of a period with its strike, from and to between two strikes: 1 along the motion, 0 across, and those of a stride."""
    kernels, (theta, rate, period) = ncgen.compile(walker(0.009)), (0.2003109005443, -0.1998324730050, 3.882463752851)
    h = 1e-30
    jacobian = np.array([stride(theta + h * 1j, rate, 0.009).imag, stride(theta, rate + h * 1j, 0.009).imag]).T / h
    expected = sorted(np.linalg.eigvals(jacobian), key=lambda z: z.imag)
    assert expected == pytest.approx([-0.19010 - 0.55760j, -0.19010 + 0.55760j], abs=1e-5)
    start = {"A1.x": rate, "A2.x": math.cos(2 * theta) * rate}
    inside = ncgen.simulate(kernels, 40 * period + 1.0, q0={"A1.x": theta - 1e-9, "A2.x": -theta}, qd0=start, rtol=1e-12, points=2)
    names = kernels.coordinates
    q0, qd0 = (dict(zip(names, values[-1].tolist(), strict=True)) for values in (inside.q, inside.qd))
    found = ncgen.sensitivities(kernels, period, 600, by=[*names, *(f"rate({name})" for name in names)], q0=q0, qd0=qd0)
    assert len(found.events) == 1
    exchanged = np.vstack([found.q_by[-1][::-1], found.qd_by[-1][::-1]])  # the legs have changed their parts
    multipliers = sorted(np.linalg.eigvals(exchanged), key=lambda z: (z.imag, z.real))
    assert multipliers == pytest.approx([expected[0], 0.0, 1.0, expected[1]], abs=1e-8)
