"""A bad choice of coordinates and a bifurcating mechanism are told apart."""

from __future__ import annotations

import numpy as np
import pytest

import ncgen
from ncgen.errors import ModelError, NcgenError
from ncgen.solver.trajectories.monitor import monitor


@pytest.fixture(scope="module")
def pendulum():
    return ncgen.compile(ncgen.load("pendulum"), backend="numpy")


def circle(angles, rate=1.0):
    """Positions and velocities of a unit pendulum."""
    q = np.column_stack([np.cos(angles), np.sin(angles)])
    return q, rate * np.column_stack([-q[:, 1], q[:, 0]])


def test_a_bad_partition(pendulum):
    """y tells nothing where the bar stands upright; the mechanism itself is regular everywhere: σ = 1."""
    angles = np.linspace(0, np.pi, 181)
    found = monitor(pendulum, angles, *circle(angles), independent=("B.y",))
    assert found.sigma == pytest.approx(np.ones(181), rel=1e-12)
    upright = np.abs(angles - np.pi / 2) < np.radians(1.5)
    assert found.partition_is_bad[upright].all()
    assert not found.partition_is_bad[np.abs(angles - np.pi / 2) > np.radians(10)].any()
    assert not found.bifurcates.any()
    (line,) = found.findings()
    assert line.startswith("B.y are bad independent coordinates near t = 1.57")


def test_a_bifurcation():
    """The N-four-bar flattens: all rods lie on one line."""
    kernels = ncgen.compile(ncgen.load("nfourbar"), backend="numpy")
    angles = np.linspace(np.pi / 2, 0, 46)
    feet = np.array([0.0, 0, 1, 0, 2, 0])
    q = np.array([feet + np.tile([np.cos(a), np.sin(a)], 3) for a in angles])
    assert kernels.coordinates == ("B0.x", "B0.y", "B1.x", "B1.y", "B2.x", "B2.y")
    found = monitor(kernels, 1 - np.sin(angles), q, 0 * q)
    assert found.bifurcates[-1] and not found.bifurcates[:-5].any()
    assert np.max(found.violation) < 1e-12
    assert any("the mechanism bifurcates near t = 1 s" in line for line in found.findings())


def test_energy_and_violation(pendulum):
    """Turning at a constant rate is no free motion of a pendulum: the energy that weight should take is the drift."""
    angles = np.linspace(0, np.pi / 2, 10)
    q, qd = circle(angles)
    found = monitor(pendulum, angles, q, qd)
    assert found.energy - found.energy[0] == pytest.approx(9.81 * np.sin(angles))
    assert found.drift[-1] == pytest.approx(1.0)
    assert monitor(pendulum, angles, q, qd, work=9.81 * np.sin(angles)).drift == pytest.approx(np.zeros(10), abs=1e-12)
    assert monitor(pendulum, angles, 1.01 * q, qd).violation == pytest.approx(np.full(10, 0.0201), rel=0.6)


def test_drift_is_relative_to_what_moves(pendulum):
    """From rest at the height of the support to the lowest point with half of the kinetic energy: half of m g L is lost of m g L."""
    q, qd = np.array([[1.0, 0.0], [0.0, -1.0]]), np.array([[0.0, 0.0], [np.sqrt(9.81), 0.0]])
    health = monitor(pendulum, [0.0, 0.5], q, qd)
    assert health.drift == pytest.approx([0.0, 0.5], abs=1e-12)


def test_a_healthy_motion(pendulum):
    run = ncgen.simulate(pendulum, 0.1, points=5)
    found = monitor(pendulum, run.t, run.q, run.qd, run.work)
    assert found.findings() == ["no singular position and no bad choice of coordinates at these instants"]
    assert np.max(found.drift) < 1e-7


def test_from_a_file(pendulum, tmp_path):
    from ncgen.report.along import Recorded, health_record

    run = ncgen.simulate(pendulum, 0.1, points=5)
    record = health_record(Recorded.read(run.to_npz(tmp_path / "run.npz")).health(pendulum))
    assert record["independent"] == ["B.y"]
    assert record["sigma"] == pytest.approx([1.0] * 5)
    other = ncgen.compile(ncgen.load("nfourbar"), backend="numpy")
    with pytest.raises(NcgenError, match="a trajectory of other coordinates than those of nfourbar"):
        Recorded.read(tmp_path / "run.npz").health(other)
    (tmp_path / "text.npz").write_text("no archive")
    with pytest.raises(NcgenError, match="text.npz: not a trajectory"):
        Recorded.read(tmp_path / "text.npz").health(pendulum)


def test_as_many_as_degrees_of_freedom(pendulum):
    with pytest.raises(ModelError, match="2 independent coordinates for 1 degree of freedom: B.x, B.y"):
        monitor(pendulum, *(np.zeros(1), *circle(np.zeros(1))), independent=("B.x", "B.y"))
