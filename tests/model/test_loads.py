"""Forces, couples, springs, dampers and callbacks against forces written out by hand, and in the energy balance."""

from __future__ import annotations

import numpy as np
import pytest
import sympy

import ncgen


def block(**options):
    """A free body of two points and two vectors, with nothing acting on it."""
    m = ncgen.Model("block")
    A, B = m.point("A", (0.1, 0.2, 0.3)), m.point("B", (1.1, 0.2, 0.3))
    u, v = m.vector("u", (0, 1, 0)), m.vector("v", (0, 0.6, 0.8))
    body = m.body("block", [A, B], [u, v], mass=2.0, com=(0.5, 0.3, 0.2), inertia=(0.5, 0.6, 0.7), **options)
    return m, body, A, B


def numpy(m):
    return ncgen.compile(m, backend="numpy")


def random_state(kernels, seed=0):
    generator = np.random.default_rng(seed)
    return kernels.q0 + 0.1 * generator.standard_normal(kernels.n), generator.standard_normal(kernels.n)


def test_couple_has_the_power_of_a_couple():
    """For a rigid motion the power of the generalised force is n·ω, whatever the position (n given in global axes)."""
    m, body, _, _ = block()
    torque = np.array([3.0, -1.0, 2.0])
    m.couple(body, torque)
    kernels = numpy(m)
    generator = np.random.default_rng(4)
    rotation = np.linalg.qr(generator.standard_normal((3, 3)))[0]
    rotation *= np.sign(np.linalg.det(rotation))
    shift, omega, velocity = generator.standard_normal((3, 3))
    q, qd = [], []
    for element in (m.elements[name] for name in "ABuv"):
        turned = rotation @ element.initial
        is_point = element.name in "AB"
        q.append(turned + shift * is_point)
        qd.append(np.cross(omega, turned) + velocity * is_point)
    q, qd = np.concatenate(q), np.concatenate(qd)
    assert kernels.force(q, qd) @ qd == pytest.approx(torque @ omega, rel=1e-12)
    assert kernels.energy(q, qd)[2] == pytest.approx(torque @ omega, rel=1e-12)


@pytest.mark.parametrize("law", [None, lambda x, v: 50.0 * (x - 0.8) + 3.0 * v, sympy.sympify("50.0*(x - 0.8) + 3.0*v")])
def test_spring_and_damper(law):
    """Force k (L − L₀) + c L̇ along the line of two points, as written out with NumPy; a law says the same."""
    m, _, A, B = block()
    G = m.point("G", (0, 0, 2), fixed=True)
    if law is None:
        m.spring(B, G, stiffness=50.0, damping=3.0, free_length=0.8)
    else:
        law = law if callable(law) else law.xreplace({s: sympy.Symbol(s.name, real=True) for s in law.free_symbols})
        m.spring(B, G, law=law)
    kernels = numpy(m)
    q, qd = random_state(kernels)
    at, speed = q[3:6], qd[3:6]
    line = np.array([0, 0, 2]) - at
    length = np.linalg.norm(line)
    rate = -speed @ line / length
    tension = 50.0 * (length - 0.8) + 3.0 * rate
    assert kernels.force(q, qd)[3:6] == pytest.approx(tension * line / length, rel=1e-12)
    assert not np.any(kernels.force(q, qd)[:3])
    potential = 25.0 * (length - 0.8) ** 2 if law is None else 0.0
    power = -3.0 * rate**2 if law is None else -tension * rate
    assert kernels.energy(q, qd)[1:] == pytest.approx([potential, power], rel=1e-12)


def test_torsion_spring():
    """Torque −k (ψ − ψ₀) − c ψ̇ along an angle, and its law."""
    m, body, A, B = block()
    x, z = m.vector("x", (1, 0, 0), fixed=True), m.vector("z", (0, 0, 1), fixed=True)
    psi = m.angle("psi", x, B - A, z)
    m.torsion_spring(psi, stiffness=4.0, damping=0.5, free_angle=0.1)
    m.torsion_spring(psi, law=lambda angle, rate: angle**3)
    kernels = numpy(m)
    q, qd = random_state(kernels)
    i = kernels.index["psi"]
    expected = -4.0 * (q[i] - 0.1) - 0.5 * qd[i] - q[i] ** 3
    assert kernels.force(q, qd)[i] == pytest.approx(expected, rel=1e-13)


def test_callback_equals_an_expression():
    """A Python function and the same force as an expression give one motion, and both balance the energy."""

    def pendulum():
        m = ncgen.Model("pendulum")
        A, B = m.point("A", (0, 0), fixed=True), m.point("B", (1, 0))
        m.body("bob", [B], mass=2.0)
        m.distance(A, B)
        m.gravity((0, -9.81, 0))
        return m, B

    said, B = pendulum()
    said.force(B, (-0.3 * B.x.rate, -0.3 * B.y.rate + sympy.sin(3 * said.time), 0))
    called, _ = pendulum()

    @called.callback
    def drag(t, q, qd, kernels):
        return -0.3 * qd + np.array([0.0, np.sin(3 * t)])

    runs = [ncgen.simulate(numpy(m), 0.5, rtol=1e-10, atol=1e-12, points=6) for m in (said, called)]
    assert np.max(np.abs(runs[0].q - runs[1].q)) < 1e-11
    for run in runs:
        assert run.energy_drift < 1e-8
        assert abs(run.work[-1]) > 1e-2


def test_callback_that_returns_nonsense_is_named():
    m = ncgen.Model("m")
    A, B = m.point("A", (0, 0), fixed=True), m.point("B", (1, 0))
    m.body("bob", [B], mass=1.0)
    m.distance(A, B)

    @m.callback
    def broken(t, q, qd, kernels):
        return [1.0]

    with pytest.raises(ncgen.ModelError, match="callback broken: it must return 2 finite numbers"):
        ncgen.simulate(numpy(m), 0.1)


def test_velocity_constraint_must_be_linear():
    m = ncgen.Model("m")
    A = m.point("A", (0, 0))
    m.constrain_velocity(A.x.rate**2 - 1, "speed")
    with pytest.raises(ncgen.ModelError, match=r"constraint 1 \(speed\).*not linear in the rates"):
        ncgen.generate(m)


def test_knife_edge_follows_its_known_path():
    """A sled on a knife edge (nonholonomic): with constant speed and spin its path is a circle of radius v/ω."""
    m = ncgen.Model("sled")
    A, B = m.point("A", (0, 0)), m.point("B", (1, 0))
    m.body("sled", [A, B], mass=1.0, com=A.initial, inertia=0.5)
    across = (A.x.rate * (B.y - A.y)) - (A.y.rate * (B.x - A.x))  # A moves only along AB
    m.constrain_velocity(across, "knife")
    kernels = numpy(m)
    assert ncgen.freedom(kernels).dof == 2
    v, omega = 0.8, 2.0
    run = ncgen.simulate(kernels, 1.0, rtol=1e-10, atol=1e-12, points=5, z=["A.x", "B.y"], zd0={"A.x": v, "B.y": omega})
    angle = omega * run.t
    circle = v / omega * np.column_stack([np.sin(angle), 1 - np.cos(angle), 0 * angle])
    assert np.max(np.abs(run.point("A") - circle)) < 1e-8
