"""Products, lengths and weights of vectors of numbers, with the same bits on every machine.

NumPy's own go through BLAS and LAPACK, where the order of additions and fused operations depend on the processor. What becomes part of
generated code is found here; what is only compared with a threshold need not be.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from operator import mul
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

DOUBLE = np.dtype(float)
"""The type of arrays of numbers, one object for all of them."""


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
    return math.ldexp(math.sqrt(math.fsum([math.ldexp(x, -power) ** 2 for x in numbers])), power)


def unit(a: ArrayLike) -> np.ndarray:
    """A vector (k,) divided by its length."""
    return np.asarray(a, dtype=float) / norm(a)


def cross(a: ArrayLike, b: ArrayLike) -> np.ndarray:
    """a × b of two vectors (3,), with the bits of np.cross in a tenth of its time."""
    (a0, a1, a2), (b0, b1, b2) = _floats(a), _floats(b)
    return np.array([a1 * b2 - a2 * b1, a2 * b0 - a0 * b2, a0 * b1 - a1 * b0])


def across(axis: np.ndarray) -> np.ndarray:
    """A direction of length 1 that is perpendicular to a vector (3,), and the farthest from its smallest component."""
    return unit(cross(axis, np.eye(3)[int(np.argmin(np.abs(axis)))]))


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
    """Numbers w of the least squares target = Σ w · base, of independent vectors (k,): exact, and rounded once.

    Vectors become integers by one common factor, which w does not depend on, and elimination without fractions keeps them (Bareiss 1968).
    """
    *columns, wanted = _integers([*base, target])
    rows = [[_sum(a, b) for b in (*columns, wanted)] for a in columns]
    before = 1
    for k, row in enumerate(rows):  # the matrix is positive definite, so no pivot vanishes
        pivot = row[k]
        for other in rows:
            if other is not row:
                factor = other[k]
                other[:] = [(pivot * x - factor * y) // before for x, y in zip(other, row, strict=True)]
        before = pivot
    return [row[-1] / row[k] for k, row in enumerate(rows)]


def _floats(a: ArrayLike) -> list[Any]:
    if isinstance(a, np.ndarray) and a.dtype is DOUBLE:  # as most are
        return a.tolist()
    return np.asarray(a, dtype=float).tolist()


def _integers(vectors: Sequence[ArrayLike]) -> list[list[int]]:
    """Vectors times the least power of two that makes integers of all their components."""
    ratios = [[x.as_integer_ratio() for x in _floats(vector)] for vector in vectors]
    factor = max((below for ratio in ratios for _, below in ratio), default=1)
    return [[above * (factor // below) for above, below in ratio] for ratio in ratios]


def _sum(a: Sequence[int], b: Sequence[int]) -> int:
    return sum(map(mul, a, b))


def without_rounding(vector: np.ndarray) -> list[float]:
    """The components of a vector of order one, 0 where they are rounding."""
    return [0.0 if abs(x) < 1e-15 else float(x) for x in vector]
