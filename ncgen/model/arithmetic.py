"""Products, lengths and weights of vectors of numbers, with the same bits on every machine.

NumPy's own go through BLAS and LAPACK, where the order of additions and fused operations depend on the processor. What becomes part of
generated code is found here; what is only compared with a threshold need not be.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction
from operator import mul
from typing import Any

import numpy as np
from numpy.typing import ArrayLike


def dot(a: ArrayLike, b: ArrayLike) -> float:
    """The scalar product of two vectors (k,); the sum is rounded once."""
    return math.fsum(x * y for x, y in zip(_floats(a), _floats(b), strict=True))


def norm(a: ArrayLike) -> float:
    """The length of a vector (k,). Squares of very large and very small numbers neither overflow nor vanish."""
    numbers = _floats(a)
    largest = max(map(abs, numbers), default=0.0)
    if not 0.0 < largest < math.inf:
        return largest
    _, power = math.frexp(largest)
    return math.ldexp(math.sqrt(math.fsum(math.ldexp(x, -power) ** 2 for x in numbers)), power)


def unit(a: ArrayLike) -> np.ndarray:
    """A vector (k,) divided by its length."""
    return np.asarray(a, dtype=float) / norm(a)


def across(axis: np.ndarray) -> np.ndarray:
    """A direction of length 1 that is perpendicular to a vector (3,), and the farthest from its smallest component."""
    return unit(np.cross(axis, np.eye(3)[int(np.argmin(np.abs(axis)))]))


def product(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return the product of a matrix (n, k) with a matrix (k, m) or a vector (k,); every sum is rounded once.

    Matrices become lists once: of small ones that is most of the work.
    """
    if a.shape[1] != b.shape[0]:
        raise ValueError(f"matrices {a.shape} and {b.shape} have no product")
    rows, other = _floats(a), _floats(b.T)
    if b.ndim == 1:
        return np.array([math.fsum(map(mul, row, other)) for row in rows])
    return np.array([[math.fsum(map(mul, row, column)) for column in other] for row in rows])


def weights(base: np.ndarray | Sequence[ArrayLike], target: ArrayLike) -> list[float]:
    """Numbers w of the least squares target = Σ w · base, of independent vectors (k,): exact, and rounded once."""
    columns, wanted = [_exact(column) for column in base], _exact(target)
    rows = [[_sum(a, b) for b in columns] + [_sum(a, wanted)] for a in columns]
    for k, row in enumerate(rows):  # the matrix is positive definite, so no pivot vanishes
        for other in rows[k + 1 :]:
            ratio = other[k] / row[k]
            other[:] = [x - ratio * y for x, y in zip(other, row, strict=True)]
    exact: list[Fraction] = []
    for row in reversed(rows):
        k = len(rows) - 1 - len(exact)
        exact.insert(0, (row[-1] - _sum(row[k + 1 : -1], exact)) / row[k])
    return [float(w) for w in exact]


def _floats(a: ArrayLike) -> list[Any]:
    return np.asarray(a, dtype=float).tolist()


def _exact(a: ArrayLike) -> list[Fraction]:
    return [Fraction(x) for x in _floats(a)]


def _sum(a: Sequence[Fraction], b: Sequence[Fraction]) -> Fraction:
    return sum((x * y for x, y in zip(a, b, strict=True)), Fraction(0))


def without_rounding(vector: np.ndarray) -> list[float]:
    """The components of a vector of order one, 0 where they are rounding."""
    return [0.0 if abs(x) < 1e-15 else float(x) for x in vector]
