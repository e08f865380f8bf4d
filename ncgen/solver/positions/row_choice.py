"""Which rows of a matrix are kept of those that are dependent: the first ones, or the ones farthest from dependent."""

from __future__ import annotations

import numpy as np

from ncgen.model.singular_values import least_squares, singular_values, svd
from ncgen.program.algebra.pivoting import column_order

MIN_SINGULAR_FRACTION = 1e-4
"""Share of the least singular value of all rows below which that of the kept ones asks for others."""

ROWS_AT_ONCE = 64
"""Rows whose parts outside a basis are computed by products of matrices, which reach the basis once for all of them."""


def best_rows(jacobian: np.ndarray, rank: int) -> np.ndarray:
    """The `rank` rows that a QR factorisation with exchanges finds farthest from dependent, in their own order."""
    return np.sort(column_order(jacobian.T)[:rank])


def counting_rows(jacobian: np.ndarray, rank: int) -> np.ndarray:
    """All rows but those in which the combinations that vanish are largest, as ncgen_redundant.c chooses them in C."""
    left, _, _ = svd(jacobian, full=True)
    return np.sort(column_order(left[:, rank:].T)[len(jacobian) - rank :])


def largest_share(jacobian: np.ndarray, rows: np.ndarray) -> float:
    """The largest share, at least 1, of rows that count in the sum of all others, these with signs in turn."""
    others = np.delete(jacobian, rows, axis=0)
    signs = (-1.0) ** np.arange(len(others))
    return max(1.0, float(np.max(np.abs(least_squares(jacobian[rows].T, signs @ others)), initial=0.0)))


def represents_badly(jacobian: np.ndarray, kept: list[int], values: np.ndarray) -> bool:
    """True if rows, of which there are as many as the rank, are much nearer to being dependent than all rows together.

    values: singular ones of all rows
    """
    count = len(kept)
    return count > 0 and singular_values(jacobian[kept])[count - 1] < MIN_SINGULAR_FRACTION * values[count - 1]


def first_independent(jacobians: list[np.ndarray]) -> list[int]:
    """Rows in their own order, each kept if it is independent of those kept before in some position, which is then asked on.

    Positions in which a kept row depends on those before are asked no more, so that all kept rows are independent together.
    """
    bases = [(j, np.zeros((min(j.shape), j.shape[1]))) for j in jacobians]
    kept: list[int] = []
    for start in range(0, len(jacobians[0]), ROWS_AT_ONCE):
        before = len(kept)
        blocks = [(j, basis, _outside(_normalised(j[start : start + ROWS_AT_ONCE]), basis[:before])) for j, basis in bases]
        for row in range(len(blocks[0][2])):
            rests = [(block, _outside(block[2][row : row + 1], block[1][before : len(kept)])[0]) for block in blocks]
            new = [(block, rest / size) for block, rest in rests if (size := np.linalg.norm(rest)) > 1e-8]
            if new and len(kept) < len(new[0][0][1]):
                blocks = [block for block, _ in new]
                for (_, basis, _), rest in new:
                    basis[len(kept)] = rest
                kept.append(start + row)
        bases = [(j, basis) for j, basis, _ in blocks]
    return kept


def _normalised(rows: np.ndarray) -> np.ndarray:
    return rows / np.maximum(np.linalg.norm(rows, axis=1), 1e-300)[:, None]


def _outside(rows: np.ndarray, basis: np.ndarray) -> np.ndarray:
    """The part of normalised rows outside an orthonormal basis, orthogonalised twice against rounding."""
    for _ in range(2):
        rows = rows - rows @ basis.T @ basis
    return rows
