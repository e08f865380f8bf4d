"""Accelerations of longer and longer arms by everything that has them, side by side: `bench.py arm --arms`.

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
from functools import partial
from pathlib import Path
from typing import Any

import mpmath
import numpy as np

import ncgen
from benchmarks.exact_motion import exact_motion, moved
from benchmarks.rivals import articulated, mujoco, pinocchio
from ncgen.comparisons.batches import STATES
from ncgen.comparisons.rivals import relative_error
from ncgen.comparisons.rivals.base import own_start
from ncgen.comparisons.rivals.exact import DIGITS
from ncgen.compiler import compile
from ncgen.errors import NcgenError
from ncgen.exchange.examples import example_module
from ncgen.exchange.robots import load_robot
from ncgen.mechanism.library import CompiledKernels
from ncgen.mechanism.runtime import EmittedDynamics
from ncgen.model import Model
from ncgen.model.values import evaluate as value_of
from ncgen.program.ir.cost import cost
from ncgen.program.programs import Split
from ncgen.report.clock import Run, measure, repeated
from ncgen.report.derivative import motion
from ncgen.report.repeat import KernelCall, runner
from ncgen.solver.engines.acceleration_forms import all_coordinates
from ncgen.solver.engines.partition_dynamics import dynamics, split_of
from ncgen.solver.motions.entry_points import simulate

COUNTS = (7, 20, 50)
"""Joints."""

REACH, SPEED = 1.0, 1.0
"""How far the angles are from the start, and their rates (rad, rad/s)."""

ROUNDS = 15

SEED = 1
"""Of the random arm that stands beside the example."""

DURATION, STEP = 1.0, 1e-3
"""Of whole runs, and of their steps by rk4 (s)."""

RTOL, TIGHT = 1e-8, 1e-12
"""Of whole runs that choose their steps, and of the one whose end theirs are held to."""

FIRST = "ncgen: accelerations and positions"

READY = """
import json, sys, time
import numpy, scipy.linalg, cffi.cparser, sympy, ncgen
import ncgen.emit.sources, ncgen.mechanism.constrained_dynamics, ncgen.program.assemble, ncgen.program.motions.dynamics
import ncgen.solver.engines.compiled
from benchmarks.arms import arm
start = time.perf_counter()
kernels = ncgen.compile(arm(*json.loads(sys.argv[1])), "c")
ncgen.start(kernels).step(1e-3)
print(time.perf_counter() - start)
"""


@dataclass(frozen=True, eq=False)
class Contender:
    """values: the accelerations of the angles after a run, or what else `expected` holds; operations, ready (seconds from the model): None
    where nobody knows; states: how many of them one call of the run computes"""

    name: str
    run: Run
    values: Callable[[], np.ndarray]
    operations: int | None = None
    ready: float | None = None
    states: int = 1
    expected: np.ndarray | None = None


@dataclass(frozen=True, eq=False)
class Posture:
    """An arm in a closed position, q, with rates of its angles; expected: their accelerations."""

    kernels: CompiledKernels
    emitted: EmittedDynamics
    split: Split
    q: np.ndarray
    rates: np.ndarray
    expected: np.ndarray
    arm: tuple[int, int | None]

    @property
    def angles(self) -> np.ndarray:
        return self.q[list(self.split.independent)]


LINK = """
<link name="link{i}"><inertial><origin xyz="{half!r} 0 0" rpy="{turn}"/><mass value="{mass!r}"/>
<inertia ixx="{ixx!r}" iyy="{iyy!r}" izz="{izz!r}" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="psi{i}" type="continuous"><parent link="link{before}"/><child link="link{i}"/><axis xyz="{axis}"/>
<origin xyz="{length!r} 0 0" rpy="{frame}"/></joint>"""


def random_arm(count: int, seed: int) -> Model:
    """An arm from a robot's file (URDF) whose links' frames are turned by chance: they have 0.3 to 3 kg and are 0.2 to 0.5 m long, and the
    hinges turn about y and z in turns."""
    rng, length, text = np.random.default_rng(seed), 0.0, '<link name="link0"/>'
    for i in range(1, count + 1):
        frame, turn = (" ".join(map(repr, rng.uniform(-np.pi, np.pi, 3).tolist())) for _ in range(2))
        before, size, mass = length, float(rng.uniform(0.2, 0.5)), float(rng.uniform(0.3, 3.0))
        ixx, iyy, izz = (part * mass * size**2 / 12 for part in (0.2, 0.9, 1.0))
        text += LINK.format(
            i=i, before=i - 1, length=before, half=size / 2, mass=mass, axis="0 1 0" if i % 2 else "0 0 1", frame=frame, turn=turn,
            ixx=ixx, iyy=iyy, izz=izz,
        )  # fmt: skip
        length = size
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "arm.urdf"
        path.write_text(f'<robot name="random_arm">{text}</robot>', encoding="utf-8")
        return load_robot(path)


def arm(count: int, seed: int | None = None) -> Model:
    """The example, or with a seed a random arm."""
    return example_module("arm").build(count) if seed is None else random_arm(count, seed)


def posture(count: int, seed: int | None = None) -> Posture:
    """A random one of an arm."""
    kernels = compile(arm(count, seed), "c")
    assert isinstance(kernels, CompiledKernels), "compiled a line above"
    (start, partitions), rng = own_start(kernels), np.random.default_rng(count)
    split = split_of(partitions.velocity)
    emitted = dynamics(kernels, partitions, "emitted", start, kernels.p0)
    programs = emitted.written.programs
    rates = SPEED * rng.uniform(-1, 1, count)
    moves = REACH * rng.uniform(-1, 1, count)
    with mpmath.workdps(DIGITS):
        q, zd, by = ([mpmath.mpf(float(x)) for x in numbers] for numbers in (start, rates, moves))
        q = moved(programs, q, list(split.independent), by, kernels.p0)
        found = exact_motion(programs, q, zd, kernels.p0)
        expected = np.array([float(x) for x in found[kernels.n : -2]])
    return Posture(kernels, emitted, split, np.array([float(x) for x in q]), rates, expected, (count, seed))


def arm_records(counts: Iterable[int] = COUNTS, seed: int = SEED) -> Iterator[list[dict]]:
    """The records of one number of joints after the other, of the example and of a random arm: count, seed (None: the example), tool,
    seconds (the least of several), low, high, ratio to the first, operations, error, ready."""
    for count, own_seed in ((count, own_seed) for count in counts for own_seed in (None, seed)):
        place = posture(count, own_seed)
        contenders = [*own(place), *whole_runs(place), *others(place)]
        spent = measure({c.name: c.run for c in contenders}, ROUNDS)
        first = spent[FIRST].least
        records = []
        for c in contenders:
            times = spent[c.name].seconds(c.states) | {"seconds": spent[c.name].least / c.states}
            error = relative_error(c.values(), place.expected if c.expected is None else c.expected)
            record = {
                "case": "arm",
                "count": count,
                "seed": own_seed,
                "tool": c.name,
                "error": error,
                "operations": c.operations,
                "ready": c.ready,
            }
            records.append(record | times | {"ratio": times["seconds"] / first})
        yield records


def own(place: Posture) -> Iterator[Contender]:
    """ncgen's state derivatives."""
    kernels, emitted, q = place.kernels, place.emitted, place.q
    programs, n = emitted.written.programs, kernels.n
    newton, acceleration = (getattr(programs, name) for name in ("newton", "acceleration"))
    functions = (emitted._dynamics.newton, newton), (emitted._dynamics.acceleration, acceleration)
    calls = [KernelCall(function, program.size, (kernels, emitted)) for function, program in functions]

    def zdd() -> np.ndarray:
        return calls[1].out[n:-2].copy()

    both = cost(newton).total + cost(acceleration).total
    yield Contender(FIRST, runner(0.0, q, place.rates, kernels.p0, calls[:1], calls[1]), zdd, both)
    alone = runner(0.0, q, place.rates, kernels.p0, [], calls[1])
    yield Contender("ncgen: accelerations", alone, zdd, cost(acceleration).total)
    yield _side_by_side(place, both)
    counts, made = motion(kernels), all_coordinates(kernels, form="emitted")
    if counts is not None and made.is_emitted:
        stage = KernelCall(made._dynamics.motion.derivative, 2 * n + 2, (kernels, made))
        qd = calls[1].out[:n]
        alone(1)
        run = runner(0.0, q, qd.copy(), made.with_prepared(kernels.p0), [], stage)
        found = list(place.split.independent)
        ready = _ready(*place.arm)
        yield Contender("ncgen: a stage of a default run", run, lambda: stage.out[found], counts["derivative"], ready)


def _side_by_side(place: Posture, operations: int) -> Contender:
    """Many states in one call on one core; the whole call from Python, in place."""
    q, rates = (np.tile(x, (STATES, 1)) for x in (place.q, place.rates))
    batch = ncgen.accelerations(place.kernels, q, rates)
    run = repeated(lambda: ncgen.accelerations(place.kernels, batch.q, rates, threads=1, out=batch))
    return Contender(f"ncgen: {STATES:,} states in one call", run, lambda: batch.zdd[-1], operations, states=STATES)


def whole_runs(place: Posture) -> Iterator[Contender]:
    """Runs of DURATION from the posture, called from Python, by an evaluation; their errors are those of the position at the end."""
    names = [place.kernels.coordinates[i] for i in place.split.independent]
    start: dict[str, Any] = {"q0": place.q, "zd0": dict(zip(names, place.rates.tolist(), strict=True)), "points": 2}
    tight = simulate(place.kernels, DURATION, rtol=TIGHT, **start)
    ways: dict[str, dict[str, Any]] = {
        "rk4, 1 ms": {"formalism": "lagrange", "integrator": "rk4", "max_step": STEP},
        f"default, rtol {RTOL:g}": {"rtol": RTOL},
    }
    for name, options in ways.items():
        run = partial(simulate, place.kernels, DURATION, **start, **options)
        done = run()
        evaluations = done.statistics.evaluations
        yield Contender(f"ncgen: a run of {name}", repeated(run), partial(np.array, done.q[-1]), None, None, evaluations, tight.q[-1])


def _ready(count: int, seed: int | None) -> float | None:
    """Seconds from the model to the first step, with an empty cache, in a process of its own."""
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-c", READY, json.dumps([count, seed])]
        paths = {"NCGEN_CACHE_DIR": folder, "PYTHONPATH": os.pathsep.join(sys.path)}
        done = subprocess.run(command, env=os.environ | paths, capture_output=True, text=True)
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


def title(record: dict) -> str:
    which = "arm" if record["seed"] is None else f"random arm (seed {record['seed']})"
    return f"{which} of {record['count']} joints: accelerations in a random posture; least ns a state, operations, error"


def rows(records: list[dict]) -> list[tuple[str, ...]]:
    """Titles and lines."""
    found: list[tuple[str, ...]] = [("", "ns", "ratio", "operations", "error", "ready, s")]
    for r in records:
        ready = "" if r["ready"] is None else f"{r['ready']:.2g}"
        found.append((r["tool"], f"{1e9 * r['seconds']:.0f}", f"{r['ratio']:.2f}", str(r["operations"] or ""), f"{r['error']:.1e}", ready))
    return found
