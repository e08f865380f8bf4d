"""`bench.py all --defaults`: a call that names no method, next to the best method that could have been named."""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass
from typing import Any

from ncgen.comparisons.case import Case
from ncgen.comparisons.hard import warm
from ncgen.comparisons.hard_cases import CASES
from ncgen.compiler import compile
from ncgen.errors import NcgenError
from ncgen.mechanism.library import CompiledKernels
from ncgen.report.clock import measure, repeated
from ncgen.report.precision import FIXED, TimeIsUp, methods, time_limit
from ncgen.solver.motions.entry_points import simulate
from ncgen.solver.runs.progress_reports import ProgressOption
from ncgen.solver.trajectories.trajectory import Trajectory

NAMES = ("robot", "nfourbar-2", "nfourbar-40", "disc", "free-body", "heavy-top", "bricard")

RTOL = 1e-8
"""That of a call that names none."""

LADDER = tuple(10.0**-digits for digits in range(5, 14))
"""Tolerances at which the named methods are tried."""

WORTH = 10.0
"""How many times as long as the default a named method may take; it would not be the best."""

TURNS = 15
"""Samples of the default and of the best, in turns; the quickest of each counts."""


@dataclass(frozen=True)
class _Way:
    """One way to call: how, what it gave (largest error, method), and how long it took (s)."""

    call: Callable[[], Trajectory]
    error: float
    method: str
    seconds: float


def default_records(names: Collection[str] = NAMES, limit: float = 20.0) -> Iterator[dict]:
    """A record for every case.

    case; error: largest, m or as the case says; tolerances: that over rtol times the natural length; seconds: of the whole call
    chosen: what the call took; best, best_error, best_seconds: the quickest named method and tolerance with no larger error
    ratio: seconds over best_seconds, measured in turns
    """
    for name in names:
        case = CASES[name]
        kernels = compile(case.build(), "c")
        own = _way(kernels, case, limit)
        if own is None:
            raise NcgenError(f"{name}: the default call gives no result in {limit:g} s")
        worth = min(limit, WORTH * own.seconds + 0.1)
        named = [
            way
            for formalism, integrator in methods()
            if integrator not in FIXED
            for rtol in LADDER
            if (way := _way(kernels, case, worth, formalism=formalism, integrator=integrator, rtol=rtol)) and way.error <= own.error
        ]
        best = min(named, key=lambda way: way.seconds, default=None)
        record = {"case": name, "error": own.error, "tolerances": own.error / (RTOL * kernels.length), "chosen": own.method}
        if best is None:
            yield record | {"seconds": own.seconds, "best": None, "best_error": None, "best_seconds": None, "ratio": None}
            continue
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            seconds, least = (spread.least for spread in measure({0: repeated(own.call), 1: repeated(best.call)}, TURNS).values())
        record |= {"seconds": seconds, "best": best.method, "best_error": best.error, "best_seconds": least}
        yield record | {"ratio": seconds / least}


def _way(kernels: CompiledKernels, case: Case, limit: float, **method: Any) -> _Way | None:
    """None where there is no result within so many seconds, or one with a warning."""

    def call(progress: ProgressOption = None) -> Trajectory:
        return simulate(kernels, case.duration, **case.options, **method, points=case.points, progress=progress)

    warm(kernels, case, **case.options, **method)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            start = time.perf_counter()
            run = call(time_limit(limit))
            seconds = time.perf_counter() - start
    except (NcgenError, TimeIsUp, Warning):
        return None
    tolerance = f" at {method['rtol']:.0e}" if method else ""
    return _Way(call, float(case.error(run)), f"{run.formalism}, {run.integrator}{tolerance}", seconds)


def default_lines(records: list[dict]) -> Iterator[str]:
    """The records as a table."""
    yield f"{'':<14}{'error':>9}{'/ rtol':>8}{'ms':>10}   {'best by name, to no larger error':<48}{'error':>9}{'ms':>10}{'ratio':>7}"
    for r in records:
        line = f"{r['case']:<14}{r['error']:>9.1e}{r['tolerances']:>8.2g}{1e3 * r['seconds']:>10.2f}   "
        yield line + (
            f"{r['best']:<48}{r['best_error']:>9.1e}{1e3 * r['best_seconds']:>10.2f}{r['ratio']:>7.2f}" if r["best"] else "none reaches it"
        )
