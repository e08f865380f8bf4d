"""`ncgen hard`: every hard case by every method: the error, the drift, the time, or the reason why it fails."""

from __future__ import annotations

import time
import warnings
from collections.abc import Iterator

import numpy as np

from ncgen.build.kernels import Kernels
from ncgen.compiler import compile
from ncgen.errors import NcgenError
from ncgen.report.hard_cases import CASES, Case
from ncgen.solver.formalisms import FORMALISMS
from ncgen.solver.integrators import INTEGRATORS
from ncgen.solver.methods import partners
from ncgen.solver.simulate import simulate

RTOL, ATOL = 1e-10, 1e-12
LIMIT = 20.0
"""Seconds after which a run is stopped."""

FIXED = ("rk4", "trapezoidal", "rattle", "energy-momentum", "generalized-alpha")
"""Integrators with a fixed step."""

WIDELY = ("coordinate-partitioning", "lagrange")
"""Formalisms that are tried with each of their integrators; the others with one, since the integrator is not what differs."""

ONE = "dop853"


class TimeIsUp(Exception):
    """Raised between two steps of a run that has used up its time."""


def methods() -> list[tuple[str, str]]:
    """Every formalism with an integrator, two of them with all."""
    found = []
    for name, formalism in FORMALISMS.items():
        known = partners(formalism)
        found += [(name, integrator) for integrator in known if name in WIDELY or integrator == ONE or ONE not in known]
    return found


def hard_records(names=(), limit: float = LIMIT) -> Iterator[dict]:
    """Records of the named cases (default: all), a run at a time.

    case, formalism, integrator, engine; error and against: largest error, and what is known; drift: of the energy, relative;
    seconds; reason: in words, where there is no result
    """
    for name in names or CASES:
        case = CASES[name]
        kernels = compile(case.build(), "c")
        for formalism, integrator in methods():
            yield run_case(kernels, case, formalism, integrator, limit)


def run_case(kernels: Kernels, case: Case, formalism: str, integrator: str, limit: float = LIMIT) -> dict:
    """One run as a record."""
    record = {"case": case.name, "formalism": formalism, "integrator": integrator, "engine": None, "error": None, "drift": None}
    record |= {"against": case.against, "seconds": None, "reason": None}
    start = time.perf_counter()

    def watch(t: float) -> None:
        if time.perf_counter() - start > limit:
            raise TimeIsUp(f"stopped after {limit:g} s at t = {t:.4g} of {case.duration:g} s")

    steps = {"max_step": case.step} if integrator in FIXED else {"rtol": RTOL, "atol": ATOL}
    options = {**case.options, **steps, "points": case.points, "progress": watch}
    if case.violated:
        noise = np.random.default_rng(1).uniform(-1, 1, kernels.n)
        options["q0"] = kernels.q0 + case.violated * kernels.column_sizes * noise
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # an open start is part of a case
            run = simulate(kernels, case.duration, formalism=formalism, integrator=integrator, **options)
    except (NcgenError, TimeIsUp) as error:
        return record | {"seconds": time.perf_counter() - start, "reason": str(error)}
    record |= {"engine": run.engine.split(":")[0], "seconds": run.statistics.seconds}
    error, drift = case.error(run), run.energy_drift
    if not np.isfinite(error) or not np.all(np.isfinite(run.q)):
        return record | {"reason": "the motion is not finite, and nothing said so"}
    return record | {"error": float(error), "drift": float(drift)}


def lines(records: list[dict]) -> Iterator[str]:
    """The records as a table, a case after the other."""
    for name in dict.fromkeys(r["case"] for r in records):
        mine = [r for r in records if r["case"] == name]
        yield f"{name}: {CASES[name].breaks}; error against {mine[0]['against']}"
        for r in mine:
            method = f"  {r['formalism']:<24}{r['integrator']:<18}"
            if r["reason"]:
                yield f"{method}{'':>34}{r['reason']}"
            else:
                yield f"{method}{r['engine']:<8}{r['error']:>9.1e}{r['drift']:>9.1e}{r['seconds']:>7.2f} s"
        yield ""
