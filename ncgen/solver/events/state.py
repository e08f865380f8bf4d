"""An instant of a run with events."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ncgen.solver.trajectories.happening import Happening


@dataclass(frozen=True, eq=False, kw_only=True)
class State:
    """t (s), q and qd (n,) in m, rad and per second, p (n_p,) without what drives inputs, and names of the locks that are closed."""

    t: float
    q: np.ndarray
    qd: np.ndarray
    p: np.ndarray
    locked: tuple[str, ...] = ()

    def speed(self, sizes: np.ndarray) -> float:
        """The greatest velocity (1/s) in natural sizes (n,)."""
        return greatest_speed(self.qd, sizes)


def greatest_speed(qd: np.ndarray, sizes: np.ndarray) -> float:
    """The greatest of velocities (n,), in natural sizes (n,) per second."""
    return float(np.max(np.abs(qd) / sizes, initial=0.0))


@dataclass(frozen=True, eq=False, kw_only=True)
class Done:
    """What was done at an instant: the gaps and ratchets of these numbers were hit together, one event acted, locks closed, or without any
    of these velocities were brought onto constraints with other parameters.

    before, after: states; locks: names of those that closed; restores: False for impacts without restitution
    """

    events: tuple[int, ...]
    is_impact: bool
    before: State
    after: State
    locks: tuple[str, ...] = ()
    restores: bool = True


@dataclass(frozen=True, eq=False, kw_only=True)
class Occurrence:
    """An instant at which something happened.

    before, after: states; held_before, held: numbers of what was held, and is from here on
    crossed: numbers of the conditions that ended the part of the run before, those of loads behind those of the mechanism; () at the start
    done, happened: in order; stops: True where the run ended
    """

    before: State
    after: State
    held_before: tuple[int, ...]
    held: tuple[int, ...]
    crossed: tuple[int, ...]
    done: tuple[Done, ...]
    stops: bool
    happened: tuple[Happening, ...]

    @property
    def names(self) -> str:
        """Of the events."""
        return ", ".join(dict.fromkeys(each.name for each in self.happened))
