"""What studies ask of runs and batches: instants of one's own, and states that do not look at their neighbours."""

from __future__ import annotations

import numpy as np
import pytest
from study_models import swing

import ncgen
from ncgen.solver.trajectories.energy import Instants, drift, drifts


@pytest.fixture(scope="module")
def kernels():
    return ncgen.compile(swing())


def test_instants_of_ones_own(kernels):
    """The motion at chosen instants is that of even ones, in every engine."""
    times = [0.0, 0.1, 0.25, 0.8, 1.0]
    even = ncgen.simulate(kernels, 1.0, zd0={"psi": 1.0}, points=21, rtol=1e-10)
    for options in ({}, {"engine": "python"}, {"formalism": "coordinate-partitioning", "integrator": "dopri5"}):
        run = ncgen.simulate(kernels, 1.0, zd0={"psi": 1.0}, points=times, rtol=1e-10, **options)
        assert run.t.tolist() == times and run["psi"] == pytest.approx(even["psi"][[0, 2, 5, 16, 20]], abs=1e-8)
    batch = ncgen.simulate(kernels, 1.0, zd0=np.array([[1.0]]), points=times, rtol=1e-10)
    assert batch.q[0, :, kernels.index["psi"]] == pytest.approx(even["psi"][[0, 2, 5, 16, 20]], abs=1e-8)


@pytest.mark.parametrize(
    "points", [[0.0], [0.1, 1.0], [0.0, 0.9], [0.0, 0.5, 0.5, 1.0], [0.0, 0.5, 0.4, 1.0], [0.0, np.nan, 1.0], "ab", [[0.0, 1.0]]]
)
def test_instants_that_cannot_be(kernels, points):
    with pytest.raises(ncgen.ModelError, match="points"):
        ncgen.simulate(kernels, 1.0, points=points)


def test_mirror_roots_are_seen_with_own_parameters():
    """A fixed arm that a parameter turns: whether a state's angle is half a turn off is its own matter, wherever it stands in a batch."""
    m = ncgen.Model("turned")
    x, y = m.parameter("x", 1.0), m.parameter("y", 0.0)
    A, G = m.point("A", (0, 0), fixed=True), m.point("G", (x, y), fixed=True)
    B, z = m.point("B", (0, -1)), m.vector("z", (0, 0, 1), fixed=True)
    m.body("rod", [A, B], mass=1.0, inertia=0.1)
    m.angle("psi", G - A, B - A, z)
    kernels = ncgen.compile(m)
    p = np.array([[1.0, 0.0], [-1.0, 0.0]])
    q0 = np.array([kernels.q0, kernels.q0])
    psi = kernels.index["psi"]
    q0[1, psi] = -np.pi / 2  # of G on the other side it is π/2: the mirror root
    for order in ([0, 1], [1, 0]):
        batch = ncgen.simulate(kernels, 0.01, q0=q0[order], p=p[order])
        assert batch.ok.tolist() == [i == 0 for i in order], batch.status
        assert "mirror root" in batch.status[order.index(1)]


def test_drifts_are_those_of_single_motions(kernels):
    p = np.array([[0.9, 2.0, 9.81], [1.1, 3.0, 9.81]])
    batch = ncgen.simulate(kernels, 1.0, p=p, zd0=np.array([[1.0], [2.0]]), points=11, rtol=1e-5)
    own = [drift(kernels, Instants(batch.t, batch.q[i], batch.qd[i], batch.work[i]), p[i]) for i in range(2)]
    assert drifts(kernels, batch.t, batch.q, batch.qd, batch.work, p) == pytest.approx(own, rel=1e-6) and min(own) > 0
