"""A whole simulation: seconds against error for integrators, in C and in Python, and for hand-written code."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any, TypeAlias

from ncgen.comparisons.rivals import handwritten
from ncgen.comparisons.rivals.base import own_start
from ncgen.errors import NcgenError
from ncgen.mechanism.kernels import Kernels
from ncgen.report.precision import REFERENCE_RTOL, own_run, tolerances
from ncgen.solver.engines.capabilities import is_emitted
from ncgen.solver.motions.simulate import simulate_one
from ncgen.solver.trajectories.trajectory import Trajectory

TOLERANCES = (1e-5, 1e-6, 1e-7, 1e-8, 1e-10)
STEPS = (50, 100, 200)
REPEATS = 9
MAX_REPEATED_SECONDS = 2.0
"""Seconds after which a run in C is not repeated any more."""

PARTITIONED = "coordinate-partitioning"


@dataclass(frozen=True)
class Way:
    """An engine with its formalism, and what the table calls them."""

    engine: str
    formalism: str
    title: str


DEFAULT = Way("auto", "lagrange", "all coordinates")
"""What a call without arguments takes."""

WAYS = (DEFAULT, Way("emitted", PARTITIONED, "emitted C"), Way("c", PARTITIONED, "C, dense elimination"))
IN_PYTHON = Way("python", PARTITIONED, "Python")


Others: TypeAlias = Callable[[Kernels, float, Mapping[str, float]], Iterator[dict]]
"""(kernels, duration, {coordinate: end value}) -> records of what else simulates it."""


def fall_records(kernels: Kernels, others: Others = lambda *arguments: iter(())) -> Iterator[dict]:
    """Records of the model's own simulation, one at a time.

    error: largest difference (m, rad) of the end position; seconds: of the run; total: of the whole call of `simulate`
    """
    duration = own_run(kernels)[0]  # what only Python simulates would take minutes
    if not is_emitted(kernels, own_start(kernels)[1]) or (reference := end_state(kernels, duration)) is None:
        return
    for way in WAYS:
        for integrator, setting, options in _settings(duration):
            yield _timed(kernels, duration, reference, integrator, setting, options, way, REPEATS)
    yield _timed(kernels, duration, reference, "dopri5", "rtol 1e-06", tolerances(1e-6), IN_PYTHON, 1)
    yield from others(kernels, duration, reference)


def _settings(duration: float) -> Iterator[tuple[str, str, Mapping[str, Any]]]:
    for rtol in TOLERANCES:
        for integrator in ("dopri5", "dop853"):
            yield integrator, f"rtol {rtol:g}", tolerances(rtol)
    for steps in STEPS:
        yield "rk4", f"{steps} steps", {"max_step": duration / steps}


def end_state(kernels: Kernels, duration: float) -> dict[str, float] | None:
    """{coordinate: end value}: known beforehand, or from a run at tight tolerance; None where it cannot be simulated."""
    module = handwritten(kernels)
    if module is not None:
        return module.END
    try:
        tight: dict[str, Any] = {**tolerances(REFERENCE_RTOL), **own_run(kernels)[1]}
        run = simulate_one(kernels, duration, formalism=PARTITIONED, integrator="dopri5", points=2, engine="emitted", **tight)
    except NcgenError:
        return None
    return dict(zip(kernels.coordinates, run.q[-1].tolist(), strict=True))


def _timed(
    kernels: Kernels,
    duration: float,
    reference: Mapping[str, float],
    integrator: str,
    setting: str,
    options: Mapping[str, Any],
    way: Way,
    repeats: int,
) -> dict:
    record = {"case": "simulation", "tool": f"{integrator}, {way.title}", "setting": setting}
    try:
        run, seconds, totals = _repeated(kernels, duration, integrator, options, way, repeats)
    except NcgenError as error:
        return record | {"error": None, "seconds": None, "stopped": str(error)}
    if way != IN_PYTHON and run.engine.startswith("python"):
        return record | {"error": None, "seconds": None, "stopped": run.engine}
    counts = run.statistics
    return record | {
        "error": max(abs(run[name][-1] - value) for name, value in reference.items()),
        "seconds": statistics.median(seconds),
        "total": statistics.median(totals),
        "steps": counts.steps,
        "evaluations": counts.evaluations,
        "newton_steps": counts.newton_steps,
    }


def _repeated(
    kernels: Kernels, duration: float, integrator: str, options: Mapping[str, Any], way: Way, repeats: int
) -> tuple[Trajectory, list[float], list[float]]:
    """The last of at least one run, and the seconds of each: of the run, and of the whole call."""
    seconds, totals = [], []
    call = partial(
        simulate_one, kernels, duration, formalism=way.formalism, integrator=integrator, engine=way.engine, points=2, **options,
        **own_run(kernels)[1],
    )  # fmt: skip
    if way != IN_PYTHON:
        call()  # compiles
    while True:
        start = time.perf_counter()
        run = call()
        totals.append(time.perf_counter() - start)
        seconds.append(run.statistics.seconds)
        if len(seconds) >= repeats or sum(totals) >= MAX_REPEATED_SECONDS:
            return run, seconds, totals
