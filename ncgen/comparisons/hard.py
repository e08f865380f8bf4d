"""`ncgen hard`: every hard case by every method: the error, the drift, the time, or the reason why it fails."""

from __future__ import annotations

import time
import warnings
from collections.abc import Collection, Iterator
from contextlib import suppress
from typing import Any

import numpy as np

from ncgen.comparisons.case import Case
from ncgen.comparisons.hard_cases import CASES
from ncgen.compiler import compile
from ncgen.errors import NcgenError
from ncgen.mechanism.library import CompiledKernels
from ncgen.report.precision import FIXED, TimeIsUp, methods, time_limit, tolerances
from ncgen.solver.motions.simulate import simulate_one

LIMIT = 20.0
"""Seconds after which a run is stopped."""


def hard_records(names: Collection[str] = (), limit: float = LIMIT) -> Iterator[dict]:
    """Records of the named cases (default: all), a run at a time.

    case, formalism, integrator, engine; error and reference: largest error, and what it is compared with; drift: of the energy, relative;
    seconds; reason: in words, where there is no result; warnings: of a run with a result
    """
    for name in names or CASES:
        case = CASES[name]
        kernels = compile(case.build(), "c")
        for formalism, integrator in methods():
            yield run_case(kernels, case, formalism, integrator, limit)


def run_case(kernels: CompiledKernels, case: Case, formalism: str, integrator: str, limit: float = LIMIT) -> dict:
    """One run as a record."""
    record = {"case": case.name, "formalism": formalism, "integrator": integrator, "engine": None, "error": None, "drift": None}
    record |= {"reference": case.against, "seconds": None, "reason": None, "warnings": None}
    steps = {"max_step": case.step} if integrator in FIXED else tolerances(case.rtol, kernels.length)
    options = {**case.options, **steps, "points": case.points}
    if case.violated:
        noise = np.random.default_rng(1).uniform(-1, 1, kernels.n)
        options["q0"] = kernels.q0 + case.violated * kernels.column_sizes * noise
    warm(kernels, case, formalism=formalism, integrator=integrator, **options)
    start = time.perf_counter()
    try:
        with warnings.catch_warnings(record=True) as caught:
            run = simulate_one(kernels, case.duration, formalism=formalism, integrator=integrator, progress=time_limit(limit), **options)
    except (NcgenError, TimeIsUp) as error:
        return record | {"seconds": time.perf_counter() - start, "reason": str(error)}
    record |= {"engine": run.engine.split(":")[0], "seconds": run.statistics.seconds}
    record |= {"warnings": "; ".join(str(warning.message) for warning in caught) or None}
    if not np.all(np.isfinite(run.q)):
        return record | {"reason": "the motion is not finite, and there was no warning"}
    return record | {"error": float(case.error(run)), "drift": float(run.energy_drift)}


def warm(kernels: CompiledKernels, case: Case, **options: Any) -> None:
    """Begin a run, so that what it compiles is in the cache; what goes wrong goes wrong again in the run itself."""
    with suppress(NcgenError, TimeIsUp), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        simulate_one(kernels, 1e-3 * case.duration, progress=time_limit(LIMIT), **options)


def lines(records: list[dict]) -> Iterator[str]:
    """The records as a table, a case after the other."""
    for name in dict.fromkeys(r["case"] for r in records):
        records_of_case = [r for r in records if r["case"] == name]
        yield f"{name}: {CASES[name].breaks}; error against {records_of_case[0]['reference']}"
        for r in records_of_case:
            method = f"  {r['formalism']:<24}{r['integrator']:<18}"
            if r["reason"]:
                yield f"{method}{'':>34}{r['reason']}"
            else:
                message = f"  {r['warnings']}" if r["warnings"] else ""
                yield f"{method}{r['engine']:<8}{r['error']:>9.1e}{r['drift']:>9.1e}{r['seconds']:>7.2f} s{message}"
        yield ""
