"""What is found in the described position comes from the cache at a second start, to the last bit."""

import numpy as np
import pytest

import ncgen
from ncgen.exchange.examples import example_module
from ncgen.mechanism import constrained_dynamics
from ncgen.solver.engines import compiled
from ncgen.solver.positions import open_tree, rank


@pytest.fixture
def own_folder(tmp_path, monkeypatch):
    """A cache of the test's own."""
    monkeypatch.setenv("NCGEN_CACHE_DIR", str(tmp_path))


def test_a_second_start_of_a_long_arm_finds_its_tables_in_the_cache(own_folder, monkeypatch):
    """As the plan of its matrix, and that all motions have inertia: the run is the same to the last bit."""
    first = ncgen.simulate(ncgen.compile(example_module("arm").build(70)), 0.01, points=3)

    def again(*_):
        raise AssertionError("it is in the cache")

    for module, name in ((open_tree, "OpenTree"), (constrained_dynamics, "plan"), (compiled, "least_energy")):
        monkeypatch.setattr(module, name, again)
    second = ncgen.simulate(ncgen.compile(example_module("arm").build(70)), 0.01, points=3)
    assert first.engine == second.engine == "tree"
    assert np.array_equal(first.q, second.q) and np.array_equal(first.qd, second.qd)
    with pytest.raises(AssertionError, match="in the cache"):
        ncgen.simulate(ncgen.compile(example_module("arm").build(71)), 0.01, points=3)


def test_tables_are_those_of_the_tree(own_folder):
    kernels = ncgen.compile(example_module("arm").build(25), "numpy")
    for known in (open_tree.known_tree(kernels), open_tree.known_tree(ncgen.compile(example_module("arm").build(25), "numpy"))):
        assert known.freedoms == open_tree.open_tree(kernels).freedoms == 25
        assert known.tables.plain() == open_tree.tables_of(open_tree.open_tree(kernels)).plain()
    assert open_tree.known_tree(ncgen.compile(ncgen.load("fourbar"), "numpy")) is None


def test_a_second_start_finds_the_degrees_of_freedom_in_the_cache(monkeypatch):
    monkeypatch.setattr(rank, "MIN_CACHED_ROWS", 1)
    found = ncgen.freedom(ncgen.compile(ncgen.load("robot"), "numpy"))

    def again(*_):
        raise AssertionError("they are in the cache")

    monkeypatch.setattr(rank, "_freedom", again)
    kept = ncgen.freedom(ncgen.compile(ncgen.load("robot"), "numpy"))
    names = ("rank", "rank_here", "dof", "redundant", "kept_rows", "positions")
    assert [getattr(kept, name) for name in names] == [getattr(found, name) for name in names]
    assert np.array_equal(kept.vanishing, found.vanishing) and kept.vanishing.shape == found.vanishing.shape


def test_other_positions_are_looked_at(monkeypatch):
    kernels = ncgen.compile(ncgen.load("robot"), "numpy")
    asked = []
    monkeypatch.setattr(rank, "_freedom_from_cache", lambda *given: asked.append(given))
    moved = ncgen.move(kernels, kernels.q0, {kernels.coordinates[0]: kernels.q0[0] + 1e-3}).q
    assert ncgen.freedom(kernels, moved).dof == ncgen.freedom(kernels, moved, t=1.0).dof
    assert not asked
