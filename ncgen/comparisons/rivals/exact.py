"""Kernels with 50 digits, and how large their numbers are.

Any: a number of mpmath, whose module makes its types at run time.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import mpmath
import numpy as np

from ncgen.comparisons.rivals.base import Inputs
from ncgen.mechanism.kernels import Kernels
from ncgen.model.pieces import Pieces
from ncgen.program.ir.evaluate import evaluate
from ncgen.program.ir.functions import FUNCTIONS
from ncgen.program.ir.graph import PIECES

DIGITS = 50

MPMATH = {f: getattr(mpmath, f) for f in FUNCTIONS if hasattr(mpmath, f)} | {"abs": abs, "pow": mpmath.power}

_MAGNITUDES = {
    "sub": lambda a, b: a + b,
    "neg": lambda a: a,
    "abs": lambda a: a,
    "sin": lambda a: 1.0,
    "cos": lambda a: 1.0,
    PIECES: lambda pieces, a: _largest(pieces, a),
}
"""Operations on sizes: what they give at most, so that nothing cancels."""


def exact(kernels: Kernels, name: str, inputs: Inputs) -> np.ndarray:
    """A kernel's output with 50 digits, rounded at the end to long double, which judges long double itself by halves."""
    with mpmath.workdps(DIGITS):
        return _rounded(_exact(kernels, name, _numbers(inputs)))


def by_differences(kernels: Kernels, name: str, inputs: Inputs) -> np.ndarray:
    """Φ_q or γ from Φ alone, rounded at the end: differences over 1e-15 with 50 digits are good to 1e-28.

    The generated derivatives take no part. For rows that are equations of position.
    """
    with mpmath.workdps(DIGITS):
        h = mpmath.mpf(10) ** -15
        numbers = _numbers(inputs)

        def phi(direction: Sequence[Any], step: Any) -> list[Any]:
            moved = [x + step * v for x, v in zip(numbers["q"], direction, strict=True)]
            return _exact(kernels, "phi", {**numbers, "q": moved, "t": numbers["t"] + step * (name == "gamma")})

        if name == "gamma":
            forward, centre, backward = (phi(numbers["qd"], step) for step in (h, mpmath.mpf(0), -h))
            return _rounded([-(a - 2 * b + c) / h**2 for a, b, c in zip(forward, centre, backward, strict=True)])
        jacobian = np.zeros((kernels.m, kernels.n), dtype=np.longdouble)
        for j in range(kernels.n):
            unit = [mpmath.mpf(i == j) for i in range(kernels.n)]
            jacobian[:, j] = _rounded([(a - b) / (2 * h) for a, b in zip(phi(unit, h), phi(unit, -h), strict=True)])
        return jacobian.ravel()[kernels.phi_q_pattern.flat]


def scale(kernels: Kernels, name: str, inputs: Inputs) -> np.ndarray:
    """The size of what is added up in every number of an output: errors of a few of its ulps are those of rounding."""
    sizes = {key: np.abs(getattr(inputs, key)).tolist() for key in ("q", "qd", "p")}
    largest = evaluate(kernels.programs.programs[name], {"t": abs(inputs.t), **sizes}, _MAGNITUDES, abs)
    return np.maximum(largest, np.finfo(float).tiny)


def relative_error(value: np.ndarray, reference: np.ndarray) -> float:
    """The largest difference, relative to the largest entry."""
    return float(np.max(np.abs(value - reference), initial=0.0) / max(np.max(np.abs(reference), initial=0.0), 1e-300))


def _largest(pieces: Pieces, a: float) -> float:
    """The size of what a lookup adds up, in whichever piece; a is how far beyond the knots x may be."""
    widths = [a, *(end - start for start, end in zip(pieces.knots, pieces.knots[1:])), a]
    return max(sum(abs(c) * w**k for k, c in enumerate(row[1:])) for row, w in zip(pieces.rows, widths, strict=True))


def _rounded(values: Iterable[Any]) -> np.ndarray:
    """The values as long doubles (doubles on platforms without)."""
    return np.array([np.longdouble(mpmath.nstr(v, 25)) for v in values])


def _exact(kernels: Kernels, name: str, numbers: dict[str, Any]) -> list[Any]:
    return evaluate(kernels.programs.programs[name], numbers, MPMATH, mpmath.mpf)


def _numbers(inputs: Inputs) -> dict[str, Any]:
    arrays = {key: [mpmath.mpf(float(x)) for x in getattr(inputs, key)] for key in ("q", "qd", "p")}
    return {"t": mpmath.mpf(inputs.t), **arrays}
