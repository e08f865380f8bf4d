"""One emitted state derivative: its parts, what they take, and what their operations alone would take."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from ncgen.comparisons.rivals import Inputs, exact, handwritten, relative_error
from ncgen.comparisons.rivals.base import own_start
from ncgen.mechanism.kernels import Kernels
from ncgen.mechanism.library import CompiledKernels
from ncgen.methods.method import Method
from ncgen.program.ir.blocks import Program
from ncgen.program.ir.cost import cost
from ncgen.report.clock import Run, Spread, measure, repeated
from ncgen.report.derivative import motion
from ncgen.report.repeat import OPERATIONS, KernelCall, arithmetic, runner
from ncgen.solver.engines.acceleration_forms import all_coordinates, has_emitted_recursion
from ncgen.solver.engines.capabilities import is_emitted
from ncgen.solver.engines.partition_dynamics import dynamics as dynamics_in_c
from ncgen.solver.formalisms.coordinate_partitioning import motion_at

REFINED = "accelerations, refined"
COMBINATIONS: dict[str, tuple[tuple[str, ...], str | None]] = {
    "residual": (("phi",), None),
    "Newton step": (("newton",), None),
    "accelerations": ((), "acceleration"),
    REFINED: ((), REFINED),
    "all, with one Newton step": (("phi", "newton"), "acceleration"),
}
"""What is measured: functions of the position, and one of the velocity."""

STAGE = "a stage of a default run"
"""The derivative of all coordinates, which needs no Newton step."""

SPEED = 1.0
"""Independent velocities at which the derivative is measured."""


def arithmetic_rate() -> float:
    """Multiplications and additions per second of one core, one number at a time."""
    return OPERATIONS / measure({"rate": arithmetic()})["rate"].median


@dataclass(frozen=True, eq=False)
class RatedPart:
    """What computes the accelerations of the independent coordinates: run; values after a run; operations, None where nobody knows."""

    run: Run
    values: Callable[[], np.ndarray]
    operations: int | None = None


OtherParts: TypeAlias = Callable[[CompiledKernels, np.ndarray, np.ndarray], dict[str, RatedPart]]
"""(kernels, q, zd) -> what else has the accelerations of this state, by name."""


def derivative_records(
    kernels: CompiledKernels, rate: float, others: OtherParts = lambda kernels, q, zd: {}, worst: Mapping[str, float] | None = None
) -> list[dict]:
    """Parts of the state derivative in C and in Python; empty where the mechanism has no such code.

    worst: {part: the largest of its errors in many positions}, where it is known
    error: relative, of the independent accelerations against the reference in Python
    """
    q, partitions = own_start(kernels)
    if not is_emitted(kernels, partitions):
        return []
    zd = np.full(len(partitions.velocity.independent), SPEED)
    _, parts, programs = emitted_parts(kernels)
    motion, independent = motion_at(kernels, partitions.velocity, 0.0, q, zd, kernels.p0), partitions.velocity.independent
    runs: dict[str, Run] = {
        name: runner(0.0, q, zd, kernels.p0, [parts[at] for at in positions], parts[velocity] if velocity else None)
        for name, (positions, velocity) in COMBINATIONS.items()
    }
    runs |= {"in Python": repeated(lambda: motion_at(kernels, partitions.velocity, 0.0, q, zd, kernels.p0))}
    more = _student(kernels, q, zd) | others(kernels, q, zd) | _stage(kernels, q, motion.qd, independent)
    spent = measure(runs | {name: each.run for name, each in more.items()})
    error = _error(kernels, q, parts, motion.qdd[independent]) | {
        name: relative_error(each.values(), motion.qdd[independent]) for name, each in more.items()
    }
    counts = _counts(programs) | {name: each.operations for name, each in more.items()}
    return [_record(name, spread, counts.get(name), rate, error.get(name), (worst or {}).get(name)) for name, spread in spent.items()]


def _stage(kernels: CompiledKernels, q: np.ndarray, qd: np.ndarray, independent: np.ndarray) -> dict[str, RatedPart]:
    """The derivative that default runs take, if they take one."""
    counts = motion(kernels)
    if counts is None or not has_emitted_recursion(kernels, Method.of("lagrange", "dop853")):
        return {}
    made = all_coordinates(kernels, form="emitted")
    call = KernelCall(made._dynamics.motion.derivative, 2 * kernels.n + 2, (kernels, made))
    run = runner(0.0, q, qd, made.with_prepared(kernels.p0), [], call)
    return {STAGE: RatedPart(run, lambda: call.out[independent], counts["derivative"])}


def emitted_parts(kernels: CompiledKernels) -> tuple[np.ndarray, dict[str, KernelCall], dict[str, Program]]:
    """A closed position, the functions phi, newton, acceleration and the refined one as calls, and their programs."""
    q, partitions = own_start(kernels)
    emitted, refined = (dynamics_in_c(kernels, partitions, form, q, kernels.p0) for form in ("emitted", "refined"))
    programs = {"phi": kernels.programs.programs["phi"]}
    programs |= {name: getattr(emitted.written.programs, name) for name in ("newton", "acceleration")}
    programs |= {REFINED: refined.written.programs.acceleration}
    functions = {"phi": kernels.function("phi"), REFINED: refined._dynamics.acceleration}
    functions |= {name: getattr(emitted._dynamics, name) for name in ("newton", "acceleration")}
    return q, {name: KernelCall(functions[name], program.size, (kernels, emitted, refined)) for name, program in programs.items()}, programs


def _counts(programs: dict[str, Program]) -> dict[str, int | None]:
    return {
        name: sum(cost(programs[program]).total for program in (*positions, *([velocity] if velocity else [])))
        for name, (positions, velocity) in COMBINATIONS.items()
    }


def _student(kernels: Kernels, q: np.ndarray, zd: np.ndarray) -> dict[str, RatedPart]:
    """The hand-written derivative, started from the position itself."""
    module = handwritten(kernels)
    if module is None:
        return {}
    y, guess = np.concatenate([zd, q[module.INDEPENDENT]]), q.copy()

    def rates() -> np.ndarray:
        return module.derivative(0.0, y, guess)

    return {"hand-written NumPy": RatedPart(repeated(rates), lambda: rates()[: len(zd)])}


def _error(kernels: Kernels, q: np.ndarray, parts: dict[str, KernelCall], expected: np.ndarray) -> dict[str, float]:
    """Errors of what the functions have just written."""
    errors = {"residual": float(np.max(np.abs(parts["phi"].out - exact(kernels, "phi", Inputs(q, q, kernels.p0)))))}
    for name, call in (("accelerations", "acceleration"), ("all, with one Newton step", "acceleration"), (REFINED, REFINED)):
        errors[name] = relative_error(parts[call].out[kernels.n : kernels.n + len(expected)], expected)
    return errors


def _record(name: str, spread: Spread, operations: int | None, rate: float, error: float | None, worst: float | None) -> dict:
    record = {"case": "state derivative", "tool": name, "error": error, "worst": worst} | spread.seconds()
    return record if operations is None else record | {"operations": operations, "floor": operations / rate}
