"""Derivatives of a whole motion by all inertial data: exact ones, forward and back, beside differences of the same motion."""

from __future__ import annotations

import pickle
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ncgen.comparisons.rivals import casadi_motions
from ncgen.compiler import compile
from ncgen.errors import ModelError
from ncgen.mechanism.kernels import Kernels
from ncgen.model import Model
from ncgen.model.bodies import Inertia
from ncgen.model.values import Value, is_number
from ncgen.program.cost import cost
from ncgen.program.dynamics import assemble_motion
from ncgen.report.clock import measure, repeated
from ncgen.solver.compiled import own_positions
from ncgen.solver.gradients import gradient_batch
from ncgen.solver.run import simulation_of
from ncgen.solver.sensitivity import motion_of
from ncgen.solver.taped_motion import TapedMotion

STEPS = 100
"""Of rk4."""

LANES = 8
"""Directions that are carried along at the price of one."""

TOGETHER = 256
"""Motions whose gradients are found together, by one thread."""

GENERAL = 3
"""Elements of a basis from which on a centre of mass may be anywhere."""

SHARE = 1e-6
"""By which share of a number differences change it."""


def gradient_records(model: Model) -> Iterator[dict]:
    """Records of how a sum of all positions and velocities of a motion changes with every inertial datum.

    seconds: from the arguments to the result; ratio: to the motion alone; error: relative to the largest derivative, of what goes back
    beside what goes forward, whose programs are others, of differences beside both, and of CasADi where it is installed
    Raises ModelError where the mechanism's motion is not written out.
    """
    case = _Case(compile(with_inertia_as_parameters(model), "c"))
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
    found = {name: call() for name, call in tools.items()}
    spent = measure({name: repeated(call) for name, call in tools.items()})
    for name, spread in spent.items():
        compared = np.size(found[name]) == count and "forward" not in name
        error = float(np.max(np.abs(found[name] - exact)) / np.max(np.abs(exact))) if compared else None
        low, median, high = (x / (TOGETHER if name == together else 1) for x in (spread.low, spread.median, spread.high))
        times = {"seconds": median, "low": low, "high": high, "ratio": median / spent["the motion"].median}
        yield {"case": "gradients", "tool": name, "error": error, **times}


def operation_records(model: Model) -> Iterator[dict]:
    """Records of the operations of the state derivative over all coordinates with numbers in it, and with every inertial datum a
    parameter; ratio: to the first. Nothing where the motion is not written out."""
    plain = 0
    for tool, built in (("with numbers", model), ("inertial data are parameters", with_inertia_as_parameters(model))):
        kernels = compile(built, "c")
        seen = own_positions(kernels)
        programs = assemble_motion(kernels.programs.equations, *seen, kernels.column_sizes) if seen else None
        if programs is None:
            return
        count = cost(programs.derivative).total
        plain = plain or count
        yield {"case": "operations", "tool": tool, "error": None, "operations": count, "ratio": count / plain}


def with_inertia_as_parameters(model: Model) -> Model:
    """A copy whose masses, centres and moments of inertia are parameters, at the numbers that they were."""
    copy: Model = pickle.loads(pickle.dumps(model))
    for body in copy.bodies.values():
        if body.inertia is not None:
            body.inertia = _parametric(copy, body.name, body.inertia, len(body.basis) >= GENERAL)
    return copy


def _parametric(model: Model, name: str, inertia: Inertia, is_general: bool) -> Inertia:
    def datum(what: str, value: Value) -> Value:
        return model.parameter(f"{name}_{what}", float(value)) if is_number(value) and value != 0.0 else value

    mass = datum("mass", inertia.mass)
    if not is_general:
        return replace(inertia, mass=mass)
    com = tuple(datum(f"c{axis}", value) for axis, value in zip("xyz", inertia.com, strict=True))
    tensor = np.array(inertia.tensor, dtype=object)
    for i, j in zip(*np.triu_indices(3), strict=True):
        value = datum(f"J{'xyz'[i]}{'xyz'[j]}", tensor[i, j])
        tensor[i, j] = tensor[j, i] = value
    return replace(inertia, mass=mass, com=com, tensor=tensor)


@dataclass(frozen=True)
class _Case:
    """A model's own motion, with weights of all that is seen of it."""

    kernels: Kernels

    def _motion(self, p: np.ndarray) -> TapedMotion:
        options = simulation_of(self.kernels.model)
        given = {name: options[name] for name in ("q0", "zd0", "qd0", "z") if name in options}
        motion = motion_of(self.kernels, float(options["duration"]), STEPS, "rk4", p=p, **given)
        if not isinstance(motion, TapedMotion):
            raise ModelError(f"{self.kernels.name}: its motion is not written out in C, so there is nothing to compare")
        return motion

    @cached_property
    def _weights(self) -> tuple[np.ndarray, np.ndarray]:
        by_q, by_qd = np.random.default_rng(1).standard_normal((2, STEPS + 1, self.kernels.n))
        return by_q, by_qd

    def value(self, p: np.ndarray) -> float:
        motion, (by_q, by_qd) = self._motion(p), self._weights
        return float(np.sum(by_q * motion.q) + np.sum(by_qd * motion.qd))

    def back(self) -> np.ndarray:
        return self._motion(self.kernels.p0).backward(*self._weights)[0][: len(self.kernels.p0)]

    def forward(self, directions: np.ndarray) -> np.ndarray:
        """Along directions (parameters, D)."""
        by_q, by_qd = self._weights
        q, qd = self._motion(self.kernels.p0).along(directions)
        return np.einsum("kn,knd->d", by_q, q) + np.einsum("kn,knd->d", by_qd, qd)

    def together(self) -> np.ndarray:
        """Of many motions, all the same; the last one's."""
        kernels, weights = self.kernels, self._weights
        options = simulation_of(kernels.model)
        given = {name: options[name] for name in ("q0", "zd0", "z") if name in options}
        duration, many = float(options["duration"]), np.tile(kernels.p0, (TOGETHER, 1))
        found = gradient_batch(kernels, duration, STEPS, lambda q, qd: (0.0, *weights), p=many, threads=1, **given)
        return found.slopes[-1, : len(kernels.p0)]

    def in_casadi(self) -> dict[str, Callable[[], np.ndarray]]:
        """The same motion and its gradient by CasADi, from the start that the motion has; nothing where it is not installed."""
        motion = self._motion(self.kernels.p0)
        made = casadi_motions.motion(self.kernels, motion.t[-1] - motion.t[0], STEPS)
        if made is None:
            return {}
        given = motion.q[0], motion.qd[0], motion.p, *self._weights
        return {
            "CasADi, the motion": lambda: np.array([made.value(*given)]),
            f"CasADi, back, {len(self.kernels.p0)} data": lambda: made.back(*given),
        }

    def differences(self, both_sides: bool) -> np.ndarray:
        p0 = self.kernels.p0
        own, found = self.value(p0), np.empty(len(p0))
        for k, number in enumerate(p0):
            step = SHARE * abs(number) * np.eye(len(p0))[k]
            other = self.value(p0 - step) if both_sides else own
            found[k] = (self.value(p0 + step) - other) / ((2 if both_sides else 1) * SHARE * abs(number))
        return found
