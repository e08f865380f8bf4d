"""What happened at an event of a run."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from ncgen.errors import ModelError

if TYPE_CHECKING:
    from ncgen.solver.trajectories.trajectory import Trajectory

Search = Literal["polynomial", "interval", "sampled", "action", "start"]

GAPS, JOINTS, RATCHETS, LOCKS = ("rests", "leaves"), ("sticks", "slips", "turns"), ("catches", "releases"), ("locks", "frees")
"""What may happen to a gap that is held closed, to a joint with friction, to a ratchet, and to a lock or clutch."""

FORMER = {"what": "transition"}
"""{name in archives of before: name today}."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Happening:
    """One event of a run.

    t: s; name: of the event
    search: how it was found: "polynomial", where its condition is one within a step, and "interval", where it was bounded on every part
        of it, both of which miss none; "sampled", where it was compared at the nodes of a polynomial only; "action", as another event of
        the same instant changed its sign; "start"
    q, before, after (n,): position, and velocities before and after it (m, rad, and per second)
    impulse: of an impact, along the gap: N s, or N m s where the gap is an angle; 0 for others
    energy_lost: kinetic and potential energy before less that after it (J)
    limit: s, where bounces accumulate at this time and the gap is at rest from here on; None for others
    transition: of modes: "rests" and "leaves" of a gap, "sticks", "slips" and "turns" of a friction, "catches" and "releases" of a ratchet,
        "locks" and "frees" of a lock or clutch; empty for others
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
    transition: str = ""

    @property
    def label(self) -> str:
        """The name, and after it the transition if there is one."""
        return f"{self.name} {self.transition}".strip()

    def plain(self) -> dict[str, object]:
        """What JSON can say of it, of which `of` makes the same again."""
        return {name: value.tolist() if isinstance(value, np.ndarray) else value for name, value in vars(self).items()}

    @classmethod
    def of(cls, record: dict[str, Any]) -> Happening:
        """From what `plain` said, also with its former names. Raises TypeError for what it does not say."""
        values: dict[str, Any] = {
            FORMER.get(name, name): np.array(value, dtype=float) if isinstance(value, list) else value for name, value in record.items()
        }
        return cls(**values)

    def __repr__(self) -> str:
        rest = "" if self.limit is None else f", at rest from {self.limit:.9g} s"
        return f"<{self.label} at {self.t:.9g} s, {self.search}, {self.energy_lost:.6g} J lost{rest}>"


def refuse_pieces(run: Trajectory, results: str) -> None:
    """Raise ModelError where a run is not one motion of one mechanism, which `results` needs."""
    if run.modes or run.changed:
        why = "gaps or joints were held or rubbed on the way" if run.modes else "events changed parameters"
        raise ModelError(f"{run.name}: {results} need a motion of one mechanism, and {why}; take a run without these events")
