"""Nanoseconds per kernel call, measured inside C for compiled kernels."""

from __future__ import annotations

import numpy as np

from ncgen.mechanism.kernels import Kernels
from ncgen.mechanism.library import CompiledKernels
from ncgen.report.clock import Run, measure, repeated
from ncgen.report.repeat import KernelCall, runner

ROUNDS = 7

SAMPLE_SECONDS = 2e-4
"""Seconds of a sample: the table of a run takes 20 ms so, and 100 ms with the samples of a benchmark."""


def kernel_times(kernels: Kernels) -> dict[str, float]:
    """{kernel: median nanoseconds per call} at the initial position with velocities of one.

    Compiled kernels are called in a loop in C, so that calling from Python does not count; NumPy kernels are
    timed as they are called.
    """
    runs = {name: _run(kernels, name) for name in kernels.programs.programs}
    return {name: 1e9 * spread.median for name, spread in measure(runs, ROUNDS, sample_seconds=SAMPLE_SECONDS).items()}


def _run(kernels: Kernels, name: str) -> Run:
    program = kernels.programs.programs[name]
    velocity = "qd" in program.inputs
    q, v, p = kernels.q0, np.ones(kernels.n), kernels.p0
    if isinstance(kernels, CompiledKernels):
        call = KernelCall(kernels.function(name), program.size, kernels)
        return runner(0.0, q, v, p, [] if velocity else [call], call if velocity else None)
    return repeated(lambda: kernels.values(name, 0.0, q, v if velocity else None, p))
