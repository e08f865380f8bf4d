"""Impacts along the gradients of gaps and across them, with the constraints of the mechanism; C has their laws (`impacts_in_c`).

The impulses Λ of gaps with gradients W act with those of the constraints: M (q̇⁺ − q̇⁻) + Φ_qᵀ μ = Wᵀ Λ, Φ_q q̇⁺ = ν. The velocities
u = W q̇ + ∂g/∂t of the gaps then change by G Λ with G = W M̂⁻¹ Wᵀ, M̂⁻¹ being the inverse mass matrix on the motions that the constraints
allow. W and G have further rows for the velocities at which contacts with friction slide.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ncgen.errors import ConvergenceError, ModelError, NcgenError, SingularError
from ncgen.mechanism import impacts_in_c
from ncgen.mechanism.impacts_in_c import LAWS, Blow, ImpactInC, impact
from ncgen.mechanism.kernels import Kernels
from ncgen.solver.events.mobility import response
from ncgen.solver.events.state import State

STOPPED, STOPPED_IN_TURN = 64 * float(np.finfo(float).eps), 1e-11
"""Impulses have stopped what moves by less than this share of the greatest velocity before: rounding, or where impacts in turn end."""


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


def hit_gaps(kernels: Kernels, at: State, gaps: Sequence[Gap], orders: set[str]) -> Hit | None:
    """The impact of some closed gaps, or None where no one closes; kernels: of the mode; orders: the laws that were said.

    Raises SingularError, ConvergenceError or ModelError with the names of gaps that cannot be hit.
    """
    W, drift, blows = rows_of(gaps)
    positions, sizes = [blow.gap for blow in blows], kernels.column_sizes
    terms = np.abs(W) @ sizes * at.speed(sizes) + np.abs(drift)
    responses = response(kernels, at, W)
    energy = float(kernels.energy(at.q, at.qd, at.t, at.p)[0])
    solved = impact(W @ responses, W @ at.qd + drift, blows, LAWS[next(iter(orders))] if len(orders) == 1 else LAWS[""], terms, energy)
    if solved.failure:
        raise _failure(kernels, at, [gap.name for gap in gaps], orders, solved, at.qd + responses @ solved.impulses)
    if not solved.closes:
        return None
    turns, qd = [], at.qd
    for number, pushes in solved.turns:
        qd = qd + responses @ pushes
        turns.append(((number,), qd))
    impulses, qd = solved.impulses[positions], _stopped(at, at.qd + responses @ solved.impulses, sizes, bool(turns))
    if not solved.turns:
        turns = [(tuple(np.flatnonzero(impulses > 0).tolist()), qd)]
    return Hit(qd=qd, impulses=impulses, sticks=solved.sticks, lost=solved.lost, turns=tuple(turns))


def are_coupled(kernels: Kernels, at: State, gaps: Sequence[Gap]) -> bool:
    """Whether an impulse of one gap changes how another one does, without ratchets, so that laws of impact differ."""
    if len(gaps) < 2:
        return False
    W, _, blows = rows_of(gaps)
    return impacts_in_c.are_coupled(W @ response(kernels, at, W), blows)


def _stopped(at: State, qd: np.ndarray, sizes: np.ndarray, in_turn: bool) -> np.ndarray:
    """Velocities qd (n,) after impulses, but for rounding: what these have stopped does not move. at: before; sizes (n,)"""
    nothing = (STOPPED_IN_TURN if in_turn else STOPPED) * at.speed(sizes) * sizes
    return np.where((qd != at.qd) & (np.abs(qd) <= nothing), 0.0, qd)


def rows_of(gaps: Sequence[Gap]) -> tuple[np.ndarray, np.ndarray, list[Blow]]:
    """W (r, n), ∂g/∂t (r,), 0 for velocities at which contacts slide, and what C has of each gap."""
    W = np.vstack([np.vstack([gap.gradient[None], gap.rubs]) for gap in gaps])
    positions = np.cumsum([0, *(1 + len(gap.rubs) for gap in gaps[:-1])])
    drift = np.zeros(len(W))
    drift[positions] = [gap.drift for gap in gaps]
    blows = [
        Blow(int(position), len(gap.rubs), gap.is_poisson, gap.restitution, gap.friction, gap.tangential)
        for position, gap in zip(positions, gaps, strict=True)
    ]
    return W, drift, blows


def _failure(kernels: Kernels, at: State, names: list[str], orders: set[str], solved: ImpactInC, after: np.ndarray) -> NcgenError:
    """What C could not do, in words. after (n,): velocities at the end"""
    where, several = f"{kernels.name} at t = {at.t:.6g} s", ", ".join(names)
    if solved.failure == "NCGEN_SINGULAR":
        return SingularError(
            f"{kernels.name}: event {names[solved.which]} at t = {at.t:.6g} s: no motion that the constraints allow changes its gap, "
            "so no impulse can; leave the event out, or free a coordinate"
        )
    if solved.failure == "NCGEN_NO_ORDER" and len(orders) > 1:
        return ModelError(
            f"{kernels.name}: impacts of {several} at one instant, t = {at.t:.6g} s, have different orders; give all the same one"
        )
    if solved.failure == "NCGEN_NO_ORDER":
        return ModelError(
            f"{kernels.name}: several impacts at one instant, of {several} at t = {at.t:.6g} s, "
            'where laws differ; say which holds, order="simultaneous" or order="in turn" of ncgen.impact or of the element'
        )
    if solved.failure == "NCGEN_GAIN":
        return ModelError(
            f"{where}: the impact of {several} would gain {-float(np.sum(solved.lost)):.6g} J; with friction Newton's law may do so, "
            'take law="poisson" or less restitution'
        )
    if solved.failure == "NCGEN_ENDLESS":
        return ConvergenceError(
            f"{where}: impacts of {several} in turn do not end after {solved.count} of them, velocities from "
            f"{np.max(np.abs(at.qd)):.3g} to {np.max(np.abs(after)):.3g}; take order='simultaneous'"
        )
    chosen = several if solved.which < 0 else names[solved.which]
    return ConvergenceError(
        f"{where}: no impulses of {chosen} satisfy the laws of impact and friction together; take less friction, or order='in turn'"
    )
