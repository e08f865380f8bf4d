"""The degrees of freedom of the described position come from the cache at a second start, to the last bit."""

import numpy as np

import ncgen
from ncgen.solver.positions import rank


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
