"""Couples that vary with time, position and velocity, in the plane and in space, on bodies that nothing holds: against closed forms."""

import numpy as np
import pytest
import sympy
from scipy.special import ellipj

import ncgen
from ncgen.exchange.toml_writer import to_toml

MASS, MOMENT = 2.0, 0.3


def flat():
    """A free body in the plane whose u is at its angle θ; θ̈ = n/J."""
    m = ncgen.Model("flat")
    P, u = m.point("P", (0, 0)), m.vector("u", (1, 0, 0), fixed="z")
    return m, m.body("b", [P], [u], mass=MASS, inertia=MOMENT), u


def angle_of(run):
    x, y, _ = run.vector("u").T
    return np.unwrap(np.arctan2(y, x))


def motion(m, rate=0.0, duration=2.0, **more):
    k = ncgen.compile(m)
    qd0 = np.zeros(k.n)
    qd0[k.index["u.y"]] = rate
    return ncgen.simulate(k, duration, qd0=qd0, points=21, rtol=1e-11, atol=1e-12, **more)


def test_a_couple_of_time_turns_a_free_body():
    """n = A sin ωt: θ = A/(J ω²) (ωt − sin ωt); the work is in the energy balance."""
    m, body, _ = flat()
    m.couple(body, 0.2 * sympy.sin(3 * m.time))
    run = motion(m)
    t = run.t
    assert np.allclose(angle_of(run), 0.2 / (MOMENT * 9) * (3 * t - np.sin(3 * t)), atol=1e-9)
    assert run.energy_drift < 1e-9


def test_a_couple_of_the_position_is_a_pendulum():
    """n = −k sin θ from θ̇₀ at θ = 0: sin(θ/2) = κ sn(ω₀ t, κ) with κ = θ̇₀/(2 ω₀)."""
    m, body, u = flat()
    m.couple(body, (0, 0, -1.5 * u.y))
    run = motion(m, rate=2.0)
    omega = np.sqrt(1.5 / MOMENT)
    modulus = 2.0 / (2 * omega)
    assert np.allclose(np.sin(angle_of(run) / 2), modulus * ellipj(omega * run.t, modulus**2)[0], atol=1e-9)


def test_a_couple_of_the_velocity_is_a_damper():
    """n = −c ω: θ = θ̇₀ J/c (1 − exp(−c t/J)), whatever the engine."""
    m, body, u = flat()
    c = m.parameter("c", 0.5)
    m.couple(body, -c * (u.x * u.y.rate - u.y * u.x.rate))
    expected = 2.0 * MOMENT / 0.5 * (1 - np.exp(-0.5 * np.linspace(0, 2, 21) / MOMENT))
    for engine in ("c", "python"):
        assert np.allclose(angle_of(motion(m, rate=2.0, engine=engine)), expected, atol=1e-9)


SHAPES = {"three directions": 3, "two directions": 2}


@pytest.mark.parametrize("shape", SHAPES)
def test_a_couple_in_space(shape):
    """On a body with equal moments ω = ∫n/J, and the power is n·ω; with two directions the third is their cross product."""
    m = ncgen.Model("space")
    P = m.point("P", (0, 0, 0))
    axes = (("u", (1, 0, 0)), ("v", (0, 1, 0)), ("w", (0, 0, 1)))[: SHAPES[shape]]
    body = m.body("b", [P], [m.vector(name, axis) for name, axis in axes], mass=MASS, inertia=(MOMENT,) * 3)
    direction = np.array([1.0, -2.0, 0.5])
    m.couple(body, [x * m.time * sympy.cos(m.time) for x in direction])
    run = motion(m, duration=1.0)
    t = run.t
    assert np.allclose(run.angular_velocity("b"), np.outer((t * np.sin(t) + np.cos(t) - 1) / MOMENT, direction), atol=1e-8)
    assert run.energy_drift < 1e-9


def test_an_input_and_a_parameter_called_like_an_argument():
    """Names of coordinates and numbers may be those of the type's own arguments."""
    m, body, _ = flat()
    a = m.parameter("nz", 2.0)
    LL = m.input("LL", default=0.1)
    m.couple(body, a * LL * (1 + m.time))
    run = motion(m)
    assert np.allclose(angle_of(run), 2.0 * 0.1 / MOMENT * (run.t**2 / 2 + run.t**3 / 6), atol=1e-9)


def test_couples_and_flat_forces_go_through_files(tmp_path):
    m, body, u = flat()
    m.couple(body, -0.3 * u.y.rate + sympy.sin(m.time))
    m.force(m.elements["P"], (1.0, -0.5 * m.time))
    m.gravity((0.1, -9.81))
    text = to_toml(m)
    (tmp_path / "m.toml").write_text(text, encoding="utf-8")
    again = ncgen.load(tmp_path / "m.toml")
    assert to_toml(again) == text
    assert np.array_equal(motion(again).q, motion(m).q)


def test_vectors_of_the_plane_have_two_components():
    """A free point mass under a force and gravity of two components: x = f t²/(2 m), y = −g t²/2."""
    m = ncgen.Model("m")
    P = m.point("P", (0, 0))
    m.body("b", [P], mass=MASS)
    m.force(P, (3.0, 0))
    m.gravity((0, -9.81))
    run = ncgen.simulate(ncgen.compile(m), 1.0, points=2)
    assert np.allclose(run.point("P")[-1][:2], (3.0 / MASS / 2, -9.81 / 2), rtol=1e-7)


REFUSED = {
    "a force of two in space": (lambda m, P, b: m.force(P, (1, 0)), "force on P: 2 components given; give three"),
    "a couple of one in space": (lambda m, P, b: m.couple(b, 1.0), "couple on b: 1.0 given; give three numbers or expressions"),
    "a couple of two": (lambda m, P, b: m.couple(b, (1.0, 0)), "couple on b: 2 components given; give three"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_wrong_numbers_of_components(case):
    act, words = REFUSED[case]
    m = ncgen.Model("m")
    P = m.point("P", (0, 0, 0))
    body = m.body("b", [P], [m.vector("u", (1, 0, 0)), m.vector("v", (0, 1, 0))], mass=1.0, inertia=(1, 1, 1))
    with pytest.raises(ncgen.ModelError, match=words):
        act(m, P, body)


def test_a_point_takes_no_couple():
    m = ncgen.Model("m")
    body = m.body("b", [m.point("P", (0, 0))], mass=1.0)
    m.couple(body, 1.0)
    with pytest.raises(ncgen.ModelError, match="couple on b: the body's elements cannot describe every rotation"):
        ncgen.compile(m, "numpy")
