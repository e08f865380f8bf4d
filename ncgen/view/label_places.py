"""Where names go in a picture: next to their point, as far as possible from lines and other names."""

from __future__ import annotations

import numpy as np

DIRECTIONS = np.array([[np.cos(a), np.sin(a)] for a in np.radians(45 + 22.5 * np.arange(16))])
SAMPLES = np.linspace(0, 1, 13)[:, None]

CLEARANCE_WEIGHTS = np.array([0.6, 1.0])
"""A name is wider than high, so clearance to the sides counts less."""


class LabelPlaces:
    """The places already taken on the screen.

    screen: the screen's two directions in the picture's coordinates, shape (2, 2) or (3, 2), orthonormal columns
    offset: from a point to the middle of its name (m)
    """

    def __init__(self, screen: np.ndarray, offset: float) -> None:
        self.screen = screen
        self.offset = offset
        self.taken = np.empty((0, 2))

    def avoid(self, start: np.ndarray, end: np.ndarray) -> None:
        """Keep names away from a line; `start` and `end` have shape (2,) or (3,)."""
        self._take((start + SAMPLES * (end - start)) @ self.screen)

    def next_to(self, point: np.ndarray) -> np.ndarray:
        """The place of a name next to a point, in the picture's coordinates; it is taken from now on."""
        anchor = point @ self.screen
        candidates = anchor + self.offset * DIRECTIONS
        clearance = self._clearance(candidates)
        best = candidates[np.argmax(np.round(clearance / self.offset, 6))]
        self._take(best[None])
        return point + self.screen @ (best - anchor)

    def _clearance(self, candidates: np.ndarray) -> np.ndarray:
        distances = np.linalg.norm((candidates[:, None] - self.taken) * CLEARANCE_WEIGHTS, axis=2)
        return distances.min(axis=1, initial=3 * self.offset)

    def _take(self, positions: np.ndarray) -> None:
        self.taken = np.concatenate([self.taken, positions])
