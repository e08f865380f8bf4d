"""Other simulators beside ncgen, on N four-bars through their singular position (10 s), a mechanism that all can express.

Each module has NAME and run(count, duration, intervals, steps) -> (seconds, positions of B0). What they compute is checked: the
error is against the exact motion, so a simulator that solves another problem shows it. Errors: largest distance of B0 over 101 instants.
"""

from __future__ import annotations

import importlib
import warnings
from collections.abc import Callable, Iterable, Iterator
from typing import Any, NoReturn

import numpy as np

from ncgen.comparisons.hard_linkages import four_bars_position
from ncgen.compiler import compile
from ncgen.errors import NcgenError
from ncgen.exchange.examples import example_module
from ncgen.mechanism.kernels import Kernels
from ncgen.methods.table import FORMALISMS, INTEGRATORS, partners
from ncgen.report.document import aligned
from ncgen.report.precision import FIXED, TimeIsUp, time_limit, tolerances
from ncgen.solver.motions.entry_points import simulate

Run = Callable[[], tuple[float, np.ndarray]]
"""A run: seconds, and positions of B0."""

PEERS = ("pinocchio", "mujoco", "exudyn")
"""Modules of this package."""

COUNTS = (2, 40)
DURATION, INTERVALS = 10.0, 100
ERROR = 2e-6
"""The error (m) at which times are compared; who has reached it is not asked for more."""

STEPS = (5, 10, 20, 40, 80)
"""Steps in an interval of 0.1 s."""

TOLERANCES = tuple(10.0 ** (-k / 4) for k in range(20, 40))
LIMIT = 20.0
"""Seconds a run of ncgen may last; what took half of it is not tried with smaller steps."""

REPEATS = 7
LONGEST = 1.0
"""Runs that last longer (s) are not repeated."""


def peer_records(counts: Iterable[int] = COUNTS, names: Iterable[str] = PEERS, limit: float = LIMIT) -> Iterator[dict]:
    """count, tool, setting, error (m), seconds (of the quickest of several), or None for both and a reason."""
    for count in counts:
        t = np.linspace(0.0, DURATION, INTERVALS + 1)
        exact = four_bars_position(count, t)
        runs = [*_own(count, limit), *(run for name in names for run in _peer(name, count))]
        stopped: set[str] = set()
        measured = []
        for tool, setting, run in runs:
            if tool in stopped:
                continue
            record = {"count": count, "tool": tool, "setting": setting, "error": None, "seconds": None, "reason": None}
            try:
                with warnings.catch_warnings():
                    warnings.simplefilter("ignore")
                    seconds, found = run()
            except (NcgenError, TimeIsUp, ImportError, RuntimeError, ValueError) as problem:
                stopped |= {tool} if isinstance(problem, (TimeIsUp, ImportError)) else set()
                yield record | {"reason": str(problem).strip().splitlines()[0]}
                continue
            error = float(np.max(np.hypot(*(found - exact).T)))
            stopped |= {tool} if seconds > limit / 2 or error <= ERROR else set()
            measured.append((record | {"error": error if np.isfinite(error) else None, "seconds": seconds}, run))
        yield from _repeated(measured)


def _repeated(measured: list[tuple[dict, Run]]) -> Iterator[dict]:
    """Every run that is not long again, in turns, so that all see the same disturbances."""
    samples = [[record["seconds"]] for record, _ in measured]
    for _ in range(REPEATS - 1):
        for own, (_, run) in zip(samples, measured, strict=True):
            if own[0] < LONGEST:
                own.append(run()[0])
    for (record, _), own in zip(measured, samples, strict=True):
        yield record | {"seconds": min(own)}


def _peer(name: str, count: int) -> Iterator[tuple[str, str, Run]]:
    try:
        module = importlib.import_module(f"benchmarks.peers.{name}")
        module.run(count, DURATION / INTERVALS, 1, 1)  # may compile: that is not timed, nor limited
    except (ImportError, NcgenError) as problem:
        missing = problem
        yield name, "", lambda: _raise(missing)
        return
    for steps in STEPS:
        yield module.NAME, f"{INTERVALS * steps} steps", lambda steps=steps: module.run(count, DURATION, INTERVALS, steps)


def _raise(problem: Exception) -> NoReturn:
    raise problem


def _own(count: int, limit: float) -> Iterator[tuple[str, str, Run]]:
    """What ncgen has in C on all coordinates; independent coordinates cannot pass the singular position."""
    kernels = compile(example_module("nfourbar").build(count), "c")
    for formalism in (f for f in FORMALISMS.values() if f.in_c and f.options.get("stabilisation") == "projection"):
        for integrator in (i for i in partners(formalism) if INTEGRATORS[i].in_c):
            tool = f"ncgen, {integrator} on {formalism.name}"
            steps = [(f"{INTERVALS * k} steps", {"max_step": DURATION / (INTERVALS * k)}) for k in STEPS]
            adaptive = [(f"rtol {rtol:.1e}", {**tolerances(rtol)}) for rtol in TOLERANCES]
            for setting, options in steps if integrator in FIXED else adaptive:
                yield tool, setting, _simulated(kernels, formalism.name, integrator, limit, options)


def _simulated(kernels: Kernels, formalism: str, integrator: str, limit: float, options: dict[str, Any]) -> Run:
    def run() -> tuple[float, np.ndarray]:
        start: dict[str, Any] = {"zd0": {"B0.x": 1.0}, "points": INTERVALS + 1, "engine": "c", "progress": time_limit(limit)}
        found = simulate(kernels, DURATION, formalism=formalism, integrator=integrator, **start, **options)
        return found.statistics.seconds, np.column_stack([found["B0.x"], found["B0.y"]])

    return run


# -- for people --------------------------------------------------------------------------------------------------------


def table(records: list[dict], count: int) -> list[tuple[str, ...]]:
    """Rows of cells, titles first: of every tool the quickest run within ERROR, else its most exact one; the quickest first."""
    mine = [r for r in records if r["count"] == count and r["error"] is not None]
    best = {}
    for r in mine:
        rank = (r["error"] > ERROR, r["seconds"] if r["error"] <= ERROR else r["error"])
        if r["tool"] not in best or rank < best[r["tool"]][0]:
            best[r["tool"]] = rank, r
    order = [r for _, r in sorted(best.values(), key=lambda entry: entry[0])]
    first = order[0]["seconds"]
    rows: list[tuple[str, ...]] = [("", f"ms to {ERROR:.0e} m", "ratio", "error, m", "setting")]
    for r in order:
        reached = r["error"] <= ERROR
        time = f"{1e3 * r['seconds']:.3g}" if reached else f"never ({1e3 * r['seconds']:.3g})"
        rows.append((r["tool"], time, f"{r['seconds'] / first:.3g}" if reached else "", f"{r['error']:.1e}", r["setting"]))
    return rows


def reasons(records: list[dict], count: int) -> list[str]:
    """What did not run or did not arrive, and why, a line a tool."""
    mine = [r for r in records if r["count"] == count and r["error"] is None]
    return [f"{r['tool']}{', ' * bool(r['setting'])}{r['setting']}: {r['reason'] or 'not finite'}" for r in mine]


def lines(records: list[dict]) -> Iterator[str]:
    """The records as tables, and what did not arrive."""
    for count in dict.fromkeys(r["count"] for r in records):
        exactness = f"the quickest run of each within {ERROR:.0e} m of B0's exact motion, else its most exact one"
        yield f"{count} four-bars, {DURATION:g} s: {exactness}"
        yield from aligned(table(records, count))
        yield from (f"  {line}" for line in reasons(records, count))
        yield ""
