"""The order of columns by a QR factorisation with exchanges is that of LAPACK, as far as the columns are independent."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg

from ncgen.program.algebra import pivoting


@pytest.mark.parametrize("seed", range(60))
def test_columns_come_in_lapacks_order(seed, monkeypatch):
    """Of whole numbers, of dependent columns and of random ones; many of the first are equal."""
    rng = np.random.default_rng(seed)
    rows, columns = rng.integers(1, 40, 2)
    rank = int(rng.integers(1, min(rows, columns) + 1))
    matrix = rng.standard_normal((rows, rank)) @ rng.standard_normal((rank, columns))
    if seed % 3 == 0:
        matrix = np.round(matrix)
    rank = np.linalg.matrix_rank(matrix)
    own = pivoting.column_order(matrix)
    assert sorted(own) == list(range(columns))
    calls, lapack = [], scipy.linalg.qr
    monkeypatch.setattr(scipy.linalg, "qr", lambda *a, **k: calls.append(a) or lapack(*a, **k))
    monkeypatch.setattr(pivoting, "MAX_DENSE_ENTRIES", 0)
    assert own[:rank].tolist() == pivoting.column_order(matrix)[:rank].tolist()
    assert len(calls) == 1


def test_a_matrix_of_zeros_keeps_its_order():
    assert pivoting.column_order(np.zeros((3, 4))).tolist() == [0, 1, 2, 3]
