"""CasADi in the place of taped motions: the expressions of a motion's own programs as a step, a map of steps, and its reverse mode.

Any: an expression or a function of CasADi.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from types import ModuleType
from typing import Any

import numpy as np

from benchmarks.rivals.casadi import column
from benchmarks.rivals.translation import translatable
from ncgen.errors import ModelError
from ncgen.mechanism.kernels import Kernels
from ncgen.methods.table import INTEGRATORS
from ncgen.program.motions.dynamics import MotionPrograms, assemble_motion
from ncgen.solver.engines.acceleration_forms import own_positions

CLOSINGS = 2
"""Newton steps with which the end of a step is closed, each time: CasADi's have to be a given number."""


@dataclass(frozen=True, eq=False)
class CasadiMotion:
    """value and back: from q and q̇ at the start (n,), p (n_p,) and weights of q and q̇ at all instants, (K, n) each, to the weighted sum,
    and to how it changes with q, q̇ and p, (2 n + n_p,); seconds: until both could be called."""

    value: Callable[..., float]
    back: Callable[..., np.ndarray]
    seconds: float


def motion(kernels: Kernels, duration: float, steps: int) -> CasadiMotion | None:
    """By steps of rk4, in CasADi's own machine, from t = 0 on; None where CasADi is not installed, or the mechanism is driven, rolls or
    looks things up. Raises ModelError where no motion is written out."""
    try:
        casadi = import_module("casadi")
    except ImportError:
        return None
    if not translatable(kernels):
        return None
    start, n, n_p = time.perf_counter(), kernels.n, len(kernels.p0)
    seen = own_positions(kernels)
    programs = assemble_motion(kernels.programs.equations, *seen, kernels.column_sizes) if seen else None
    if programs is None:
        raise ModelError(f"{kernels.name}: its motion is not emitted in C, so there is nothing to compare")
    x, p = casadi.SX.sym("x", 2 * n), casadi.SX.sym("p", n_p)
    every = _prepared(casadi, programs, p)
    prepare = casadi.Function("prepare", [p], [every])
    known, t = casadi.SX.sym("known", every.numel()), casadi.SX.sym("t")
    step = casadi.Function("step", [x, casadi.vertcat(t, known)], [_step(casadi, programs, t, x, known, n, duration / steps)])
    at, of_p, weights = casadi.MX.sym("at", 2 * n), casadi.MX.sym("p", n_p), casadi.MX.sym("weights", 2 * n, steps + 1)
    begun = casadi.DM(duration * np.arange(steps) / steps).T
    states = casadi.horzcat(at, step.mapaccum("run", steps)(at, casadi.vertcat(begun, casadi.repmat(prepare(of_p), 1, steps))))
    total = casadi.dot(weights, states)
    value = casadi.Function("value", [at, of_p, weights], [total])
    back = casadi.Function("back", [at, of_p, weights], [casadi.vertcat(casadi.gradient(total, at), casadi.gradient(total, of_p))])

    def given(q: np.ndarray, qd: np.ndarray, p: np.ndarray, by_q: np.ndarray, by_qd: np.ndarray) -> tuple[np.ndarray, ...]:
        return np.concatenate([q, qd]), p, np.hstack([by_q, by_qd]).T

    return CasadiMotion(
        lambda *arrays: float(value(*given(*arrays))),
        lambda *arrays: np.asarray(back(*given(*arrays))).ravel(),
        time.perf_counter() - start,
    )


def _prepared(casadi: ModuleType, programs: MotionPrograms, p: Any) -> Any:
    """p with what depends on it alone."""
    return casadi.vertcat(p, column(casadi, programs.prepare, {"p": casadi.vertsplit(p)})) if programs.prepare else p


def _step(casadi: ModuleType, programs: MotionPrograms, t: Any, x: Any, p: Any, n: int, h: float) -> Any:
    """The state where a step of rk4 ends, on the constraints as `ncgen_projection.c` brings it there."""
    tableau = INTEGRATORS["rk4"].coefficients
    every = casadi.vertsplit(p)

    def read(program: Any, t: Any, q: Any, qd: Any = None) -> Any:
        rates = {} if qd is None else {"qd": casadi.vertsplit(qd)}
        return column(casadi, program, {"t": t, "q": casadi.vertsplit(q), "p": every} | rates)

    def closed(q: Any) -> Any:
        for _ in range(CLOSINGS):
            q = q + read(programs.closing, t + h, q)[:n]
        return q

    slopes: list[Any] = []
    for node, row in zip(tableau.c, [(), *tableau.a][: tableau.stages], strict=False):
        stage = x + h * sum(float(a) * slope for a, slope in zip(row, slopes, strict=False)) if row else x
        slopes.append(read(programs.derivative, t + float(node) * h, stage[:n], stage[n:])[: 2 * n])
    left = x + h * sum(float(b) * slope for b, slope in zip(tableau.weights, slopes, strict=False))
    q = closed(left[:n])
    q = closed(q + read(programs.velocities, t + h, q, left[:n] - q)[:n])
    return casadi.vertcat(q, read(programs.velocities, t + h, q, left[n:])[:n])
