"""Nanoseconds per kernel call, measured inside C for compiled kernels."""

from __future__ import annotations

import statistics
import time

import numpy as np

from ncgen.build.kernels import Kernels
from ncgen.build.library import CompiledKernels, Repeater

SHORTEST = 2e-4
"""Seconds that one sample should last at least, far above the clock's resolution."""

SAMPLES = 7


def kernel_times(kernels: Kernels) -> dict[str, float]:
    """{kernel: median nanoseconds per call} at the initial position with velocities of one.

    Compiled kernels are called in a loop in C, so that calling from Python does not count; NumPy kernels are
    timed as they are called.
    """
    inputs = {"t": 0.0, "q": kernels.q0, "qd": np.ones(kernels.n), "p": kernels.p0}
    repeater = Repeater(kernels) if isinstance(kernels, CompiledKernels) else None
    return {name: 1e9 * _time(_runner(kernels, repeater, name, inputs)) for name in kernels.programs.programs}


def _runner(kernels, repeater, name, inputs):
    if repeater is not None:
        return repeater.runner(name, **inputs)
    program = kernels.programs.programs[name]
    qd = inputs["qd"] if "qd" in program.inputs else None

    def run(times: int) -> None:
        for _ in range(times):
            kernels.values(name, inputs["t"], inputs["q"], qd, inputs["p"])

    return run


def _time(run) -> float:
    """Median seconds per call over samples that are long enough for the clock; the first run only warms up."""
    times = 1
    while (elapsed := _elapsed(run, times)) < SHORTEST:
        times = max(2 * times, int(times * SHORTEST / max(elapsed, 1e-9)))
    return statistics.median(_elapsed(run, times) for _ in range(SAMPLES)) / times


def _elapsed(run, times: int) -> float:
    start = time.perf_counter()
    run(times)
    return time.perf_counter() - start
