"""Derivatives through locks, clutches and ratchets, against closed forms and differences of runs."""

from __future__ import annotations

import numpy as np
import pytest
from sliding import sliding_block
from test_locks import two_discs

import ncgen
from examples.winch import winch

GIVEN = {"integrator": "dop853", "rtol": 1e-11}


def slopes_of(function, point):
    """Derivatives of a closed form, by a complex step; (…, columns)."""
    step, point = 1e-30, np.array(point, dtype=complex)
    return np.array([np.imag(function(*(point + 1j * step * row))) / step for row in np.eye(len(point))]).T


def differences_of(function, at, step=1e-4):
    """Derivatives of a function of {name: number}, to the fourth order; (…, columns)."""
    columns = []
    for name in at:
        ends = [function(at | {name: at[name] + way * step}) for way in (1, -1, 2, -2)]
        columns.append((8 * (ends[0] - ends[1]) - (ends[2] - ends[3])) / (12 * step))
    return np.array(columns).T


def check_sweep(kernels, duration, steps, found, by, **given):
    """The gradient of a sum of all coordinates and velocities is that sum of the sensitivities."""

    def total(q, qd):
        return np.sum(q) + np.sum(qd), np.ones_like(q), np.ones_like(qd)

    back = ncgen.gradient(kernels, duration, steps, total, by=by, **given)
    forward = np.sum(found.q_by, axis=(0, 1)) + np.sum(found.qd_by, axis=(0, 1))
    assert [back.derivatives[name] for name in by] == pytest.approx(forward, rel=1e-10, abs=1e-10)


def test_a_clutch_that_closes_at_a_speed():
    """Disc 2 is driven by T until ω₂ = w; then both have (J₁ ω + J₂ w)/(J₁ + J₂)."""
    m, (psi1, psi2) = two_discs()
    T, w = m.parameter("T", 6.0), m.parameter("w", 1.0)
    m.torque(psi2, T)
    m.clutch(psi1, psi2, when=w - psi2.rate, until=1.0 - m.time, name="clutch")
    kernels, given = ncgen.compile(m), GIVEN | {"qd0": {"psi1": 10.0, "psi2": 0.0}}
    by = ["T", "w", "rate(P1.y)"]
    found = ncgen.sensitivities(kernels, 1.5, 10, by=by, **given)

    def end(T, w, speed):
        t = 3 * w / T
        common = (2 * speed + 3 * w) / 5
        last = common + T / 5 * (1 - t)
        first = speed * t + common * (1 - t) + T / 10 * (1 - t) ** 2 + last / 2
        second = T * t**2 / 6 + common * (1 - t) + T / 10 * (1 - t) ** 2 + last / 2 + T / 24
        return np.array([t, common, first, second, last, last + T / 6])

    places = [kernels.index[name] for name in ("psi1", "psi2")]
    mine = np.vstack([found.events[0].t_by, found.events[0].after_by[places[:1]], found.q_by[-1][places], found.qd_by[-1][places]])
    assert mine == pytest.approx(slopes_of(end, [6.0, 1.0, 10.0]), rel=1e-9, abs=1e-10)
    check_sweep(kernels, 1.5, 10, found, by, **given)


def test_a_lock_holds_what_there_was():
    """A block pushed by F is locked where s = a, and freed at 2 s: s = a + F (T − 2)²/2."""
    m, s = sliding_block("gripped")
    F, a = m.parameter("F", 1.0), m.parameter("a", 0.5)
    m.torque(s, F)
    m.lock(s, when=a - s, until=2.0 - m.time)
    kernels, by = ncgen.compile(m), ["F", "a"]
    found = ncgen.sensitivities(kernels, 3.0, 12, by=by)
    column = kernels.index["s"]
    assert found.q[6, column] == pytest.approx(0.5, rel=1e-12) and found.q_by[6, column] == pytest.approx([0.0, 1.0], abs=1e-11)
    assert found.events[0].t_by == pytest.approx([-0.5, 1.0], rel=1e-10)
    assert found.q_by[-1, column] == pytest.approx([0.5, 1.0], rel=1e-10)
    assert found.qd_by[-1, column] == pytest.approx([1.0, 0.0], abs=1e-10)
    check_sweep(kernels, 3.0, 12, found, by)


def test_a_clutch_that_is_closed_at_the_start():
    """Common speed (J₁ ω₁ + J₂ ω₂)/(J₁ + J₂) at once, and in a lock inside an event that sets a velocity."""
    m, (psi1, psi2) = two_discs()
    v = m.parameter("v", 2.0)
    m.clutch(psi1, psi2, closed=True, name="clutch")
    m.event("kick", 0.5 - m.time, do={"rate(psi1)": v * psi1.rate})
    kernels, given = ncgen.compile(m), GIVEN | {"qd0": {"psi1": 10.0, "psi2": 0.0}}
    found = ncgen.sensitivities(kernels, 1.0, 10, by=["rate(P1.y)", "v"], **given)
    places = [kernels.index[name] for name in ("psi1", "psi2")]
    assert found.qd_by[-1][places] == pytest.approx(np.array([[0.8, 4.0]] * 2), rel=1e-10)
    assert found.q_by[-1][places] == pytest.approx(np.array([[0.2 + 0.4, 2.0], [0.6, 2.0]]), rel=1e-9)


def test_a_ratchet_holds_where_it_turns_back():
    """Thrown with v against F it stays at v²/(2 F); pushed with p t from 1 s on it leaves when p t = F."""
    m, s = sliding_block("thrown")
    F, p, on = m.parameter("F", 2.0), m.parameter("p", 1.0), m.input("on")
    m.torque(s, on * p * m.time - F)
    m.event("push", 1.0 - m.time, do={"on": 1.0})
    m.ratchet(s)
    kernels, by, given = ncgen.compile(m), ["F", "p", "rate(s)"], {"qd0": {"s": 1.0}}
    found = ncgen.sensitivities(kernels, 3.0, 60, by=by, **given)

    def end(F, p, v):
        return np.array([v / F, F / p, v**2 / (2 * F) + p * (3 - F / p) ** 3 / 6])

    column, (held, leaves) = kernels.index["s"], [each for each in found.events if each.transition]
    mine = np.vstack([held.t_by, leaves.t_by, found.q_by[-1, column]])
    assert mine == pytest.approx(slopes_of(end, [2.0, 1.0, 1.0]), rel=1e-9, abs=1e-10)
    check_sweep(kernels, 3.0, 60, found, by, **given)


@pytest.mark.parametrize("restitution", [0.4, 0.8])
def test_a_ratchet_takes_the_impulse_of_a_stop(restitution):
    """Of two discs that a ratchet joins in one direction the first hits a stop: what it would turn back is shared, and both leave the stop.

    A torque on the second one loads the ratchet from then on.
    """
    torque = 0.6
    m, (psi1, psi2) = two_discs()
    stop, e = m.parameter("stop", 1.0), m.parameter("e", restitution)
    m.stop(psi1, upper=stop, restitution=e)
    m.ratchet(psi1, psi2)
    m.torque(psi2, torque)
    kernels, by, T = ncgen.compile(m), ["stop", "e", "rate(P1.y)", "rate(P2.y)"], 0.36
    found = ncgen.sensitivities(kernels, T, 10, by=by, qd0={"psi1": 3.0, "psi2": 0.5}, **GIVEN)

    def end(stop, e, first, second):
        t, turned = stop / first, -e * first
        common, rest = (2 * turned + 3 * second + torque * t) / 5, T - t
        moved = common * rest + torque / 10 * rest**2
        return np.array([stop + moved, second * t + torque / 6 * t**2 + moved, common + torque / 5 * rest])

    places = [kernels.index[name] for name in ("psi1", "psi2")]
    mine = np.vstack([found.q_by[-1][places], found.qd_by[-1][places[:1]]])
    assert mine == pytest.approx(slopes_of(end, [1.0, restitution, 3.0, 0.5]), rel=1e-9, abs=1e-10)


def test_a_ratchet_presses_a_disc_to_its_stop():
    """The ratchet stops what it would press back, with the stop and without restitution: both rest from then on."""
    m, (psi1, psi2) = two_discs()
    stop, e = m.parameter("stop", 1.0), m.parameter("e", 0.4)
    m.stop(psi1, upper=stop, restitution=e)
    m.ratchet(psi1, psi2)
    kernels, by = ncgen.compile(m), ["stop", "e", "rate(P1.y)", "rate(P2.y)"]
    found = ncgen.sensitivities(kernels, 0.36, 10, by=by, qd0={"psi1": 3.0, "psi2": 1.0}, **GIVEN)
    places = [kernels.index[name] for name in ("psi1", "psi2")]

    def end(stop, e, first, second):
        return np.array([stop, second * stop / first, 0.0 * stop, 0.0 * stop])

    mine = np.vstack([found.q_by[-1][places], found.qd_by[-1][places]])
    assert mine == pytest.approx(slopes_of(end, [1.0, 0.4, 3.0, 1.0]), rel=1e-9, abs=1e-10)


def locked_fourbar():
    """The four-bar: its crank is locked where it passes an angle, and freed; a ratchet holds its follower."""
    m = ncgen.load("fourbar")
    psi = m.elements["psi"]
    angle = m.parameter("angle", -0.6)
    m.lock(psi, when=psi - angle, until=0.3 - m.time)
    m.ratchet(psi, direction="falling")
    return ncgen.compile(m)


def test_a_four_bar_that_is_locked_and_held_by_a_ratchet():
    """All coordinates, velocities and times of events by differences of runs."""
    kernels, at = locked_fourbar(), {"angle": -0.6, "rate(psi)": -3.0}
    found = ncgen.sensitivities(kernels, 1.4, 14, by=list(at), zd0={"psi": -3.0}, **GIVEN)

    def everything(values):
        run = ncgen.simulate(kernels, 1.4, rtol=1e-13, p={"angle": values["angle"]}, zd0={"psi": values["rate(psi)"]})
        return np.concatenate([run.q[-1], run.qd[-1], [each.t for each in run.events]])

    mine = np.vstack([found.q_by[-1], found.qd_by[-1], [each.t_by for each in found.events]])
    assert mine == pytest.approx(differences_of(everything, at), rel=1e-6, abs=1e-7)
    check_sweep(kernels, 1.4, 14, found, list(at), zd0={"psi": -3.0}, **GIVEN)


@pytest.mark.slow
def test_the_winch():
    """Clutch, ratchet and brake by the torque with which the motor begins; differences of runs."""
    model, velocities = winch()
    kernels = ncgen.compile(model)
    found = ncgen.sensitivities(kernels, 3.2, 16, by=["torque"], qd0=velocities, **GIVEN)

    def everything(values):
        run = ncgen.simulate(kernels, 3.2, rtol=1e-12, qd0=velocities, p=values)
        return np.concatenate([run.q[-1], run.qd[-1], [each.t for each in run.events]])

    mine = np.vstack([found.q_by[-1], found.qd_by[-1], [each.t_by for each in found.events]])
    assert {each.transition for each in found.events} == {"", "sticks", "slips", "locks", "frees", "catches", "releases"}
    assert mine == pytest.approx(differences_of(everything, {"torque": 0.0}), rel=1e-7, abs=1e-8)
