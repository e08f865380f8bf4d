"""How exact emitted accelerations are from position to position: their order of pivots is fixed, and can be unlucky."""

from __future__ import annotations

import numpy as np

import ncgen
from ncgen.comparisons.derivative_parts import REFINED, emitted_parts
from ncgen.comparisons.rivals.base import own_start
from ncgen.mechanism.kernels import Kernels
from ncgen.mechanism.library import CompiledKernels
from ncgen.program.ir.blocks import Program
from ncgen.program.ir.evaluate import evaluate
from ncgen.program.ir.functions import FUNCTIONS
from ncgen.report.repeat import KernelCall, runner
from ncgen.solver.engines.capabilities import is_emitted

POSITIONS = 1000
REACH = 1.0
"""How far the independent coordinates go from where they start, in radians or natural sizes."""

STAGES = 20
"""Newton's method follows from one to the next, so that it stays on its branch."""


def worst_errors(kernels: CompiledKernels) -> dict[str, float]:
    """Of the accelerations, as they are and refined; empty where they are not emitted."""
    if not is_emitted(kernels, own_start(kernels)[1]):
        return {}
    q, calls, programs = emitted_parts(kernels)
    return largest_errors(kernels, q, {"accelerations": calls["acceleration"], REFINED: calls[REFINED]}, programs[REFINED])


def largest_errors(kernels: Kernels, q: np.ndarray, calls: dict[str, KernelCall], exact: Program) -> dict[str, float]:
    """The largest relative error of z̈ in many closed positions, of some ways to compute [q̇, z̈, …].

    q: where to start; exact: a program of the same numbers, which is evaluated in long double
    Empty where long double is no better than double, or there is no freedom to go anywhere.
    """
    if np.finfo(np.longdouble).eps >= np.finfo(float).eps:
        return {}
    positions, rates = _positions(kernels, q, exact.size - kernels.n - 2)
    if not rates.size:
        return {}
    expected = _exact(kernels, positions, rates, exact)
    scale = np.maximum(np.max(np.abs(expected), axis=1), np.finfo(float).tiny)  # nothing need accelerate
    found = {
        name: np.array([_evaluated(kernels, call, x, v) for x, v in zip(positions, rates, strict=True)]) for name, call in calls.items()
    }
    return {name: float(np.max(np.max(np.abs(values - expected), axis=1) / scale)) for name, values in found.items()}


def _positions(kernels: Kernels, q: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Closed positions, reached from q in stages, and random rates of the `count` independent coordinates."""
    rng = np.random.default_rng(0)
    rates = rng.uniform(-1, 1, (POSITIONS, count))
    batch = ncgen.accelerations(kernels, np.tile(q, (POSITIONS, 1)), rates)
    independent = [kernels.index[name] for name in batch.independent]
    steps = rng.uniform(-REACH, REACH, rates.shape) * kernels.column_sizes[independent] / STAGES
    arrived = np.ones(POSITIONS, dtype=bool)
    for _ in range(STAGES):
        batch.q[:, independent] += steps
        batch.q[~arrived] = q  # what does not close any more stays out
        batch = ncgen.accelerations(kernels, batch.q, rates, out=batch)
        arrived &= batch.ok
    return batch.q[arrived], rates[arrived]


def _exact(kernels: Kernels, positions: np.ndarray, rates: np.ndarray, program: Program) -> np.ndarray:
    long = np.longdouble
    inputs = {"t": long(0), "q": long(1) * positions.T, "zd": long(1) * rates.T, "p": long(1) * kernels.p0}
    functions = {name: getattr(np, f.numpy) for name, f in FUNCTIONS.items()}
    values = evaluate(program, inputs, functions, long)[kernels.n : -2]
    return np.array([np.broadcast_to(x, len(positions)) for x in values]).T


def _evaluated(kernels: Kernels, call: KernelCall, q: np.ndarray, rates: np.ndarray) -> np.ndarray:
    runner(0.0, q, rates, kernels.p0, [], call)(1)
    return call.out[kernels.n : -2].copy()
