"""One emitted state derivative: its parts, what they take, and what their operations alone would take."""

from __future__ import annotations

import numpy as np

from ncgen.comparisons.positions import largest_errors
from ncgen.comparisons.rivals import Inputs, exact, handwritten, relative_error
from ncgen.comparisons.rivals.articulated import rival as articulated
from ncgen.comparisons.rivals.base import own_start
from ncgen.mechanism.kernels import Kernels
from ncgen.mechanism.library import CompiledKernels
from ncgen.methods.method import Method
from ncgen.program.ir.blocks import Program
from ncgen.program.ir.cost import cost
from ncgen.report.clock import Run, Spread, measure, repeated
from ncgen.report.derivative import motion
from ncgen.report.repeat import OPERATIONS, Call, arithmetic, runner
from ncgen.solver.engines.compiled import all_coordinates, is_emitted, is_written_out, split_of
from ncgen.solver.engines.compiled import dynamics as dynamics_in_c
from ncgen.solver.formalisms.coordinate_partitioning import motion_at
from ncgen.solver.positions.partition import Partitions

REFINED = "accelerations, refined"
COMBINATIONS: dict[str, tuple[tuple[str, ...], str | None]] = {
    "residual": (("phi",), None),
    "Newton step": (("newton",), None),
    "accelerations": ((), "acceleration"),
    REFINED: ((), REFINED),
    "all, with one Newton step": (("phi", "newton"), "acceleration"),
}
"""What is measured: functions of the position, and one of the velocity."""

ARTICULATED = "articulated body, CasADi"
"""What computes the accelerations of an arm from its angles, in C that another generator writes."""

STAGE = "a stage of a default run"
"""The derivative of all coordinates, which needs no Newton step."""

SPEED = 1.0
"""Independent velocities at which the derivative is measured."""


def arithmetic_rate() -> float:
    """Multiplications and additions per second of one core, one number at a time."""
    return OPERATIONS / measure({"rate": arithmetic()})["rate"].median


def derivative_records(kernels: CompiledKernels, rate: float) -> list[dict]:
    """Parts of the state derivative in C and in Python; empty where the mechanism has no such code.

    error: relative, of the independent accelerations against the reference in Python; worst: the largest of many positions
    against long double
    """
    q, partitions = own_start(kernels)
    if not is_emitted(kernels, partitions):
        return []
    zd = np.full(len(partitions.velocity.independent), SPEED)
    _, parts, programs = emitted_parts(kernels)
    refined = dynamics_in_c(kernels, partitions, "refined", q, kernels.p0)
    programs[REFINED] = refined.written.programs.acceleration
    parts[REFINED] = Call(refined._dynamics.acceleration, programs[REFINED].size, (kernels, refined))
    runs: dict[str, Run] = {
        name: runner(0.0, q, zd, kernels.p0, [parts[at] for at in positions], parts[velocity] if velocity else None)
        for name, (positions, velocity) in COMBINATIONS.items()
    }
    runs |= {"in Python": repeated(lambda: motion_at(kernels, partitions.velocity, 0.0, q, zd, kernels.p0))}
    runs |= _student(kernels, q, zd)
    other = articulated(kernels, split_of(partitions.velocity))
    if other:
        runs[ARTICULATED] = runner(0.0, q, zd, kernels.p0, [], other[0])
    here, part = motion_at(kernels, partitions.velocity, 0.0, q, zd, kernels.p0), partitions.velocity.independent
    stage = _stage(kernels)
    if stage:
        given = all_coordinates(kernels, form="emitted").with_prepared(kernels.p0)
        runs[STAGE] = runner(0.0, q, here.qd, given, [], stage[0])
    spent = measure(runs)
    error = _error(kernels, partitions, q, zd, parts)
    counts = _counts(programs)
    if stage:
        counts[STAGE] = stage[1]
        error[STAGE] = relative_error(stage[0].out[kernels.n :][part], here.qdd[part])
    if other:
        error[ARTICULATED] = relative_error(other[0].out, here.qdd[part])
        counts[ARTICULATED] = other[1]
    ways = {"accelerations": parts["acceleration"], REFINED: parts[REFINED]}
    worst = largest_errors(kernels, q, ways, programs[REFINED])
    return [_record(name, spread, counts.get(name), rate, error.get(name), worst.get(name)) for name, spread in spent.items()]


def _stage(kernels: CompiledKernels) -> tuple[Call, int] | None:
    """The derivative that default runs take, and its operations; None where they take none."""
    counts = motion(kernels)
    if counts is None or not is_written_out(kernels, Method.of("lagrange", "dop853")):
        return None
    made = all_coordinates(kernels, form="emitted")
    return Call(made._dynamics.motion.derivative, 2 * kernels.n + 2, (kernels, made)), counts["derivative"]


def emitted_parts(kernels: CompiledKernels) -> tuple[np.ndarray, dict[str, Call], dict[str, Program]]:
    """A closed position, the functions phi, newton and acceleration as calls, and their programs."""
    q, partitions = own_start(kernels)
    emitted = dynamics_in_c(kernels, partitions, "emitted", q, kernels.p0)
    programs = {"phi": kernels.programs.programs["phi"]}
    programs |= {name: getattr(emitted.written.programs, name) for name in ("newton", "acceleration")}
    functions = {"phi": kernels.function("phi")}
    functions |= {name: getattr(emitted._dynamics, name) for name in ("newton", "acceleration")}
    return q, {name: Call(functions[name], program.size, (kernels, emitted)) for name, program in programs.items()}, programs


def _counts(programs: dict[str, Program]) -> dict[str, int]:
    return {
        name: sum(cost(programs[part]).total for part in (*positions, *([velocity] if velocity else [])))
        for name, (positions, velocity) in COMBINATIONS.items()
    }


def _student(kernels: Kernels, q: np.ndarray, zd: np.ndarray) -> dict[str, Run]:
    """The hand-written derivative, started from the position itself."""
    module = handwritten(kernels)
    if module is None:
        return {}
    y, guess = np.concatenate([zd, q[module.INDEPENDENT]]), q.copy()
    return {"hand-written NumPy": repeated(lambda: module.derivative(0.0, y, guess))}


def _error(kernels: Kernels, partitions: Partitions, q: np.ndarray, zd: np.ndarray, parts: dict[str, Call]) -> dict[str, float]:
    """Errors of what the functions have just written."""
    here = motion_at(kernels, partitions.velocity, 0.0, q, zd, kernels.p0)
    part = partitions.velocity.independent
    found = {"residual": float(np.max(np.abs(parts["phi"].out - exact(kernels, "phi", Inputs(q, q, kernels.p0)))))}
    for name, call in (("accelerations", "acceleration"), ("all, with one Newton step", "acceleration"), (REFINED, REFINED)):
        found[name] = relative_error(parts[call].out[kernels.n : kernels.n + len(part)], here.qdd[part])
    return found | _student_error(kernels, q, zd, here.qdd[part])


def _student_error(kernels: Kernels, q: np.ndarray, zd: np.ndarray, expected: np.ndarray) -> dict[str, float]:
    module = handwritten(kernels)
    if module is None:
        return {}
    rate = module.derivative(0.0, np.concatenate([zd, q[module.INDEPENDENT]]), q.copy())
    return {"hand-written NumPy": relative_error(rate[: len(zd)], expected)}


def _record(name: str, spread: Spread, operations: int | None, rate: float, error: float | None, worst: float | None) -> dict:
    record = {"case": "state derivative", "tool": name, "error": error, "worst": worst} | spread.seconds()
    return record if operations is None else record | {"operations": operations, "floor": operations / rate}
