"""Gears push with their teeth: closed forms of a pair and of a planetary set; what is no pair of wheels says that it is a couple."""

from __future__ import annotations

import numpy as np
import pytest

import ncgen
from ncgen import Model
from ncgen.errors import ModelError

ANGLE = np.radians(20)


def wheel(m, name, centre, towards, mass, inertia, other=()):
    """A wheel on a pin; its own point lies 0.1 m from it."""
    centre = m.point(f"{name}.O", centre, fixed=True) if isinstance(centre, tuple) else centre
    at = m.point(f"{name}.P", tuple(np.array(towards, float)))
    m.body(name, [centre, at], mass=mass, com=tuple(centre.initial[:2]), inertia=inertia)
    return centre, at


def pair(r1=0.2, r2=0.3, torque=1.5):
    """Two wheels on the ground 0.5 m apart on a line at 30 degrees; a couple on the first, which starts from rest. No weight."""
    m = Model("pair")
    m.gravity((0, 0, 0))
    X, z = m.vector("X", (1, 0, 0), fixed=True), m.vector("z", (0, 0, 1), fixed=True)
    e = np.array([np.cos(np.pi / 6), 0.5])
    distance = abs(r1 + r2)
    O, P = wheel(m, "first", (0.0, 0.0), (0.1, 0.0), 1.0, 0.02)
    C, Q = wheel(m, "second", tuple(distance * e), tuple(distance * e + [0.1, 0.0]), 2.0, 0.05)
    first, second = m.angle("psi1", X, P - O, z), m.angle("psi2", X, Q - C, z)
    m.gear(first, second, r1, r2)
    m.torque(first, torque)
    return m, e


@pytest.mark.parametrize(("r1", "r2"), [(0.2, 0.3), (0.6, -0.2), (-0.2, 0.6), (0.1, 0.5)])
def test_a_pair_of_wheels(r1, r2):
    """(I₁ + I₂ (r₁/r₂)²) α₁ = τ; the tangential force is what turns the second wheel, I₂ α₂ over its radius, and the radial one is
    its part tan 20°, towards the middle of the wheel whose teeth point outwards."""
    m, e = pair(r1, r2)
    run = ncgen.simulate(ncgen.compile(m), 0.02, points=3, rtol=1e-10)
    found = run.reactions()
    e, t, tau = np.array([*e, 0.0]), np.array([-e[1], e[0], 0.0]), 1.5
    alpha = tau / (0.02 + 0.05 * (r1 / r2) ** 2)
    # (P − c₂) × F on the second wheel is I₂ α₂; the pitch point is c₁ + ρ₁ e
    scale = abs(r1 + r2) / (r1 + r2)
    rho2 = scale * r2
    on_second = 0.05 * (-r1 / r2 * alpha) / -rho2 * t
    inwards = e if r1 * r2 > 0 else np.sign(scale * r1) * e * (-1 if abs(r1) > abs(r2) else 1)
    on_second = on_second + np.tan(ANGLE) * np.linalg.norm(on_second) * inwards
    force, moment = found.wrench("second", "second.O", neighbour="first")
    assert force == pytest.approx(np.tile(on_second, (3, 1)), abs=1e-7)
    assert moment[:, 2] == pytest.approx(0.05 * (-r1 / r2 * alpha), abs=1e-7)
    # the pin of the second holds the tooth force: its centre stands still
    pin, turning = found.wrench("second", "second.O", neighbour="ground")
    assert pin == pytest.approx(-force, abs=1e-7)
    assert turning == pytest.approx(0 * turning, abs=1e-7)
    assert found.wrench("first", "first.O", neighbour="second")[0] == pytest.approx(-force, abs=1e-7)
    assert found.couples == ()


def planetary():
    """A ring on the ground (r = 0.3 m), an arm of 0.2 m, a planet (0.1 m), a sun (0.1 m) with a couple of 2 N m, at rest."""
    m = Model("planetary")
    m.gravity((0, 0, 0))
    X, z = m.vector("X", (1, 0, 0), fixed=True), m.vector("z", (0, 0, 1), fixed=True)
    O, C = m.point("O", (0, 0), fixed=True), m.point("C", (0.2, 0))
    S, P = m.point("S", (0.1, 0)), m.point("P", (0.25, 0))
    m.body("sun", [O, S], mass=1.0, com=(0, 0), inertia=0.01)
    m.body("arm", [O, C], mass=0.5, com=(0, 0), inertia=0.02)
    m.body("planet", [C, P], mass=0.8, com=(0.2, 0), inertia=0.005)
    sun, planet = m.angle("sun", C - O, S - O, z), m.angle("planet", C - O, P - C, z)
    ring, driven = m.angle("ring", C - O, X, z), m.angle("driven", X, S - O, z)
    m.gear(sun, planet, 0.1, 0.1)
    m.gear(planet, ring, -0.1, 0.3)
    m.torque(driven, 2.0)
    return m


@pytest.mark.parametrize("angle", [0.0, ANGLE])
def test_the_planet_s_pin_carries_two_tooth_forces(angle):
    """By Lagrange: sun 4α of the arm, planet −2α; the pin takes the planet's mass times its centre's acceleration and both tangential
    forces; the radial ones cancel in sum but for their difference, and no moment passes."""
    run = ncgen.simulate(ncgen.compile(planetary()), 1e-3, points=2, rtol=1e-10)
    found = run.reactions(pressure_angle=angle)
    # ω_sun = 4 Ω, ω_planet = −2 Ω of the arm's Ω
    alpha = 4 * 2.0 / (0.01 * 16 + 0.02 + 0.005 * 4 + 0.8 * 0.2**2)
    at_sun = (2.0 - 0.01 * 4 * alpha) / 0.1  # what the sun's teeth do to the planet, along y
    at_ring = at_sun - 0.005 * 2 * alpha / 0.1  # 0.1 (at_ring − at_sun) is the planet's moment, which turns the other way
    tangential = at_sun + at_ring
    radial = (abs(at_sun) - abs(at_ring)) * np.tan(angle)
    pin, moment = (part[0] for part in found.wrench("planet", "C", neighbour="arm"))
    assert pin == pytest.approx([-radial, 0.8 * 0.2 * alpha - tangential, 0], abs=1e-6)
    assert moment == pytest.approx(np.zeros(3), abs=1e-7)
    assert found.wrench("planet", "C", neighbour="sun")[0][0] == pytest.approx([abs(at_sun) * np.tan(angle), at_sun, 0], abs=1e-6)
    parts = [found.wrench("planet", "C", neighbour=other) for other in ("arm", "sun", "ground")]
    whole = found.wrench("planet", "C")
    assert sum(p[0] for p in parts) == pytest.approx(whole[0], abs=1e-8)
    assert sum(p[1] for p in parts) == pytest.approx(whole[1], abs=1e-8)


def test_what_has_no_common_carrier_is_a_couple():
    m = Model("serial")
    m.gravity((0, -9.81, 0))
    X, z = m.vector("X", (1, 0, 0), fixed=True), m.vector("z", (0, 0, 1), fixed=True)
    O, A, B, C = m.point("O", (0, 0), fixed=True), m.point("A", (1, 0)), m.point("B", (2, 0)), m.point("C", (3, 0))
    for name, ends in (("one", [O, A]), ("two", [A, B]), ("three", [B, C])):
        m.body(name, ends, mass=1.0, inertia="rod")
    m.gear(m.angle("psi1", X, A - O, z), m.angle("psi3", B - A, C - B, z), 1.0, 1.0)
    m.angle("psi2", A - O, B - A, z)
    found = ncgen.simulate(ncgen.compile(m), 0.1, points=2).reactions()
    assert found.couples == ("gear psi1, psi3",)
    assert repr(found).endswith("gear psi1, psi3 as couples>")


@pytest.mark.parametrize("radii", [(0.0, 1.0), (1.0, 0.0)])
def test_radii_of_0_are_refused(radii):
    with pytest.raises(ModelError, match=r"gear psi1, psi2: radius_(first|second) is 0 m"):
        pair(*radii)


def test_a_pressure_angle_is_an_angle():
    run = ncgen.simulate(ncgen.compile(pair()[0]), 0.01, points=2)
    with pytest.raises(ModelError, match="pressure_angle: 20 rad given"):
        run.reactions(pressure_angle=20)
