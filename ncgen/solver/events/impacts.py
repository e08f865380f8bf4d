"""Newton's law of impact along the gradients of gaps, with the constraints of the mechanism.

The impulses Λ of gaps with gradients W act with those of the constraints: M (q̇⁺ − q̇⁻) + Φ_qᵀ μ = Wᵀ Λ, Φ_q q̇⁺ = ν. The velocities
u = W q̇ + ∂g/∂t of the gaps then change by G Λ with G = W M̂⁻¹ Wᵀ, M̂⁻¹ being the inverse mass matrix on the motions that the constraints
allow. Newton's law in its general form is 0 ≤ Λ ⊥ u⁺ + e u⁻ ≥ 0 (Moreau, Unilateral contact and dry friction, 1988).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.optimize

from ncgen.errors import ConvergenceError, SingularError
from ncgen.mechanism.kernels import Kernels
from ncgen.solver.events.state import State
from ncgen.solver.formalisms.projection import least_energy

MOST_TURNS = 10_000
"""Impacts in turn at one instant, after which they are said to accumulate."""

OPENING = 1e-12
"""A gap whose velocity is above minus this, relative to the sizes of its terms, does not close."""


@dataclass(frozen=True, eq=False)
class Hit:
    """Velocities qd (n,) after impacts, and of every gap its impulse (N s, or N m s) and the kinetic energy (J) that it takes.

    turns: numbers of the gaps that are hit together, and velocities (n,) after that, one group after the other
    """

    qd: np.ndarray
    impulses: np.ndarray
    lost: np.ndarray
    turns: tuple[tuple[tuple[int, ...], np.ndarray], ...]


class Gaps:
    """The gaps of some events at an instant. W (k, n): gradients; drift (k,): ∂g/∂t; restitution (k,)"""

    def __init__(
        self, kernels: Kernels, at: State, W: np.ndarray, drift: np.ndarray, restitution: np.ndarray, names: tuple[str, ...]
    ) -> None:
        self.W, self.drift, self.restitution, self.names = W, drift, restitution, names
        n, sizes = kernels.n, kernels.column_sizes
        force = (sizes * W).T
        change, _ = least_energy(kernels, at.q, at.t, at.p).solve(force, np.zeros((kernels.m, len(W))))
        scaled = sizes**2 * kernels.mass(at.q, at.t, at.p).diagonal()
        unit = float(np.max(scaled, initial=0.0)) or 1.0  # that `least_energy` measures inertia in
        self.response = sizes[:, None] * change.reshape(n, len(W)) / unit
        self.G = W @ self.response
        if (stuck := np.flatnonzero(np.diag(self.G) <= 0)).size:
            raise SingularError(
                f"{kernels.name}: event {names[stuck[0]]} at t = {at.t:.6g} s: no motion that the constraints allow changes its gap, so no "
                "impulse can; leave the event out, or free a coordinate"
            )

    def velocities(self, qd: np.ndarray) -> np.ndarray:
        """Of the gaps, u (k,)."""
        return self.W @ qd + self.drift

    def closing(self, qd: np.ndarray) -> np.ndarray:
        """Mask of the gaps that close."""
        return self.velocities(qd) < -OPENING * (np.abs(self.W) @ np.abs(qd) + np.abs(self.drift))

    def all_at_once(self, qd: np.ndarray) -> Hit:
        """0 ≤ Λ ⊥ u⁺ + e u⁻ ≥ 0 for all gaps together."""
        u = self.velocities(qd)
        needed = (1 + self.restitution) * u
        values, vectors = np.linalg.eigh(self.G)
        kept = values > 1e-12 * values[-1]
        root = np.sqrt(values[kept])[:, None] * vectors[:, kept].T
        impulses, _ = scipy.optimize.nnls(root, -(vectors[:, kept] / np.sqrt(values[kept])).T @ needed)
        return self._hit(qd, impulses)

    def in_turn(self, qd: np.ndarray, where: str) -> Hit:
        """One gap after the other, the one that closes fastest first, until none does. Raises ConvergenceError where that has no end."""
        before, impulses, lost, turns = qd, np.zeros(len(self.W)), np.zeros(len(self.W)), list[tuple[tuple[int, ...], np.ndarray]]()
        for _ in range(MOST_TURNS):
            closing = np.flatnonzero(self.closing(qd))
            if not len(closing):
                return Hit(qd, impulses, lost, tuple(turns))
            u = self.velocities(qd)
            k = int(closing[np.argmin(u[closing])])
            push = -(1 + self.restitution[k]) * u[k] / self.G[k, k]
            qd = qd + push * self.response[:, k]
            impulses[k] += push
            turns.append(((k,), qd))
            lost[k] -= push * u[k] * (1 - self.restitution[k]) / 2
        raise ConvergenceError(
            f"{where}: impacts of {', '.join(self.names)} in turn do not end after {MOST_TURNS} of them, velocities from "
            f"{np.max(np.abs(before)):.3g} to {np.max(np.abs(qd)):.3g}; take order='simultaneous'"
        )

    def _hit(self, qd: np.ndarray, impulses: np.ndarray) -> Hit:
        after = qd + self.response @ impulses
        mean = (self.velocities(qd) + self.velocities(after)) / 2
        return Hit(after, impulses, -impulses * mean, ((tuple(np.flatnonzero(impulses > 0).tolist()), after),))
