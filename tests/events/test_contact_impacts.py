"""Impacts of contacts with friction, alone and together, by the laws of Newton and Poisson."""

from __future__ import annotations

import math

import numpy as np
import pytest
import scipy.optimize
from test_contacts import RADIUS, G, disc, spin, velocity

import ncgen
from ncgen.mechanism.impacts_in_c import Blow, impact


def test_a_superball_turns_its_sliding_velocity_round():
    """Restitution 1 along and across: w⁺ = −w⁻ with 2/7 of the mass, and no energy is lost."""
    kernels = ncgen.compile(disc(1.0, friction=10.0, restitution=1.0, tangential=1.0))
    run = ncgen.simulate(kernels, 0.6, qd0=velocity(2.0, 3.0), rtol=1e-11)
    (hit,) = run.events
    slip = 2.0 + 3.0 * RADIUS
    assert hit.after[0] == pytest.approx(2.0 - 4 / 7 * slip, rel=1e-9)
    assert spin(hit.q, hit.after) == pytest.approx(3.0 - 10 / 7 * slip / RADIUS, rel=1e-9)
    assert hit.after[1] == pytest.approx(math.sqrt(2 * G * 0.9), rel=1e-9) and hit.energy_lost == pytest.approx(0.0, abs=1e-12)


def block(**options: object) -> ncgen.Model:
    """A plate on two tips, 1 m apart, that falls flat on the ground."""
    m = ncgen.Model("block")
    up, O = m.vector("up", (0, 1), fixed=True), m.point("O", (0, 0), fixed=True)
    tips = {"left": m.point("A", (0, 0.5)), "right": m.point("B", (1, 0.5))}
    body = m.body("block", list(tips.values()), mass=1.0, com=(0.5, 0.7), inertia=0.1)
    m.gravity((0, -G))
    for name, P in tips.items():
        m.contact(name, body, P, m.ground, O, normal=up, friction=0.3, **options)
    return m


def test_a_block_lands_on_two_tips_and_stops():
    """Both together take 0.3 of the vertical momentum from the horizontal one; then it slides with 0.3 g and stops, for ever."""
    start = {"A.x": 1.0, "B.x": 1.0, "A.y": 0.0, "B.y": 0.0}
    run = ncgen.simulate(ncgen.compile(block(order="simultaneous")), 1.0, qd0=start, rtol=1e-11)
    fall = math.sqrt(2 * 0.5 / G)
    left = 1.0 - 0.3 * G * fall
    hits, stops = [each for each in run.events if not each.transition], [each for each in run.events if each.transition == "sticks"]
    assert [each.t for each in hits] == pytest.approx([fall] * 2, rel=1e-10) and hits[0].after[0] == pytest.approx(left, rel=1e-9)
    assert sum(each.impulse for each in hits) == pytest.approx(G * fall, rel=1e-9)
    assert [each.name for each in stops] == ["left", "right"] and stops[0].t == pytest.approx(fall + left / (0.3 * G), rel=1e-10)
    assert run["A.x"][-1] == pytest.approx(fall + left**2 / (0.6 * G), rel=1e-9) and not np.any(run.qd[-1])


def test_the_law_of_several_contacts_must_be_said():
    start = {"A.x": 1.0, "B.x": 1.0, "A.y": 0.0, "B.y": 0.0}
    with pytest.raises(ncgen.ModelError, match='several impacts at one instant, of left, right .* order="in turn"'):
        ncgen.simulate(ncgen.compile(block()), 1.0, qd0=start)


def double_pendulum(law: str) -> ncgen.Model:
    """Two rods of 1 m at 20° and 30°, whose end is about to hit the ground (Kane and Levinson, Dynamics, 1985)."""
    first, second = math.radians(20), math.radians(30)
    m = ncgen.Model("kane")
    A = (math.sin(first), -math.cos(first))
    B = (A[0] + math.sin(second), A[1] - math.cos(second))
    up, O, F = m.vector("up", (0, 1), fixed=True), m.point("O", (0, 0), fixed=True), m.point("F", (0, B[1] - 1e-9), fixed=True)
    A, B = m.point("A", A), m.point("B", B)
    m.body("one", [O, A], mass=1.0, inertia="rod")
    two = m.body("two", [A, B], mass=1.0, inertia="rod")
    m.contact("tip", two, B, m.ground, F, normal=up, friction=0.5, restitution=0.5, law=law)
    return m


def test_newton_would_gain_energy_where_poisson_does_not():
    kernels = ncgen.compile(double_pendulum("poisson"))
    A, B = (np.array([-kernels.q0[1], kernels.q0[0]]), np.array([kernels.q0[1] - kernels.q0[3], kernels.q0[2] - kernels.q0[0]]))
    start = dict(zip(kernels.coordinates, np.concatenate([-0.1 * A, -0.1 * A - 0.2 * B]), strict=True))
    run = ncgen.simulate(kernels, 1e-4, qd0=start)
    assert 0 < run.events[0].energy_lost < 0.02
    with pytest.raises(ncgen.ModelError, match=r'the impact of tip would gain 0.013619 J; .* take law="poisson" or less restitution'):
        ncgen.simulate(ncgen.compile(double_pendulum("newton")), 1e-4, qd0=start)


@pytest.mark.parametrize("directions", [1, 2])
@pytest.mark.parametrize("seed", range(10))
def test_random_impulses_obey_the_laws(directions, seed):
    """Of three contacts: 0 ≤ Λ ⊥ u⁺ + e u⁻ ≥ 0, and friction against the sliding velocity or less than its limit."""
    rng = np.random.default_rng(seed)
    size = 3 * (1 + directions)
    root = rng.normal(size=(size, size + 3))
    G, u = root @ root.T, rng.normal(size=size) - np.tile([1.0, *[0.0] * directions], 3)
    mu, e, e_t = rng.uniform(0, 0.4, 3), rng.uniform(0, 1, 3), rng.uniform(0, 1, 3)
    blows = [Blow(k * (1 + directions), directions, False, e[k], mu[k], e_t[k]) for k in range(3)]
    found = impact(G, u, blows, "NCGEN_SIMULTANEOUS", np.zeros(size), 1e3)
    assert found.closes and found.failure is None
    impulses, after = found.impulses, u + G @ found.impulses
    assert found.velocities == pytest.approx(after, rel=1e-12, abs=1e-12)
    for k, blow in enumerate(blows):
        gap = blow.gap
        across = slice(gap + 1, gap + 1 + directions)
        normal, push, slip = impulses[gap], impulses[across], after[across] + e_t[k] * u[across]
        opening = after[gap] + e[k] * u[gap]
        assert normal >= -1e-12 and opening >= -1e-9 and abs(normal * opening) < 1e-9
        assert np.linalg.norm(push) <= mu[k] * normal + 1e-9
        assert np.linalg.norm(slip) * (mu[k] * normal) == pytest.approx(-push @ slip, abs=1e-8)


@pytest.mark.parametrize("seed", range(20))
def test_random_gaps_without_friction_follow_moreau(seed):
    """Together: the impulses of least squares of SciPy's nnls, also where gaps depend on each other (up to 12 gaps of 6 motions)."""
    rng = np.random.default_rng(seed)
    count = int(rng.integers(2, 13))
    W = rng.normal(size=(count, 6)) * rng.choice([1e-3, 1.0, 1e3], size=(count, 1))
    u, e = W @ (rng.normal(size=6) - W.T @ rng.uniform(0, 1, count) / np.linalg.norm(W)), float(rng.uniform(0, 1))
    found = impact(W @ W.T, u, [Blow(k, 0, False, e, 0.0, 0.0) for k in range(count)], "NCGEN_SIMULTANEOUS", np.zeros(count), 1e9)
    expected, _ = scipy.optimize.nnls(W.T, -(1 + e) * np.linalg.lstsq(W, u, rcond=None)[0])
    assert found.failure is None and found.closes == bool(np.any(u < 0)) and np.all(found.impulses >= 0)
    size = np.linalg.norm(W, axis=1) * np.linalg.norm(W.T @ expected)
    assert np.all(np.abs(W @ (W.T @ (found.impulses - expected))) <= 1e-9 * size)
    lost = -expected @ (u + W @ (W.T @ expected) / 2)
    assert np.sum(found.lost) == pytest.approx(lost, rel=1e-9, abs=1e-9 * np.sum(expected * np.abs(u)))


def test_balls_in_turn_pass_the_velocity_on():
    """Newton's cradle: the fastest gap first, so that the last of three balls of 1 kg takes 2 m/s along, in two impacts."""
    W = np.array([[-1.0, 1.0, 0.0], [0.0, -1.0, 1.0]])
    found = impact(W @ W.T, W @ [2.0, 0.0, 0.0], [Blow(k, 0, False, 1.0, 0.0, 0.0) for k in range(2)], "NCGEN_IN_TURN", np.zeros(2), 2.0)
    assert [number for number, _ in found.turns] == [0, 1] and found.impulses == pytest.approx([2.0, 2.0], rel=1e-15)
    assert W.T @ found.impulses + [2.0, 0.0, 0.0] == pytest.approx([0.0, 0.0, 2.0], abs=1e-15) and np.all(np.abs(found.lost) < 1e-15)
