"""Rows that stand for redundant ones."""

import ncgen
from ncgen import Model


def test_kept_rows_are_not_nearly_dependent_where_others_are_not():
    """x, x + 1e-7 y and y: two of them say that nothing moves, and the first two would say it with seven digits less."""
    m = Model("stuck")
    P = m.point("P", (0.0, 0.0))
    m.body("ball", [P], mass=1.0)
    for label, row in (("x", P.x.symbol), ("nearly x", P.x.symbol + 1e-7 * P.y.symbol), ("y", P.y.symbol)):
        m.constrain(row, label)
    found = ncgen.freedom(ncgen.compile(m, "numpy"))
    assert found.rank == 2
    assert 2 in found.kept_rows
