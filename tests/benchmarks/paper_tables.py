"""The paper's Tables 9 and 10 again: a simulation by every integrator with derivatives from every source.

Table 9 asks what the derivatives of the rows cost (by hand, automatic, generated), Table 10 what ∂ẏ/∂y gives implicit methods.
"""

from __future__ import annotations

import copy
import time
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp
from scipy.sparse import csr_array

from benchmarks.rivals.casadi_tangents import with_tangents
from benchmarks.students import Derivative, hand_written
from ncgen.comparisons.falls import end_state
from ncgen.comparisons.rivals.base import differentiable, handwritten
from ncgen.comparisons.rivals.differences import Slope, central, complex_step, jacobian
from ncgen.comparisons.rivals.exact import relative_error
from ncgen.compiler import compile
from ncgen.errors import NcgenError
from ncgen.mechanism.kernels import Kernels
from ncgen.methods.table import INTEGRATORS
from ncgen.model import Model
from ncgen.report.precision import own_run, tolerances
from ncgen.solver.formalisms.coordinate_partitioning import Motion, StepStart, motion
from ncgen.solver.formalisms.dynamics_jacobian import partitioned_jacobian
from ncgen.solver.integrators.solvers import ODE_SOLVERS
from ncgen.solver.motions.entry_points import simulate
from ncgen.solver.positions.partition import determined
from ncgen.solver.runs.run import Initial
from ncgen.solver.runs.start import begin

EXPLICIT = ("adams", "dopri5", "bdf")
"""The paper's ode113, ode45 and ode15s."""

IMPLICIT = ("bdf", "radau", "lsoda")
TOLERANCES = tolerances(1e-6)
MOST = 20_000
"""Evaluations after which a run is given up."""


class _TooMany(Exception):
    pass


def table_9(model: Model) -> Iterator[dict]:
    """One record a run: integrator, source, seconds, error (of the end position), evaluations, note; None where it failed."""
    kernels = compile(model, "c")
    duration, end = _task(kernels)
    if end is None:
        return
    for integrator in EXPLICIT:
        if (student := hand_written(kernels)) is not None:
            yield _solved(integrator, "hand-written NumPy", *student, duration, end)
        for source, variant in _variants(model, kernels):
            yield _simulated(variant, integrator, source, duration, end, "python")
        if INTEGRATORS[integrator].in_c:
            yield _simulated(kernels, integrator, "generated C, whole run", duration, end, "emitted")


def table_10(model: Model) -> Iterator[dict]:
    """Implicit integrators with a numerical, an automatic and the generated ∂ẏ/∂y; records as in Table 9."""
    kernels = compile(model, "c")
    duration, end = _task(kernels)
    if end is None:
        return
    sources = {"generated C, numerical": None, "generated C, CasADi": with_tangents(kernels), "generated C, generated": kernels}
    for integrator in IMPLICIT:
        if (student := hand_written(kernels)) is not None:
            yield _solved(integrator, "hand-written NumPy, numerical", *student, duration, end)
        for source, tangents in sources.items():
            if tangents is None and "numerical" not in source:
                continue
            run = _Partitioned(kernels, tangents)
            jac = run.jacobian if tangents else None
            yield _solved(integrator, source, run.derivative, run.y0, run.names, duration, end, jac)


def first_slopes(model: Model) -> Iterator[dict]:
    """How far ∂ẏ/∂y by differences is off at the start of the run, in the steps that SciPy's implicit methods take first.

    Those are √ε max(|y|, atol): where a coordinate is zero, a step is smaller than what Newton's method corrects, so that the other
    coordinates stay or move by rounding alone. Records: derivative, atol, error relative to the largest entry.
    """
    kernels = compile(model, "c")
    if _task(kernels)[1] is None:
        return
    run = _Partitioned(kernels, kernels)
    exact = run.jacobian(0.0, run.y0)
    student = hand_written(kernels)
    derivatives = {"generated C": run.derivative} | ({"hand-written NumPy": student[0]} if student else {})
    for name, derivative in derivatives.items():
        for atol in (1e-6, 1e-8, 1e-10):
            steps = np.sqrt(np.finfo(float).eps) * np.maximum(np.abs(run.y0), atol)
            here = derivative(0.0, run.y0)
            slopes = [(derivative(0.0, run.y0 + h * unit) - here) / h for h, unit in zip(steps, np.eye(len(steps)), strict=True)]
            yield {"derivative": name, "atol": atol, "error": relative_error(np.column_stack(slopes), exact)}


def _task(kernels: Kernels) -> tuple[float, dict[str, float] | None]:
    """The model's own duration, and where it ends; None where ncgen cannot find out."""
    duration = own_run(kernels)[0]
    return duration, end_state(kernels, duration) if kernels.m else None


def _variants(model: Model, kernels: Kernels) -> Iterator[tuple[str, Kernels]]:
    """(source of Φ_q, kernels), slowest first."""
    numpy = compile(model, "numpy")
    if differentiable(kernels):
        yield "Φ_q by complex steps", _with_jacobian(numpy, complex_step)
        yield "Φ_q by differences", _with_jacobian(kernels, central)
    yield "generated NumPy", numpy
    yield "generated C", kernels


def _with_jacobian(kernels: Kernels, slope: Slope) -> Kernels:
    """The same kernels with Φ_q from Φ."""
    other = copy.copy(kernels)
    other.jacobian = lambda q, t=0.0, p=None: jacobian(slope, lambda x: kernels.phi(x, t, p), np.asarray(q))
    other.phi_q = lambda q, t=0.0, p=None: csr_array(other.jacobian(q, t, p))
    return other


class _Partitioned:
    """The state derivative on independent coordinates and its Jacobian, each evaluation starting from the last one.

    tangents: the kernels whose tangents the Jacobian is made of; None for none; times count from the beginning of the run
    """

    def __init__(self, kernels: Kernels, tangents: Kernels | None = None) -> None:
        initial = Initial.from_arguments(kernels, **own_run(kernels)[1])
        begun = begin(kernels, initial, partitioned=True)
        self.kernels, self.p, self.partitions, self.begin = kernels, begun.p, determined(begun.partitions), initial.t
        self.start = StepStart(initial.t, begun.q, begun.qd, self.p)
        z = self.partitions.position.independent
        self.names = [kernels.coordinates[i] for i in z]
        self.y0 = np.concatenate([begun.qd[z], begun.q[z]])
        self.tangents = tangents
        if tangents is not None:
            self.jacobian(0.0, self.y0)  # compiles

    def _motion(self, t: float, y: np.ndarray) -> Motion:
        count = len(y) // 2
        now = motion(self.kernels, self.partitions, self.start, self.begin + t, y[count:], y[:count])
        self.start = StepStart(now.t, now.q, now.qd, self.p)
        return now

    def derivative(self, t: float, y: np.ndarray) -> np.ndarray:
        now = self._motion(t, y)
        z = self.partitions.position.independent
        return np.concatenate([now.qdd[z], now.qd[z]])

    def jacobian(self, t: float, y: np.ndarray) -> np.ndarray:
        """∂ẏ/∂y. Raises NcgenError where there are no tangents to make it of."""
        if self.tangents is None:
            raise NcgenError(f"{self.kernels.name}: there are no tangents here to make a Jacobian of")
        return partitioned_jacobian(self.tangents, self.partitions, self._motion(t, y), self.p)[:-1, :-1]


def _simulated(kernels: Kernels, integrator: str, source: str, duration: float, end: Mapping[str, float], engine: str) -> dict:
    """A run by ncgen's own engines."""
    try:
        options: dict[str, Any] = {
            "formalism": "coordinate-partitioning",
            "integrator": integrator,
            "engine": engine,
            "points": 2,
            **own_run(kernels)[1],
            **TOLERANCES,
        }
        simulate(kernels, duration / 100, **options)  # compiles
        start = time.perf_counter()
        run = simulate(kernels, duration, **options)
        seconds = time.perf_counter() - start
    except NcgenError as error:
        return _record(integrator, source, None, None, None, str(error))
    error = max(abs(run[name][-1] - value) for name, value in end.items())
    note = "" if engine == "python" else f"engine: {run.engine}; the integration alone {1e3 * run.statistics.seconds:.2f} ms"
    return _record(integrator, source, seconds, float(error), run.statistics.evaluations, note)


def _solved(
    integrator: str,
    source: str,
    derivative: Derivative,
    y0: np.ndarray,
    names: list[str],
    duration: float,
    end: Mapping[str, float],
    jac: Derivative | None = None,
) -> dict:
    """A run by the integrator alone, over a derivative that is given."""
    count = 0

    def counted(t: float, y: np.ndarray) -> np.ndarray:
        nonlocal count
        count += 1
        if count > MOST:
            raise _TooMany
        return derivative(t, y)

    start = time.perf_counter()
    options: dict[str, Any] = {"method": ODE_SOLVERS[integrator], **TOLERANCES} | ({} if jac is None else {"jac": jac})
    try:
        found = solve_ivp(counted, (0.0, duration), y0, **options)
    except _TooMany:
        seconds = time.perf_counter() - start
        return _record(integrator, source, seconds, None, count - 1, f"given up after {MOST:,} evaluations")
    except (NcgenError, ArithmeticError, np.linalg.LinAlgError) as error:
        return _record(integrator, source, None, None, count, str(error))
    seconds = time.perf_counter() - start
    last = dict(zip(names, found.y[len(names) :, -1], strict=True))
    error = max((abs(last[name] - value) for name, value in end.items() if name in last), default=None)
    return _record(integrator, source, seconds, None if error is None else float(error), count, "" if found.success else found.message)


def _record(integrator: str, source: str, seconds: float | None, error: float | None, evaluations: int | None, note: str) -> dict:
    return {
        "integrator": integrator,
        "source": source,
        "seconds": seconds,
        "error": error,
        "evaluations": evaluations,
        "note": note,
    }


HEAD = ("integrator", "derivatives", "seconds", "error", "evaluations", "")


def table(records: list[dict]) -> list[tuple[str, ...]]:
    """Rows of cells, titles first."""
    rows: list[tuple[str, ...]] = [HEAD]
    for r in records:
        seconds = "" if r["seconds"] is None else f"{r['seconds']:.4f}"
        error = "" if r["error"] is None else f"{r['error']:.1e}"
        count = "" if r["evaluations"] is None else f"{r['evaluations']:,}"
        rows.append((r["integrator"], r["source"], seconds, error, count, r["note"]))
    return rows


def slope_table(records: list[dict]) -> list[tuple[str, ...]]:
    """Rows of cells, titles first."""
    return [("derivative", "atol", "error of ∂ẏ/∂y"), *((r["derivative"], f"{r['atol']:.0e}", f"{r['error']:.1e}") for r in records)]


def paper_rows(kernels: Kernels) -> dict[str, list[tuple[str, ...]]]:
    """{"9": rows, "10": rows} as printed in 2007, where the example has them."""
    module = handwritten(kernels)
    if module is None:
        return {}
    nine = [("Matlab integrator", "by hand, s", "ADiMat, s")]
    nine += [(name, f"{hand}", f"{automatic}") for name, (hand, automatic) in module.PAPER_TABLE_9.items()]
    ten = [("Matlab integrator", "numerical, s", "ADiMat, s")]
    ten += [(name, f"{numerical}", f"{automatic}") for name, (numerical, automatic) in module.PAPER_TABLE_10.items()]
    return {"9": nine, "10": ten}
