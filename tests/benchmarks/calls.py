"""`bench.py all --calls`: what a call from Python costs beside the run in C that it makes."""

from __future__ import annotations

import sys
import time
import warnings
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from itertools import cycle
from typing import Any

import numpy as np

import ncgen
from ncgen.compiler import compile
from ncgen.exchange.examples import load
from ncgen.mechanism import prepared_run
from ncgen.mechanism.kernels import Kernels
from ncgen.solver.motions.entry_points import simulate

DURATION = 0.01
"""Seconds of a run: some steps."""

CALLS = 400
"""Of which the median and the least are taken."""

FIRST_CALLS = 20
"""Before them, in which everything is found that later calls find again."""

STARTS = 50
"""Different velocities, in turns: more than are kept with a mechanism."""


class _Timed:
    """The runtime, and the seconds that its runs take."""

    seconds = 0.0

    def __init__(self, library: Any) -> None:
        self._library, run = library, library.ncgen_simulate

        def timed(*arguments: Any) -> int:
            begun = time.perf_counter()
            status = run(*arguments)
            _Timed.seconds += time.perf_counter() - begun
            return status

        self.ncgen_simulate = timed

    def __getattr__(self, name: str) -> Any:
        return getattr(self._library, name)


@contextmanager
def _runs_timed() -> Iterator[None]:
    """Within it the seconds of runs in C of kernels that have not run before are added up."""
    plain = prepared_run.runtime_of
    prepared_run.runtime_of = lambda number, part: _Timed(plain(number, part))  # type: ignore[assignment]
    try:
        yield
    finally:
        prepared_run.runtime_of = plain


def call_records(names: Sequence[str]) -> Iterator[dict]:
    """A record for every example: n, evaluations, functions called in a call, and seconds beside C, and in it.

    beside, least: median and least of a call like those before; in_c: the median of the run
    changed: the median beside C where every call begins with other velocities
    """
    with _runs_timed(), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for name in names:
            kernels = compile(load(name), "c")
            run = simulate(kernels, DURATION)
            same = _seconds(lambda _, kernels=kernels: simulate(kernels, DURATION))
            changed = _with_other_starts(kernels) if run.independent else None
            yield {
                "model": name,
                "n": kernels.n,
                "evaluations": run.statistics.evaluations,
                "functions": calls_of(lambda kernels=kernels: simulate(kernels, DURATION)),
                "beside": float(np.median(same[:, 0])),
                "least": float(np.min(same[:, 0])),
                "in_c": float(np.median(same[:, 1])),
                "changed": None if changed is None else float(np.median(changed[:, 0])),
            }


def _with_other_starts(kernels: Kernels) -> np.ndarray:
    """The same of calls that begin with other velocities each."""
    z, rates = simulate(kernels, DURATION).independent[0], np.random.default_rng(1).uniform(0.01, 0.02, STARTS).tolist()
    return _seconds(lambda i: simulate(kernels, DURATION, zd0={z: rates[i % STARTS]}))


def _seconds(call: Callable[[int], object]) -> np.ndarray:
    """Seconds beside C and in C of calls, (CALLS, 2)."""
    found = []
    for i in range(FIRST_CALLS + CALLS):
        _Timed.seconds, begun = 0.0, time.perf_counter()
        call(i)
        whole = time.perf_counter() - begun
        found.append((whole - _Timed.seconds, _Timed.seconds))
    return np.array(found[FIRST_CALLS:])


def calls_of(call: Callable[[], object]) -> int:
    """How many functions are called in a call, of Python and of C: the same on every machine."""
    count = 0

    def note(frame: object, event: str, argument: object) -> None:
        nonlocal count
        count += event in ("call", "c_call")

    call()
    before = sys.getprofile()
    sys.setprofile(note)
    try:
        call()
    finally:
        sys.setprofile(before)
    return count


def other_records(name: str) -> Iterator[dict]:
    """A record for other calls that are made in loops: functions called in a call, and the median of its seconds."""
    kernels = compile(load(name), "c")
    run = simulate(kernels, 0.1, points=51)
    z, near = [kernels.index[each] for each in run.independent], cycle(range(1, 51))
    q, zd, simulation = run.q[:1], run.qd[:1, z], ncgen.start(kernels)
    out = ncgen.accelerations(kernels, q, zd)

    def elsewhere() -> object:
        row = next(near)
        return simulate(kernels, DURATION, q0=run.q[row], qd0=run.qd[row])

    calls = {
        "start().step": lambda: simulation.step(1e-4),
        "freedom": lambda: ncgen.freedom(kernels),
        "joint_space": lambda: ncgen.joint_space(kernels),
        "accelerations, with out": lambda: ncgen.accelerations(kernels, q, zd, out=out),
        "start": lambda: ncgen.start(kernels),
        "accelerations": lambda: ncgen.accelerations(kernels, q[0], zd[0]),
        "simulate from another position": elsewhere,
        "linearise": lambda: ncgen.linearise(kernels),
    }
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for label, call in calls.items():
            seconds = []
            for _ in range(FIRST_CALLS + CALLS // 4):
                begun = time.perf_counter()
                call()
                seconds.append(time.perf_counter() - begun)
            yield {"call": label, "functions": calls_of(call), "seconds": float(np.median(seconds[FIRST_CALLS:]))}


def other_lines(name: str, records: Iterable[dict]) -> Iterator[str]:
    """The records as a table, in µs."""
    yield f"{name:<32}{'functions':>11}{'whole call':>12}"
    for r in records:
        yield f"{r['call']:<32}{r['functions']:>11}{1e6 * r['seconds']:>12.1f}"


def call_lines(records: list[dict]) -> Iterator[str]:
    """The records as a table, in µs, with the median of all and the worst."""
    yield f"{'':<16}{'n':>5}{'evaluations':>13}{'functions':>11}{'beside C':>10}{'least':>8}{'in C':>8}{'other start':>13}"
    for r in records:
        changed = "-" if r["changed"] is None else f"{1e6 * r['changed']:.0f}"
        numbers = f"{1e6 * r['beside']:>10.0f}{1e6 * r['least']:>8.0f}{1e6 * r['in_c']:>8.0f}"
        yield f"{r['model']:<16}{r['n']:>5}{r['evaluations']:>13}{r['functions']:>11}{numbers}{changed:>13}"
    beside = [1e6 * r["beside"] for r in records]
    yield f"beside C: median {np.median(beside):.0f}, worst {max(beside):.0f} µs"
