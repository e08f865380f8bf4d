"""Error against time of whole simulations: every formalism, integrator and engine, from loose to tight.

The error is that of the end position, relative to the mechanism's size, against a run at the tightest tolerance on all
coordinates; a second one by other equations says how far that can be trusted.
"""

from __future__ import annotations

import hashlib
import time
import warnings
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from itertools import product
from typing import TYPE_CHECKING, Any, TypedDict

import numpy as np
import scipy

from ncgen import __version__
from ncgen.compiler import compile
from ncgen.errors import ModelError, NcgenError
from ncgen.mechanism import runtime_library
from ncgen.mechanism.kernels import Kernels
from ncgen.mechanism.library import CompiledKernels
from ncgen.methods.table import FORMALISMS, INTEGRATORS, partners
from ncgen.model import Model
from ncgen.report.clock import is_noisy
from ncgen.solver.groups import StartArguments
from ncgen.solver.motions.simulate import simulate_one
from ncgen.solver.runs.simulation_options import check_simulation, simulation_of
from ncgen.solver.trajectories.trajectory import Trajectory
from ncgen.toolchain.abi import NUMBERS
from ncgen.toolchain.cache_location import keep, kept

if TYPE_CHECKING:
    from matplotlib.figure import Figure

REFERENCE_RTOL = 1e-13
ATOL_OVER_RTOL = 1e-2
"""Absolute tolerance as a share of the relative one, for a mechanism of one metre."""

TOLERANCES = tuple(10.0**-k for k in range(3, 13))
STEPS = tuple(50 * 2**k for k in range(14))
LIMIT = 1.0
"""Seconds after which a run is stopped; the method is not asked for more accuracy then."""

MIN_SECONDS = 0.1
"""Runs shorter than this (s) are repeated."""

ROUNDS = 7

WRITTEN_OUT = ("rk4", "dopri5", "dop853")
"""Integrators that are also run with the emitted state derivative, there in every number type, and in Python."""

TARGETS = (1e-3, 1e-6, 1e-9)
"""Errors for which every method's time is shown."""

ERROR_LEVELS = tuple(10.0**-k for k in range(2, 13))
"""Errors for which the quickest method is named."""

ENGINES = {"emitted": "emitted C", "c": "C", "python": "Python"}


@dataclass(frozen=True, eq=False)
class PrecisionReference:
    """q: end position; doubt: how far another method's end position is from it, relative to the mechanism's size."""

    q: np.ndarray
    doubt: float


class ToleranceArguments(TypedDict):
    """How an integrator that chooses its steps takes its accuracy: arguments of `simulate`."""

    rtol: float
    atol: float


def tolerances(rtol: float, length: float = 1.0) -> ToleranceArguments:
    """Both of a mechanism of this length (m)."""
    return {"rtol": rtol, "atol": ATOL_OVER_RTOL * rtol * length}


def reference(kernels: CompiledKernels, duration: float, start: dict[str, Any]) -> PrecisionReference:
    """The end of a run, found by two methods and kept in the cache folder. Raises NcgenError where neither succeeds."""
    facts = (kernels.fingerprint, duration, sorted(start.items()), REFERENCE_RTOL, __version__, np.__version__, scipy.__version__)
    key = hashlib.sha256(repr(facts).encode()).hexdigest()[:40]
    if entry := kept("references", key):
        return PrecisionReference(np.array(entry["q"]), entry["doubt"])
    ends = []
    for method in (("lagrange", "dop853"), ("coordinate-partitioning", "dop853"), ("lagrange", "dopri5")):
        try:
            tight: dict[str, Any] = {**tolerances(REFERENCE_RTOL, kernels.length), "points": 2}
            ends.append(simulate_one(kernels, duration, formalism=method[0], integrator=method[1], **tight, **start).q[-1])
        except NcgenError:
            if len(ends) < 1 and method[1] == "dopri5":
                raise
        if len(ends) == 2:
            break
    doubt = _distance(kernels, *ends) if len(ends) == 2 else np.inf
    keep("references", key, {"q": ends[0].tolist(), "doubt": doubt})
    return PrecisionReference(ends[0], doubt)


def _distance(kernels: Kernels, one: np.ndarray, other: np.ndarray) -> float:
    """The largest difference of positions, points relative to the mechanism's length."""
    return float(np.max(np.abs(one - other) / kernels.column_sizes, initial=0.0))


def tried() -> list[tuple[str, str]]:
    """(formalism, integrator): what `methods` chooses, and all that there is in C."""
    pairs = [(entry, integrator) for entry in FORMALISMS.values() if entry.in_c for integrator in partners(entry)]
    return list(dict.fromkeys([*methods(), *((entry.name, name) for entry, name in pairs if INTEGRATORS[name].in_c)]))


def precision_records(model: Model, limit: float = LIMIT, **chosen: Any) -> list[dict]:
    """Records of runs, a method after the other, each from loose to tight.

    chosen: duration and arguments of the start for `simulate`, in place of the model's own where they are not None
    method: in words; formalism, integrator, engine ("emitted", "c" or "python"), kernels ("c" or "numpy"), number type, setting; error;
    reference_error: of the reference; seconds, low, high: of the run, median and quartiles; noisy; steps, evaluations; reason: in words,
    where there is no result

    Raises ModelError where nothing moves: every method is exact then.
    """
    check_simulation(model, **chosen)
    kernels = compile(model, "c")
    duration, start = own_run(kernels, **chosen)
    _check_motion(kernels, duration, start)
    known = reference(kernels, duration, start)
    numpy = compile(model, "numpy")
    measured = []
    runtime_library.prepare(kernels)
    for formalism, integrator in tried():
        for engine, used, number in _ways(formalism, integrator, kernels, numpy):
            measured += _ladder(used, known, duration, start, formalism, integrator, engine, number, limit)
    _repeat([(record, again) for record, again in measured if record["seconds"] is not None and record["seconds"] < MIN_SECONDS])
    return [record for record, _ in measured]


def own_run(kernels: Kernels, **others: Any) -> tuple[float, dict[str, Any]]:
    """Duration (s) and beginning of the model's own simulation, with others that are not None in their place, for `simulate`."""
    options = simulation_of(kernels.model, **others)
    return float(options["duration"]), {k: options[k] for k in StartArguments.__annotations__ if k in options}


def _check_motion(kernels: Kernels, duration: float, start: dict[str, Any]) -> None:
    """Raise ModelError where a mechanism moves less than the smallest error that is shown."""
    run = _run(kernels, duration, start, np.inf)
    if max(_distance(kernels, q, run.q[0]) for q in run.q) < min(TARGETS):
        advice = f"give a start velocity, such as --velocity {run.independent[0]}=1" if run.independent else "it has no degrees of freedom"
        raise ModelError(f"{kernels.name}: nothing moves in {duration:g} s, so every method is exact; {advice}")


def _repeat(runs: list[tuple[dict, Callable[[], float]]]) -> None:
    """Measure in turns, so that all methods see the same disturbances."""
    samples = [[again() for _, again in runs] for _ in range(ROUNDS)]
    for (record, _), seconds in zip(runs, zip(*samples, strict=True), strict=True):
        low, middle, high = map(float, np.quantile(seconds, (0.25, 0.5, 0.75)))
        record |= {"seconds": middle, "low": low, "high": high, "noisy": is_noisy(low, middle, high)}


def _ways(formalism: str, integrator: str, kernels: Kernels, numpy: Kernels) -> list[tuple[str, Kernels, str]]:
    """(engine, kernels, number type) that a method is run with."""
    ways: list[tuple[str, Kernels, str]] = [("auto", kernels, "double")]
    if formalism == "coordinate-partitioning" and integrator in WRITTEN_OUT:
        ways += [("emitted", kernels, number) for number in NUMBERS]
        ways += [("python", kernels, "double"), ("python", numpy, "double")]
    return ways


def _ladder(
    kernels: Kernels,
    known: PrecisionReference,
    duration: float,
    start: dict[str, Any],
    formalism: str,
    integrator: str,
    engine: str,
    number: str,
    limit: float,
) -> Iterator[tuple[dict, Callable[[], float]]]:
    """Runs of one method, each with a function that times it again, until one takes too long or fails; the first failure says why."""
    fixed = integrator in FIXED
    if engine == "emitted":
        with suppress(NcgenError):  # the first run of the ladder says it again
            _run(kernels, duration, {"engine": engine, "number": number, "points": 2, **start}, np.inf)  # compiles
    method = _name(formalism, integrator, engine, kernels, number)
    for level in STEPS if fixed else TOLERANCES:
        record = {
            "method": method,
            "formalism": formalism,
            "integrator": integrator,
            "engine": engine,
            "kernels": kernels.backend,
            "number": number,
        }
        record |= {"setting": f"{level} steps" if fixed else f"rtol {level:.0e}", "error": None, "reference_error": known.doubt}
        record |= {"seconds": None, "low": None, "high": None, "noisy": False, "steps": None, "evaluations": None, "reason": None}
        accuracy = {"max_step": duration / level} if fixed else tolerances(level, kernels.length)
        options = {"formalism": formalism, "integrator": integrator, "engine": engine, "number": number, "points": 2, **accuracy, **start}
        try:
            run = _run(kernels, duration, options, limit)
        except (NcgenError, TimeIsUp) as error:
            yield record | {"reason": str(error)}, lambda: 0.0
            return
        engine = run.engine.split(":")[0]
        method = _name(formalism, integrator, engine, kernels, number)
        counts = run.statistics
        done = {
            "method": method,
            "engine": engine,
            "error": _distance(kernels, run.q[-1], known.q),
            "seconds": counts.seconds,
            "low": counts.seconds,
            "high": counts.seconds,
            "steps": counts.steps,
            "evaluations": counts.evaluations,
        }
        yield record | done, lambda options=options: _run(kernels, duration, options, np.inf).statistics.seconds


def _name(formalism: str, integrator: str, engine: str, kernels: Kernels, number: str) -> str:
    """A method in words."""
    where = f" in {_title(engine, kernels.backend, number)}" if engine in ENGINES else ""
    return f"{integrator} on {formalism}{where}"


def _title(engine: str, backend: str, number: str) -> str:
    """Where a method runs, in words."""
    return ENGINES[engine] + ", NumPy kernels" * (backend == "numpy") + f", {number}" * (number != "double")


def _run(kernels: Kernels, duration: float, options: dict[str, Any], limit: float) -> Trajectory:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # a method without projection drifts; its error says so
        return simulate_one(kernels, duration, progress=time_limit(limit), **options)


# -- for people --------------------------------------------------------------------------------------------------------

HEAD = ("method", *(f"{target:.0e}" for target in TARGETS), "best error", "stopped")


def by_method(records: list[dict]) -> dict[str, list[dict]]:
    """The records of every method."""
    return {method: [r for r in records if r["method"] == method] for method in dict.fromkeys(r["method"] for r in records)}


def table(records: list[dict]) -> list[tuple[str, ...]]:
    """Milliseconds until a method reaches an error, titles first."""
    rows: list[tuple[str, ...]] = [HEAD]
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
    """The quickest method for every error that the reference can tell, in words."""
    lines = []
    done = [r for r in records if r["error"] is not None]
    for level in (level for level in ERROR_LEVELS if all(level > r["reference_error"] for r in done)):
        enough = [r for r in done if r["error"] <= level]
        if enough:
            best = min(enough, key=lambda r: r["seconds"])
            time = f"{1e3 * best['seconds']:.3g} ms{' (noisy)' if best['noisy'] else ''}"
            lines.append(f"for {level:.0e}: {best['method']}, {best['setting']}: {time} at {best['error']:.1e}")
    return lines


def figure(records: list[dict], title: str) -> Figure:
    """Time against error, a panel an engine, a line a method; the band is Pareto's front: nothing is both quicker and more exact."""
    from ncgen.view.chart import GRID, empty

    done = [r for r in records if r["error"] is not None]
    present = {_place(r) for r in done}
    panels = [panel for panel in product(ENGINES, ("c", "numpy"), NUMBERS) if panel in present]
    formalisms, integrators = (list(dict.fromkeys(r[key] for r in done)) for key in ("formalism", "integrator"))
    chart = empty(10.0, 0.8 + 3.6 * ((len(panels) + 1) // 2))
    chart.set_layout_engine("constrained")
    chart.suptitle(title)
    axes, legend = None, {}
    for number, panel in enumerate(panels, 1):
        axes = chart.add_subplot((len(panels) + 1) // 2, 2, number, xscale="log", yscale="log", sharex=axes, sharey=axes)
        axes.set(title=_title(*panel), xlabel="error, relative to the size", ylabel="seconds")
        axes.minorticks_off()  # hundreds of them make a file large
        axes.grid(**GRID)
        axes.set_axisbelow(True)
        axes.plot(*_points(_unbeaten(done)), color="#ffd166", linewidth=7, alpha=0.6)
        for runs in by_method([r for r in done if _place(r) == panel]).values():
            formalism, integrator = runs[0]["formalism"], runs[0]["integrator"]
            color, marker = COLORS[integrators.index(integrator) % len(COLORS)], MARKERS[formalisms.index(formalism) % len(MARKERS)]
            axes.plot(*_points(runs), color=color, marker=marker, linewidth=0.9, markersize=3.5)
            legend[integrator] = axes.plot([], [], color=color)[0]
            legend[formalism] = axes.plot([], [], color="black", marker=marker, linestyle="none", markersize=4)[0]
    if axes:
        axes.invert_xaxis()
        names = [*integrators, *formalisms]
        chart.legend([legend[name] for name in names], names, loc="outside lower center", ncols=6, fontsize=7, frameon=False)
    return chart


MIN_DRAWN_ERROR, MAX_DRAWN_ERROR = 1e-16, 1.0
"""Errors that are drawn: a run that ends a whole size away has gone somewhere else."""

COLORS = (
    "#c8102e",
    "#30506b",
    "#e08a00",
    "#2a9d5c",
    "#7b4fa3",
    "#888888",
    "#00a3b4",
    "#a0522d",
    "#d45ba0",
    "#556b2f",
    "#000000",
    "#b5a400",
)
MARKERS = "osD^vP*X"


def _place(record: dict) -> tuple[str, str, str]:
    return record["engine"], record["kernels"], record["number"]


def _points(runs: list[dict]) -> tuple[list[float], list[float]]:
    drawn = [r for r in runs if r["error"] <= MAX_DRAWN_ERROR]
    return [max(r["error"], MIN_DRAWN_ERROR) for r in drawn], [r["seconds"] for r in drawn]


def _unbeaten(done: list[dict]) -> list[dict]:
    """From the most exact on, every run that is quicker than all more exact ones."""
    unbeaten: list[dict] = []
    for r in sorted(done, key=lambda r: (r["error"], r["seconds"])):
        if not unbeaten or r["seconds"] < unbeaten[-1]["seconds"]:
            unbeaten.append(r)
    return unbeaten


FIXED = tuple(name for name, entry in INTEGRATORS.items() if entry.has_fixed_step)
"""Integrators with a fixed step."""

ONE = "dop853"
"""Every formalism is tried with this one, since there the integrator is not what differs."""


class TimeIsUp(Exception):
    """Raised when a run has used up its time."""


def methods() -> list[tuple[str, str]]:
    """Coordinate partitioning with every integrator, every formalism with one, and all that step the constrained equations."""
    ordinary = [("coordinate-partitioning", entry.name) for entry in INTEGRATORS.values() if entry.is_ordinary]
    formalisms = [(entry.name, ONE) for entry in FORMALISMS.values() if entry.is_ordinary]
    steppers = [(formalism, entry.name) for entry in INTEGRATORS.values() for formalism in entry.steps]
    return list(dict.fromkeys([*ordinary, *formalisms, *steppers]))


def time_limit(seconds: float) -> Callable[[float], None]:
    """The `progress` of a run that raises TimeIsUp as soon as so many seconds have passed from now.

    A run calls it while it computes, in C too, so that nothing is interrupted but the run: an alarm of the system would raise between
    any two instructions, in the middle of an import or while somebody holds a lock.
    """
    end = time.perf_counter() + seconds

    def check(t: float) -> None:
        if time.perf_counter() > end:
            raise TimeIsUp(f"stopped after {seconds:g} s")

    return check
