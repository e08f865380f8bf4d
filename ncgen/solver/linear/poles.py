"""Poles of a linear system with what moves in them, its zeros, and its response to sines.

The share of state i in a pole is |P_ii| of the projector P on the pole's own directions, over the sum of all: it has no units and does not
depend on those of the states, and poles that are there more than once, as those of a cart that nothing holds, have one in common.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.linalg

from ncgen.errors import ModelError

POLE_TOLERANCE = 1e-6
"""Poles nearer to each other than this share of the matrix are one: rounding parts a double zero by the root of its size."""

MARKOV_ROUNDING = 1e-9
"""A Markov parameter below this share of what its factors could give is 0."""


@dataclass(frozen=True)
class Pole:
    """value: 1/s; of a pair the one that is given has the positive imaginary part.

    participation: {name: share} of what moves, the largest first; a coordinate and its rate count together
    """

    value: complex
    participation: dict[str, float]

    @property
    def frequency(self) -> float:
        """Hz, |Im| / 2π: 0 of what does not swing."""
        return abs(self.value.imag) / (2 * np.pi)

    @property
    def damping_ratio(self) -> float:
        """Decay over natural frequency: 1 of what decays without swinging, negative of what grows, 0 of a pole at 0."""
        return -self.value.real / abs(self.value) if self.value else 0.0

    def __str__(self) -> str:
        sign = f" ± {abs(self.value.imag):.6g}i" if self.value.imag else ""
        most = ", ".join(f"{name} {100 * fraction:.0f} %" for name, fraction in self.participation.items() if fraction >= 0.005)
        return f"{self.value.real:.6g}{sign} 1/s: {most}"


def poles_of(A: np.ndarray, values: np.ndarray, names: Sequence[str]) -> tuple[Pole, ...]:
    """The poles of a matrix, of each pair one. values: its eigenvalues, in the order wanted; names: of what moves in every state."""
    size, poles = float(np.linalg.norm(scipy.linalg.matrix_balance(A)[0], 2)) if A.size else 0.0, []
    for value in values:
        if value.imag < -POLE_TOLERANCE * size:
            continue
        near = np.abs(values - value) <= POLE_TOLERANCE * size
        shares = np.abs(np.diag(_projector(A, values[near])))
        shares = shares / np.sum(shares)
        moved = {name: float(sum(s for s, n in zip(shares, names, strict=True) if n == name)) for name in dict.fromkeys(names)}
        poles.append(Pole(complex(value), dict(sorted(moved.items(), key=lambda item: -item[1]))))
    return tuple(poles)


def _projector(A: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Onto the directions of these eigenvalues along those of all others: of A = Q T Qᴴ with them first, Q [1 Y; 0 0] Qᴴ where
    T₁₁ Y − Y T₂₂ = T₁₂."""
    sized = scipy.linalg.matrix_balance(A, permute=False)[0]
    reach = 2 * POLE_TOLERANCE * np.linalg.norm(sized, 2)
    ordered: Any = scipy.linalg.schur(sized.astype(complex), output="complex", sort=lambda x: bool(np.min(np.abs(values - x)) <= reach))
    T, Q, count = ordered
    top = np.zeros_like(T)
    top[:count, :count] = np.eye(count)
    if 0 < count < len(A):
        top[:count, count:] = scipy.linalg.solve_sylvester(T[:count, :count], -T[count:, count:], T[:count, count:])
    return Q @ top @ Q.conj().T  # its diagonal does not know the scale of the states


def response_of(A: np.ndarray, B: np.ndarray, C: np.ndarray, D: np.ndarray, w: np.ndarray) -> np.ndarray:
    """C (iω − A)⁻¹ B + D at the frequencies w (rad/s), shape (len(w), outputs, inputs). Raises ModelError at a pole."""
    response = np.empty((len(w), *D.shape), dtype=complex)
    for k, frequency in enumerate(w):
        try:
            response[k] = C @ np.linalg.solve(1j * frequency * np.eye(len(A)) - A, B.astype(complex)) + D
        except np.linalg.LinAlgError:
            raise ModelError(f"w: {frequency:.6g} rad/s is a pole, where the response has no bound; leave it out") from None
    return response


def zeros_of(A: np.ndarray, b: np.ndarray, c: np.ndarray, d: float) -> np.ndarray:
    """Where one input moves nothing in one output (1/s): the finite eigenvalues of [A − s b; c d].

    There are as many as states less the order of the first rate of the output that the input changes at once; none where it changes
    nothing.
    """
    count, moved = len(A), b
    sizes = np.linalg.norm(c) * np.linalg.norm(b)
    finite = count if abs(d) > MARKOV_ROUNDING * sizes else None
    for order in range(1, count + 1):
        if finite is not None:
            break
        finite = count - order if abs(c @ moved) > MARKOV_ROUNDING * sizes else None
        moved, sizes = A @ moved, sizes * np.linalg.norm(A)
    if not finite:
        return np.zeros(0, dtype=complex)
    shift = np.zeros((count + 1, count + 1))
    shift[:count, :count] = np.eye(count)
    pencil: Any = scipy.linalg.eigvals(
        np.block([[A, b[:, None]], [c[None], np.array([[d]])]]), shift, homogeneous_eigvals=True
    )  # two arrays
    above, below = pencil
    nearest = np.argsort(np.arctan2(np.abs(above), np.abs(below)))[:finite]
    return np.sort_complex(above[nearest] / below[nearest])
