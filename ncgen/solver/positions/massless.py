"""The refusal of a mechanism that can move without inertia, with the names of what moves so."""

from __future__ import annotations

import numpy as np

from ncgen.errors import SingularError
from ncgen.mechanism.kernels import Kernels

SMALL = 1e-9
"""Singular values below this, relative to the largest, belong to motions without inertia."""

NAMED = 4
"""How many coordinates a message names."""


def massless(kernels: Kernels, resistance: np.ndarray, basis: np.ndarray | None = None) -> SingularError:
    """The error for a matrix (k, n) that no motion without inertia resists, or (k, z) on motions `basis` (n, z); without units."""
    _, values, right = np.linalg.svd(resistance, full_matrices=True)
    count = right.shape[0] - int(np.sum(values > SMALL * np.max(values, initial=0.0)))
    motions = right[-max(count, 1) :].T
    # What the rows of an orthonormal basis measure does not depend on the basis.
    moved = np.linalg.norm(motions if basis is None else np.linalg.qr(basis @ motions)[0], axis=1)
    moved = np.round(moved / np.max(moved), 6)  # equals stay in the order of the coordinates
    names = [kernels.coordinates[i] for i in np.argsort(-moved, kind="stable") if moved[i] > 0]
    more = f" and {len(names) - NAMED} more" if len(names) > NAMED else ""
    return SingularError(
        f"{kernels.name}: a motion of the mechanism has no inertia: {', '.join(names[:NAMED])}{more} can move without any; "
        "give the bodies that move mass"
    )
