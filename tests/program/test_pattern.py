"""Sparsity patterns against dense matrices."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from scipy.sparse import csr_array

from ncgen.program.ir.blocks import Pattern

SHAPE = (5, 7)
places = st.lists(st.tuples(st.integers(0, SHAPE[0] - 1), st.integers(0, SHAPE[1] - 1)), max_size=30)


def filled(listed) -> np.ndarray:
    """A matrix with a different number at every listed place."""
    dense = np.zeros(SHAPE)
    for number, place in enumerate(sorted(set(listed)), 1):
        dense[place] = number
    return dense


@given(places)
def test_pattern_is_the_one_of_a_sparse_matrix(listed):
    """indptr and indices are those that scipy finds for the same places, whatever order they come in."""
    pattern, sparse = Pattern.of(SHAPE, listed), csr_array(filled(listed))
    assert pattern.shape == SHAPE
    assert pattern.nonzeros == len(set(listed))
    assert list(pattern.indptr) == list(sparse.indptr)
    assert list(pattern.indices) == list(sparse.indices)


@given(places)
def test_positions_and_flat_point_at_the_values(listed):
    """positions() numbers the places in the order of the values; flat is where they stand in the dense matrix."""
    dense, pattern = filled(listed), Pattern.of(SHAPE, listed)
    values = csr_array(dense).data
    assert {place: dense[place] for place in set(listed)} == {place: values[k] for place, k in pattern.positions().items()}
    again = np.zeros(SHAPE)
    again.flat[pattern.flat] = values
    assert (again == dense).all()


def test_nothing_is_a_pattern():
    """A matrix without rows, or without any place, has an empty pattern."""
    for shape in ((0, 4), (3, 4)):
        pattern = Pattern.of(shape, [])
        assert pattern.indptr == (0,) * (shape[0] + 1) and pattern.nonzeros == 0
        assert pattern.flat.size == 0 and pattern.positions() == {}


def test_products_and_diagonals():
    random = np.random.default_rng(2)
    for shape in ((5, 7), (7, 5), (6, 6), (0, 4), (3, 0)):
        dense = random.standard_normal(shape) * (random.random(shape) < 0.4)
        matrix = csr_array(dense)
        pattern = Pattern.of(shape, [(int(i), int(j)) for i, j in zip(*np.nonzero(dense), strict=True)])
        x = random.standard_normal(shape[1])
        np.testing.assert_allclose(pattern.times(matrix.data, x), dense @ x, rtol=1e-13, atol=1e-15)
        if shape[0] == shape[1]:
            assert np.array_equal(pattern.diagonal(matrix.data), np.diag(dense))
