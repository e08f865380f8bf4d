"""Natural sizes of coordinates and rows: nothing is found to depend because it is small."""

from __future__ import annotations

import numpy as np
import pytest

import ncgen
from ncgen.model import Model


def test_a_length_is_as_large_as_the_mechanism():
    """A pendulum of a gigametre whose rod is measured by a coordinate: all four rows count, one of them being in that coordinate alone."""
    size = 1e9
    m = Model("far")
    A, B = m.point("A", (0, 0), fixed=True), m.point("B", (size, 0))
    C = m.point("C", (size, -size))
    m.body("upper", points=[B], mass=1.0)
    m.body("lower", points=[C], mass=1.0)
    m.distance(A, B)
    m.distance(B, C)
    m.length("reach", A, C)
    kernels = ncgen.compile(m, "numpy")
    assert kernels.column_sizes[kernels.index["reach"]] == kernels.column_sizes[kernels.index["B.x"]] == size
    found = ncgen.freedom(kernels)
    assert (found.rank, found.rank_here, found.dof) == (3, 3, 2)


@pytest.mark.parametrize("factor", [1e-10, 1.0, 1e10])
def test_rows_of_the_users_own_have_any_size(factor):
    """Two rows on two coordinates, one of them multiplied: both count, and neither implies the other."""
    m = Model("own")
    A = m.point("A", (0.3, 0.4))
    m.body("ball", points=[A], mass=1.0)
    m.constrain(factor * (A.x + A.y - 0.7), label="line")
    kernels = ncgen.compile(m, "numpy")
    B = Model("two")
    P = B.point("P", (0.3, 0.4, 0.0))
    B.body("ball", points=[P], mass=1.0)
    B.constrain(factor * (P.x + P.y - 0.7), label="one")
    B.constrain(P.x - P.y + 0.1, label="other")
    both = ncgen.freedom(ncgen.compile(B, "numpy"))
    assert (ncgen.freedom(kernels).rank, both.rank, len(both.redundant)) == (1, 2, 0)
    assert np.isfinite(kernels.row_sizes).all()
