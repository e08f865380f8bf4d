"""How well a motion keeps its energy, T + V − W, and what speaks against it."""

from __future__ import annotations

import math
from functools import cached_property

import numpy as np

from ncgen.mechanism.kernels import Kernels

ROUNDING = 64 * np.finfo(float).eps
"""A change of energy below this share of all energies is rounding."""

REST = 1e-10
"""Speeds below this, in natural sizes a second, are rest."""

DISPLACEMENT_ROUNDING = 1e-11
"""Displacements up to this, in natural sizes, are rounding: positions are closed to a tenth of it (`ncgen.solver.positions.position`)."""

MIN_ALARMING_DRIFT = 1e-8
"""A drift below this raises no alarm at any tolerance (√rtol), so nobody needs to know whether anything moved."""

MIN_ENERGY = 1e-300
"""An energy that does no harm as a divisor where nothing has mass."""


class Instants:
    """Times of a motion in s, and q, qd (…, n) and work then; rows: numbers of those that are meant, None for all."""

    def __init__(self, t: np.ndarray, q: np.ndarray, qd: np.ndarray, work: np.ndarray, rows: list[int] | None = None) -> None:
        self._arrays, self._rows = (t, q, qd, work), rows

    @cached_property
    def t(self) -> np.ndarray:
        """Times (K,)."""
        return self._of_rows(0)

    @cached_property
    def q(self) -> np.ndarray:
        """Positions (K, n)."""
        return self._of_rows(1)

    @cached_property
    def qd(self) -> np.ndarray:
        """Velocities (K, n)."""
        return self._of_rows(2)

    @cached_property
    def work(self) -> np.ndarray:
        """Work (K,) in J."""
        return self._of_rows(3)

    def works(self) -> list[float]:
        """The same as numbers."""
        work, rows = self._arrays[3], self._rows
        return work.tolist() if rows is None else [work.item(row) for row in rows]  # quicker than an array of a few

    def energies(self, kernels: Kernels, p: np.ndarray) -> np.ndarray:
        """Kinetic and potential energy (J) and power (W) of forces without a potential, (K, 3)."""
        t, q, qd, _ = self._arrays
        return kernels.energies(q, qd, t, p, self._rows)

    def _of_rows(self, number: int) -> np.ndarray:
        return self._arrays[number] if self._rows is None else self._arrays[number].take(self._rows, axis=0)


def energies(kernels: Kernels, t: np.ndarray, q: np.ndarray, qd: np.ndarray, p: np.ndarray | None) -> np.ndarray:
    """Kinetic and potential energy (J) and power (W) of forces without a potential, shape (K, 3), of K instants."""
    return kernels.energies(q, qd, t, kernels.p0 if p is None else p)


def drift(kernels: Kernels, instants: Instants, p: np.ndarray, unseen: float = 0.0, limit: float = 0.0) -> float:
    """The largest |T + V − W − its start| over K instants, relative to the energy that moves: the largest T or W or change of V.

    0 where that is rounding, or below what is `unseen` (J), and where nothing leaves its place by more than rounding. A mechanism at rest
    moves at least the kinetic energy of speeds that count as rest, so that the noise of its velocities is no drift.
    limit: a drift that is below it by the largest T alone is 0, too
    """
    energies_of_run = instants.energies(kernels, p)
    each = energies_of_run.tolist()
    totals = [kinetic + potential - done for (kinetic, potential, _), done in zip(each, instants.works(), strict=True)]
    error = max(max(totals) - totals[0], totals[0] - min(totals))
    if math.isfinite(sum(totals)) and is_small(error, totals[0], max(each)[0], limit):  # else nobody knows which of them is the largest
        return 0.0
    kinetic, potential = energies_of_run[:, 0], energies_of_run[:, 1]
    least = _least(kernels, instants.t[0], instants.q[0], p)
    ratio = float(_relative(kinetic, potential, instants.work, least, unseen))
    return 0.0 if not ratio < MIN_ALARMING_DRIFT and _is_still(kernels, instants.q) else ratio


def is_small(change: float, energy: float, kinetic: float, limit: float) -> bool:
    """Whether a change of a total energy is rounding, or below a limit of the largest kinetic energy, all in J."""
    return change <= ROUNDING * abs(energy) or change < limit * kinetic


def drifts(kernels: Kernels, t: np.ndarray, q: np.ndarray, qd: np.ndarray, work: np.ndarray, p: np.ndarray) -> np.ndarray:
    """`drift` of B motions, (B,): q, qd (B, K, n), work (B, K), p (B, n_p), on the same K instants."""
    count, instants = work.shape
    flat = q.reshape(-1, kernels.n), qd.reshape(-1, kernels.n)
    energies_of_runs = kernels.batch.energy(*flat, np.tile(t, count), np.repeat(p, instants, axis=0)).reshape(count, instants, 3)
    at_rest = np.tile(REST * kernels.column_sizes, (count, 1))
    least = np.maximum(kernels.batch.energy(q[:, 0], at_rest, np.full(count, t[0]), p)[:, 0], MIN_ENERGY)
    return np.where(_is_still(kernels, q), 0.0, _relative(energies_of_runs[..., 0], energies_of_runs[..., 1], work, least))


def _is_still(kernels: Kernels, q: np.ndarray) -> np.ndarray | np.bool_:
    """Whether motions (…, K, n) stay where they start but for rounding, (…)."""
    return (np.abs(q - q[..., :1, :]) <= DISPLACEMENT_ROUNDING * kernels.column_sizes).all(axis=(-2, -1))


def _relative(kinetic: np.ndarray, potential: np.ndarray, work: np.ndarray, least: np.ndarray | float, unseen: float = 0.0) -> np.ndarray:
    """The drift along the last axis, relative to what moves, at least to `least`; 0 up to `unseen` (J)."""
    error = _error(kinetic + potential - work)
    done = np.abs(work)
    rounding = ROUNDING * (np.abs(kinetic) + np.abs(potential) + done).max(axis=-1)
    span = potential.max(axis=-1) - potential.min(axis=-1)
    moved = np.maximum(np.maximum(kinetic.max(axis=-1), span), done.max(axis=-1))
    return np.where(error <= np.maximum(rounding, unseen), 0.0, error / np.maximum(moved, least))


def _error(total: np.ndarray) -> np.ndarray:
    """The largest change of a total energy along the last axis (J)."""
    return np.abs(total - total[..., :1]).max(axis=-1)


def _least(kernels: Kernels, t: float, q: np.ndarray, p: np.ndarray) -> float:
    """The kinetic energy of speeds that count as rest, or a number that does no harm where nothing has mass."""
    return max(float(kernels.energy(q, REST * kernels.column_sizes, t, p)[0]), MIN_ENERGY)
