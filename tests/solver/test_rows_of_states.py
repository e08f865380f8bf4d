"""A batch is the same function called with rows: which calls have rows, and that each row moves as it does alone."""

from __future__ import annotations

import numpy as np
import pytest
from driven_models import pendulum

import ncgen
from ncgen.solver.batch_rows import has_rows


@pytest.fixture(scope="module")
def rod():
    """A rod that a torque about its pin turns."""
    return ncgen.compile(pendulum())


@pytest.fixture(scope="module")
def block():
    """A mass of 2 kg that an input pushes along x: ẍ = push/2."""
    m = ncgen.Model("block")
    A = m.point("A", (1, 0), fixed="y")
    m.body("block", [A], mass=m.parameter("mass", 2.0), inertia="point")
    m.force(A, (m.input("push"), 0))
    return ncgen.compile(m)


@pytest.mark.parametrize(
    "arguments, rows",
    [
        ({}, False),
        ({"q0": [1.0, 2.0], "zd0": None}, False),
        ({"q0": [[1.0, 2.0]]}, True),
        ({"p": np.zeros((1, 0))}, True),
        ({"zd0": {"phi": 1.0}}, False),
        ({"zd0": {"phi": [1.0]}}, True),
        ({"qd0": {"phi": np.zeros(3), "A.x": 1.0}}, True),
        ({"zd0": [[1.0], [1.0, 2.0]]}, False),
        ({"inputs": {"tau": [0.0, 1.0]}, "z": ("phi", "psi")}, False),
    ],
)
def test_rows_are_an_array_of_two_dimensions_or_one_by_name(arguments, rows):
    assert has_rows(arguments) == rows


def test_one_state_and_rows_of_one_function(rod):
    rates = [0.0, 0.5, 1.0]
    one, rows = ncgen.simulate(rod, 0.2, zd0={"psi": 0.5}), ncgen.simulate(rod, 0.2, zd0={"psi": rates})
    assert len(one.t) == 101 and rows.q.shape == (3, 2, rod.n) and rows.ok.all()
    np.testing.assert_allclose(rows.q[1, -1], one.q[-1], rtol=0, atol=1e-7)
    same = ncgen.simulate(rod, 0.2, zd0=np.array(rates)[:, None], formalism="coordinate-partitioning", integrator="auto")
    np.testing.assert_array_equal(same.q, rows.q)


def test_rows_start_simulations_that_move_as_alone(rod):
    sims = ncgen.start(rod, zd0={"psi": [0.0, 0.5, 1.0]}, inputs={"tau": [1.0, 2.0, 3.0]}, threads=2)
    alone = [ncgen.start(rod, zd0={"psi": rate}, inputs={"tau": tau}) for rate, tau in ((0.0, 1.0), (0.5, 2.0), (1.0, 3.0))]
    for _ in range(5):
        sims.step(0.01)
        for sim in alone:
            sim.step(0.01)
    assert all(np.array_equal(sims.q[row], sim.q) and np.array_equal(sims.qd[row], sim.qd) for row, sim in enumerate(alone))
    sims.reset()
    assert sims["rate(psi)"].tolist() == [0.0, 0.5, 1.0]


def test_rows_of_parameters_start_simulations(block):
    sims = ncgen.start(block, p={"mass": [1.0, 2.0, 4.0]}).step(1.0, push=2.0)
    np.testing.assert_allclose(sims["A.x"], [2.0, 1.5, 1.25], rtol=1e-12)  # x = 1 + t² push/(2 mass)


def test_accelerations_of_one_state_and_of_rows(block):
    one = ncgen.accelerations(block, [1.0], [3.0], inputs={"push": 5.0}, velocities=True)
    assert (one.q, one.qd, one.zdd, one.independent) == (pytest.approx([1.0]), pytest.approx([3.0]), pytest.approx([2.5]), ("A.x",))
    assert ncgen.accelerations(block, {"A.x": 1.0}, {"A.x": 3.0}, p={"mass": 4.0, "push": 6.0}).zdd == pytest.approx([1.5])
    rows = ncgen.accelerations(block, [1.0], [[3.0], [0.0]], p={"mass": [1.0, 5.0]}, inputs={"push": 5.0})
    np.testing.assert_allclose(rows.zdd, [[5.0], [1.0]], rtol=1e-14)
    again = ncgen.accelerations(block, rows.q, [[3.0], [0.0]], p={"mass": [1.0, 5.0]}, inputs={"push": 10.0}, out=rows)
    np.testing.assert_allclose(again.zdd, [[10.0], [2.0]], rtol=1e-14)


def test_a_state_without_accelerations_is_refused(rod):
    with pytest.raises(ncgen.ConvergenceError, match="the state has no accelerations .domain.; start from a regular position"):
        ncgen.accelerations(rod, rod.q0, [np.nan], z="psi")


def test_gradients_of_rows_by_some_names(block):
    """The way after t = 1 s is 1 + ẋ + push/(2 mass)."""

    def way(q, qd):
        by_q = np.zeros_like(q)
        by_q[-1, 0] = 1.0
        return q[-1, 0], by_q, None

    rows = ncgen.gradient(block, 1.0, 10, way, p={"push": [2.0, 8.0]}, by=("rate(A.x)", "mass"))
    assert rows.names == ("rate(A.x)", "mass")
    np.testing.assert_allclose(rows.derivatives, [[1.0, -0.25], [1.0, -1.0]], rtol=1e-12)
    one = ncgen.gradient(block, 1.0, 10, way, p={"push": 8.0}, by=rows.names)
    assert [one.derivatives[name] for name in rows.names] == pytest.approx(rows.derivatives[1].tolist(), rel=1e-12)


@pytest.mark.parametrize(
    "call, message",
    [
        (lambda k: ncgen.simulate(k, 0.1, threads=2), "^simulate: threads is for a batch, and no argument has rows; leave it out"),
        (lambda k: ncgen.start(k, threads=2), "^start: threads is for a batch"),
        (lambda k: ncgen.start(k, inputs={"push": [1.0, 2.0]}), "push"),
        (lambda k: ncgen.start(k, 3, zd0=[[1.0], [2.0]]), "^start: variants is 3, and the start has 2 rows; leave variants out$"),
        (lambda k: ncgen.start(k, zd0=[[1.0], [2.0]], q0=np.ones((3, 1))), "^block: q0 has 3, zd0 has 2 rows; a batch has one number"),
        (lambda k: ncgen.start(k, zd0=np.zeros((0, 1))), "^block: a batch of no states; give at least one row$"),
        (lambda k: ncgen.start(k, zd0=[[1.0], [np.nan]]), "^simulation 1: zd0"),
        (lambda k: ncgen.start(k, p={"mass": [1.0, -1.0]}), "^simulation 1: .*mass"),
        (lambda k: ncgen.accelerations(k, [1.0], [1.0], threads=3), "^accelerations: threads is for a batch"),
        (lambda k: ncgen.accelerations(k, [1.0], [1.0], inputs={"push": lambda t: t}), "^inputs: accelerations needs numbers"),
        (lambda k: ncgen.gradient(k, 1.0, 2, lambda q, qd: (0.0, None, None), progress=True), "^gradient: progress is for a batch"),
        (lambda k: ncgen.gradient(k, 1.0, 2, lambda q, qd: (0.0, None, None), zd0=[[1.0]], rtol=1e-6), "^gradient: rtol is given, and it"),
        (lambda k: ncgen.simulate(k, 0.1, zd0=[[1.0]], formalism="lagrange"), "^simulate: formalism is given, and it has no effect with"),
    ],
)  # fmt: skip
def test_what_does_not_fit_rows_is_refused(block, call, message):
    with pytest.raises(ncgen.NcgenError, match=message):
        call(block)


def test_former_functions_name_those_of_today():
    with pytest.raises(AttributeError, match="ncgen.simulate_batch is now ncgen.simulate, called with rows"):
        ncgen.simulate_batch  # noqa: B018
