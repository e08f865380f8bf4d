"""Several things at one instant: stops, ratchets, clutches and velocities that are set, against the laws of impact solved by trying.

Discs on one axis without loads move with constant velocities between impacts. `motion` knows their laws alone: stops that close are hit
together with the ratchets that do not run forward, with restitution; then ratchets that run backward are stopped with all that touches.
"""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest

import ncgen


def discs(stops=(), ratchets=(), order="simultaneous", count=2):
    """Discs with stops of some and ratchets (a, b) that let a run ahead of b; parameters J1 …, upper1 …, e."""
    m = ncgen.Model("discs")
    O, x, z = m.point("O", (0, 0), fixed=True), m.vector("x", (1, 0, 0), fixed=True), m.vector("z", (0, 0, 1), fixed=True)
    angles, e = [], m.parameter("e", 0.4)
    for k in range(1, count + 1):
        P, inertia = m.point(f"P{k}", (1, 0)), m.parameter(f"J{k}", float(k + 1))
        m.body(f"disc{k}", [O, P], mass=1.0, com=(0, 0), inertia=inertia)
        angles.append(m.angle(f"psi{k}", x, P - O, z))
    for k in stops:
        m.stop(angles[k], upper=m.parameter(f"upper{k + 1}", 1.0), restitution=e, order=order)
    for a, b in ratchets:
        m.ratchet(angles[a], angles[b])
    return m, angles


def pushed(inertias, rows, wanted, w):
    """Velocities w after impulses ≥ 0 along rows; one pushes only where its row has the velocity that is wanted, others have more."""
    best = None
    for active in product((False, True), repeat=len(rows)):
        W = rows[list(active)]
        G = W / inertias @ W.T
        impulses = np.linalg.lstsq(G, wanted[list(active)] - W @ w, rcond=None)[0]
        after = w + W.T @ impulses / inertias
        if np.all(impulses >= -1e-12) and np.all(rows @ after >= wanted - 1e-12) and np.allclose(W @ after, wanted[list(active)]):
            best = after
    assert best is not None
    return best


def after_impacts(inertias, at, w, stops, ratchets, restitution):
    """Velocities after all impacts at one instant at these angles."""
    unit = np.eye(len(w))
    touching = np.array([-unit[k] for k, upper in stops.items() if abs(at[k] - upper) < 1e-9]).reshape(-1, len(w))
    running = np.array([unit[a] - unit[b] for a, b in ratchets]).reshape(-1, len(w))
    if np.any(touching @ w < -1e-9):
        u = touching @ w
        still = running[running @ w <= 1e-9]
        w = pushed(inertias, np.vstack([touching, still]), np.append(np.where(u < 0, -restitution * u, 0.0), np.zeros(len(still))), w)
    if np.any(running @ w < -1e-9):
        rows = np.vstack([touching, running])
        w = pushed(inertias, rows, np.zeros(len(rows)), w)
    return np.where(np.abs(w) < 1e-12, 0.0, w)


def motion(inertias, w, stops, ratchets, restitution, duration, at=None):
    """Angles and velocities at the end of a motion from these velocities, and the greatest angles."""
    inertias, t = np.array(inertias), 0.0
    at = np.zeros(len(w)) if at is None else np.array(at)
    w = after_impacts(inertias, at, np.array(w), stops, ratchets, restitution)
    for _ in range(1000):
        times = [(upper - at[k]) / w[k] for k, upper in stops.items() if w[k] > 1e-12 and upper - at[k] > 1e-9]
        step = min([duration - t, *times])
        at, t = at + w * step, t + step
        if t >= duration - 1e-12:
            return at, w
        w = after_impacts(inertias, at, w, stops, ratchets, restitution)
    raise AssertionError("too many impacts")


def simulated(kernels, velocities, duration, **p):
    """The run, and angles and velocities at its end; a batch agrees."""
    names = [f"psi{k}" for k in range(1, len(velocities) + 1)]
    run = ncgen.simulate(kernels, duration, points=2, rtol=1e-10, qd0=dict(zip(names, velocities, strict=True)), p=p)
    rows = {name: [value, value] for name, value in zip(names, velocities, strict=True)}
    batch = ncgen.simulate(kernels, duration, points=2, rtol=1e-10, qd0=rows, p=p)
    places = [kernels.index[name] for name in names]
    assert batch.status == ("ok", "ok") and not np.any(batch.alone)
    assert batch.q[0, -1, places] == pytest.approx(run.q[-1, places], abs=1e-8)
    assert batch.qd[0, -1, places] == pytest.approx(run.qd[-1, places], abs=1e-8)
    return run, run.q[-1, places], run.qd[-1, places]


@pytest.mark.parametrize("order", ["", "simultaneous", "in turn"])
def test_a_ratchet_pushes_a_disc_back_to_its_stop(order):
    """The stop leaves (−e ω₁, ω₂), whose common velocity would pass it: both rest there, and a torque later on does not move them."""
    m, (_, psi2) = discs([0], [(0, 1)], order)
    m.torque(psi2, ncgen.smooth_step(m.time, 0.5, 0.7))
    kernels = ncgen.compile(m)
    for e in (0.0, 0.4):
        run, at, w = simulated(kernels, (3.0, 1.0), 1.0, e=e)
        assert at == pytest.approx([1.0, 1 / 3], abs=1e-8) and w == pytest.approx([0.0, 0.0], abs=1e-9)
        hits = [event for event in run.events if event.impulse > 1e-6]
        assert sum(event.impulse for event in hits if "stop" in event.name) == pytest.approx(2 * 3 + 3 * 1, rel=1e-8)
        assert sum(event.energy_lost for event in hits) == pytest.approx(0.5 * 2 * 9 + 0.5 * 3 * 1, rel=1e-8)


def test_a_ratchet_that_is_held_when_its_disc_hits_a_stop():
    """Two discs that turn as one come back as one: −e ω, whatever rounding makes of the difference of their velocities."""
    kernels = ncgen.compile(discs([0], [(0, 1)], "")[0])
    for a, b, upper in product((0.0, 1e-13), (0.0, 1e-13), (0.0, 1e-13, -1e-13)):
        _, at, w = simulated(kernels, (3.0 + a, 3.0 + b), 0.5, upper1=1.0 + upper)
        assert w == pytest.approx([-1.2, -1.2], abs=1e-8) and at == pytest.approx([0.8, 0.8], abs=1e-8)


def test_a_gap_that_opens_has_nothing_to_restore():
    """Disc 2 runs away from disc 1 and hits its stop at once: turned back to −e ω₂, it takes disc 1 along, and they leave as one."""
    m, (psi1, psi2) = discs([1])
    m.event("between", psi2 - psi1, do=ncgen.impact(restitution=0.7, order="simultaneous"))
    kernels = ncgen.compile(m)
    for e in (0.0, 0.4, 1.0):
        _, at, w = simulated(kernels, (-0.5, 2.0), 0.5, e=e, upper2=0.0)
        common = (2 * -0.5 + 3 * -2 * e) / 5
        assert w == pytest.approx([-0.5, 0.0] if e == 0 else [common, common], abs=1e-9)
        assert at[0] <= at[1] + 1e-9


def test_a_velocity_that_is_set_at_a_stop():
    """At rest at its stop, disc 1 is kicked into it, and leaves with restitution."""
    m, _ = discs([0], order="")
    m.event("kick", 0.2 - m.time, do={"rate(psi1)": 4.0})
    _, at, w = simulated(ncgen.compile(m), (0.0, 1.0), 0.5, upper1=0.0, e=0.5)
    assert w == pytest.approx([-2.0, 1.0], abs=1e-9) and at == pytest.approx([-0.6, 0.5], abs=1e-9)


def test_a_clutch_that_closes_at_a_stop():
    """A clutch takes disc 1 along into the stop at which it is: both leave with restitution, at once where it is closed from the start."""
    m, (psi1, psi2) = discs([0], order="")
    m.clutch(psi1, psi2, when=0.2 - m.time, name="clutch")
    _, at, w = simulated(ncgen.compile(m), (0.0, 1.0), 0.5, upper1=0.0, e=0.5)
    assert w == pytest.approx([-0.3, -0.3], abs=1e-9) and at == pytest.approx([-0.09, 0.2 - 0.09], abs=1e-9)
    m, (psi1, psi2) = discs([0], order="")
    m.clutch(psi1, psi2, closed=True, name="clutch")
    _, at, w = simulated(ncgen.compile(m), (-1.0, 2.0), 0.5, upper1=0.0, e=0.5)
    assert w == pytest.approx([-0.4, -0.4], abs=1e-9) and at == pytest.approx([-0.2, -0.2], abs=1e-9)


def test_an_event_follows_where_a_ratchet_catches():
    """The impulse of a ratchet turns disc 2 around, which brings about an event at the same instant."""
    m, (_, psi2) = discs([0], [(0, 1)])
    m.event("turned", psi2.rate)
    run, _, w = simulated(ncgen.compile(m), (6.0, 0.5), 0.5, e=0.5)
    assert w == pytest.approx([(-6 + 1.5) / 5] * 2, abs=1e-9)
    assert [event.t for event in run.events if event.name == "turned"] == pytest.approx([1 / 6], rel=1e-9)


@pytest.mark.parametrize("torque", ["smooth", "kink"])
def test_what_stands_at_a_stop_is_stopped_when_it_is_pushed_later(torque):
    """Brought to rest without a load, it is pushed into the stop by a torque that begins later."""
    m, (psi1, _) = discs([0], order="")
    m.torque(psi1, 3 * ncgen.smooth_step(m.time, 0.7, 1.0) if torque == "smooth" else 5 * abs(m.time - 0.7) + 5 * (m.time - 0.7))
    run = ncgen.simulate(ncgen.compile(m), 1.5, points=2, rtol=1e-10, qd0={"psi1": 3.0, "psi2": 0.0}, p={"e": 0.0})
    assert run["psi1"][-1] == pytest.approx(1.0, abs=1e-9) and run["rate(psi1)"][-1] == pytest.approx(0.0, abs=1e-9)


STRUCTURES = {
    "a ratchet": (2, [0], [(0, 1)]),
    "stops of both": (2, [0, 1], [(0, 1)]),
    "a row of ratchets": (3, [0, 2], [(0, 1), (1, 2)]),
    "a ring of ratchets": (3, [0, 1, 2], [(0, 1), (1, 2), (2, 0)]),
    "two against one": (3, [1], [(0, 1), (2, 1)]),
}


@pytest.mark.parametrize("order", ["simultaneous", pytest.param("", id="no order")])
@pytest.mark.parametrize("structure", list(STRUCTURES))
def test_discs_by_chance(structure, order):
    """Angles and velocities at the end, with stops that differ by rounding; some discs turn as one, some hit their stops at one instant.

    Stops that ratchets alone couple need no order.
    """
    count, stops, ratchets = STRUCTURES[structure]
    rng, kernels = np.random.default_rng(11), ncgen.compile(discs(stops, ratchets, order, count=count)[0])
    for number in range(12):
        inertias, w, e = rng.uniform(0.5, 4.0, count), rng.uniform(-2.0, 4.0, count), float(rng.choice([0.0, 0.3, 0.7]))
        w = np.full(count, abs(w[0])) if number % 4 == 0 else w
        uppers = {k: float(abs(w[k]) / 4 if number % 3 == 0 else rng.uniform(0.2, 1.0)) for k in stops}
        expected = motion(inertias, w, uppers, ratchets, e, 0.8)
        for shift in (0.0, 1e-13):
            p = {f"J{k + 1}": inertia for k, inertia in enumerate(inertias)}
            p |= {f"upper{k + 1}": upper + shift for k, upper in uppers.items()}
            _, at, velocities = simulated(kernels, w, 0.8, e=e, **p)
            assert velocities == pytest.approx(expected[1], abs=1e-7), number
            assert at == pytest.approx(expected[0], abs=1e-7), number
