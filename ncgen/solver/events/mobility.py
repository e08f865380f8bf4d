"""What impulses along some directions change: how far a mode lets gaps and joints move."""

from __future__ import annotations

import numpy as np

from ncgen.mechanism.active_in_c import leaves_none
from ncgen.mechanism.kernels import Kernels
from ncgen.solver.events.state import State
from ncgen.solver.formalisms.projection import least_energy


def response(kernels: Kernels, at: State, W: np.ndarray) -> np.ndarray:
    """Changes of velocities (n, k) by unit impulses along the rows of W (k, n), with those of the constraints."""
    n, sizes = kernels.n, kernels.column_sizes
    change, _ = least_energy(kernels, at.q, at.t, at.p).solve((sizes * W).T, np.zeros((kernels.m, len(W))))
    scaled = sizes**2 * kernels.mass(at.q, at.t, at.p).diagonal()
    unit = float(np.max(scaled, initial=0.0)) or 1.0  # that `least_energy` measures inertia in
    return sizes[:, None] * change.reshape(n, len(W)) / unit


def is_blocked(mode: Kernels, mechanism: Kernels, at: State, W: np.ndarray) -> np.ndarray:
    """Mask (k,) of the rows of W (k, n) along which the mechanism can move and a mode of it cannot."""
    in_mode, whole = (np.einsum("kn,nk->k", W, response(kernels, at, W)) for kernels in (mode, mechanism))
    return np.array([leaves_none(moved, all_of_it) for moved, all_of_it in zip(in_mode.tolist(), whole.tolist(), strict=True)], dtype=bool)
