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


@pytest.mark.parametrize("name", ["fourbar", "robot", "stewart", "bennett", "disc", "slidercrank3d"])
def test_rows_that_are_clearly_independent_need_no_other_positions(name, monkeypatch):
    """What is said at once is what six positions around say; where rows depend on others, nothing is."""
    kernels = ncgen.compile(ncgen.load(name), "numpy")
    positions = [kernels.q0, *rank.trial_positions(kernels, kernels.q0, count=2)[1:]]
    quick = [rank._freedom(kernels, q, 0.0, kernels.p0) for q in positions]
    monkeypatch.setattr(rank, "_has_clear_rank", lambda jacobian: False)
    for q, found in zip(positions, quick, strict=True):
        whole = rank._freedom(kernels, q, 0.0, kernels.p0)
        assert whole.positions > 1 and (found.positions == 1) == (whole.rank == kernels.m)
        for member in ("rank", "rank_here", "dof", "kept_rows"):
            assert getattr(found, member) == getattr(whole, member)


def test_a_singular_position_is_no_clear_case():
    """A flat parallelogram, of which the rank drops in the position where all points are on one line."""
    m = ncgen.Model("flat")
    O, P = m.point("O", (0, 0), fixed=True), m.point("P", (2, 0), fixed=True)
    A, B = m.point("A", (1, 0)), m.point("B", (3, 0))
    for one, other in ((O, A), (A, B), (P, B)):
        m.distance(one, other)
    m.body("bar", [A, B], mass=1.0, inertia="rod")
    found = ncgen.freedom(ncgen.compile(m, "numpy"))
    assert found.is_singular and found.positions > 1


@pytest.mark.parametrize("name", ["robot", "bennett", "bricard", "excavator", "stewart", "tree"])
def test_the_rank_where_another_position_is_known_is_that_of_the_whole_search(name):
    """At positions of a motion, in an order in which none is the first."""
    kernels = ncgen.compile(ncgen.load(name), "numpy")
    run = ncgen.simulate(ncgen.compile(ncgen.load(name)), 0.3, points=4)
    assert rank.rank_at(kernels, kernels.q0, 0.0, kernels.p0) == (ncgen.freedom(kernels).rank, False)
    for t, q in zip(run.t[1:], run.q[1:], strict=True):
        here = rank.freedom_at(ncgen.compile(ncgen.load(name), "numpy"), q, float(t), kernels.p0)
        assert rank.rank_at(kernels, q, float(t), kernels.p0) == (here.rank, here.is_singular)


def test_a_singular_position_of_redundant_rows_is_found_after_a_regular_one():
    """Three parallel cranks and a coupler: one row is implied by the others, and where all lie in a line two more motions are possible."""
    m = ncgen.Model("cranks")
    centres = [m.point(f"O{i}", (i, 0), fixed=True) for i in range(3)]
    pins = [m.point(f"P{i}", (i + np.cos(0.5), np.sin(0.5))) for i in range(3)]
    for i in range(3):
        m.body(f"crank{i}", [centres[i], pins[i]], mass=1.0, inertia="rod")
    m.body("coupler", pins, mass=1.0, inertia=1.0)
    kernels = ncgen.compile(m, "numpy")
    for angle in (0.5, 1.0, 0.0, 2.0, np.pi):
        q = np.ravel([(i + np.cos(angle), np.sin(angle)) for i in range(3)])
        here = rank._freedom(kernels, q, 0.0, kernels.p0)
        assert rank.rank_at(kernels, q, 0.0, kernels.p0) == (here.rank, here.is_singular)
        assert here.is_singular == (np.sin(angle) < 1e-9)
