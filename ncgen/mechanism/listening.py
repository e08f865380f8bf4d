"""Listening to a run in C: how far it has come is told, and what is raised meanwhile ends it, such as by Ctrl-C.

Python's signal handlers run while it is listened, so this is what makes a long run answer. A short one is never asked.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from math import inf
from types import TracebackType

from ncgen.toolchain.abi import InC, Interface, runtime_abi
from ncgen.toolchain.once import once

REACTION = 0.05
"""Seconds between two calls; what is raised takes effect that soon, or after a stage of a step where one takes longer."""

FIRST = 1000
"""Stages before the first call, of a small mechanism: some hundred steps."""

WORK = 5e7
"""Operations before the first call, where a stage takes the cube of a mechanism's size."""


class Progress:
    """Tells how far a simulation has come, forward only and not more often than anybody can see.

    A simulation may be many runs, where it changes its coordinates, or some of it be done again.
    """

    def __init__(self, tell: Callable[[float], None] | None) -> None:
        self._tell, self._last, self._clock = tell, -inf, -inf

    def __call__(self, t: float) -> None:
        if self._tell and t > self._last and time.perf_counter() - self._clock >= REACTION / 2:
            self._last = t
            self._tell(t)
            self._clock = time.perf_counter()


class Listener:
    """Who listens to one run.

    progress: called with the time (s) that the run has reached, if anybody wants to know
    patience: stages until the next call; raised: what ended the run, or None
    """

    def __init__(self, progress: Callable[[float], None] | None, size: int) -> None:
        self.progress = progress
        self.patience = max(1, min(FIRST, int(WORK / max(size, 1) ** 3)))
        self.raised: BaseException | None = None
        self._clock = time.perf_counter()

    def hear(self, t: float) -> int:
        """How many stages the run may go on before it asks again, at most twice as many as last time."""
        passed = time.perf_counter() - self._clock
        self.patience = max(1, min(2 * self.patience, int(self.patience * REACTION / max(passed, 1e-9)), 2**30))
        if self.progress:
            self.progress(t)
        self._clock = time.perf_counter()
        return self.patience


@once
def watch(number: str) -> InC:
    """The function that C calls, whose context is the handle of a `Listener`; one serves all runs of a number type."""
    ffi: Interface = runtime_abi(number)

    def hear(context: InC, t: InC) -> int:
        return ffi.from_handle(context).hear(float(t))

    def keep(kind: type[BaseException], raised: BaseException, traceback: TracebackType) -> None:
        # A handler may raise between any two instructions, before `hear` could catch it: cffi hands on whatever it was.
        ffi.from_handle(traceback.tb_frame.f_locals["context"]).raised = raised

    return ffi.callback("ncgen_watch *", hear, error=0, onerror=keep)
