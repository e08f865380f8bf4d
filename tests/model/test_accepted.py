"""What is right is accepted: rounded data, small bodies, springs without a length, loops that almost close."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import ncgen
from ncgen import Model, ModelError


@pytest.mark.parametrize("seed", range(20))
def test_a_turned_tensor(seed):
    """R D Rᵀ is symmetric but for rounding; the moments are those of D."""
    R = Rotation.random(random_state=seed).as_matrix()
    tensor = R @ np.diag([2e-9, 3e-9, 4e-9]) @ R.T
    m = Model("turned")
    points = [m.point(f"P{k}", x) for k, x in enumerate([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)])]
    body = m.body("b", points, mass=1.0, inertia=tensor)
    assert np.array_equal(body.inertia.tensor, body.inertia.tensor.T)
    assert np.linalg.eigvalsh(body.inertia.tensor) == pytest.approx([2e-9, 3e-9, 4e-9], rel=1e-12)
    with pytest.raises(ModelError, match="not symmetric"):
        m.body("c", points, mass=1.0, inertia=tensor + 1e-15 * np.eye(3)[[1, 2, 0]])


@pytest.mark.parametrize("inertia", [None, (0.2, 0.3, 0.4)])
@pytest.mark.parametrize("constant_mass", [False, True])
def test_a_slider_on_one_point(inertia, constant_mass):
    """It falls down a slope of 30 degrees with g/2, whatever carries it, and does not turn."""
    m = Model("slider")
    O, P = m.point("O", (0, 0, 0), fixed=True), m.point("P", (0.1, 0, 0))
    slope = m.vector("slope", (np.cos(np.pi / 6), 0, -0.5), fixed=True)
    slider = m.body("slider", [P], mass=2.0, inertia=inertia, constant_mass=constant_mass)
    m.prismatic(m.ground, slider, O, P, slope)
    m.gravity((0, 0, -9.81))
    run = ncgen.simulate(ncgen.compile(m, "numpy"), 0.5, q0=_on(m, P, 0.1 * slope.initial), points=2)
    assert np.linalg.norm(run.point("P")[-1] - run.point("P")[0]) == pytest.approx(0.5 * 9.81 / 2 * 0.25, rel=1e-7)


def _on(m, point, place):
    kernels = ncgen.compile(m, "numpy")
    q = kernels.q0.copy()
    for c, x in zip(point.components, place, strict=True):
        q[kernels.index[c.name]] = x
    return q


def test_one_point_and_two_vectors_carry_any_inertia():
    """The kinetic energy of a turning body on one point and two vectors is ½ m v² + ½ ωᵀ I ω."""
    tensor = np.array([[0.5, 0.05, 0.02], [0.05, 0.7, 0.1], [0.02, 0.1, 0.6]])
    m = Model("top")
    P, u, v = m.point("P", (0.3, 0.1, 0)), m.vector("u", (1, 0, 0)), m.vector("v", (0, 0.6, 0.8))
    com = np.array([0.5, 0.2, 0.4])
    m.body("b", [P], [u, v], mass=3.0, com=com, inertia=tensor)
    kernels = ncgen.compile(m, "numpy")
    omega, speed = np.array([0.4, -1.1, 0.7]), np.array([0.2, 0.5, -0.3])
    qd = np.concatenate([speed, np.cross(omega, u.initial), np.cross(omega, v.initial)])
    centre = speed + np.cross(omega, com - P.initial)
    kinetic = 1.5 * centre @ centre + 0.5 * omega @ tensor @ omega
    assert kernels.energy(kernels.q0, qd)[0] == pytest.approx(kinetic, rel=1e-12)


@pytest.mark.parametrize("height", [0.0, 1.0])
def test_a_flat_body_on_a_point_and_a_vector(height):
    """A physical pendulum: the energy of turning about its point is ½ (I + m d²) ω²."""
    m = Model("flat")
    A = m.point("A", (0, 0, height), fixed="z")
    u = m.vector("u", (0.6, 0.8, 0), fixed="z")
    m.body("plate", [A], [u], mass=2.0, com=(0.3, 0.4, height), inertia=0.5)
    kernels = ncgen.compile(m, "numpy")
    qd = np.array([0, 0, -0.8, 0.6]) * 1.7
    assert kernels.energy(kernels.q0, qd)[0] == pytest.approx(0.5 * (0.5 + 2.0 * 0.25) * 1.7**2, rel=1e-12)


def test_a_spring_without_length():
    """Force −k a, energy k a²/2, also where the ends meet; a damper there has no direction and is refused."""
    m = Model("spring")
    A, B = m.point("A", (1, 2, 3), fixed=True), m.point("B", (1, 2, 3))
    m.body("bob", [B], mass=2.0)
    m.spring(A, B, 50.0, free_length=0)
    kernels = ncgen.compile(m, "numpy")
    for place in (kernels.q0, kernels.q0 + [0.1, -0.2, 0.3]):
        a = place - A.initial
        assert kernels.force(place, np.zeros(3)) == pytest.approx(-50 * a, abs=1e-13)
        assert kernels.energy(place, np.zeros(3))[1] == pytest.approx(25 * a @ a)
    run = ncgen.simulate(kernels, np.pi / 10, qd0={"B.x": 1.0}, points=2, rtol=1e-10)
    assert run["B.x"][-1] == pytest.approx(1 + np.sin(5 * np.pi / 10) / 5, abs=1e-8)
    with pytest.raises(ModelError, match="spring A-B: .*length 0"):
        m.spring(A, B, 50.0, damping=1.0, free_length=0)
    with pytest.raises(ModelError, match="spring A-B: .*length 0"):
        m.spring(A, B, 50.0)


def test_a_damper_beside_a_spring_without_length():
    """Apart it is the damper that it always was: −c (a·v) a/|a|²."""
    m = Model("damper")
    A, B = m.point("A", (0, 0, 0), fixed=True), m.point("B", (1, 2, 2))
    m.spring(A, B, 50.0, 3.0, 0.0)
    kernels = ncgen.compile(m, "numpy")
    a, v = np.array([1.0, 2.0, 2.0]), np.array([0.3, -0.1, 0.5])
    assert kernels.force(a, v) == pytest.approx(-50 * a - 3 * (a @ v) / 9 * a)
    assert kernels.energy(a, v)[2] == pytest.approx(-3 * (a @ v) ** 2 / 9)


def test_a_unit_vector_of_six_digits():
    """It is brought to length 1; its direction stays, and the file keeps the digits that were typed."""
    m = Model("digits")
    given = (0.577350, 0.577350, 0.577350)
    u = m.vector("u", given)
    assert np.linalg.norm(u.initial) == pytest.approx(1.0, abs=1e-15)
    assert np.max(np.abs(np.cross(u.initial, given))) < 1e-16
    assert m.facts[-1].arguments["direction"] == given
    with pytest.raises(ModelError, match="vector v: its length is 1.00002"):
        m.vector("v", (1.00002, 0, 0))


def loop(gap):
    """A parallelogram with a fifth bar: overconstrained, and open by `gap`."""
    m = Model("loop")
    A, D, E = (m.point(n, (x, 0), fixed=True) for n, x in zip("ADE", (0, 2, 1), strict=True))
    B, C = m.point("B", (0.6, 0.8)), m.point("C", (2.6, 0.8))
    F = m.point("F", (1.6, 0.8))
    m.body("coupler", [B, F, C], mass=1.0, inertia="point")
    for start, end, length in ((A, B, 1.0), (D, C, 1.0), (E, F, 1.0 + gap)):
        m.distance(start, end, length)
    return ncgen.compile(m, "numpy")


def test_the_closing_tolerance_can_be_chosen():
    kernels = loop(3e-7)
    with pytest.raises(ncgen.ConvergenceError, match="does not close"):
        ncgen.assemble(kernels)
    q = ncgen.assemble(kernels, tolerance=1e-6)
    residual = np.abs(kernels.phi(q) / kernels.row_sizes)
    assert 1e-9 < np.max(residual) < 1e-6
    assert np.max(np.abs(q - kernels.q0)) < 1e-5
    with pytest.raises(ncgen.ConvergenceError, match="does not close"):
        ncgen.assemble(kernels, tolerance=1e-8)


def test_a_tolerance_does_not_leave_open_what_can_close():
    """A four-bar drawn with six digits closes to rounding, however much is allowed."""
    kernels = ncgen.compile(ncgen.load("fourbar"), "numpy")
    q = ncgen.assemble(kernels, kernels.q0 + 1e-6, tolerance=1e-3)
    assert np.max(np.abs(kernels.phi(q))) < 1e-11


@pytest.mark.parametrize("tolerance", [0, -1e-6, 2.0, np.nan, "much", None])
def test_a_tolerance_that_is_none(tolerance):
    with pytest.raises(ModelError, match="closing tolerance"):
        ncgen.assemble(loop(0.0), tolerance=tolerance)
