"""∂ẏ/∂y against differences of the state derivative itself, and what it does to implicit integrators."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

import ncgen
from ncgen.solver.formalisms import accelerations_by
from ncgen.solver.formalisms.coordinate_partitioning import StepStart, motion, motion_at
from ncgen.solver.formalisms.dynamics_jacobian import acceleration_jacobians, partitioned_jacobian
from ncgen.solver.formalisms.instant import Baumgarte
from ncgen.solver.positions.partition import choose_partitions
from ncgen.solver.positions.rank import trial_positions

EXAMPLES = ("fourbar", "robot", "heavytop", "bricard", "disc", "flyball", "jansen", "suspension")
"""Angles, redundant rows, M(q) and singular M, rolling, springs and dampers, a driver."""

T = 0.05


@cache
def kernels_of(name):
    return ncgen.compile(ncgen.load(name), backend="c")


def state(kernels):
    """A consistent motion that is not special."""
    generator = np.random.default_rng(2)
    start = ncgen.solve_position(kernels, kernels.q0, T).q
    q = trial_positions(kernels, start, T, kernels.p0)[-1]
    partitions = choose_partitions(kernels, q, T, kernels.p0)
    zd = generator.standard_normal(len(partitions.velocity.independent))
    return partitions, motion_at(kernels, partitions.velocity, T, q, zd, kernels.p0)


def differences(function, x, sizes):
    """∂function/∂x by central differences of order 4, columns."""
    steps = 1e-3 * sizes
    columns = []
    for h, e in zip(steps, np.eye(len(x)), strict=True):
        values = [function(x + k * h * e) for k in (-2, -1, 1, 2)]
        columns.append((values[0] - 8 * values[1] + 8 * values[2] - values[3]) / (12 * h))
    return np.array(columns).T.reshape(-1, len(x))


@pytest.mark.parametrize("name", [name for name in EXAMPLES if name != "jansen"])  # the driver leaves it no freedom
def test_independent_coordinates(name):
    kernels = kernels_of(name)
    partitions, now = state(kernels)
    velocities, positions = partitions.velocity.independent, partitions.position.independent
    start = StepStart(T, now.q, now.qd, kernels.p0)
    count = len(velocities)

    def derivative(y):
        there = motion(kernels, partitions, start, T, y[count:], y[:count])
        return np.concatenate([there.qdd[velocities], there.qd[positions]])

    y = np.concatenate([now.qd[velocities], now.q[positions]])
    sizes = np.concatenate([kernels.column_sizes[velocities], kernels.column_sizes[positions]])
    known = differences(derivative, y, sizes)
    found = partitioned_jacobian(kernels, partitions, now, kernels.p0)[:-1, :-1]
    assert found == pytest.approx(known, abs=1e-7 * np.max(np.abs(known), initial=0.0))


@pytest.mark.parametrize("gains", [None, Baumgarte(10.0, 0.7)], ids=["plain", "baumgarte"])
@pytest.mark.parametrize("name", EXAMPLES)
def test_all_coordinates(name, gains):
    """Off the constraints as well, where rows that others imply are left out."""
    kernels = kernels_of(name)
    partitions, now = state(kernels)
    rows = partitions.velocity.rows
    lagrange = accelerations_by("lagrange")
    options = {"stabilisation": "baumgarte", "omega": gains.omega, "xi": gains.xi} if gains else {"stabilisation": "none"}
    sizes = kernels.column_sizes
    q = now.q + 1e-3 * sizes * np.random.default_rng(3).standard_normal(kernels.n)
    now = lagrange.motion(kernels, q, now.qd, T, kernels.p0, options, rows)
    by_q = differences(lambda x: lagrange.motion(kernels, x, now.qd, T, kernels.p0, options, rows).qdd, q, sizes)
    by_qd = differences(lambda x: lagrange.motion(kernels, q, x, T, kernels.p0, options, rows).qdd, now.qd, sizes)
    for found, known in zip(acceleration_jacobians(kernels, now, kernels.p0, rows, gains), (by_q, by_qd), strict=True):
        assert found == pytest.approx(known, abs=1e-7 * max(np.max(np.abs(known)), 1.0))


@pytest.mark.parametrize("formalism", ["coordinate-partitioning", "lagrange"])
@pytest.mark.parametrize("integrator", ["bdf", "radau"])
def test_implicit_integrators_use_it(formalism, integrator, monkeypatch):
    """The same motion as with differences, for fewer evaluations."""
    from ncgen.solver.engines import reference

    options = dict(zd0={"psi": 12.0}, points=5, formalism=formalism, integrator=integrator, engine="python")
    with_it = ncgen.simulate(kernels_of("fourbar"), 0.1, **options)
    monkeypatch.setattr(reference, "takes_jacobian", lambda *_: False)
    without = ncgen.simulate(kernels_of("fourbar"), 0.1, **options)
    assert with_it.q == pytest.approx(without.q, abs=1e-6)
    assert with_it.statistics.evaluations < without.statistics.evaluations
