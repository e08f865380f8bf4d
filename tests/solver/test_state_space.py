"""Linearisation with inputs and outputs: closed forms of textbooks, and differences of the whole derivative."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.signal
import sympy
from driven_models import mass_on_a_slide, pendulum

import ncgen
from ncgen import ModelError

GRAVITY = 9.81


def cart_pole(cart: float, bob: float, length: float, up: bool) -> ncgen.Model:
    """A cart pushed along x with a point mass on a massless rod: upright it is the inverted pendulum, hanging the gantry crane."""
    m = ncgen.Model("cartpole")
    m.gravity((0, -GRAVITY, 0))
    x, y, z = (m.vector(name, axis, fixed=True) for name, axis in (("x", (1, 0, 0)), ("y", (0, 1, 0)), ("z", (0, 0, 1))))
    O, C, D = m.point("O", (0, 0), fixed=True), m.point("C", (0, 0), fixed="y"), m.point("D", (0.3, 0), fixed="y")
    B = m.point("B", (0, length if up else -length))
    s = m.slide("s", O, C, x)
    m.body("cart", [C, D], mass=cart, inertia="point")
    m.body("pole", [C, B], mass=bob, com=B.initial, inertia="point")
    phi = m.angle("phi", y if up else -y, B - C, z)
    m.torque(s, m.input("F", "N"))
    m.output("place", s, "m")
    m.output("angle", phi, "rad")
    m.output("push back", s.acceleration, "m/s2")
    m.independent(s, phi)
    return m


@pytest.mark.filterwarnings("ignore::scipy.signal.BadCoefficients")
@pytest.mark.parametrize("up", [True, False])
def test_cart_and_pole(up):
    """(M + m) s̈ ∓ m l φ̈ = F and l φ̈ ∓ s̈ = ± g φ, linearised, upper signs upright: as in any textbook."""
    M, m, l, sign = 1.3, 0.4, 0.6, 1.0 if up else -1.0
    found = ncgen.linearise(ncgen.compile(cart_pole(M, m, l, up)))
    # φ counts from the vertical against the clock: the bob is at s − sign l φ.
    A = np.zeros((4, 4))
    A[0, 2] = A[1, 3] = 1.0
    A[2, 1] = m * GRAVITY / M
    A[3, 1] = sign * (M + m) * GRAVITY / (M * l)
    B = np.array([[0.0], [0.0], [1 / M], [sign / (M * l)]])
    assert found.states == ("s", "phi", "rate(s)", "rate(phi)")
    assert np.allclose(found.A, A, rtol=0, atol=1e-10)
    assert np.allclose(found.B, B, rtol=0, atol=1e-10)
    assert np.allclose(found.C, np.vstack([np.eye(4)[:2], A[2]]), rtol=0, atol=1e-10)
    assert np.allclose(found.D, [[0.0], [0.0], [1 / M]], rtol=0, atol=1e-10)
    assert (found.inputs, found.outputs) == (("F",), ("place", "angle", "push back"))
    system = found.state_space()
    zeros = scipy.signal.StateSpace(system.A, system.B, system.C[:1], system.D[:1]).to_zpk()
    assert np.allclose(np.sort_complex(zeros.zeros**2), sign * GRAVITY / l, rtol=1e-6)  # s(t) has the pendulum's own zeros


def quarter_car() -> ncgen.Model:
    """Two masses above each other with springs and a damper; the actuator pushes both apart."""
    m = ncgen.Model("quarter")
    y = m.vector("y", (0, 1, 0), fixed=True)
    O = m.point("O", (0, 0), fixed=True)
    W, V = m.point("W", (0, 0.3), fixed="x"), m.point("V", (0, 0.2), fixed="x")
    S, T = m.point("S", (0, 0.8), fixed="x"), m.point("T", (0, 0.9), fixed="x")
    m.body("wheel", [W, V], mass=40.0, inertia="point")
    m.body("car", [S, T], mass=300.0, inertia="point")
    low, high = m.slide("low", O, W, y), m.slide("high", O, S, y)
    m.spring(O, W, stiffness=2e5)
    m.spring(W, S, stiffness=2e4, damping=1.5e3)
    F = m.input("F", "N")
    m.torque(high, F)
    m.torque(low, -F)
    m.output("comfort", high.acceleration, "m/s2")
    m.output("grip", low, "m")
    m.independent(low, high)
    return m


def test_quarter_car():
    M = np.diag([40.0, 300.0])
    K = np.array([[2.2e5, -2e4], [-2e4, 2e4]])
    D = np.array([[1.5e3, -1.5e3], [-1.5e3, 1.5e3]])
    A = np.block([[np.zeros((2, 2)), np.eye(2)], [-np.linalg.solve(M, K), -np.linalg.solve(M, D)]])
    B = np.concatenate([[0, 0], np.linalg.solve(M, [-1.0, 1.0])])
    found = ncgen.linearise(ncgen.compile(quarter_car()))
    assert np.allclose(found.A, A, rtol=1e-10, atol=1e-9)
    assert np.allclose(found.B[:, 0], B, rtol=1e-10)
    assert np.allclose(found.C, [A[3], [1, 0, 0, 0]], rtol=1e-10, atol=1e-9)
    assert np.allclose(found.D[:, 0], [B[3], 0.0], rtol=1e-10)
    # The gain of comfort at infinity is 1/M, at rest nothing accelerates.
    w, response = scipy.signal.freqresp(scipy.signal.StateSpace(found.A, found.B, found.C[:1], found.D[:1]), [1e-4, 1e6])
    assert abs(response[0]) < 1e-9
    assert abs(response[1]) == pytest.approx(1 / 300, rel=1e-3)


@pytest.mark.filterwarnings("ignore:.*neither rest in equilibrium")
@pytest.mark.parametrize("name", ["fourbar", "excavator", *(pytest.param(name, marks=pytest.mark.slow) for name in ("robot", "delta"))])
def test_against_differences(name):
    """Inputs added to examples along their independent coordinates: B and C against central differences of accelerations."""
    model = ncgen.load(name)
    kernels = ncgen.compile(model)
    z = [n for n in ncgen.linearise(kernels, **_where(model)).positions]
    if not all(n in model.elements for n in z[:1]):
        pytest.skip("its independent coordinates are no relative ones")
    coordinate = model.elements[z[0]]
    model.torque(coordinate, model.input("push") * (1 + 0.3 * sympy.sin(coordinate.symbol)))
    model.output("seen", coordinate.acceleration + coordinate.rate**2 + sympy.cos(coordinate.symbol) * model.inputs["push"].symbol)
    kernels = ncgen.compile(model)
    at = _where(model)
    found = ncgen.linearise(kernels, p={"push": 1.5}, **at)
    h = 1e-3

    def accelerations(push: float) -> np.ndarray:
        sim = ncgen.start(kernels, inputs={"push": push}, q0=at.get("q"), qd0=at.get("qd"))
        return np.array([sim.qdd[kernels.index[n]] for n in found.velocities] + list(sim.outputs.values()))

    by_input = (accelerations(1.5 + h) - accelerations(1.5 - h)) / (2 * h)
    scale = np.max(np.abs(by_input))
    count = len(found.velocities)
    assert np.allclose(found.B[len(found.positions) :, 0], by_input[:count], rtol=0, atol=1e-7 * scale)
    assert np.allclose(found.D[0, 0], by_input[count], rtol=1e-7, atol=1e-7 * scale)


def _where(model: ncgen.Model) -> dict:
    return {"z": model.chosen_independent} if model.chosen_independent else {}


@pytest.mark.filterwarnings("ignore:.*neither rest in equilibrium")
def test_about_a_held_input():
    """The rod held horizontal by its motor: δψ̈ = (m g l/2 sin ψ δψ + δτ)/J with ψ = 0."""
    kernels = ncgen.compile(pendulum())
    inertia = 0.7**2 / 3
    found = ncgen.linearise(kernels, p={"tau": GRAVITY * 0.35})
    assert found.steady
    assert np.allclose(found.A, [[0, 1], [0, 0]], atol=1e-10)
    assert np.allclose(found.B, [[0], [1 / inertia]], rtol=1e-12)


@pytest.mark.filterwarnings("ignore:.*neither rest in equilibrium")
def test_without_ports():
    with pytest.raises(ModelError, match=r"the model has no input; declare it with m\.input"):
        ncgen.linearise(ncgen.compile(ncgen.load("pendulum"))).state_space()
    found = ncgen.linearise(ncgen.compile(mass_on_a_slide()))
    assert np.allclose(found.D, [[0.0], [0.5]])
