"""The paper's run, 0.5 s of free fall from rest, and a spatial motion: against other people's numbers and a tree of rotations."""

from __future__ import annotations

import numpy as np
import pytest
from robot_motions import SPATIAL, TIGHT
from robot_tree import ANGLES

import ncgen

STILL = ("psi1", "psi4", "psi6")


@pytest.fixture(scope="module")
def published(reference):
    """{angle: (angle, rate)} at the end of the fall."""
    lines = reference("robot_fall.csv")
    return {name: (float(angle), float(rate)) for name, angle, rate in lines}


def fall(kernels, integrator="dopri5", points=101, **options):
    return ncgen.simulate(kernels, 0.5, integrator=integrator, points=points, **TIGHT, **options)


@pytest.fixture(scope="module")
def falling(robot):
    return fall(robot)


def end_errors(run, published):
    found = [(run[name][-1], run[f"rate({name})"][-1]) for name in published]
    return np.abs(np.array(found) - np.array(list(published.values())))


@pytest.mark.parametrize(("integrator", "bound"), [("dopri5", 1e-8), ("dop853", 1e-8), ("ode113", 1e-6), ("ode15s", 1e-6)])
def test_end_of_the_fall(robot, published, integrator, bound):
    """The end state of two independent programs, see tests/reference/robot_fall.csv."""
    run = fall(robot, integrator, points=3)
    assert np.max(end_errors(run, published)) <= bound
    assert max(np.max(np.abs(run[name] - run[name][0])) for name in STILL) < 1e-12


def test_the_tree_agrees_with_the_published_end(tree, published):
    """The two oracles of this folder, one against the other."""
    psi, rates = tree.fall(np.zeros(6), 0.5)
    found = np.array([(psi[i], rates[i]) for i in (1, 2, 4)])
    assert found == pytest.approx(np.array(list(published.values())), abs=1e-9)


def test_constraints_and_energy(falling):
    """Φ stays at the Newton tolerance and T + V at the integrator's."""
    assert np.max(falling.violation()) <= 1e-11
    assert falling.energy_drift <= 1e-9
    assert np.max(np.abs(falling.work)) == 0.0


def test_energy_starts_with_the_weights(falling, robot_tables):
    """At rest T = 0 and V = Σ m g z of the centres of mass, by Table 6."""
    kinetic, potential, power = falling.energy()[0]
    weight = sum(entry["m"] * 9.81 * entry["cog"][2] for entry in robot_tables.INERTIA.values())
    assert (kinetic, power) == (0.0, 0.0)
    assert potential == pytest.approx(weight, rel=1e-14)


def test_numpy_gives_the_same_fall(falling, robot_numpy):
    """The same accelerations, of the factored matrix, from kernels in C and in NumPy differ by rounding."""
    other, mine = (fall(kernels, "dop853", points=11, engine="c") for kernels in (robot_numpy, falling.kernels))
    for name in ("q", "qd"):
        assert getattr(other, name) == pytest.approx(getattr(mine, name), abs=1e-12)
    assert other.statistics.steps == mine.statistics.steps


def test_spatial_constraints_and_energy(spatial):
    assert np.max(spatial.violation()) <= 1e-11
    assert spatial.energy_drift <= 1e-9
    assert all(np.ptp(spatial[name]) > 0.1 for name in ANGLES)


def test_spatial_motion_of_the_tree(spatial, tree):
    """The same motion from six angles and rotation matrices."""
    psi, rates = tree.fall(np.array(list(SPATIAL.values())), 0.5)
    assert [spatial[name][-1] for name in ANGLES] == pytest.approx(psi, abs=1e-8)
    assert [spatial[f"rate({name})"][-1] for name in ANGLES] == pytest.approx(rates, abs=1e-7)
    places = tree.points(tree.frames(psi, rates))
    for number, place in places.items():
        assert spatial.point(f"r{number}")[-1] == pytest.approx(place.position, abs=1e-8)


def same_motion(run, other, tolerance=1e-7):
    return np.max(np.abs(run.q - other.q)) < tolerance and np.max(np.abs(run.qd - other.qd)) < 10 * tolerance


def test_numpy_gives_the_same_spatial_motion(spatial, robot_numpy):
    other = ncgen.simulate(robot_numpy, 0.5, integrator="dop853", zd0=SPATIAL, points=3, **TIGHT)
    assert other.q == pytest.approx(spatial.q[::25], abs=1e-9)
    assert other.qd == pytest.approx(spatial.qd[::25], abs=1e-9)


@pytest.mark.parametrize("options", [{"form": "paper"}, {"scale": False}], ids=["paper", "raw"])
def test_other_rows_same_motion(robot_tables, spatial, options):
    """The paper's switched rows and raw rows have the same solutions. ψ4 and ψ6 change from one kind of row to the other."""
    kernels = ncgen.compile(robot_tables.build(**options), "c")
    run = ncgen.simulate(kernels, 0.5, integrator="dop853", zd0=SPATIAL, points=51, **TIGHT)
    assert same_motion(run, spatial)
    kinds = np.sin(run["psi4"]) ** 2 > 0.5, np.sin(run["psi6"]) ** 2 > 0.5
    assert all(kind[0] != kind[-1] for kind in kinds)


def test_printed_angles_same_motion(robot_tables, spatial):
    """Table 5 as printed counts ψ1, ψ2 and ψ6 backwards; points and vectors do not notice."""
    kernels = ncgen.compile(robot_tables.build(angles=robot_tables.PRINTED_ANGLES, form="paper"), "c")
    backwards = {name: -rate if name in ("psi1", "psi2", "psi6") else rate for name, rate in SPATIAL.items()}
    run = ncgen.simulate(kernels, 0.5, integrator="dop853", zd0=backwards, points=51, **TIGHT)
    assert np.max(np.abs(run.q[:, :30] - spatial.q[:, :30])) < 1e-7
    for name, rate in SPATIAL.items():
        sense = backwards[name] / rate
        assert run[name] == pytest.approx(sense * spatial[name], abs=1e-7)
