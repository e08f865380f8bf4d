"""What a run in C is given: where it starts, what changes parameters on the way, and who watches it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ncgen.mechanism.conditions_in_c import Conditions
from ncgen.mechanism.driving import Function, InputPieces


@dataclass(frozen=True, eq=False)
class InitialState:
    """Where a run starts; in a batch every array has a row for each state, or p is the same for all.

    q (n,): in m and rad
    velocities: independent ones (nz,) with coordinate partitioning, all of them (n,) with other formalisms, in m/s and rad/s
    p (n_p,): the parameters
    """

    q: ArrayLike
    velocities: ArrayLike
    p: ArrayLike


@dataclass(frozen=True, eq=False, kw_only=True)
class RunInputs:
    """What changes parameters while a run continues.

    signals: one an input of the mechanism: a table, a function of time, or None; () where all keep their values in p
    breaks (B, 2): of the laws in time, as `break_times` finds them, those of the signals' tables among them
    rule: the parameters that follow from a position and those there are, asked at the start of every step; None where none do
    """

    signals: Sequence[InputPieces | Function | None] = ()
    breaks: np.ndarray | tuple[()] = ()
    rule: Callable[[np.ndarray, np.ndarray], np.ndarray] | None = None


@dataclass(frozen=True, eq=False, kw_only=True)
class Monitor:
    """Who watches a run, and may end it.

    conditions: at the first of which to stop
    progress: called now and then with the time that the run has reached. What it raises, or a handler of a signal such as that of Ctrl-C,
        ends the run; `Outcome.completed` raises it again
    """

    conditions: Conditions | None = None
    progress: Callable[[float], None] | None = None


NO_INPUTS = RunInputs()
UNWATCHED_RUN = Monitor()
