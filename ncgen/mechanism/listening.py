"""Listening to a run in C: how far it has come is reported, and what is raised meanwhile ends it, such as by Ctrl-C.

Python's signal handlers run while it is listened, so this is what makes a long run answer. A short one is never asked.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from math import inf
from types import TracebackType

from ncgen.errors import ConvergenceError
from ncgen.mechanism.library import STATUS
from ncgen.toolchain.abi import InC, Interface, runtime_abi
from ncgen.toolchain.once import once

REACTION = 0.05
"""Seconds between two calls; what is raised takes effect that soon, or after a stage of a step where one takes longer."""

FIRST = 1000
"""Stages before the first call, of a small mechanism: some hundred steps."""

WORK = 5e7
"""Operations before the first call, where a stage takes the cube of a mechanism's size."""


STAGES = 4_000_000
"""Stages of a run between two looks at its pace: seconds, for a small mechanism."""

MOST_STAGES = 2e9
"""Stages that a run may still have before it: about an hour of the smallest mechanism. What takes longer is asked for in parts."""


class Progress:
    """Tells how far a simulation has come, forward only and not more often than anybody can see, and ends one that would never arrive.

    A simulation may be many runs, where it changes its coordinates, or some of it be done again.
    name: of the mechanism; end: where the simulation is to arrive (s), None where nobody can say, as where an event ends it
    """

    def __init__(self, report: Callable[[float], None] | None, name: str = "", end: float | None = None) -> None:
        self._tell, self._last, self._clock = report, -inf, -inf
        self._name, self._end, self._stages, self._mark = name, end, 0, -inf

    def __call__(self, t: float) -> None:
        if self._tell and t > self._last and time.perf_counter() - self._clock >= REACTION / 2:
            self._last = t
            self._tell(t)
            self._clock = time.perf_counter()

    def spend(self, t: float, stages: int) -> None:
        """Count stages that ended at t. Raises ConvergenceError where, at the pace of the last STAGES, MOST_STAGES do not arrive."""
        self._stages += stages
        if self._end is None or (self._stages < STAGES and self._mark > -inf):
            return
        if self._mark > -inf and (self._end - t) * self._stages > MOST_STAGES * (t - self._mark):
            raise ConvergenceError(
                f"{self._name}: {self._stages:.1e} evaluations came from t = {self._mark:.6g} s to {t:.6g} s, so more than "
                f"{MOST_STAGES:.0e} are left until {self._end:.6g} s; look for a stiffness that is too large, ask for less (rtol), or "
                "simulate in parts"
            )
        self._stages, self._mark = 0, t


class Listener:
    """Who listens to one run.

    progress: called with the time (s) that the run has reached, if anybody wants to know
    attempts: stages until the next call; raised: what ended the run, or None
    """

    def __init__(self, progress: Callable[[float], None] | None, size: int) -> None:
        self._first = max(1, min(FIRST, int(WORK / max(size, 1) ** 3)))
        self.begin(progress)

    def begin(self, progress: Callable[[float], None] | None) -> None:
        """Listen to another run."""
        self.progress, self.attempts = progress, self._first
        self.raised: BaseException | None = None
        self._clock = time.perf_counter()

    def hear(self, t: float) -> int:
        """How many stages the run may go on before it asks again, at most twice as many as last time."""
        passed = time.perf_counter() - self._clock
        if isinstance(self.progress, Progress):
            self.progress.spend(t, self.attempts)
        self.attempts = max(1, min(2 * self.attempts, int(self.attempts * REACTION / max(passed, 1e-9)), 2**30))
        if self.progress:
            self.progress(t)
        self._clock = time.perf_counter()
        return self.attempts


@once
def watch(number: str) -> InC:
    """The function that C calls, whose context is the handle of a `Listener`; one serves all runs of a number type."""
    ffi: Interface = runtime_abi(number)

    def hear(context: InC, t: InC) -> int:
        return ffi.from_handle(context).hear(float(t))

    return ffi.callback("ncgen_progress_function *", hear, error=0, onerror=keeper(ffi))


def called(ffi: Interface, kind: str, function: Callable[..., int], keep: Callable[[BaseException], None]) -> InC:
    """A function that C calls, as that kind of pointer: what it raises is kept, and C told that the state has no such numbers."""

    def failed(kind: type[BaseException], raised: BaseException, traceback: TracebackType) -> None:
        keep(raised)

    return ffi.callback(kind, function, error=STATUS.index("domain"), onerror=failed)


def keeper(ffi: Interface) -> Callable[[type[BaseException], BaseException, TracebackType], None]:
    """What notes what a function raised that C calls, as `raised` of the object whose handle its argument `context` is.

    A handler of a signal may raise between any two instructions, before the function could catch it: cffi hands on whatever it was.
    """

    def keep(kind: type[BaseException], raised: BaseException, traceback: TracebackType) -> None:
        ffi.from_handle(traceback.tb_frame.f_locals["context"]).raised = raised

    return keep
