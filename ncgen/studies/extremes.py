"""The smallest and the largest of histories, between instants too where rates are known."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np


def extremes(t: np.ndarray, x: np.ndarray, rates: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
    """Smallest and largest (B,) of x (B, K) over instants t (K,) in s; with rates (B, K) those of the cubics between instants."""
    low, high = x.min(axis=1), x.max(axis=1)
    for _, values in _turning_points(t, x, rates):
        low, high = np.minimum(low, values.min(axis=1)), np.maximum(high, values.max(axis=1))
    return low, high


def weights(t: np.ndarray, x: np.ndarray, rates: np.ndarray | None, largest: bool) -> tuple[np.ndarray, np.ndarray]:
    """How the largest or the smallest of one history x (K,) changes with x and with its rates, (K,) each."""
    sign = 1.0 if largest else -1.0
    k = int(np.argmax(sign * x))
    best, extreme = x[k], (k, 0.0)
    for s, values in _turning_points(t, x[None], None if rates is None else rates[None]):
        j = int(np.argmax(sign * values[0]))
        if sign * values[0, j] > sign * best:
            best, extreme = values[0, j], (j, float(s[0, j]))
    (k, s), by_x, by_rates = extreme, np.zeros(len(t)), np.zeros(len(t))
    if s == 0.0:
        by_x[k] = 1.0
        return by_x, by_rates
    step = t[k + 1] - t[k]  # between instants: what the cubic is made of there; that its top moves counts for nothing
    by_x[k : k + 2] = (1 + 2 * s) * (1 - s) ** 2, s**2 * (3 - 2 * s)
    by_rates[k : k + 2] = step * s * (1 - s) ** 2, step * s**2 * (s - 1)
    return by_x, by_rates


def _turning_points(t: np.ndarray, x: np.ndarray, rates: np.ndarray | None) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Places s in every interval, from 0 to 1, and values (B, K - 1) there: one turning point of the cubics, then the other; the
    beginning of the interval where there is none. Without rates there are none."""
    if rates is None:
        return
    step = np.diff(t)
    rise, begin, end = np.diff(x, axis=1), rates[:, :-1] * step, rates[:, 1:] * step
    square, cube = 3 * rise - 2 * begin - end, begin + end - 2 * rise
    with np.errstate(all="ignore"):  # where a cubic has no turning point, what follows is no number or lies outside
        root = np.sqrt(square**2 - 3 * cube * begin)
        q = -(square + np.copysign(root, square))  # the roots of begin + 2 square s + 3 cube s², without cancellation
        for s in (begin / q, q / (3 * cube)):
            inside = (s > 0) & (s < 1)
            values = np.where(inside, x[:, :-1] + s * (begin + s * (square + s * cube)), x[:, :-1])
            yield np.where(inside, s, 0.0), values
