"""How far a mass matrix is from one that does not resist a motion."""

from __future__ import annotations

import numpy as np


def least_inertia(matrix: np.ndarray) -> float:
    """The least eigenvalue of a mass matrix (n, n) that is scaled to a diagonal of 1; 0 where a motion by itself has no inertia, 1 without
    motions."""
    sizes = np.sqrt(np.diag(matrix).clip(min=0.0))
    if not np.all(sizes > 0):
        return 0.0
    return float(np.linalg.eigvalsh(matrix / np.outer(sizes, sizes))[0]) if len(sizes) else 1.0
