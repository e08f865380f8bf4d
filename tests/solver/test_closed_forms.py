"""Motions that are known otherwise: the pendulum's elliptic functions, the four-bar as one equation, a free fall."""

from __future__ import annotations

import numpy as np
import pytest
from robot_motions import TIGHT
from scipy.special import ellipj, ellipk

import ncgen
from ncgen import Model


@pytest.fixture(scope="module")
def exact(reference):
    """t, x, y, vx, vy of the pendulum every 0.5 s, see tests/reference/pendulum_a01.csv."""
    return np.array([[float(word) for word in line] for line in reference("pendulum_a01.csv")])


@pytest.fixture(scope="module")
def pendulum():
    return ncgen.compile(ncgen.load("pendulum"), backend="c")


def test_the_reference_is_the_closed_form(exact):
    """sin(θ/2) = √½ sn(K − √9.81 t | ½), θ from the downward vertical, by SciPy's elliptic functions."""
    sn, _, dn, _ = ellipj(ellipk(0.5) - np.sqrt(9.81) * exact[:, 0], 0.5)
    half = np.sqrt(0.5) * sn
    assert exact[:, 1] == pytest.approx(-2 * half * dn, abs=1e-12)
    assert exact[:, 2] == pytest.approx(2 * half**2 - 1, abs=1e-12)


def test_pendulum(pendulum, exact):
    """Ten seconds; x and y take turns in being independent, since neither is at both ends of the swing."""
    run = ncgen.simulate(pendulum, 10.0, formalism="coordinate-partitioning", integrator="dop853", points=21, **TIGHT)
    assert run.t == pytest.approx(exact[:, 0], abs=1e-14)
    assert run.point("B")[:, :2] == pytest.approx(exact[:, 1:3], abs=1e-7)
    assert run.qd == pytest.approx(exact[:, 3:], abs=1e-7)
    assert np.max(run.violation()) < 1e-11
    assert run.energy_drift < 1e-8
    assert run.statistics.partition_changes >= 10
    assert run.statistics.repeated_steps == 0


@pytest.mark.parametrize("z", ["B.x", "B.y"])
def test_pendulum_with_a_coordinate_of_choice(pendulum, exact, z):
    """Half a second from an instant where either coordinate will do: the choice changes nothing."""
    start = exact[3, 1:3] / np.linalg.norm(exact[3, 1:3])
    rates = dict(zip(("B.x", "B.y"), exact[3, 3:]))
    run = ncgen.simulate(pendulum, 0.5, q0=start, z=(z,), zd0={z: rates[z]}, points=2, **TIGHT)
    assert run.q[-1] == pytest.approx(exact[4, 1:3], abs=1e-8)
    assert run.qd[0] == pytest.approx(exact[3, 3:], abs=1e-14)


def test_backends_agree_on_the_pendulum(pendulum):
    """Two swings, with changes of the independent coordinate at the same instants."""
    other = ncgen.compile(ncgen.load("pendulum"), backend="numpy")
    one, two = (ncgen.simulate(k, 1.0, formalism="coordinate-partitioning", points=11, **TIGHT) for k in (pendulum, other))
    assert two.q == pytest.approx(one.q, abs=1e-9)
    assert two.qd == pytest.approx(one.qd, abs=1e-9)
    assert one.statistics.partition_changes == two.statistics.partition_changes >= 1


def test_four_bar(turning, fourbar, loop):
    """Nearly two turns of the crank against the reduced equation J θ̈ + ½ J′ θ̇² + V′ = 0."""
    angle, rate = loop.motion(12.0, turning.t)
    assert turning["psi"] == pytest.approx(angle, abs=1e-7)
    assert turning["rate(psi)"] == pytest.approx(rate, abs=1e-6)
    for k, theta in enumerate(angle):
        B, C = loop.places(theta)
        assert turning.point("B")[k, :2] == pytest.approx(B, abs=1e-7)
        assert turning.point("C")[k, :2] == pytest.approx(C, abs=1e-7)
        assert turning.qdd[k, fourbar.index["psi"]] == pytest.approx(loop.acceleration(theta, rate[k]), abs=1e-4)
    assert angle[-1] > 3.5 * np.pi


def test_four_bar_accelerations(turning, fourbar, loop):
    """θ̈ at the run's own states, where no integration error enters."""
    psi = fourbar.index["psi"]
    for q, qd, qdd in zip(turning.q, turning.qd, turning.qdd, strict=True):
        expected = loop.acceleration(q[psi], qd[psi])
        assert qdd[psi] == pytest.approx(expected, rel=1e-9, abs=1e-7)


def test_four_bar_energy(turning, fourbar, loop):
    """T + V of the three uniform bars, by the formula of the ends' velocities."""
    psi = fourbar.index["psi"]
    expected = [loop.energy(q[psi], qd[psi]) for q, qd in zip(turning.q, turning.qd, strict=True)]
    assert turning.energy()[:, :2].sum(axis=1) == pytest.approx(expected, abs=1e-11)
    assert turning.energy_drift < 1e-9


def test_a_mass_without_rows_falls():
    """No row, no multiplier: a parabola, exactly integrated by every method of order two or more."""
    m = Model("stone")
    P = m.point("P", (0, 0, 10))
    m.body("stone", [P], mass=2.0)
    m.gravity((0, 0, -9.81))
    run = ncgen.simulate(ncgen.compile(m, "numpy"), 1.0, zd0={"P.x": 3.0}, points=5)
    t = run.t
    assert run.point("P") == pytest.approx(np.stack([3 * t, 0 * t, 10 - 9.81 / 2 * t**2], axis=1), abs=1e-12)
    assert run.lam.shape == (5, 0)
    assert np.array_equal(run.violation(), np.zeros(5))
    assert run.energy_drift < 1e-13


def test_work_against_a_damper():
    """A mass on a plane slowed by −c v: v = v₀ e^(−ct/m), and W = T − T₀ is the energy that went."""
    m = Model("sledge")
    P = m.point("P", (0, 0, 0), fixed="yz")
    m.body("sledge", [P], mass=2.0)
    m.force(P, (-3.0 * P.x.rate, 0, 0))
    run = ncgen.simulate(ncgen.compile(m, "numpy"), 1.0, zd0={"P.x": 5.0}, points=6, **TIGHT)
    v = 5.0 * np.exp(-1.5 * run.t)
    assert run["rate(P.x)"] == pytest.approx(v, abs=1e-9)
    assert run["P.x"] == pytest.approx((5.0 - v) / 1.5, abs=1e-9)
    assert run.work == pytest.approx(v**2 - 25.0, abs=1e-8)
    assert run.energy_drift < 1e-9


def test_parameters_given_at_run_time():
    """A pendulum's length and mass in p: small swings take 2π √(L/g), so a quarter of it leads from the end to the middle."""
    m = Model("clock")
    L = m.parameter("L", 1.0)
    A, B = m.point("A", (0, 0), fixed=True), m.point("B", (0.001, -np.sqrt(1 - 1e-6)))
    m.body("bob", [B], mass=m.parameter("m", 1.0))
    m.distance(A, B, L)
    m.gravity((0, -9.81, 0))
    kernels = ncgen.compile(m, "numpy")
    quarter = np.pi / 2 * np.sqrt(4.0 / 9.81)
    start = 4.0 * kernels.q0
    run = ncgen.simulate(kernels, quarter, p=[4.0, 7.0], q0=start, points=3, **TIGHT)
    assert run["B.x"][-1] == pytest.approx(0.0, abs=1e-8)
    assert run["rate(B.x)"][-1] == pytest.approx(-0.004 * np.sqrt(9.81 / 4.0), rel=1e-6)


def test_a_fixed_point_moved_by_a_parameter():
    """The pendulum hangs half a metre higher, so everything is half a metre higher."""
    m = Model("hook")
    h = m.parameter("h", 0.0)
    A, B = m.point("A", (0, h), fixed=True), m.point("B", (1, 0))
    m.body("bob", [B], mass=1.0)
    m.distance(A, B, 1.0)
    kernels = ncgen.compile(m, "numpy")
    run = ncgen.simulate(kernels, 0.1, p=[0.5], q0=[1.0, 0.5], points=2)
    assert run.point("A")[0] == pytest.approx([0, 0.5, 0])
