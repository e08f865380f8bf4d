"""Laws of impact along the gradients of gaps and across them, with the constraints of the mechanism.

The impulses Λ of gaps with gradients W act with those of the constraints: M (q̇⁺ − q̇⁻) + Φ_qᵀ μ = Wᵀ Λ, Φ_q q̇⁺ = ν. The velocities
u = W q̇ + ∂g/∂t of the gaps then change by G Λ with G = W M̂⁻¹ Wᵀ, M̂⁻¹ being the inverse mass matrix on the motions that the constraints
allow. Newton's law in its general form is 0 ≤ Λ ⊥ u⁺ + e u⁻ ≥ 0 (Moreau, Unilateral contact and dry friction, 1988). W and G have further
rows for the velocities at which contacts with friction slide (`blows`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.optimize

from ncgen.errors import ConvergenceError, SingularError
from ncgen.mechanism.kernels import Kernels
from ncgen.solver.events.blows import Blow, simultaneous
from ncgen.solver.events.mobility import response
from ncgen.solver.events.state import State

MAX_ROUNDS = 10_000
"""Impacts in turn at one instant, after which they are said to accumulate."""

OPENING = 1e-12
"""A gap whose velocity is above minus this, relative to all velocities before, does not close."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Gap:
    """A gap at an instant: its gradient (n,), drift ∂g/∂t, and restitution.

    rubs: gradients (d, n) by q̇ of the velocities at which it slides, d = 0 without friction; friction, tangential, is_poisson: as of
    `Contact`
    """

    name: str
    gradient: np.ndarray
    drift: float
    restitution: float
    rubs: np.ndarray
    friction: float = 0.0
    tangential: float = 0.0
    is_poisson: bool = False


@dataclass(frozen=True, eq=False, kw_only=True)
class Hit:
    """Velocities qd (n,) after impacts, and of every gap its impulse (N s, or N m s), whether it sticks, and the energy (J) it takes.

    turns: numbers of the gaps that are hit together, and velocities (n,) after that, one group after the other
    """

    qd: np.ndarray
    impulses: np.ndarray
    sticks: np.ndarray
    lost: np.ndarray
    turns: tuple[tuple[tuple[int, ...], np.ndarray], ...]


class Gaps:
    """Some gaps at an instant. places: of each gap the rows of W: its own, then those at which it slides"""

    def __init__(self, kernels: Kernels, at: State, gaps: Sequence[Gap]) -> None:
        self.gaps, self.names = tuple(gaps), tuple(gap.name for gap in gaps)
        self.W = np.vstack([np.vstack([gap.gradient[None], gap.rubs]) for gap in gaps])
        ends = np.cumsum([1 + len(gap.rubs) for gap in gaps])
        self.places = [np.arange(end - 1 - len(gap.rubs), end) for gap, end in zip(gaps, ends, strict=True)]
        self.normal = np.array([place[0] for place in self.places])
        self.drift = np.zeros(len(self.W))
        self.drift[self.normal] = [gap.drift for gap in gaps]
        sizes = kernels.column_sizes
        self._rounding = OPENING * (np.abs(self.W) @ sizes * np.max(np.abs(at.qd) / sizes, initial=0.0) + np.abs(self.drift))
        self.response = response(kernels, at, self.W)
        self.G = self.W @ self.response
        if (stuck := np.flatnonzero(np.diag(self.G)[self.normal] <= 0)).size:
            raise SingularError(
                f"{kernels.name}: event {self.names[stuck[0]]} at t = {at.t:.6g} s: no motion that the constraints allow changes its gap, "
                "so no impulse can; leave the event out, or free a coordinate"
            )

    def velocities(self, qd: np.ndarray) -> np.ndarray:
        """Of the gaps, and those at which they slide, as the rows of W."""
        return self.W @ qd + self.drift

    def closing(self, qd: np.ndarray) -> np.ndarray:
        """Mask (k,) of the gaps that close."""
        return (self.velocities(qd) < -self._rounding)[self.normal]

    def are_coupled(self) -> bool:
        """True if an impulse of one gap changes the velocity of another."""
        sizes = np.sqrt(np.outer(np.diag(self.G), np.diag(self.G)))
        apart = np.ones_like(self.G, dtype=bool)
        for place in self.places:
            apart[np.ix_(place, place)] = False
        return bool(np.any(np.abs(self.G[apart]) > 1e-12 * sizes[apart]))

    def all_at_once(self, qd: np.ndarray, where: str) -> Hit:
        """0 ≤ Λ ⊥ u⁺ + e u⁻ ≥ 0 for all gaps together, with friction where they have some."""
        u = self.velocities(qd)
        if any(len(gap.rubs) for gap in self.gaps):
            impulses = self._blow(range(len(self.gaps)), u, where)
        else:
            needed = (1 + np.array([gap.restitution for gap in self.gaps])) * u
            values, vectors = np.linalg.eigh(self.G)
            kept = values > 1e-12 * values[-1]
            root = np.sqrt(values[kept])[:, None] * vectors[:, kept].T
            impulses, _ = scipy.optimize.nnls(root, -(vectors[:, kept] / np.sqrt(values[kept])).T @ needed)
        after = qd + self.response @ impulses
        works = -impulses * (u + self.velocities(after)) / 2
        together = tuple(np.flatnonzero(impulses[self.normal] > 0).tolist())
        return self._hit(after, impulses, np.array([float(np.sum(works[place])) for place in self.places]), [(together, after)])

    def in_turn(self, qd: np.ndarray, where: str) -> Hit:
        """One gap after the other, the one that closes fastest first, until none does. Raises ConvergenceError where that has no end."""
        before, impulses, lost, turns = qd, np.zeros(len(self.W)), np.zeros(len(self.gaps)), list[tuple[tuple[int, ...], np.ndarray]]()
        for _ in range(MAX_ROUNDS):
            closing = np.flatnonzero(self.closing(qd))
            if not len(closing):
                return self._hit(qd, impulses, lost, turns)
            u = self.velocities(qd)
            k = int(closing[np.argmin(u[self.normal][closing])])
            push = self._blow([k], u, where)
            qd = qd + self.response @ push
            impulses += push
            turns.append(((k,), qd))
            lost[k] -= float(push @ (u + self.velocities(qd))) / 2
        raise ConvergenceError(
            f"{where}: impacts of {', '.join(self.names)} in turn do not end after {MAX_ROUNDS} of them, velocities from "
            f"{np.max(np.abs(before)):.3g} to {np.max(np.abs(qd)):.3g}; take order='simultaneous'"
        )

    def _blow(self, chosen: Sequence[int], u: np.ndarray, where: str) -> np.ndarray:
        """Impulses of some gaps together, as the rows of W."""
        blows = [
            Blow(
                places=self.places[k],
                restitution=gap.restitution,
                friction=gap.friction,
                tangential=gap.tangential,
                is_poisson=gap.is_poisson,
            )
            for k in chosen
            for gap in [self.gaps[k]]
        ]
        impulses = simultaneous(self.G, u, blows)
        if impulses is None:
            names = ", ".join(self.names[k] for k in chosen)
            raise ConvergenceError(
                f"{where}: no impulses of {names} satisfy the laws of impact and friction together; take less friction, or order='in turn'"
            )
        return impulses

    def _hit(self, qd: np.ndarray, impulses: np.ndarray, lost: np.ndarray, turns: Sequence[tuple[tuple[int, ...], np.ndarray]]) -> Hit:
        normal = impulses[self.normal]
        across = np.array([float(np.linalg.norm(impulses[place[1:]])) for place in self.places])
        friction = np.array([gap.friction if len(gap.rubs) else 0.0 for gap in self.gaps])
        u = self.velocities(qd)
        slides = np.array([float(np.linalg.norm(u[place[1:]])) for place in self.places])
        sizes = np.array([float(np.max(np.abs(self.G[place]) @ np.abs(impulses))) for place in self.places])
        sticks = (normal > 0) & (across < friction * normal) & (slides <= OPENING * sizes)
        return Hit(qd=qd, impulses=normal, sticks=sticks, lost=lost, turns=tuple(turns))
