"""Accelerations, multipliers and motor torques of the robot: against dense algebra and a tree of rotations."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from robot_motions import SPATIAL, TIGHT, six_angles, torques_along
from robot_tree import ANGLES

import ncgen
from ncgen import Model
from ncgen.errors import ModelError, SingularError
from ncgen.solver.loads.inverse_dynamics import inverse_dynamics, motor_forces

INSTANTS = (0, 17, 33, 50)


def saddle_point(kernels, t, q, qd):
    """q̈ of [M Φ_qᵀ; Φ_q 0][q̈; λ] = [Q; γ] by least squares: unique although the rows are redundant."""
    M, J = kernels.mass_matrix(q, t), kernels.jacobian(q, t)
    matrix = np.block([[M, J.T], [J, np.zeros((kernels.m, kernels.m))]])
    right = np.concatenate([kernels.force(q, qd, t), kernels.gamma(q, qd, t)])
    return np.linalg.lstsq(matrix, right, rcond=1e-13)[0][: kernels.n]


@pytest.mark.parametrize("k", INSTANTS)
def test_accelerations_solve_the_saddle_point(spatial, k):
    expected = saddle_point(spatial.kernels, spatial.t[k], spatial.q[k], spatial.qd[k])
    assert np.max(np.abs(spatial.qdd[k] - expected)) <= 1e-10 * np.max(np.abs(expected))


@pytest.mark.parametrize("k", INSTANTS)
def test_accelerations_of_the_tree(spatial, tree, k):
    _, psi, rates, accelerations = six_angles(spatial)[k]
    expected = tree.accelerations(psi, rates)
    assert accelerations == pytest.approx(expected, abs=1e-10 * np.max(np.abs(expected)))


def test_accelerations_with_motors(driven, tree):
    for (_, psi, rates, accelerations), torques in zip(six_angles(driven), torques_along(driven), strict=True):
        expected = tree.accelerations(psi, rates, torques)
        assert accelerations == pytest.approx(expected, abs=1e-9 * np.max(np.abs(expected)))


@pytest.mark.parametrize("name", ["spatial", "driven"])
def test_multipliers_balance_every_coordinate(request, name):
    """M q̈ + Φ_qᵀ λ = Q in all 36 equations, and Φ_q q̈ = γ in all 31, kept or not."""
    run = request.getfixturevalue(name)
    for t, q, qd, qdd, lam in zip(run.t, run.q, run.qd, run.qdd, run.lam, strict=True):
        Q, gamma = run.kernels.force(q, qd, t), run.kernels.gamma(q, qd, t)
        J = run.kernels.jacobian(q, t)
        assert run.kernels.mass_matrix(q, t) @ qdd + J.T @ lam == pytest.approx(Q, abs=1e-10 * np.max(np.abs(Q)))
        assert J @ qdd == pytest.approx(gamma, abs=1e-10 * max(1.0, np.max(np.abs(gamma))))
        assert J @ qd == pytest.approx(np.zeros(31), abs=1e-12 * np.max(np.abs(qd)))


def test_motor_torque_is_the_multiplier_of_its_angle(driven):
    """The smooth row has ∂Φ/∂ψ = 1 where Φ = 0, and ψ has no inertia: λ = τ (natural coordinates, 2.9)."""
    assert driven.lam[:, 25:] == pytest.approx(torques_along(driven), abs=1e-9)


# -- inverse dynamics ---------------------------------------------------------------------------


def test_inverse_dynamics_returns_the_motors(driven_unawares):
    """A model that knows nothing of the motors finds the torques the motion was made with."""
    found = inverse_dynamics(driven_unawares)
    expected = torques_along(driven_unawares)
    assert found.names == ANGLES
    assert found.forces == pytest.approx(expected, abs=1e-10 * np.max(np.abs(expected)))
    assert found["psi3"] == pytest.approx(expected[:, 2], abs=1e-9)


def test_inverse_dynamics_of_the_tree(driven_unawares, tree):
    found = inverse_dynamics(driven_unawares).forces
    expected = [tree.torques(psi, rates, accelerations) for _, psi, rates, accelerations in six_angles(driven_unawares)]
    assert found == pytest.approx(np.array(expected), abs=1e-9)


def test_motors_in_any_order(driven_unawares):
    """Torques belong to names, not to places."""
    run = driven_unawares
    instant = (run.t[4], run.q[4], run.qd[4], run.qdd[4])
    forces, lam = motor_forces(run.kernels, ANGLES[::-1], *instant)
    assert forces[::-1] == pytest.approx(torques_along(run)[4], abs=1e-9)
    assert lam == pytest.approx(run.lam[4], abs=1e-9)


def test_nothing_is_missing_in_a_free_fall(spatial, driven):
    """Where the model knows all forces, motors have nothing to do."""
    few = replace(spatial, **{name: getattr(spatial, name)[::10] for name in ("t", "q", "qd", "work")})
    for run in (few, driven):
        assert np.max(np.abs(inverse_dynamics(run).forces)) < 1e-9


def test_work_of_the_motors(driven, driven_unawares):
    """T + V changes by ∫ Σ τ ψ̇ dt: as the run integrated it, and by Simpson's rule over the nine instants."""
    energy = driven_unawares.energy()[:, :2].sum(axis=1)
    assert driven.work == pytest.approx(energy - energy[0], abs=1e-7)
    assert driven.energy_drift <= 1e-9
    power = np.sum(torques_along(driven) * np.array([rates for _, _, rates, _ in six_angles(driven)]), axis=1)
    assert driven.energy()[:, 2] == pytest.approx(power, abs=1e-9 * np.max(np.abs(power)))
    simpson = driven.t[1] / 3 * (power[0] + power[-1] + 4 * power[1::2].sum() + 2 * power[2:-1:2].sum())
    assert driven.work[-1] == pytest.approx(simpson, rel=5e-3)


def test_motors_are_refused_where_they_cannot_work(spatial):
    run = spatial
    instant = (run.t[0], run.q[0], run.qd[0], run.qdd[0])
    with pytest.raises(ModelError, match="psi9"):
        motor_forces(run.kernels, ("psi9",), *instant)
    with pytest.raises(ModelError, match="5 motors for 6 degrees of freedom"):
        motor_forces(run.kernels, ANGLES[:5], *instant)
    with pytest.raises(SingularError, match="r2.z"):  # the column of body 2 keeps its height
        motor_forces(run.kernels, ("r2.z", *ANGLES[1:]), *instant)


def test_inverse_dynamics_after_a_change_of_rows():
    """A bar turns freely from −90° through 0°, where the cosine row of its start says nothing: no torque all the way."""
    m = Model("bar", form="paper")
    A, B = m.point("A", (0, 0), fixed=True), m.point("B", (0, -1))
    m.body("bob", [B], mass=1.0)
    m.distance(A, B)
    x, z = m.vector("x", (1, 0, 0), fixed=True), m.vector("z", (0, 0, 1), fixed=True)
    psi = m.angle("psi", x, B - A, z)
    m.independent(psi)
    run = ncgen.simulate(ncgen.compile(m, "numpy"), 1.0, zd0={"psi": np.pi}, points=3, **TIGHT)
    assert run["psi"] == pytest.approx([-np.pi / 2, 0, np.pi / 2], abs=1e-10)
    assert inverse_dynamics(run).forces == pytest.approx(np.zeros((3, 1)), abs=1e-9)


@pytest.mark.parametrize("rate", [0.0, 0.3])
def test_independent_coordinates_of_choice(robot, spatial, rate):
    """Coordinates of points serve as well as angles; ψ̈ is the same motion's."""
    z = ("r2.x", "r4.y", "r7.z", "r8.x", "r8.z", "u5.y")
    start = spatial.q[25]
    zd0 = {name: rate for name in z}
    run = ncgen.simulate(robot, 1e-3, q0=start, z=z, zd0=zd0, points=2, **TIGHT)
    assert run.independent == z
    assert [run.qd[0][robot.index[name]] for name in z] == [rate] * 6
    expected = saddle_point(robot, 0.0, run.q[0], run.qd[0])
    assert run.qdd[0] == pytest.approx(expected, abs=1e-9 * np.max(np.abs(expected)))


def test_unknown_rates_are_refused(robot):
    """SPATIAL names every independent coordinate; anything else is said by name."""
    with pytest.raises(ModelError, match="u3.x.*psi1, psi2"):
        ncgen.simulate(robot, 0.1, zd0={**SPATIAL, "u3.x": 1.0})
