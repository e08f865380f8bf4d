"""The spatial slider-crank against its closed-form loop and the motion that its energy gives."""

import numpy as np
import pytest
from scipy.integrate import quad

import ncgen
from ncgen.solver.positions.position import residual, sweep

CRANK, ROD = 0.08, 0.3
PIVOT = np.array([0, 0.1, 0.12])
WEIGHTS = 9.81 * np.array([0.12, 0.5])
"""Of crank and rod (N)."""


@pytest.fixture(scope="module")
def mechanism():
    return ncgen.compile(ncgen.load("slidercrank3d"), backend="numpy")


@pytest.fixture(scope="module")
def run(mechanism):
    """Half a second, in which the crank goes nearly once round."""
    return ncgen.simulate(mechanism, 0.5, integrator="dop853", rtol=1e-10, atol=1e-11, points=11, zd0={"psi": 6.0})


def loop(psi):
    """Crank pin B, slider C and the rod's pin h at crank angle psi, which may be complex."""
    B = PIVOT + CRANK * np.array([0, -np.sin(psi), np.cos(psi)])
    C = np.array([np.sqrt(ROD**2 - B[1] ** 2 - B[2] ** 2), 0, 0])
    return B, C, np.array([0, B[2], -B[1]]) / np.sqrt(B[1] ** 2 + B[2] ** 2)


def rod_axes(psi):
    """Unit vectors along the rod, along its pin, and across both, as rows."""
    B, C, h = loop(psi)
    along = (C - B) / ROD
    return np.array([along, h, np.cross(along, h)])


def derivative(function, psi, step=1e-30):
    return function(psi + 1j * step).imag / step


def rod_turning(psi):
    """Angular velocity of the rod at unit speed of the crank, about its own axes."""
    axes, rates = rod_axes(psi), derivative(rod_axes, psi)
    return np.array([rates[1] @ axes[2], rates[2] @ axes[0], rates[0] @ axes[1]])


def inertia(psi):
    """Twice the kinetic energy at unit speed of the crank."""
    middle = derivative(lambda x: (loop(x)[0] + loop(x)[1]) / 2, psi)
    slider = derivative(lambda x: loop(x)[1], psi)
    crank = 1e-4 + 0.12 * (CRANK / 2) ** 2
    return crank + 0.5 * middle @ middle + rod_turning(psi) ** 2 @ [0.0004, 0.004, 0.004] + 2.0 * slider @ slider


def potential(psi):
    return WEIGHTS @ [loop(psi)[0][2] / 2, loop(psi)[0][2] / 2]


def speed(psi):
    """The crank's speed at an angle, from the energy it started with at 6 rad/s."""
    energy = inertia(0.0) * 6.0**2 / 2 + potential(0.0)
    return np.sqrt(2 * (energy - potential(psi)) / inertia(psi))


def test_one_degree_of_freedom(mechanism):
    found = ncgen.freedom(mechanism)
    assert (found.dof, len(found.redundant)) == (1, 0)


def test_it_closes_from_a_perturbed_start(mechanism):
    noise = 0.01 * mechanism.length * np.random.default_rng(0).standard_normal(mechanism.n)
    q = ncgen.assemble(mechanism, mechanism.q0 + noise)
    assert residual(mechanism, q) < 1e-11
    assert np.max(np.abs(q - mechanism.q0)) < 0.05


def test_the_loop_all_the_way_round(mechanism):
    angles = np.linspace(0, 2 * np.pi, 25)
    path = sweep(mechanism, "psi", angles)
    found = path[:, [mechanism.index[c] for c in ("B.y", "B.z", "C.x", "h.y", "h.z")]]
    expected = [[B[1], B[2], C[0], h[1], h[2]] for B, C, h in map(loop, angles)]
    assert np.allclose(found, expected, rtol=0, atol=1e-12)


def test_velocities_at_the_start_are_the_published_ones(run):
    """As printed in Exudyn's sliderCrank3Dbenchmark.py for a crank speed of 6 rad/s."""
    assert abs(run["rate(C.x)"][0] - 0.24) < 1e-12
    assert np.allclose(6 * rod_axes(0).T @ rod_turning(0), [1.92, -0.96, 0.48], rtol=0, atol=1e-12)
    assert np.allclose(run.angular_velocity("rod")[0], [1.92, -0.96, 0.48], rtol=0, atol=1e-12)


def test_energy(run):
    assert run.energy_drift < 1e-8
    assert np.max(run.violation()) < 1e-11


def test_speed_and_time_follow_from_the_energy(run):
    """With the closed-form loop, energy alone gives the speed at every angle, and its integral the time."""
    assert np.allclose(run["rate(psi)"], [speed(psi) for psi in run["psi"]], rtol=1e-8)
    time = quad(lambda psi: 1 / speed(psi), 0, run["psi"][-1], epsabs=1e-11, epsrel=1e-11, limit=200)[0]
    assert abs(time - run.t[-1]) < 1e-9
