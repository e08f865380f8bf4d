"""Where a spatial scene is seen from, the same in all still pictures."""

from __future__ import annotations

import numpy as np

AZIMUTH, ELEVATION = 40.0, 20.0
"""The turn of the eye about Z, from X, and its height (degrees)."""

LIGHT_DIRECTION = np.array([0.4, -0.12, 0.9]) / np.linalg.norm([0.4, -0.12, 0.9])
"""Towards the light, over the eye's left shoulder."""


def screen() -> np.ndarray:
    """The screen's rightward and upward directions in a spatial scene, the columns of a 3×2 matrix."""
    turn, height = np.radians([AZIMUTH, ELEVATION])
    right = [-np.sin(turn), np.cos(turn), 0]
    up = [-np.sin(height) * np.cos(turn), -np.sin(height) * np.sin(turn), np.cos(height)]
    return np.array([right, up]).T
