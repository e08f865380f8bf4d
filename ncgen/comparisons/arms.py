"""Accelerations of longer and longer arms by everything that has them, side by side: `ncgen bench arm`.

Every tool is given angles and their rates in the same random posture; in ncgen the angles are among the natural coordinates, which have
closed there. Expected values are those of ncgen's recursion evaluated with 50 digits, where positions are closed to as many: other
programs, which share nothing with it, come out at the same numbers.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass

import mpmath
import numpy as np

from ncgen.comparisons.batches import STATES
from ncgen.comparisons.rivals import articulated, mujoco, pinocchio, relative_error
from ncgen.comparisons.rivals.base import own_start
from ncgen.comparisons.rivals.exact import DIGITS, exact_motion
from ncgen.compiler import compile
from ncgen.errors import NcgenError
from ncgen.exchange.examples import example_module
from ncgen.mechanism.library import CompiledKernels
from ncgen.mechanism.runtime import EmittedDynamics
from ncgen.model.values import evaluate as value_of
from ncgen.program.ir.cost import cost
from ncgen.program.programs import Split
from ncgen.report.clock import Run, measure, repeated
from ncgen.report.derivative import motion
from ncgen.report.repeat import Call, runner
from ncgen.solver.engines.compiled import all_coordinates, dynamics, split_of
from ncgen.solver.motions.batch import accelerations_batch

COUNTS = (7, 20, 50)
"""Joints."""

REACH, SPEED = 1.0, 1.0
"""How far the angles are from the start, and their rates (rad, rad/s)."""

ROUNDS = 15

FIRST = "ncgen: accelerations and positions"

READY = """
import json, sys, time
import numpy, scipy.linalg, cffi.cparser, sympy, ncgen
import ncgen.emit.sources, ncgen.mechanism.runtime, ncgen.program.assemble, ncgen.program.motions.dynamics, ncgen.solver.engines.compiled
from ncgen.exchange.examples import example_module
start = time.perf_counter()
kernels = ncgen.compile(example_module("arm").build(int(sys.argv[1])), "c")
ncgen.start(kernels).step(1e-3)
print(time.perf_counter() - start)
"""


@dataclass(frozen=True)
class Contender:
    """values: the accelerations of the angles, after a run; operations, ready (seconds from the model): None where nobody knows;
    states: how many of them one call of the run computes"""

    name: str
    run: Run
    values: Callable[[], np.ndarray]
    operations: int | None = None
    ready: float | None = None
    states: int = 1


@dataclass(frozen=True, eq=False)
class Posture:
    """An arm in a closed position, q, with rates of its angles; expected: their accelerations."""

    kernels: CompiledKernels
    emitted: EmittedDynamics
    split: Split
    q: np.ndarray
    rates: np.ndarray
    expected: np.ndarray

    @property
    def angles(self) -> np.ndarray:
        return self.q[list(self.split.independent)]


def posture(count: int) -> Posture:
    """A random one."""
    kernels = compile(example_module("arm").build(count), "c")
    assert isinstance(kernels, CompiledKernels), "compiled a line above"
    (start, partitions), rng = own_start(kernels), np.random.default_rng(count)
    split = split_of(partitions.velocity)
    emitted = dynamics(kernels, partitions, "emitted", start, kernels.p0)
    programs = emitted.written.programs
    rates = SPEED * rng.uniform(-1, 1, count)
    start = start.copy()
    start[list(split.independent)] += REACH * rng.uniform(-1, 1, count)
    with mpmath.workdps(DIGITS):
        q, zd = ([mpmath.mpf(float(x)) for x in numbers] for numbers in (start, rates))
        found = exact_motion(programs, q, zd, kernels.p0)
        expected = np.array([float(x) for x in found[kernels.n : -2]])
    return Posture(kernels, emitted, split, np.array([float(x) for x in q]), rates, expected)


def arm_records(counts: Iterable[int] = COUNTS) -> Iterator[list[dict]]:
    """The records of one number of joints after the other: count, tool, seconds (the least of several), low, high, ratio to the first,
    operations, error, ready."""
    for count in counts:
        place = posture(count)
        contenders = [*own(place), *others(place)]
        spent = measure({c.name: c.run for c in contenders}, ROUNDS)
        first = spent[FIRST].least
        records = []
        for c in contenders:
            times = spent[c.name].seconds(c.states) | {"seconds": spent[c.name].least / c.states}
            error = relative_error(c.values(), place.expected)
            record = {"case": "arm", "count": count, "tool": c.name, "error": error, "operations": c.operations, "ready": c.ready}
            records.append(record | times | {"ratio": times["seconds"] / first})
        yield records


def own(place: Posture) -> Iterator[Contender]:
    """ncgen's state derivatives."""
    kernels, emitted, q = place.kernels, place.emitted, place.q
    programs, n = emitted.written.programs, kernels.n
    newton, acceleration = (getattr(programs, name) for name in ("newton", "acceleration"))
    functions = (emitted._dynamics.newton, newton), (emitted._dynamics.acceleration, acceleration)
    calls = [Call(function, program.size, (kernels, emitted)) for function, program in functions]

    def zdd() -> np.ndarray:
        return calls[1].out[n:-2].copy()

    both = cost(newton).total + cost(acceleration).total
    yield Contender(FIRST, runner(0.0, q, place.rates, kernels.p0, calls[:1], calls[1]), zdd, both)
    alone = runner(0.0, q, place.rates, kernels.p0, [], calls[1])
    yield Contender("ncgen: accelerations", alone, zdd, cost(acceleration).total)
    yield _side_by_side(place, both)
    counts, made = motion(kernels), all_coordinates(kernels, form="emitted")
    if counts is not None and made.is_emitted:
        stage = Call(made._dynamics.motion.derivative, 2 * n + 2, (kernels, made))
        qd = calls[1].out[:n]
        alone(1)
        run = runner(0.0, q, qd.copy(), made.with_prepared(kernels.p0), [], stage)
        found = list(place.split.independent)
        ready = _ready(len(found))
        yield Contender("ncgen: a stage of a default run", run, lambda: stage.out[n : 2 * n][found], counts["derivative"], ready)


def _side_by_side(place: Posture, operations: int) -> Contender:
    """Many states in one call on one core; the whole call from Python, in place."""
    q, rates = (np.tile(x, (STATES, 1)) for x in (place.q, place.rates))
    batch = accelerations_batch(place.kernels, q, rates)
    run = repeated(lambda: accelerations_batch(place.kernels, batch.q, rates, threads=1, out=batch))
    return Contender(f"ncgen: {STATES:,} states in one call", run, lambda: batch.zdd[-1], operations, states=STATES)


def _ready(count: int) -> float | None:
    """Seconds from the model to the first step, with an empty cache, in a process of its own."""
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-c", READY, json.dumps(count)]
        done = subprocess.run(command, env=os.environ | {"NCGEN_CACHE_DIR": folder}, capture_output=True, text=True)
    return float(done.stdout) if done.returncode == 0 else None


def others(place: Posture) -> Iterator[Contender]:
    """Those that are installed."""
    kernels, q, rates = place.kernels, place.q, place.rates
    places, model = list(place.split.independent), kernels.model
    if found := articulated.rival(kernels, place.split):
        call, operations, ready = found
        yield Contender("CasADi's C, articulated body", runner(0.0, q, rates, kernels.p0, [], call), call.out.copy, operations, ready)
    tree = articulated.joints(kernels, place.split)
    gravity = [value_of(g, model.parameters, "gravity") for g in model.gravity_field]
    if (call := pinocchio.in_cpp(tree, places, gravity)) is not None:
        yield Contender("Pinocchio, aba in C++", runner(0.0, q, rates, kernels.p0, [], call), call.out.copy)
    for name, module in (("Pinocchio, aba", pinocchio), ("MuJoCo, mj_forward", mujoco)):
        clock = time.perf_counter()
        try:
            made = module.InPython(tree, gravity)
        except (ImportError, NcgenError):
            continue
        ready = time.perf_counter() - clock
        made.at(place.angles, rates)
        yield Contender(f"{name} from Python", repeated(made), made.accelerations, None, ready)
        if isinstance(made, mujoco.InPython) and (call := made.in_c(places)) is not None:
            yield Contender(f"{name} in C", runner(0.0, q, rates, kernels.p0, [], call), call.out.copy)


# -- for people --------------------------------------------------------------------------------------------------------


def title(count: int) -> str:
    return f"arm of {count} joints: accelerations in a random posture; least ns a state, operations, error against 50 digits"


def rows(records: list[dict]) -> list[tuple[str, ...]]:
    """Titles and lines."""
    found: list[tuple[str, ...]] = [("", "ns", "ratio", "operations", "error", "ready, s")]
    for r in records:
        ready = "" if r["ready"] is None else f"{r['ready']:.2g}"
        found.append((r["tool"], f"{1e9 * r['seconds']:.0f}", f"{r['ratio']:.2f}", str(r["operations"] or ""), f"{r['error']:.1e}", ready))
    return found
