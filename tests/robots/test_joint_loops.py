"""Joint space of mechanisms with loops, beside a closed form, beside natural coordinates, and its slopes beside complex steps."""

import time
from pathlib import Path

import numpy as np
import pytest

import ncgen
from ncgen import Model
from ncgen.errors import ConvergenceError, ModelError
from ncgen.solver.joints.joint_loops import JointsInLoops

HERE = Path(__file__).parent
LOOPS = [str(HERE / "fourbar.sdf"), "stewart", "delta", "slidercrank3d"]


def close(found, expected, share=1e-11):
    expected = np.asarray(expected)
    np.testing.assert_allclose(found, expected, rtol=0, atol=share * np.max(np.abs(expected), initial=1e-300))


def parallelogram(backend: str):
    """Two cranks of length 0.8 and a coupler that never turns; the angle of one crank is known."""
    m = Model("parallelogram")
    m.gravity((0, -9.81, 0))
    A, D = m.point("A", (0, 0), fixed=True), m.point("D", (1.5, 0), fixed=True)
    c, s = 0.8 * np.cos(1.1), 0.8 * np.sin(1.1)
    B, C = m.point("B", (c, s)), m.point("C", (1.5 + c, s))
    m.body("left", [A, B], mass=2.0, com=(0.3 * c / 0.8, 0.3 * s / 0.8), inertia=0.05)
    m.body("coupler", [B, C], mass=3.0, com=(0.5 + c, s + 0.2), inertia=0.4)
    m.body("right", [D, C], mass=1.0, com=(1.5 + 0.5 * c, 0.5 * s), inertia=0.07)
    psi = m.angle("psi", m.vector("x", (1, 0), fixed=True), B - A, m.vector("z", (0, 0, 1), fixed=True))
    m.torsion_spring(psi, 6.0, 0.9, 0.2)
    return ncgen.joint_space(ncgen.compile(m, backend))


MASS = 0.05 + 2 * 0.3**2 + 3 * 0.8**2 + 0.07 + 1 * 0.4**2
WEIGHT = 9.81 * (2 * 0.3 + 3 * 0.8 + 1 * 0.4)


@pytest.mark.parametrize("backend", ["numpy", "c"])
def test_a_parallelogram_is_a_pendulum(backend):
    """M ψ̈ = τ − G cos ψ − 6 (ψ − 0.2) − 0.9 ψ̇ with all masses on circles; and what that changes by."""
    space = parallelogram(backend)
    assert isinstance(space, JointsInLoops)
    assert space.rates == ("psi",)
    for psi, v, a, force in ((1.1, 0.0, 0.0, 0.0), (0.5, 2.0, -1.0, 3.0), (2.0, -1.5, 0.7, -2.0)):
        q = space.position({"psi": psi})
        assert np.max(np.abs(space.kernels.phi(q))) < 1e-13
        close(space.mass_matrix(q), [[MASS]])
        close(space.inverse_dynamics(q, [v], [a]), [MASS * a + WEIGHT * np.cos(psi)])
        np.testing.assert_allclose(space.coriolis(q, [v]), [0.0], atol=1e-12)
        right = force - WEIGHT * np.cos(psi) - 6 * (psi - 0.2) - 0.9 * v
        close(space.forward_dynamics(q, [v], [force]), [right / MASS])
        slopes = space.inverse_dynamics_derivatives(q, [v], [a])
        close(slopes.position, [[-WEIGHT * np.sin(psi)]])
        np.testing.assert_allclose(slopes.rate, [[0.0]], atol=1e-11)
        slopes = space.forward_dynamics_derivatives(q, [v], [force])
        close(np.concatenate(slopes, axis=1), [[(WEIGHT * np.sin(psi) - 6) / MASS, -0.9 / MASS, 1 / MASS]])
        close(space.kinetic_energy(q, [v]), 0.5 * MASS * v * v)
        heights = 0.8 * np.sin(psi) + 0.2, 0.3 * np.sin(psi), 0.4 * np.sin(psi)
        close(space.centre_of_mass(q)[1], (3 * heights[0] + 2 * heights[1] + heights[2]) / 6)
        close(space.jacobian("C", q, "coupler"), np.array([[-0.8 * np.sin(psi), 0.8 * np.cos(psi), 0, 0, 0, 0]]).T)
        close(space.centre_of_mass_jacobian(q)[1], [WEIGHT / 9.81 * np.cos(psi) / 6])
        total = WEIGHT / 9.81 * v * np.array([-np.sin(psi), np.cos(psi), 0])
        np.testing.assert_allclose(space.momentum(q, [v])[:3], total, atol=1e-13)


@pytest.fixture(scope="module", params=LOOPS, ids=lambda name: Path(name).stem)
def loops(request):
    """A mechanism's joint space, a position of it away from the start, and rates."""
    space = ncgen.joint_space(ncgen.compile(ncgen.load(request.param), "numpy"))
    assert isinstance(space, JointsInLoops)
    start, rng = space.values(space.kernels.q0), np.random.default_rng(4)
    q = space.position({name: start[k] + rng.uniform(-0.1, 0.1) for k, name in enumerate(space.rates)})
    return space, q, rng.normal(size=space.n)


def test_mass_forces_and_accelerations_are_those_of_natural_coordinates(loops):
    """TᵀMT and Tᵀf; accelerations from [M Φ_qᵀ; Φ_q 0] of all coordinates, of which the rates are some."""
    space, q, v = loops
    kernels = space.kernels
    T = space.velocities(q, np.eye(space.n)).T
    assert np.max(np.abs(kernels.phi(q) / kernels.row_sizes)) < 1e-12
    assert np.max(np.abs(kernels.jacobian(q) @ T)) < 1e-12
    mass, jacobian, qd = kernels.mass_matrix(q), kernels.jacobian(q), T @ v
    close(space.mass_matrix(q), T.T @ mass @ T)
    close(space.loads(q) - space.gravity(q), T.T @ kernels.force(q, np.zeros(kernels.n)))
    matrix = np.block([[mass, jacobian.T], [jacobian, np.zeros((kernels.m, kernels.m))]])
    right = np.concatenate([kernels.force(q, qd), kernels.gamma(q, qd)])
    qdd = np.linalg.lstsq(matrix, right, rcond=1e-12)[0][: kernels.n]
    close(space.forward_dynamics(q, v), qdd[[kernels.index[name] for name in space.rates]], 1e-8)
    needed = space.inverse_dynamics(q, v, space.forward_dynamics(q, v))
    np.testing.assert_allclose(needed, space.loads(q, v), rtol=0, atol=1e-12 * np.max(np.abs(space.inverse_dynamics(q, v))))
    close(space.kinetic_energy(q, v), qd @ mass @ qd / 2)


def test_slopes_are_those_of_complex_steps(loops):
    """Of the programs of inverse dynamics and loads, with positions closed by Newton's method at complex values."""
    space, q, v = loops
    a, step, p = np.cos(np.arange(space.n)), 1e-30, space.kernels.p0
    needed, applied = space.inverse_dynamics_derivatives(q, v, a), space._slopes("joint_loads_tangent", 0.0, q, v)
    call = space._functions
    for k in range(space.n):
        x = space.closed(space.values(q))[0].astype(complex)
        x[space.free[k]] += 1j * step
        for _ in range(4):
            found = call("joint_position", 0.0, x, p)
            x = x + found[space.kernels.n :]
        moved, rate = found[: space.kernels.n], v + 1j * step * np.eye(space.n)[k]
        close(needed.position[:, k], call("joint_inverse", 0.0, moved, v, a, p).imag / step, 1e-9)
        close(needed.rate[:, k], call("joint_inverse", 0.0, q, rate, a, p).imag / step, 1e-9)
        np.testing.assert_allclose(applied[0][:, k], call("joint_loads", 0.0, moved, v, p).imag / step, atol=1e-9)
        np.testing.assert_allclose(applied[1][:, k], call("joint_loads", 0.0, q, rate, p).imag / step, atol=1e-9)


def test_drivers_are_motions_of_their_own():
    """A driven crank beside a free pendulum on its tip: forces of the pendulum's joint for what the driver does."""
    m = Model("driven")
    m.gravity((0, -9.81, 0))
    O, A, B = m.point("O", (0, 0), fixed=True), m.point("A", (0.5, 0)), m.point("B", (0.5, -0.7))
    m.body("crank", [O, A], mass=1.0, inertia="point")
    m.body("bob", [A, B], mass=2.0, com=(0.5, -0.7), inertia=0.0)
    x, z = m.vector("x", (1, 0), fixed=True), m.vector("z", (0, 0, 1), fixed=True)
    turn = m.angle("turn", x, A - O, z)
    m.angle("swing", m.vector("down", (0, -1), fixed=True), B - A, z)
    m.drive(turn, 3.0 * m.time)
    space = ncgen.joint_space(ncgen.compile(m, "numpy"))
    assert space.rates == ("swing",)
    q = space.position({"swing": 0.4})
    # A moves on a circle of 0.5 m at 3 rad/s: its acceleration is −0.5·9 along x
    close(space.inverse_dynamics(q, [1.0], [2.0]), [2.0 * 0.7 * (0.7 * 2.0 + 9.81 * np.sin(0.4) - 4.5 * np.cos(0.4))])
    found = space.velocities(q, [1.0])[[space.kernels.index["B.x"], space.kernels.index["B.y"]]]
    close(found, [0.7 * np.cos(0.4), 1.5 + 0.7 * np.sin(0.4)])


def test_inverse_kinematics_in_loops():
    space = ncgen.joint_space(ncgen.compile(ncgen.load("stewart"), "numpy"))
    start = space.values(space.kernels.q0)
    wanted = space.position({"s1": start[0] + 0.05, "s4": start[3] - 0.03})
    name = next(point.name for point in space.kernels.model.bodies["platform"].points)
    place = wanted[[space.kernels.index[f"{name}.{axis}"] for axis in "xyz"]]
    found = space.position(space.inverse_kinematics(name, place))
    close(found[[space.kernels.index[f"{name}.{axis}"] for axis in "xyz"]], place, 1e-8)


def test_what_does_not_close_is_told():
    space = parallelogram("numpy")
    assert np.isfinite(space.position({"psi": 40.0})).all()
    m = Model("short")
    A, D = m.point("A", (0, 0), fixed=True), m.point("D", (2, 0), fixed=True)
    B, C = m.point("B", (0, 1)), m.point("C", (1.5, 1))
    for name, pair in (("crank", [A, B]), ("coupler", [B, C]), ("rocker", [D, C])):
        m.body(name, pair, mass=1.0, inertia="point")
    m.independent(m.angle("psi", m.vector("x", (1, 0), fixed=True), B - A, m.vector("z", (0, 0, 1), fixed=True)))
    short = ncgen.joint_space(ncgen.compile(m, "numpy"))
    reach = np.arccos((1 + 4 - (1.5 + np.hypot(0.5, 1)) ** 2) / 4)  # coupler and rocker in line
    assert 2.052 < reach < 2.053
    with pytest.raises(ConvergenceError, match=r"short: loops do not close where psi = 2.05\d*; choose other values"):
        short.position({"psi": 3.5})


def test_a_mechanism_that_cannot_move_by_itself():
    with pytest.raises(ModelError, match="jansen: every joint is locked by loops or drivers; joint space is undefined"):
        ncgen.joint_space(ncgen.compile(ncgen.load("jansen"), "numpy"))


@pytest.mark.parametrize("value", [1e6, -1e300])
def test_a_value_of_many_turns_is_refused_at_once(value):
    """Loops are closed on the way from the start, and a long way has an end."""
    space = parallelogram("numpy")
    began = time.process_time()
    with pytest.raises(ConvergenceError, match="psi = .* natural sizes from the start; loops are followed for 5000 at most"):
        space.position({"psi": value})
    with pytest.raises(ConvergenceError, match="B does not get there"):
        space.inverse_kinematics("B", (0.8, 0, 0), start={"psi": 1e6})
    assert time.process_time() - began < 10
