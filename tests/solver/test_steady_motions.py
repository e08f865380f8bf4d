"""Small motions beside motions that a symmetry carries along: wheels, tops, pendulums that go round, against formulas."""

from __future__ import annotations

import warnings
from functools import cache

import numpy as np
import pytest
import sympy

import ncgen
from ncgen.solver.runs.start import given_velocity

G = 9.81
MASS, RADIUS = 2.0, 0.3
ACROSS, ALONG, MOMENT = MASS * RADIUS**2 / 4, MASS * RADIUS**2 / 2, MASS * RADIUS**2
"""Of a thin disc about a diameter, about its axle, and what the contact adds."""


@cache
def disc(across=(1, 0, 0), lean=0.0):
    model = ncgen.Model("disc")
    axle, up = np.array([0, np.cos(lean), -np.sin(lean)]), np.array([0, np.sin(lean), np.cos(lean)])
    centre, u, v = model.point("C", RADIUS * up), model.vector("u", axle), model.vector("v", across)
    inertia = ACROSS * (np.eye(3) + np.outer(axle, axle))
    body = model.body("disc", [centre], [u, v], mass=MASS, inertia=inertia, constant_mass=True)
    model.rolling(body, centre, u, v, RADIUS)
    model.gravity((0, 0, -G))
    return ncgen.compile(model, backend="numpy")


def moving(kernels, omega, velocity, origin):
    """Velocities of all points and vectors of one rigid body that turns at omega, its point at `origin` moving at velocity."""
    rates = {}
    for element in kernels.model.elements.values():
        point = element in [p for body in kernels.model.bodies.values() for p in body.points]
        arm = element.initial - origin if point else element.initial
        rate = np.cross(omega, arm) + (np.array(velocity) if point else 0.0)
        rates |= {c.name: r for c, r in zip(element.components, rate, strict=True) if c.name in kernels.index}
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        return given_velocity(kernels, rates, kernels.q0, 0.0, kernels.p0)


def largest(linearisation, count=2):
    """Eigenvalues but for the zeros, whose rounding is that of roots."""
    values = linearisation.eigenvalues
    order = np.argsort(-np.abs(values))
    assert np.all(np.abs(values[order[count:]]) < 1e-5 * np.max(np.abs(values)))
    return np.sort_complex(values[order[:count]])


@pytest.mark.parametrize("z", [("C.x", "u.x", "u.z"), ("C.x", "v.y", "u.z"), ()], ids=str)
@pytest.mark.parametrize("across", [(1, 0, 0), (0.6, 0, 0.8)])
@pytest.mark.parametrize("speed", [0.5, 0.9, 1.0, 3.0])
def test_an_upright_disc(speed, across, z):
    """(A + m R²) φ̈ = (m g R − C (C + m R²) ω²/A) φ: it falls below 0.9905 m/s, whatever the coordinates are."""
    spin = speed / RADIUS
    square = (MASS * G * RADIUS - ALONG * (ALONG + MOMENT) * spin**2 / ACROSS) / (ACROSS + MOMENT)
    kernels = disc(across)
    small = ncgen.linearise(kernels, qd0=moving(kernels, [0, spin, 0], [speed, 0, 0], kernels.model.elements["C"].initial), z=z)
    root = np.emath.sqrt(square)
    assert small.steady
    assert largest(small) == pytest.approx(np.sort_complex([-root, root]), rel=1e-9)
    assert small.stable == (speed > 0.9905)


@pytest.mark.parametrize("z", [(), ("C.x", "u.x", "u.z"), ("C.x", "v.y", "u.z")], ids=str)
def test_a_disc_that_rolls_in_a_circle(z):
    """Against the linear equations of Newton and Euler in lean, turning and spin, whose coefficients are constant."""
    lean, turning = 0.25, 1.2
    s, c = np.sin(lean), np.cos(lean)
    spin = (MASS * G * RADIUS * s - ACROSS * turning**2 * s * c) / ((ALONG + MOMENT) * turning * c)
    x = sympy.symbols("lean leaning turning spin")
    sine, cosine = sympy.sin(x[0]), sympy.cos(x[0])
    overturning = MASS * G * RADIUS * sine - (ALONG + MOMENT) * x[2] * x[3] * cosine - ACROSS * x[2] ** 2 * sine * cosine
    rates = sympy.Matrix([
        x[1], overturning / (ACROSS + MOMENT),
        x[1] * (ALONG * x[3] + 2 * ACROSS * x[2] * sine) / (ACROSS * cosine), MOMENT * x[2] * x[1] * cosine / (ALONG + MOMENT),
    ])  # fmt: skip
    known = np.array(rates.jacobian(x).subs(dict(zip(x, (lean, 0, turning, spin), strict=True))), dtype=float)
    kernels = disc(lean=lean)
    omega = spin * np.array([0, c, -s]) + turning * np.array([0, s, c]) * c  # turning about the vertical, less what spin has of it
    centre = kernels.model.elements["C"].initial
    small = ncgen.linearise(kernels, qd0=moving(kernels, omega, np.cross(omega, centre), centre), z=z)
    roots = np.linalg.eigvals(known)
    roots = roots[np.argsort(-np.abs(roots))][:2]
    # In the frame that goes round with the disc, places on the plane and headings go round at the rate −turning.
    found = small.eigenvalues
    assert small.steady
    for root in (*roots, 1j * turning, -1j * turning):
        assert np.min(np.abs(found - root)) < 1e-8 * np.max(np.abs(found))


@pytest.mark.parametrize("z", [(), ("P.x", "P.z"), ("P.y", "P.z")], ids=str)
def test_a_conical_pendulum(z):
    """Ω² = g/(L cos θ), and beside it ω² = Ω² (1 + 3 cos² θ)."""
    length, angle = 0.8, 0.6
    model = ncgen.Model("conical")
    place = length * np.array([np.sin(angle) * np.cos(0.4), np.sin(angle) * np.sin(0.4), -np.cos(angle)])
    bob = model.point("P", place)
    model.body("bob", points=[bob], mass=1.5)
    model.distance(model.point("O", (0, 0, 0), fixed=True), bob)
    model.gravity((0, 0, -G))
    kernels = ncgen.compile(model, backend="numpy")
    rate = np.sqrt(G / (length * np.cos(angle)))
    small = ncgen.linearise(kernels, qd0=np.cross([0, 0, rate], place), z=z)
    assert small.steady and small.stable
    root = 1j * rate * np.sqrt(1 + 3 * np.cos(angle) ** 2)
    assert largest(small) == pytest.approx([-root, root], rel=1e-9)


@cache
def top(angle):
    """A symmetric top on its tip, and its inertia about the tip across and along the axis."""
    mass, height, radius = 0.5, 0.1, 0.06
    model = ncgen.Model("top")
    axis = np.array([np.sin(angle), 0, np.cos(angle)])
    tip, u = model.point("O", (0, 0, 0), fixed=True), model.vector("u", axis)
    v = model.vector("v", (np.cos(angle), 0, -np.sin(angle)))
    across, along = mass * radius**2 / 4, mass * radius**2 / 2
    inertia = across * np.eye(3) + (along - across) * np.outer(axis, axis)
    model.body("top", [tip, model.point("S", height * axis)], [u, v], mass=mass, com=height * axis, inertia=inertia)
    model.gravity((0, 0, -G))
    return ncgen.compile(model, backend="numpy"), axis, mass * G * height, across + mass * height**2, along


@pytest.mark.parametrize("z", [(), ("u.x", "u.y", "v.y")], ids=str)
def test_a_top_that_precesses(z):
    """Nutation ω² = U″/I from the effective potential U = (a − b cos θ)²/(2 I sin² θ) + m g h cos θ."""
    angle, precession = 0.7, 6.0
    kernels, axis, weight, across, along = top(angle)
    # No torque is left in steady precession: I₃ ω₃ Ω = m g h + I Ω² cos θ.
    spin = (weight + across * precession**2 * np.cos(angle)) / (along * precession)
    omega = np.array([0, 0, precession]) + (spin - precession * np.cos(angle)) * axis
    b = along * spin
    a = across * precession * np.sin(angle) ** 2 + b * np.cos(angle)
    x = sympy.Symbol("x")
    potential = (a - b * sympy.cos(x)) ** 2 / (2 * across * sympy.sin(x) ** 2) + weight * sympy.cos(x)
    assert abs(potential.diff(x).subs(x, angle)) < 1e-12 * weight
    root = 1j * np.sqrt(float(potential.diff(x, 2).subs(x, angle)) / across)
    small = ncgen.linearise(kernels, qd0=moving(kernels, omega, np.zeros(3), np.zeros(3)), z=z)
    assert small.steady and small.stable
    assert largest(small) == pytest.approx([-root, root], rel=1e-9)


@pytest.mark.parametrize(("spin", "stable"), [(20.0, False), (400.0, True)])
def test_a_sleeping_top(spin, stable):
    """λ² − i (C/I) n λ − m g h/I = 0 and its conjugate, in a frame that does not turn."""
    kernels, axis, weight, across, along = top(0.0)
    small = ncgen.linearise(kernels, qd0=moving(kernels, spin * axis, np.zeros(3), np.zeros(3)))
    slow = np.roots([across, -1j * along * spin, -weight])
    found = largest(small, count=4)
    for root in (*slow, *slow.conj()):
        assert np.min(np.abs(found - root)) < 1e-7 * np.max(np.abs(found))
    assert small.steady and small.stable == stable


@pytest.mark.parametrize("driven", ["angle", "component"])
@pytest.mark.parametrize("z", [(), ("B.z",)], ids=str)
def test_a_driven_governor(z, driven):
    """An arm on a shaft that a driver turns: it hangs at cos θ = g/(L Ω²), and swings at Ω sin θ. Driven is its angle, or a component
    of a vector on it, whose acceleration changes with time alone."""
    length, rate = 0.4, 7.0
    angle = np.arccos(G / (length * rate**2))
    model = ncgen.Model("governor")
    top_, e = model.point("O", (0, 0, 0), fixed=True), model.vector("e", (0, 0, 1), fixed=True)
    a = model.vector("a", (0, 1, 0))
    ball = model.point("B", length * np.array([np.sin(angle), 0, -np.cos(angle)]))
    shaft = model.body("shaft", [top_], [e, a])
    model.body("ball", [ball], mass=2.0)
    model.distance(top_, ball)
    model.constrain(a.x * ball.x + a.y * ball.y + a.z * ball.z)
    if driven == "angle":
        model.drive(model.angle("psi", model.vector("f", (0, 1, 0), fixed=True), a, e), rate * model.time)
    else:
        model.drive(a.x, -sympy.sin(rate * model.time))
    model.gravity((0, 0, -G))
    kernels = ncgen.compile(model, backend="numpy")
    assert shaft.vectors
    qd = given_velocity(kernels, {"B.z": 0.0}, kernels.q0, 0.0, kernels.p0)
    small = ncgen.linearise(kernels, qd0=qd, z=z)
    root = 1j * rate * np.sin(angle)
    assert small.steady
    assert small.eigenvalues == pytest.approx([-root, root], rel=1e-7)


def test_what_is_not_steady_is_said():
    """A pendulum on its way, and one let go aside; at rest below there is nothing to say."""
    model = ncgen.Model("pendulum")
    bob = model.point("P", (0, -0.7))
    model.body("bob", points=[bob], mass=1.0)
    model.distance(model.point("O", (0, 0), fixed=True), bob)
    model.gravity((0, -G, 0))
    kernels = ncgen.compile(model, backend="numpy")
    for start in ({"qd": np.array([1.0, 0.0])}, {"q": np.array([0.42, -0.56])}):
        with pytest.warns(UserWarning, match="pendulum: the motion is neither rest in equilibrium nor steady"):
            assert not ncgen.linearise(kernels, **start).steady
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert ncgen.linearise(kernels).steady


@pytest.mark.parametrize(("length", "rate"), [(0.8, 3.5), (1e-5, 1e9), (1e5, 1e-3)])
def test_a_swing_is_not_steady_in_any_units(length, rate):
    """At the bottom a pendulum moves as if it turned at a constant rate; its weight, no symmetry, tells. In a cone it is steady."""
    model = ncgen.Model("swing")
    bob = model.point("P", (0, 0, -length))
    model.body("bob", points=[bob], mass=1.5)
    model.distance(model.point("O", (0, 0, 0), fixed=True), bob)
    model.gravity((0, 0, -length * rate**2))
    kernels = ncgen.compile(model, backend="numpy")
    with pytest.warns(UserWarning, match="neither rest in equilibrium nor steady"):
        assert not ncgen.linearise(kernels, qd0=[1.2 * rate * length, 0, 0]).steady
    place = length * np.array([0.6, 0, -0.8])
    around = np.cross([0, 0, rate / np.sqrt(0.8)], place)
    cone = ncgen.linearise(kernels, q0=place, qd0=around)
    assert cone.steady
    root = 1j * rate / np.sqrt(0.8) * np.sqrt(1 + 3 * 0.8**2)
    assert largest(cone) == pytest.approx([-root, root], rel=1e-9)
