"""The smallest and the largest of histories, between instants too where rates are known."""

from __future__ import annotations

import numpy as np


def extremes(t: np.ndarray, x: np.ndarray, rates: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
    """Smallest and largest (B,) of x (B, K) over instants t (K,) in s; with rates (B, K) those of the cubics between instants."""
    low, high = x.min(axis=1), x.max(axis=1)
    if rates is None:
        return low, high
    step = np.diff(t)
    rise, begin, end = np.diff(x, axis=1), rates[:, :-1] * step, rates[:, 1:] * step
    square, cube = 3 * rise - 2 * begin - end, begin + end - 2 * rise
    with np.errstate(all="ignore"):  # where a cubic has no turning point, what follows is no number or lies outside
        root = np.sqrt(square**2 - 3 * cube * begin)
        q = -(square + np.copysign(root, square))  # the roots of begin + 2 square s + 3 cube s², without cancellation
        for s in (begin / q, q / (3 * cube)):
            inside = (s > 0) & (s < 1)
            there = np.where(inside, x[:, :-1] + s * (begin + s * (square + s * cube)), x[:, :-1])
            low, high = np.minimum(low, there.min(axis=1)), np.maximum(high, there.max(axis=1))
    return low, high
