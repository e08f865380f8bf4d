"""What happened at an event of a run."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

Search = Literal["proof", "sampled", "action", "start"]


@dataclass(frozen=True, eq=False)
class Happening:
    """One event of a run.

    t: s; name: of the event
    search: how it was found: "proof", where its condition is a polynomial within a step and none is missed; "sampled", where it was
        compared at the nodes of a polynomial only; "action", as another event of the same instant changed its sign; "start"
    q, before, after (n,): position, and velocities before and after it (m, rad, and per second)
    impulse: of an impact, along the gap: N s, or N m s where the gap is an angle; 0 for others
    energy_lost: kinetic and potential energy before less that after it (J)
    limit: s, where bounces accumulate at this time and the event rests from here on; None for others
    """

    t: float
    name: str
    search: Search
    q: np.ndarray
    before: np.ndarray
    after: np.ndarray
    impulse: float = 0.0
    energy_lost: float = 0.0
    limit: float | None = None

    def __repr__(self) -> str:
        rest = "" if self.limit is None else f", at rest from {self.limit:.9g} s"
        return f"<{self.name} at {self.t:.9g} s, {self.search}, {self.energy_lost:.6g} J lost{rest}>"
