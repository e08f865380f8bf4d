"""Many states in one call against one at a time: kernels and whole simulations."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping

import numpy as np

from ncgen.comparisons.derivative_parts import emitted_parts
from ncgen.comparisons.rivals import KERNELS
from ncgen.comparisons.rivals.base import own_start
from ncgen.mechanism.kernel_batch import CompiledBatch, available
from ncgen.mechanism.library import CompiledKernels
from ncgen.mechanism.run_arguments import InitialState
from ncgen.mechanism.run_rows import Outcome
from ncgen.report.clock import Run, Spread, measure, repeated
from ncgen.report.precision import tolerances
from ncgen.report.repeat import KernelCall, each, runner
from ncgen.solver.engines.capabilities import is_emitted
from ncgen.solver.engines.compiled import GROWTH
from ncgen.solver.engines.partition_dynamics import dynamics
from ncgen.solver.motions.batch import BatchTrajectory
from ncgen.solver.motions.entry_points import accelerations, simulate
from ncgen.solver.positions.position import TOLERANCE
from ncgen.solver.runs.simulation_options import simulation_of

STATES = 10_000
RUNS = 2_000
"""Simulations in a batch: enough to fill lanes and threads many times over."""

MEASURED = (*KERNELS, "constraints", "mass")
N_SINGLE_SIMULATIONS = 5
"""Simulations one at a time in a sample."""

ROUNDS = 9
ALONE_IN_C = "one at a time in C"
BATCH = "batch, threads: {}"
WAYS = {False: "batch, one after the other", True: "batch in lanes"}
COPY_CASE = "copying the results alone"
"""What memory allows: results of so many states pass through no cache."""

TOLERANCES = tolerances(1e-6)


def batch_records(kernels: CompiledKernels) -> Iterator[dict]:
    """Records of seconds a state; ratio: how many times less than one at a time in C; error: largest relative difference.

    Of kernels, one at a time goes through the same rows of states and results; everything else is one state again and again.
    chosen: of the two ways of a batch of kernels, whether `kernels.batch` takes it
    """
    yield from _kernel_records(kernels)
    if kernels.m and is_emitted(kernels, own_start(kernels)[1]):
        yield from _derivative_records(kernels)
        yield from _simulation_records(kernels)


def _kernel_records(kernels: CompiledKernels) -> Iterator[dict]:
    ways = {WAYS[in_lanes]: CompiledBatch(kernels, least=0.0 if in_lanes else np.inf) for in_lanes in WAYS}
    usual = kernels.batch
    rng = np.random.default_rng(0)
    q = kernels.q0 + rng.uniform(-0.1, 0.1, (STATES, kernels.n))
    qd = rng.uniform(-1, 1, q.shape)
    for name in (n for n in MEASURED if n in kernels.programs.programs):
        out = {way: batch.values(name, 0.0, q, qd, None) for way, batch in ways.items()}
        chosen = WAYS[isinstance(usual, CompiledBatch) and usual.in_lanes(name)]
        picked = out[chosen]
        expected = kernels.values(name, 0.0, q[-1], qd[-1], None)
        call = KernelCall(kernels.function(name), picked.shape[1], kernels)
        moves = "qd" in kernels.programs.programs[name].inputs
        runs: dict[str, Run] = {
            ALONE_IN_C: each(0.0, q, qd, kernels.p0, call.function, moves, picked),
            "the same state in C": runner(0.0, q[0], qd[0], kernels.p0, [] if moves else [call], call if moves else None),
            "one at a time from Python": repeated(lambda name=name: kernels.values(name, 0.0, q[0], qd[0], None)),
        }
        for way, batch in ways.items():
            runs[way] = repeated(lambda batch=batch, name=name, out=out[way]: batch.values(name, 0.0, q, qd, None, out))
        # Last, since wide vectors lower the clock of some processors for a while, which copying does not mind.
        spare = np.empty_like(picked)
        runs[COPY_CASE] = repeated(lambda spare=spare, picked=picked: np.copyto(spare, picked))
        counts = dict.fromkeys((ALONE_IN_C, COPY_CASE, *ways), STATES)
        error = max(_difference(result[-1], expected) for result in out.values())
        for record in _records(name, measure(runs, ROUNDS), error, counts):
            yield record | ({"chosen": record["tool"] == chosen} if record["tool"] in ways else {})


def _derivative_records(kernels: CompiledKernels) -> Iterator[dict]:
    """State derivatives at closed positions, where one Newton step is enough; the batch is the whole call from Python, in place."""
    q, parts, programs = emitted_parts(kernels)
    zd = np.random.default_rng(0).uniform(-1, 1, (STATES, programs["acceleration"].size - kernels.n - 2))
    states = np.tile(q, (STATES, 1))
    batch = accelerations(kernels, states, zd)
    states = batch.q
    runs = {
        ALONE_IN_C: runner(0.0, q, zd[-1], kernels.p0, [parts["newton"]], parts["acceleration"]),
        BATCH.format(1): repeated(lambda: accelerations(kernels, states, zd, threads=1, out=batch)),
    }
    spent = measure(runs, ROUNDS)
    expected = parts["acceleration"].out[kernels.n : -2]
    yield from _records("derivative", spent, _difference(batch.zdd[-1], expected), {BATCH.format(1): STATES})


def _simulation_records(kernels: CompiledKernels) -> Iterator[dict]:
    """One at a time: the emitted run alone, without what `simulate` does before it; the batch is the whole call."""
    duration = float(simulation_of(kernels.model)["duration"])
    (q, partitions), p, grid = own_start(kernels), kernels.p0, [0.0, duration]
    zd0 = np.random.default_rng(0).uniform(-1, 1, (RUNS, len(partitions.velocity.independent)))
    single = dynamics(kernels, partitions, "emitted", q, p)

    def alone() -> list[Outcome]:
        return [
            single.simulate("dopri5", grid, InitialState(q, zd, p), tolerance=TOLERANCE, max_growth=GROWTH, **TOLERANCES).completed()
            for zd in zd0[:N_SINGLE_SIMULATIONS]
        ]

    def together(count: int) -> Callable[[], BatchTrajectory]:
        return lambda: simulate(kernels, duration, zd0=zd0, threads=count, **TOLERANCES)

    threads = sorted({1, available()})
    batch, runs = together(1)(), alone()
    arrived = [i for i, run in enumerate(runs) if run.status == "ok"]
    error = max((_difference(batch.q[i, -1], runs[i].q[-1]) for i in arrived), default=None)
    spent = measure({ALONE_IN_C: repeated(alone)} | {BATCH.format(k): repeated(together(k)) for k in threads}, ROUNDS)
    counts = {ALONE_IN_C: N_SINGLE_SIMULATIONS} | {BATCH.format(k): RUNS for k in threads}
    yield from _records("simulation", spent, error, counts)


def _difference(ours: np.ndarray, expected: np.ndarray) -> float:
    return float(np.max(np.abs(ours - expected)) / max(np.max(np.abs(expected)), np.finfo(float).tiny))


def _records(quantity: str, spent: Mapping[str, Spread], error: float | None, states: Mapping[str, int]) -> Iterator[dict]:
    """states: how many of them a measured call computes, where it is not one."""
    times = {tool: spread.seconds(states.get(tool, 1)) for tool, spread in spent.items()}
    for tool, measured in times.items():
        record = {"case": "batch", "tool": tool, "quantity": quantity, "error": error if tool.startswith("batch") else None}
        yield record | measured | {"ratio": times[ALONE_IN_C]["seconds"] / measured["seconds"]}
