"""Error against time of whole simulations: every formalism, integrator and engine, from loose to tight.

The error is that of the end position, relative to the mechanism's size, against a run at the tightest tolerance on all
coordinates; a second one by other equations says how far that can be trusted.
"""

from __future__ import annotations

import hashlib
import io
import time
import warnings
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from ncgen.build.cache import KEPT, cache_folder
from ncgen.build.kernels import Kernels
from ncgen.compiler import compile
from ncgen.emit.sources import write_bytes
from ncgen.errors import NcgenError
from ncgen.model import Model
from ncgen.report.falls import own_run
from ncgen.report.methods import FIXED, TimeIsUp, limited, methods
from ncgen.solver.simulate import simulate

TIGHT = 1e-13
TOLERANCES = tuple(10.0**-k for k in range(3, 13))
STEPS = tuple(50 * 2**k for k in range(14))
LIMIT = 1.0
"""Seconds after which a run is stopped; the method is not asked for more accuracy then."""

SHORT = 0.1
"""Runs shorter than this are timed three times, and the quickest counts."""

WRITTEN_OUT = ("rk4", "dopri5", "dop853")
"""Integrators that are also run with the emitted state derivative, and in Python."""

TARGETS = (1e-3, 1e-6, 1e-9)
"""Errors for which the quickest method is named."""


@dataclass(frozen=True)
class Reference:
    """q: end position; doubt: how far another method's end position is from it, relative to the mechanism's size."""

    q: np.ndarray
    doubt: float


def reference(kernels: Kernels, duration: float, start: dict) -> Reference:
    """The end of a run, found by two methods and kept in the cache folder. Raises NcgenError where neither succeeds."""
    key = hashlib.sha256(repr((kernels.fingerprint, duration, sorted(start.get("zd0", {}).items()), TIGHT)).encode()).hexdigest()[:40]
    path = cache_folder() / KEPT[1] / f"{key}.npz"
    if path.is_file():
        found = np.load(path)
        return Reference(found["q"], float(found["doubt"]))
    ends = []
    for method in (("lagrange", "dop853"), ("coordinate-partitioning", "dop853"), ("lagrange", "dopri5")):
        try:
            tight = {"rtol": TIGHT, "atol": 1e-2 * TIGHT * kernels.length, "points": 2}
            ends.append(simulate(kernels, duration, formalism=method[0], integrator=method[1], **tight, **start).q[-1])
        except NcgenError:
            if len(ends) < 1 and method[1] == "dopri5":
                raise
        if len(ends) == 2:
            break
    doubt = _distance(kernels, *ends) if len(ends) == 2 else np.inf
    data = io.BytesIO()
    np.savez(data, q=ends[0], doubt=doubt)
    write_bytes(path, data.getvalue())
    return Reference(ends[0], doubt)


def _distance(kernels: Kernels, one, other) -> float:
    """The largest difference of positions, points relative to the mechanism's length."""
    return float(np.max(np.abs(one - other) / kernels.column_sizes, initial=0.0))


def precision_records(model: Model, limit: float = LIMIT) -> Iterator[dict]:
    """Records of runs, a method after the other, each from loose to tight.

    method: in words; formalism, integrator, engine ("emitted", "c" or "python"), kernels ("c" or "numpy"), setting; error;
    doubt: of the reference; seconds: of the run; steps, evaluations; reason: in words, where there is no result
    """
    kernels = compile(model, "c")
    duration, start = own_run(kernels)
    known = reference(kernels, duration, start)
    numpy = compile(model, "numpy")
    for formalism, integrator in methods():
        for engine, used in _ways(formalism, integrator, kernels, numpy):
            yield from _ladder(used, known, duration, start, formalism, integrator, engine, limit)


def _ways(formalism: str, integrator: str, kernels: Kernels, numpy: Kernels) -> list[tuple[str, Kernels]]:
    """(engine, kernels) that a method is run with."""
    ways = [("auto", kernels)]
    if formalism == "coordinate-partitioning" and integrator in WRITTEN_OUT:
        ways += [("emitted", kernels), ("python", kernels), ("python", numpy)]
    return ways


def _ladder(kernels, known, duration, start, formalism, integrator, engine, limit) -> Iterator[dict]:
    """Runs of one method, until one takes too long or fails; the first failure says why."""
    fixed = integrator in FIXED
    if engine == "emitted":
        with suppress(NcgenError):  # the first run of the ladder says it again
            _run(kernels, duration, {"engine": engine, "points": 2, **start}, np.inf)  # compiles
    method = _name(formalism, integrator, "", kernels)
    for level in STEPS if fixed else TOLERANCES:
        record = {"method": method, "formalism": formalism, "integrator": integrator, "engine": engine, "kernels": kernels.backend}
        record |= {"setting": f"{level} steps" if fixed else f"rtol {level:.0e}", "error": None, "doubt": known.doubt}
        record |= {"seconds": None, "steps": None, "evaluations": None, "reason": None}
        accuracy = {"max_step": duration / level} if fixed else {"rtol": level, "atol": 1e-2 * level * kernels.length}
        options = {"formalism": formalism, "integrator": integrator, "engine": engine, "points": 2, **accuracy, **start}
        try:
            run, seconds = _timed(kernels, duration, options, limit)
        except (NcgenError, TimeIsUp) as error:
            yield record | {"reason": str(error)}
            return
        engine = run.engine.split(":")[0]
        method = _name(formalism, integrator, engine, kernels)
        counts = run.statistics
        yield record | {
            "method": method,
            "engine": engine,
            "error": _distance(kernels, run.q[-1], known.q),
            "seconds": seconds,
            "steps": counts.steps,
            "evaluations": counts.evaluations,
        }


def _name(formalism: str, integrator: str, engine: str, kernels: Kernels) -> str:
    """A method in words."""
    where = {"emitted": " in emitted C", "c": " in C", "python": " in Python"}.get(engine, "")
    return f"{integrator} on {formalism}{where}" + ", NumPy kernels" * (kernels.backend == "numpy")


def _timed(kernels, duration, options, limit):
    """The run and its seconds: of the last of several if it is short."""
    run = _run(kernels, duration, options, limit)
    seconds = [run.statistics.seconds]
    if seconds[0] < SHORT:
        seconds = [_run(kernels, duration, options, limit).statistics.seconds for _ in range(3)]
    return run, min(seconds)


def _run(kernels, duration, options, limit):
    with warnings.catch_warnings(), limited(limit):
        warnings.simplefilter("ignore")  # a method without projection drifts; its error says so
        return simulate(kernels, duration, **options)


# -- for people --------------------------------------------------------------------------------------------------------

HEAD = ("method", *(f"{target:.0e}" for target in TARGETS), "best error", "stopped")


def by_method(records: list[dict]) -> dict[str, list[dict]]:
    """The records of every method."""
    return {method: [r for r in records if r["method"] == method] for method in dict.fromkeys(r["method"] for r in records)}


def table(records: list[dict]) -> list[tuple[str, ...]]:
    """Milliseconds until a method reaches an error, titles first."""
    rows = [HEAD]
    for method, runs in by_method(records).items():
        done = [r for r in runs if r["error"] is not None]
        cells = []
        for target in TARGETS:
            enough = [r["seconds"] for r in done if r["error"] <= target]
            cells.append(f"{1e3 * min(enough):.3g} ms" if enough else "")
        best = f"{min(r['error'] for r in done):.1e}" if done else ""
        rows.append((method, *cells, best, next((r["reason"] for r in runs if r["reason"]), "")))
    return rows


def front(records: list[dict]) -> list[str]:
    """The quickest method for every target, in words."""
    lines = []
    done = [r for r in records if r["error"] is not None]
    for target in TARGETS:
        enough = [r for r in done if r["error"] <= target]
        if enough:
            best = min(enough, key=lambda r: r["seconds"])
            lines.append(f"for {target:.0e}: {best['method']}, {best['setting']}: {1e3 * best['seconds']:.3g} ms at {best['error']:.1e}")
        else:
            lines.append(f"for {target:.0e}: no method here")
    return lines


def figure(records: list[dict], title: str):
    """Time against error, a line a method."""
    from ncgen.view.chart import GRID, empty

    chart = empty(9.0, 6.0)
    chart.set_layout_engine("constrained")
    axes = chart.add_subplot(xscale="log", yscale="log", xlabel="error of the end position, relative to the size", ylabel="time of the run (s)", title=title)
    axes.grid(**GRID)
    styles = [(color, line) for line in ("-", "--", ":") for color in COLORS]
    for (method, runs), (color, line) in zip(by_method(records).items(), styles * 2, strict=False):
        done = sorted(((max(r["error"], 1e-16), r["seconds"]) for r in runs if r["error"] is not None), reverse=True)
        if done:
            axes.plot(*zip(*done, strict=True), marker="o", markersize=3, linewidth=1, color=color, linestyle=line, label=method)
    axes.invert_xaxis()
    if axes.lines:
        axes.legend(fontsize=6, loc="upper left", bbox_to_anchor=(1.0, 1.0))
    return chart


COLORS = ("#c8102e", "#30506b", "#2e8b57", "#c77d0a", "#7a4fa3", "#3b9bb3", "#8a5a3c", "#555555")
