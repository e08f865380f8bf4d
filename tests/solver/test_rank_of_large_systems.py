"""The sparse test of independent rows: certain where it says yes, silent where rows depend on one another; and the dense choice of rows."""

import numpy as np
import pytest
import scipy.sparse

import ncgen
from ncgen.solver.positions import rank
from ncgen.solver.positions.open_tree import open_tree
from ncgen.solver.positions.row_choice import first_independent, represents_badly
from ncgen.solver.positions.sparse_rows import independent_rows


def difference_rows(m: int) -> scipy.sparse.csr_matrix:
    """Rows (−1, 1) along a chain of m + 1 coordinates: singular values 2 sin(kπ / 2(m + 1)), all positive."""
    return scipy.sparse.diags([-np.ones(m), np.ones(m)], [0, 1], shape=(m, m + 1), format="csr")


def test_rows_of_a_long_chain_are_clearly_independent():
    assert independent_rows(difference_rows(2000))


def test_the_sum_of_all_rows_is_noticed_as_dependent():
    rows = difference_rows(2000)
    implied = scipy.sparse.csr_matrix(rows.sum(axis=0))
    assert not independent_rows(scipy.sparse.vstack([rows, implied], format="csr"))


def test_a_row_of_zeros_is_noticed():
    rows = difference_rows(300)
    assert not independent_rows(scipy.sparse.vstack([rows, 0 * rows[0]], format="csr"))


def test_nearly_dependent_rows_are_left_to_the_dense_analysis():
    rows = difference_rows(300)
    near = rows[0].tolil()
    near[0, 300] = 1e-8
    assert not independent_rows(scipy.sparse.vstack([rows, near], format="csr"))


def test_a_row_of_zeros_depends_on_the_others():
    with np.errstate(all="raise"):
        assert first_independent([np.array([[0.0, 0.0], [3.0, 4.0], [6.0, 8.0]])]) == [1]


def test_rows_are_kept_until_they_depend_on_those_before():
    """In many rows, which are looked at together, as in few: here every third one is a sum of two of the rows before it, but in one of two
    positions, where those of the second half are multiples of the first row."""
    draw = np.random.default_rng(4)
    rows, dependent = draw.normal(size=(300, 250)), list(range(5, 300, 3))
    for row in dependent:
        rows[row] = rows[draw.integers(row)] - 0.3 * rows[draw.integers(row)]
    independent = [row for row in range(300) if row not in dependent]
    worse = rows.copy()
    worse[150:] = np.outer(draw.normal(size=150), rows[0])
    assert first_independent([rows]) == first_independent([rows, worse]) == first_independent([worse, rows]) == independent
    assert first_independent([worse]) == [row for row in independent if row < 150]


def test_one_tiny_row_represents_its_multiple_badly():
    tiny = np.array([[1e-12, 0.0], [1.0, 0.0]])
    values = np.linalg.svd(tiny, compute_uv=False)
    assert represents_badly(tiny, [0], values) and not represents_badly(tiny, [1], values)


def skew_arm(said_again):
    """Twelve hinges in a row, no axis along another; said_again: the links whose length is said a second time, each in a sum with that
    of the link before."""
    m, draw = ncgen.Model("skew"), np.random.default_rng(7)
    axis, base = m.vector("u0", (0, 1, 0), fixed=True), m.point("A0", (0, 0, 0), fixed=True)
    points, position = [base], np.zeros(3)
    for k in range(1, 13):
        position = position + draw.uniform(0.1, 0.4, 3)
        direction = draw.normal(size=3)
        end, following = m.point(f"A{k}", position.tolist()), m.vector(f"u{k}", (direction / np.linalg.norm(direction)).tolist())
        m.body(f"link{k}", points=[base, end], vectors=[axis, following], mass=1.0, inertia=(0.1, 0.12, 0.15))
        base, axis = end, following
        points.append(end)
    for k in said_again:
        squares = [
            sum((a.symbol - b.symbol) ** 2 for a, b in zip(*(p.components for p in pair), strict=True))
            for pair in (points[k - 1 : k + 1], points[k - 2 : k])
        ]
        lengths = [np.sum((p.initial - q.initial) ** 2) for p, q in (points[k - 1 : k + 1], points[k - 2 : k])]
        m.constrain(squares[0] + 0.3 * squares[1] - float(lengths[0] + 0.3 * lengths[1]), f"again {k}")
    m.gravity((0, 0, -9.81))
    return ncgen.compile(m, "numpy")


@pytest.mark.parametrize("said_again", [(), (5,), (3, 4, 12)])
def test_a_tree_tells_link_by_link_which_rows_are_implied(said_again, monkeypatch):
    """The same rows as all of them together, and combinations that hold in another position."""
    kernels = skew_arm(said_again)
    monkeypatch.setattr(rank, "MIN_TREE_ROWS", 10**9)
    monkeypatch.setattr(rank, "DENSE", 10**9)
    together = rank._freedom(kernels, kernels.q0, 0.0, kernels.p0)
    monkeypatch.setattr(rank, "MIN_TREE_ROWS", 1)
    monkeypatch.setattr(rank, "trial_positions", None)  # which only the look at all rows together needs
    by_links = rank._freedom(kernels, kernels.q0, 0.0, kernels.p0)
    for freedom in (together, by_links):
        assert (freedom.dof, freedom.rank, freedom.rank_here) == (12, kernels.n - 12, kernels.n - 12)
    assert by_links.kept_rows == together.kept_rows and len(by_links.redundant) == len(said_again)
    jacobian = kernels.jacobian(open_tree(kernels).aside.q)
    for row in by_links.redundant:
        implied = sum(coefficient * jacobian[k] for k, coefficient in row.implied_by.items())
        assert implied == pytest.approx(jacobian[row.row], abs=1e-10 * np.max(np.abs(jacobian)))
