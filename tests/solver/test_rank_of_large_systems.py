"""The sparse test of independent rows: certain where it says yes, silent where rows depend on one another; and the dense choice of rows."""

import numpy as np
import scipy.sparse

from ncgen.solver.positions import rank
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
        assert rank._independent_rows([np.array([[0.0, 0.0], [3.0, 4.0], [6.0, 8.0]])]) == [1]


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
    assert rank._independent_rows([rows]) == rank._independent_rows([rows, worse]) == rank._independent_rows([worse, rows]) == independent
    assert rank._independent_rows([worse]) == [row for row in independent if row < 150]


def test_one_tiny_row_represents_its_multiple_badly():
    tiny = np.array([[1e-12, 0.0], [1.0, 0.0]])
    values = np.linalg.svd(tiny, compute_uv=False)
    assert rank._represents_badly(tiny, [0], values) and not rank._represents_badly(tiny, [1], values)
