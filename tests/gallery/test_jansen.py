"""Theo Jansen's leg against circles intersected in the complex plane, and against virtual work."""

import numpy as np
import pytest

import ncgen
from ncgen.exchange.examples import example_module
from ncgen.solver.positions.position import residual

FREE = "MUWLKT"


@pytest.fixture(scope="module")
def leg():
    """The leg without its driver."""
    return ncgen.compile(example_module("jansen").build(driven=False), backend="numpy")


@pytest.fixture(scope="module")
def driven():
    return ncgen.compile(example_module("jansen").build(), backend="numpy")


@pytest.fixture(scope="module")
def turn(driven):
    return ncgen.simulate(driven, 1.0, formalism="coordinate-partitioning", integrator="dop853", rtol=1e-8, atol=1e-10, points=25)


def crossing(p, rp, q, rq):
    """Where two circles in the complex plane meet, left of the line from p to q, by the law of cosines."""
    d = abs(q - p)
    return p + rp * np.exp(1j * np.arccos((rp**2 + d**2 - rq**2) / (2 * rp * d))) * (q - p) / d


def linkage(psi):
    """{point: complex position in m} at crank angles psi, straight from Jansen's numbers."""
    O, P = 0.0 * psi, -0.38 - 0.078j + 0 * psi
    M = 0.15 * np.exp(1j * psi)
    U = crossing(P, 0.415, M, 0.50)
    W = crossing(P, 0.401, U, 0.558)
    L = crossing(M, 0.619, P, 0.393)
    K = crossing(L, 0.367, W, 0.394)
    T = crossing(L, 0.490, K, 0.657)
    return dict(O=O, P=P, M=M, U=U, W=W, L=L, K=K, T=T)


def slope(function, psi):
    """The derivative of a function of the crank angle, by differences of sixth order."""
    h = 2e-3
    return sum(w * (function(psi + k * h) - function(psi - k * h)) for k, w in ((1, 3 / 4), (2, -3 / 20), (3, 1 / 60))) / h


def energy(psi, rate=2 * np.pi):
    """Kinetic plus potential energy (J) of eleven uniform rods of 0.5 kg/m."""
    here = linkage(psi)
    velocity = {name: rate * slope(lambda angle, name=name: linkage(angle)[name], psi) for name in here}
    total = 0.0
    for a, b in ("OM", "MU", "PU", "UW", "PW", "ML", "PL", "WK", "LK", "KT", "LT"):
        mass, va, vb = 0.5 * abs(here[a] - here[b]), velocity[a], velocity[b]
        total += mass / 6 * (abs(va) ** 2 + abs(vb) ** 2 + (va * vb.conjugate()).real)
        total += mass * 9.81 * (here[a] + here[b]).imag / 2
    return total


def test_one_degree_of_freedom(leg):
    found = ncgen.freedom(leg)
    assert (found.dof, leg.m, found.redundant, found.is_singular) == (1, 12, (), False)


def test_the_driver_takes_it(driven):
    found = ncgen.freedom(driven)
    assert (found.dof, driven.m, found.redundant) == (0, 13, ())


def test_closes_from_a_rough_drawing(leg):
    rough = leg.q0 + 0.01 * np.random.default_rng(1).standard_normal(leg.n)
    closed = ncgen.assemble(leg, rough)
    assert residual(leg, closed) < 1e-9
    assert np.abs(closed - leg.q0).max() < 0.05


def test_published_position(leg):
    """The crank upright: vertices as listed (cm, four digits) in GIBBON's Jansen linkage demonstration."""
    published = dict(
        M=(38, 22.8),
        U=(-8.7357, 40.5702),
        W=(-39.6678, -5.8717),
        K=(-19.4476, -39.6874),
        L=(17.0047, -35.4306),
        T=(30.3109, -82.5894),
    )
    q = ncgen.move(leg, leg.q0, {"psi": np.pi / 2}).q
    for name, (x, y) in published.items():
        here = 100 * q[[leg.index[f"{name}.x"], leg.index[f"{name}.y"]]] + [38, 7.8]
        assert np.allclose(here, (x, y), rtol=0, atol=6e-5), name


def test_every_point_follows_the_circles(turn):
    """All round, so the leg stays on the branch it was built on."""
    expected = linkage(2 * np.pi * turn.t)
    for name in FREE:
        x, y, _ = turn.point(name).T
        assert np.abs(x + 1j * y - expected[name]).max() < 1e-11, name


def test_the_motor_does_all_work(turn):
    assert turn.energy_drift < 1e-8
    total = energy(2 * np.pi * turn.t)
    assert np.abs(turn.work - (total - total[0])).max() < 3e-8


def test_the_drivers_multiplier_is_the_motor_torque(turn):
    """At constant speed the torque is the slope of the energy over the angle."""
    torque = slope(energy, 2 * np.pi * turn.t)
    assert np.abs(-turn.lam[:, -1] - torque).max() < 1e-7 * np.abs(torque).max()
