"""How well a motion keeps its energy, T + V − W, and what may be said against it."""

from __future__ import annotations

import numpy as np

from ncgen.mechanism.kernels import Kernels

ROUNDING = 64 * np.finfo(float).eps
"""A change of energy below this share of all energies is rounding."""

REST = 1e-10
"""Speeds below this, in natural sizes a second, are rest."""


def energies(kernels: Kernels, t: np.ndarray, q: np.ndarray, qd: np.ndarray, p: np.ndarray) -> np.ndarray:
    """Kinetic and potential energy (J) and power (W) of forces without a potential, shape (K, 3), of K instants."""
    return np.array([kernels.energy(*instant, p) for instant in zip(q, qd, t, strict=True)])


def drift(kernels: Kernels, t: np.ndarray, q: np.ndarray, qd: np.ndarray, work: np.ndarray, p: np.ndarray) -> float:
    """The largest |T + V − W − its start| over K instants, relative to the energy that moves: the largest T or W or change of V.

    0 where that is rounding. A mechanism at rest moves at least the kinetic energy of speeds that count as rest, so that
    the noise of its velocities is no drift.
    """
    found = energies(kernels, t, q, qd, p)
    kinetic, potential = found[:, 0], found[:, 1]
    total = kinetic + potential - work
    error = float(np.max(np.abs(total - total[0])))
    if error <= ROUNDING * np.max(np.abs(kinetic) + np.abs(potential) + np.abs(work)):
        return 0.0
    moved = max(np.max(kinetic), np.ptp(potential), np.max(np.abs(work)))
    return error / max(moved, _least(kernels, t[0], q[0], p))


def _least(kernels: Kernels, t: float, q: np.ndarray, p: np.ndarray) -> float:
    """The kinetic energy of speeds that count as rest, or a number that does no harm where nothing has mass."""
    return max(float(kernels.energy(q, REST * kernels.column_sizes, t, p)[0]), 1e-300)
