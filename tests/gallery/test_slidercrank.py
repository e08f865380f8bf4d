"""The planar slider-crank against its closed form and the equation of motion of its one degree of freedom."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import ncgen
from ncgen.solver.positions.position import residual

R, L, G = 0.153, 0.306, 9.81
CRANK, ROD, SLIDER = (0.038, 7.4e-5), (0.038, 5.9e-4), 0.076


@pytest.fixture(scope="module")
def kernels():
    return ncgen.compile(ncgen.load("slidercrank"), backend="numpy")


@pytest.fixture(scope="module")
def turning(kernels):
    """A little more than one turn."""
    return ncgen.simulate(kernels, 0.08, zd0={"psi": 150.0}, integrator="dop853", rtol=1e-10, atol=1e-9, points=17)


def slider(psi):
    """Where the slider is, and the rod's angle below the line of sliding."""
    phi = np.arcsin(R * np.sin(psi) / L)
    return R * np.cos(psi) + L * np.cos(phi), phi


def inertia(psi):
    """The moment of inertia J(ψ) that the crank feels, T = ½ J ψ̇², and its derivative, by complex step."""

    def moment(psi):
        sin, cos = np.sin(psi), np.cos(psi)
        root = np.sqrt(L**2 - (R * sin) ** 2)
        turn = R * cos / root  # dφ/dψ
        vx, vy = -R * sin - R * sin * turn / 2, R * cos / 2  # of the rod's middle
        slide = -R * sin - R * sin * turn
        return CRANK[0] * R**2 / 4 + CRANK[1] + ROD[0] * (vx**2 + vy**2) + ROD[1] * turn**2 + SLIDER * slide**2

    value = moment(psi + 1e-30j)
    return value.real, value.imag / 1e-30


def one_equation(t, y):
    """J ψ̈ + ½ J' ψ̇² = − dV/dψ; the slider's weight does no work."""
    psi, rate = y
    J, slope = inertia(psi)
    return [rate, (-slope * rate**2 / 2 - (CRANK[0] + ROD[0]) * G * R * np.cos(psi) / 2) / J]


def test_one_degree_of_freedom(kernels):
    found = ncgen.freedom(kernels)
    assert (found.dof, kernels.m, found.redundant, found.is_singular) == (1, 4, (), False)


def test_closes_from_a_rough_drawing(kernels):
    turned = ncgen.move(kernels, kernels.q0, {"psi": 1.0}).q
    rough = turned + 0.005 * np.random.default_rng(1).standard_normal(kernels.n)
    closed = ncgen.assemble(kernels, rough)
    assert residual(kernels, closed) < 1e-9
    assert np.abs(closed - turned).max() < 0.03


def test_slider_follows_the_closed_form(kernels):
    angles = np.linspace(0.1, 2 * np.pi, 20)
    path = ncgen.sweep(kernels, "psi", angles)
    x = path[:, kernels.index["C.x"]]
    assert np.abs(x - slider(angles)[0]).max() < 1e-12


def test_energy_stays(turning):
    assert turning.energy_drift < 1e-8


def test_same_motion_as_the_single_equation(turning):
    psi, rate = solve_ivp(one_equation, (0, 0.08), [0.0, 150.0], "DOP853", turning.t, rtol=1e-13, atol=1e-12).y
    assert np.abs(turning["psi"] - psi).max() < 3e-9
    assert np.abs(turning["rate(psi)"] / rate - 1).max() < 3e-9


def test_rod_turns_against_the_crank(turning):
    _, phi = slider(turning["psi"])
    rate = -turning["rate(psi)"] * R * np.cos(turning["psi"]) / (L * np.cos(phi))
    spin = turning.angular_velocity("rod")[:, 2]
    assert np.abs(spin - rate).max() < 1e-6
    assert np.isclose(spin[0], -75.0, rtol=1e-12)  # as published
