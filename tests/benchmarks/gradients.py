"""Derivatives of a whole motion by inertial and geometric data: exact ones, forward and back, beside differences of the same motion."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import cached_property

import numpy as np

import ncgen
from benchmarks.data import ALL, first_written_out
from benchmarks.rivals import casadi_motions
from ncgen.compiler import compile
from ncgen.errors import ModelError
from ncgen.exchange.motion_functions import rates_of
from ncgen.mechanism.kernels import Kernels
from ncgen.model import Model
from ncgen.report.clock import measure, repeated
from ncgen.solver.derivatives.sensitivity import motion_of
from ncgen.solver.derivatives.taped_motion import TapedMotion
from ncgen.solver.positions.position import solve_position
from ncgen.solver.runs.simulation_options import simulation_of

STEPS = 100
"""Of rk4."""

LANES = 8
"""Directions that are carried along at the price of one."""

TOGETHER = 256
"""Motions whose gradients are found together, by one thread."""

SHARE = 1e-6
"""By which share of a number differences change it."""


def gradient_records(model: Model) -> Iterator[dict]:
    """Records of how a sum of all positions and velocities of a motion changes with every datum of inertia, geometry and springs.

    seconds: from the arguments to the result; ratio: to the motion alone; error: relative to the largest derivative, of what goes back
    beside what goes forward, whose programs are others, of differences beside both, and of CasADi where it is installed
    Raises ModelError where the mechanism's motion is not written out.
    """
    found = first_written_out(model, ALL)
    if found is None:
        raise ModelError(f"{model.name}: its motion is not emitted in C, so there is nothing to compare")
    case = _Case(compile(found[0], "c"))
    count = len(case.kernels.parameters)
    every = np.eye(count)
    tools: dict[str, Callable[[], np.ndarray]] = {
        "the motion": lambda: np.array([case.value(case.kernels.p0)]),
        f"exact, back, {count} data": case.back,
        f"exact, forward, {LANES} data": lambda: case.forward(every[:, :LANES]),
        f"exact, forward, {count} data": lambda: case.forward(every),
        f"2-point differences, {count} data": lambda: case.differences(both_sides=False),
        f"3-point differences, {count} data": lambda: case.differences(both_sides=True),
        (together := f"exact, back, {count} data, one of {TOGETHER}"): case.together,
        **case.in_casadi(),
    }
    exact = case.forward(every)
    results = {name: call() for name, call in tools.items()}
    spent = measure({name: repeated(call) for name, call in tools.items()})
    for name, spread in spent.items():
        compared = np.size(results[name]) == count and "forward" not in name
        error = float(np.max(np.abs(results[name] - exact)) / np.max(np.abs(exact))) if compared else None
        times = spread.seconds(TOGETHER if name == together else 1)
        ratio = times["seconds"] / spent["the motion"].median
        yield {"case": "gradients", "tool": name, "error": error, **times, "ratio": ratio}


class _Case:
    """A model's own motion, with weights of all that is seen of it."""

    def __init__(self, kernels: Kernels) -> None:
        self.kernels = kernels
        self.by_q, self.by_qd = np.random.default_rng(1).standard_normal((2, STEPS + 1, kernels.n))

    def _motion(self, p: np.ndarray, q0: np.ndarray | None = None) -> TapedMotion:
        options = simulation_of(self.kernels.model)
        given = {name: options[name] for name in ("q0", "zd0", "qd0", "z") if name in options}
        given |= {"p": p} if q0 is None else {"p": p, "q0": q0}
        motion = motion_of(self.kernels, float(options["duration"]), STEPS, "rk4", **given)
        if not isinstance(motion, TapedMotion):
            raise ModelError(f"{self.kernels.name}: its motion is not emitted in C, so there is nothing to compare")
        return motion

    def value(self, p: np.ndarray, q0: np.ndarray | None = None) -> float:
        motion = self._motion(p, q0)
        return float(np.sum(self.by_q * motion.q) + np.sum(self.by_qd * motion.qd))

    def back(self) -> np.ndarray:
        return self._motion(self.kernels.p0).backward(self.by_q, self.by_qd)[0][: len(self.kernels.p0)]

    def forward(self, directions: np.ndarray) -> np.ndarray:
        """Along directions (parameters, D)."""
        q, qd = self._motion(self.kernels.p0).along(directions)
        return np.einsum("kn,knd->d", self.by_q, q) + np.einsum("kn,knd->d", self.by_qd, qd)

    def together(self) -> np.ndarray:
        """Of many motions, all the same; the last one's."""
        kernels, weights = self.kernels, (self.by_q, self.by_qd)
        options = simulation_of(kernels.model)
        given = {name: options[name] for name in ("q0", "zd0", "z") if name in options}
        duration, many = float(options["duration"]), np.tile(kernels.p0, (TOGETHER, 1))
        found = ncgen.gradient(kernels, duration, STEPS, lambda q, qd: (0.0, *weights), p=many, threads=1, **given)
        return found.derivatives[-1, : len(kernels.p0)]

    def in_casadi(self) -> dict[str, Callable[[], np.ndarray]]:
        """The same motion and its gradient by CasADi, from the start that the motion has and that moves with the data as it does; nothing
        where it is not installed."""
        motion, count = self._motion(self.kernels.p0), len(self.kernels.p0)
        made = casadi_motions.motion(self.kernels, motion.t[-1] - motion.t[0], STEPS)
        if made is None:
            return {}
        given = motion.q[0], motion.qd[0], motion.p, self.by_q, self.by_qd
        start = np.vstack([changes[0] for changes in motion.along(np.eye(count))])

        def back() -> np.ndarray:
            of_start, of_p = np.split(made.back(*given), [len(start)])
            return of_p + of_start @ start

        return {"CasADi, the motion": lambda: np.array([made.value(*given)]), f"CasADi, back, {count} data": back}

    @cached_property
    def _beside(self) -> list[tuple[float, list[tuple[np.ndarray, np.ndarray]]]]:
        """Of every datum the step of a difference, and p and the position at the start after and before it.

        Exact derivatives are at the same independent coordinates, or where the data put them: closing the start must not move them.
        """
        kernels, p0, found = self.kernels, self.kernels.p0, []
        z = rates_of(kernels, {})
        for k, number in enumerate(p0):
            step = SHARE * abs(number)
            sides = [p0 + sign * step * np.eye(len(p0))[k] for sign in (1, -1)]
            found.append((step, [(p, solve_position(kernels, p=p, held=z).q) for p in sides]))
        return found

    def differences(self, both_sides: bool) -> np.ndarray:
        own, slopes = self.value(self.kernels.p0), []
        for step, (after, before) in self._beside:
            gap = self.value(*after) - (self.value(*before) if both_sides else own)
            slopes.append(gap / ((2 if both_sides else 1) * step))
        return np.array(slopes)
