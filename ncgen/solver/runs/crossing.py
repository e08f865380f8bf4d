"""Where a polynomial changes its sign for the first time on [0, 1]: the reference of `ncgen_crossing.c`, which says how and why."""

from __future__ import annotations

import numpy as np

from ncgen.mechanism.conditions_in_c import LINEAR as DEGREE
from ncgen.mechanism.conditions_in_c import basis

PARTS = 2**30
"""Two changes of sign nearer to each other than 1 / PARTS are none."""

SAMPLES = np.arange(DEGREE + 1) / DEGREE
"""Where the polynomial's values are taken."""


class _Walk:
    """What is known as parts of the interval are walked through from left to right: the last sign, where it was seen, and if any was."""

    def __init__(self, direction: int, sign: int) -> None:
        self.direction, self.sign, self.at, self.next, self.seen = direction, sign, 0.0, 0.0, False

    def turns(self, position: float, sign: int) -> bool:
        """Whether the sign at a place is the one that is waited for, and was the other one before."""
        self.next = position
        if self.sign * sign < 0 and sign * self.direction >= 0:
            return True
        if sign:
            self.sign, self.at, self.seen = sign, position, True
        return False


def first_crossing(values: np.ndarray, noise: float, direction: int) -> tuple[float, float] | None:
    """Two places in [0, 1] between which the polynomial changes its sign for the first time, or None where it does not.

    values (9,): at SAMPLES; noise: what is smaller has no sign, but for the first and the last of them
    direction: 1 from negative to positive, −1 the other way, 0 either
    """
    coefficients = basis(DEGREE)[1] @ values
    coefficients[[0, -1]] = values[[0, -1]]
    walk, position, width = _Walk(direction, int(np.sign(values[0]))), 0, PARTS
    while position < PARTS:
        low, high = position / PARTS, (position + width) / PARTS
        piece = _restricted(coefficients, low, high)
        signs = np.where(np.abs(piece) > noise, np.sign(piece), 0).astype(int)
        nonzero = signs[signs != 0]
        changes = int(np.count_nonzero(nonzero[1:] != nonzero[:-1]))
        first, last = int(signs[0]), int(signs[-1])
        if width > 1 and (changes > 1 or (changes == 1 and not (first and last))):
            width //= 2
            continue
        if changes == 0:
            bracket = walk.turns((low + high) / 2, int(nonzero[-1]) if len(nonzero) else 0)
        else:
            bracket = walk.turns(low, first) or walk.turns(high, last)
        if bracket:
            return walk.at, walk.next
        position += width
        while width < PARTS and position % (2 * width) == 0:
            width *= 2
    last = int(np.sign(values[-1]))  # to end at zero is to get there, but not to be there throughout
    return (walk.at, walk.next) if (last or walk.seen) and walk.turns(1.0, last or -walk.sign) else None


def _restricted(coefficients: np.ndarray, low: float, high: float) -> np.ndarray:
    """The coefficients (9,) on the part from low to high, by de Casteljau's rule for either end."""
    piece = coefficients.copy()
    for j in range(1, DEGREE + 1):
        piece[j:] = (1 - high) * piece[j - 1 : -1] + high * piece[j:]
    ratio = low / high
    for j in range(1, DEGREE + 1):
        piece[: DEGREE + 1 - j] = (1 - ratio) * piece[: DEGREE + 1 - j] + ratio * piece[1 : DEGREE + 2 - j]
    return piece
