"""States of simulations that are advanced step by step, of one and of many: what `reset` needs to return to them."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from ncgen.solver.events.steps import Past


@dataclass(frozen=True, eq=False, kw_only=True)
class SimulationState:
    """A simulation at an instant: all that `reset` needs to go back to it.

    t: s; q, qd (n,): m and rad, and per second; work: J; p (n_p,): parameters and inputs; next_step: s, of error control, 0 where it has
    to find one; mechanism: the fingerprint of its code, so that it is not taken for a state of another one; past: of a model with events,
    those so far and what is held
    """

    t: float
    q: np.ndarray
    qd: np.ndarray
    work: float
    p: np.ndarray
    next_step: float
    mechanism: str
    past: Past | None = field(default=None, repr=False)

    def __repr__(self) -> str:
        return f"<SimulationState of {len(self.q)} coordinates at t = {self.t:g} s>"


@dataclass(frozen=True, eq=False, kw_only=True)
class SimulationStates:
    """Simulations at an instant: t, work, next_step (N,), q and qd (N, n), p (N, n_p), pasts (N,) of a model with events, as of
    `SimulationState`."""

    t: np.ndarray
    q: np.ndarray
    qd: np.ndarray
    work: np.ndarray
    p: np.ndarray
    next_step: np.ndarray
    mechanism: str
    pasts: tuple[Past, ...] = field(default=(), repr=False)

    def __repr__(self) -> str:
        return f"<SimulationStates of {len(self.t)} simulations, {self.q.shape[1]} coordinates each>"
