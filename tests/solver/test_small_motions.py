"""Equilibria and small motions beside them, against formulas."""

from __future__ import annotations

import numpy as np
import pytest

import ncgen
from ncgen.errors import ConvergenceError, ModelError

G = 9.81


def hanging(masses, lengths, gravity=True, pull=None):
    """Point masses on massless bars below one another."""
    model = ncgen.Model("hanging")
    above, depth = model.point("P0", (0, 0), fixed=True), 0.0
    for k, (mass, length) in enumerate(zip(masses, lengths, strict=True), 1):
        depth -= length
        point = model.point(f"P{k}", (0, depth))
        model.body(f"m{k}", points=[point], mass=mass)
        model.distance(above, point)
        above = point
    if gravity:
        model.gravity((0, -G, 0))
    if pull:
        model.force(above, pull)
    return ncgen.compile(model, backend="numpy")


def test_pendulum():
    """ω = √(g/L)."""
    small = ncgen.linearise(hanging([2.0], [0.7]))
    assert small.frequencies == pytest.approx([np.sqrt(G / 0.7) / (2 * np.pi)], rel=1e-12)
    assert small.stable
    assert small.positions == small.velocities == ("P1.x",)


def test_compound_pendulum():
    """A uniform rod: ω² = 3 g / 2 L."""
    model = ncgen.Model("rod")
    a, b = model.point("A", (0, 0), fixed=True), model.point("B", (0, -1.3))
    model.body("rod", points=[a, b], mass=0.4, inertia=0.4 * 1.3**2 / 12)
    model.gravity((0, -G, 0))
    small = ncgen.linearise(ncgen.compile(model, backend="numpy"))
    assert small.frequencies == pytest.approx([np.sqrt(1.5 * G / 1.3) / (2 * np.pi)], rel=1e-12)


def test_double_pendulum():
    """Equal masses and lengths: ω² = (2 ∓ √2) g/L, amplitudes of the angles 1 : ±√2."""
    small = ncgen.linearise(hanging([1.0, 1.0], [0.5, 0.5]))
    assert 2 * np.pi * small.frequencies == pytest.approx(np.sqrt((2 + np.array([-1, 1]) * np.sqrt(2)) * G / 0.5), rel=1e-12)
    for k, ratio in enumerate([1 + np.sqrt(2), 1 - np.sqrt(2)]):
        mode = small.mode(k)
        assert mode["P2.x"] / mode["P1.x"] == pytest.approx(ratio, rel=1e-10)
        assert abs(mode["P1.y"]) < 1e-12
        assert max(map(abs, mode.values())) == pytest.approx(1.0, abs=1e-14)


def test_damped_oscillator():
    """λ = −c/2m ± √(c²/4m² − k/m)."""
    model = ncgen.Model("oscillator")
    a, b = model.point("A", (0, 0), fixed=True), model.point("B", (1, 0))
    model.body("mass", points=[b], mass=2.0)
    model.constrain(b.y)
    model.spring(a, b, stiffness=50.0, damping=4.0, free_length=1.0)
    small = ncgen.linearise(ncgen.compile(model, backend="numpy"))
    assert small.eigenvalues == pytest.approx([-1 - 1j * np.sqrt(24), -1 + 1j * np.sqrt(24)], rel=1e-12)
    assert small.damping_ratios == pytest.approx([0.2], rel=1e-12)


def test_it_falls_to_the_bottom():
    found = ncgen.equilibrium(hanging([1.0, 2.0], [0.5, 0.7]), q=[0.5, 0.0, 0.5, 0.7])
    assert found.q == pytest.approx([0, -0.5, 0, -1.2], abs=1e-12)
    assert found.stable


def test_a_hilltop_is_kept_and_said():
    kernels = hanging([1.0], [0.7])
    top = ncgen.equilibrium(kernels, q=[0.0, 0.7])
    assert top.q == pytest.approx([0, 0.7], abs=0)
    assert not top.stable
    assert ncgen.equilibrium(kernels, q=[0.1, np.sqrt(0.48)], kind="nearest").q == pytest.approx([0, 0.7], abs=1e-12)
    assert not ncgen.linearise(kernels, q0=[0.0, 0.7]).stable


def test_pulled_aside():
    """A side force F on a hanging mass: tan θ = F/(m g), and the bar carries √(F² + (m g)²)."""
    kernels = hanging([1.5], [0.7], pull=(4.0, 0.0, 0.0))
    found = ncgen.equilibrium(kernels)
    assert np.arctan2(found.q[0], -found.q[1]) == pytest.approx(np.arctan2(4.0, 1.5 * G), abs=1e-12)
    tension = np.linalg.norm(kernels.jacobian(found.q).T @ found.lam)
    assert tension == pytest.approx(np.hypot(4.0, 1.5 * G), rel=1e-12)


def test_a_long_chain_that_stands_falls_until_it_hangs():
    """Straight down, from nearly upright: steps on the way do not close and are halved."""
    n, up = 60, np.radians(75)
    standing = np.outer(0.1 * np.arange(1, n + 1), [np.cos(up), np.sin(up)])
    found = ncgen.equilibrium(hanging([1.0] * n, [0.1] * n), q=standing.ravel())
    assert found.stable
    np.testing.assert_allclose(found.q[1::2], -0.1 * np.arange(1, n + 1), rtol=1e-12)


def test_what_balances_to_rounding_stays_where_it_is():
    """On a slope along which nothing pulls every place is one of balance: what is left over is rounding beside what the slope holds."""
    model = ncgen.Model("shelf")
    place, across, up = np.array([0.1, 0.2, 0.3]), np.array([2.0, -1.0, 0.3]), np.array([0.2, 0.7, 1.1])
    bob = model.point("P", place)
    model.body("bob", points=[bob], mass=1.3)
    for normal in (across, up):
        model.constrain(sum(n * (c - x) for n, c, x in zip(normal, (bob.x, bob.y, bob.z), place, strict=True)))
    model.gravity(G * across / np.linalg.norm(across))
    kernels = ncgen.compile(model, backend="numpy")
    along = np.cross(across, up) / np.linalg.norm(np.cross(across, up))
    for way in np.linspace(-3.0, 3.0, 13):
        there = place + way * along
        found = ncgen.equilibrium(kernels, q=there)
        np.testing.assert_allclose(found.q, there, rtol=0, atol=1e-14)
        np.testing.assert_allclose(kernels.jacobian(there).T @ found.lam, 1.3 * G * across / np.linalg.norm(across), atol=1e-13)


@pytest.mark.parametrize("mass", [1.0, 1e12])
@pytest.mark.filterwarnings("error")
def test_no_balance(mass):
    """A free mass falls for ever, a heavy one too, without an overflow on the way."""
    model = ncgen.Model("falling")
    model.body("m", points=[model.point("P", (0, 0))], mass=mass)
    model.gravity((0, -G, 0))
    with pytest.raises(ConvergenceError, match="falling: no equilibrium found in 220 steps, 1 of the forces is left over"):
        ncgen.equilibrium(ncgen.compile(model, backend="numpy"))


def test_refused():
    with pytest.raises(ModelError, match="kind 'any' is unknown"):
        ncgen.equilibrium(hanging([1.0], [1.0]), kind="any")
    with pytest.raises(ModelError, match="mode 1: there are 1 modes"):
        ncgen.linearise(hanging([1.0], [1.0])).mode(1)
