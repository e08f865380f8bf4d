"""Exact derivatives of a motion with respect to parameters and initial state: forward and adjoint.

Where the mechanism's motion is written out the steps of the run in C are differentiated (`taped_motion`), else those of a run in
Python (`partitioned_motion`). Forward all directions are carried along with the motion; the adjoint sweep goes back through it once,
whatever the number of parameters.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Unpack

import numpy as np

from ncgen.errors import SHOWN, ModelError, shortened
from ncgen.mechanism.kernels import Kernels
from ncgen.methods.method import Method
from ncgen.methods.table import INTEGRATORS
from ncgen.solver.compiled import checked_compiled, is_written_out
from ncgen.solver.given import checked_kernels
from ncgen.solver.partitioned_motion import PartitionedMotion
from ncgen.solver.run import Initial, InitialArguments, count, positive
from ncgen.solver.taped_motion import TapedMotion
from ncgen.solver.tolerances import Tolerances


@dataclass(frozen=True, eq=False)
class Sensitivities:
    """A motion and its derivatives at K instants; columns in the order of `names`: parameters, z at the start, ż at the start.

    t (K,); q, qd (K, n); q_by, qd_by (K, n, columns)
    """

    t: np.ndarray
    q: np.ndarray
    qd: np.ndarray
    q_by: np.ndarray
    qd_by: np.ndarray
    names: tuple[str, ...]

    def __repr__(self) -> str:
        return f"<Sensitivities by {shortened(', '.join(self.names), SHOWN)}: {len(self.t)} instants to {self.t[-1]:g} s>"


@dataclass(frozen=True)
class Gradient:
    """The value of an objective and its derivatives by name: parameters, `z` and `rate(z)` of the independent coordinates."""

    value: float
    slopes: dict[str, float]

    def __repr__(self) -> str:
        return f"<Gradient of {self.value:.6g} by {shortened(', '.join(self.slopes), SHOWN)}>"


@dataclass(frozen=True, eq=False)
class Hessian:
    """The value of an objective, its derivatives by name, and how these change along directions: products (columns, D), rows in the order
    of `names`. Along all of them one by one this is the Hessian."""

    value: float
    slopes: dict[str, float]
    products: np.ndarray
    names: tuple[str, ...]

    def __repr__(self) -> str:
        return f"<Hessian of {self.value:.6g} by {shortened(', '.join(self.names), SHOWN)}: {self.products.shape[1]} directions>"


def sensitivities(
    kernels: Kernels,
    duration: float,
    steps: int,
    integrator: str = "rk4",
    rtol: float | None = None,
    **start: Unpack[InitialArguments],
) -> Sensitivities:
    """Derivatives of the whole motion, carried along with it.

    steps: of equal length; the motion is given at all K = steps + 1 instants
    integrator: an explicit Runge-Kutta method, as of `simulate`
    rtol: None, or for methods that estimate their error: every step is taken in as many as that takes for the whole motion, as `simulate`
        does by itself. Derivatives are those of the steps that were taken, whose lengths count as given
    start: q0, zd0 or qd0, z, p, t0, as for `simulate`; derivatives by a parameter are taken at the same z of the start, unless the model's
        own initial position has parameters and no q0 is given: then z starts where they put it
    Raises SingularError or ConvergenceError as `simulate` does, ModelError where the motion cannot be differentiated.
    """
    motion = motion_of(kernels, duration, steps, integrator, rtol, **start)
    q_by, qd_by = motion.forward()
    return Sensitivities(motion.t, motion.q, motion.qd, q_by, qd_by, motion.names)


def gradient(
    kernels: Kernels,
    duration: float,
    steps: int,
    objective: Callable[[np.ndarray, np.ndarray], tuple],
    integrator: str = "rk4",
    rtol: float | None = None,
    **start: Unpack[InitialArguments],
) -> Gradient:
    """The gradient of one number that depends on a motion, by one sweep back through it.

    objective: from q and qd (K, n) at the instants of the motion to (value, its derivatives by q and by qd, each (K, n));
        None stands for a derivative that is zero
    steps, integrator, rtol, start: as for `sensitivities`, with the same errors
    """
    motion = motion_of(kernels, duration, steps, integrator, rtol, **start)
    value, *slopes = objective(motion.q, motion.qd)
    by_q, by_qd = (filled(a, motion.q) for a in slopes)
    return Gradient(float(value), dict(zip(motion.names, motion.backward(by_q, by_qd).tolist(), strict=True)))


def hessian(
    kernels: Kernels,
    duration: float,
    steps: int,
    objective: Callable[[np.ndarray, np.ndarray], tuple],
    directions: np.ndarray | None = None,
    integrator: str = "rk4",
    rtol: float | None = None,
    **start: Unpack[InitialArguments],
) -> Hessian:
    """Second derivatives of one number that depends on a motion: how its gradient changes along directions, exact like the gradient.

    objective: from q and qd (K, n) to (value, its derivatives by q and by qd, each (K, n), change), where change(dq, dqd) says how these
        two derivatives change with q and qd; None stands for what is zero, such as the change where the number is a weighted sum
    directions: changes of parameters, z and rates at the start, in the order of `names`, (columns, D); None for all, one by one
    steps, integrator, rtol, start: as for `sensitivities`, with the same errors; ModelError, too, where the motion is not written out in C
    """
    motion = motion_of(kernels, duration, steps, integrator, rtol, **start)
    if not isinstance(motion, TapedMotion):
        raise ModelError(
            f"{kernels.name}: its motion is not written out in C, so it has no second derivatives; take differences of gradient"
        )
    count = len(motion.names)
    along = np.eye(count) if directions is None else np.asarray(directions, dtype=float)
    if along.ndim != 2 or len(along) != count:
        rows = shortened(", ".join(motion.names), SHOWN)
        raise ModelError(f"directions: they have shape {along.shape}; give ({count}, D), a row for each of {rows}")
    value, *slopes, change = objective(motion.q, motion.qd)
    by_q, by_qd = (filled(a, motion.q) for a in slopes)

    def changed(dq: np.ndarray, dqd: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        first, second = (None, None) if change is None else change(dq, dqd)
        return filled(first, dq), filled(second, dq)

    products = motion.second(by_q, by_qd, changed, along)
    return Hessian(float(value), dict(zip(motion.names, motion.backward(by_q, by_qd).tolist(), strict=True)), products, motion.names)


def filled(array: np.ndarray | None, like: np.ndarray) -> np.ndarray:
    """Derivatives, where None stands for 0."""
    return np.zeros_like(like) if array is None else np.asarray(array, dtype=float)


def motion_of(
    kernels: Kernels, duration: float, steps: int, integrator: str, rtol: float | None = None, **start: Unpack[InitialArguments]
) -> TapedMotion | PartitionedMotion:
    """A motion that can be differentiated; arguments and errors as of `sensitivities`."""
    since_start = instants(duration, steps, integrator)
    tolerances = None if rtol is None else Tolerances.promised(positive(rtol, "rtol"), since_start[-1])
    if tolerances and not INTEGRATORS[integrator].coefficients.errors:
        estimating = ", ".join(name for name in _explicit() if INTEGRATORS[name].coefficients.errors)
        raise ModelError(f"rtol: {integrator} does not estimate its error; leave rtol out, or take {estimating}")
    initial = Initial.asked(checked_kernels(kernels), **start)
    return motion_from(kernels, initial, initial.t + since_start, start.get("q0") is None, integrator, tolerances)


def instants(duration: float, steps: int, integrator: str) -> np.ndarray:
    """(K,) s from the start of a motion that can be differentiated; errors as of `sensitivities`."""
    length, steps = positive(duration, "duration", "number of seconds"), count(steps, "steps", 1, "a motion has at least 1")
    if integrator not in _explicit():
        raise ModelError(f"integrator: {integrator!r} given; derivatives go through steps of {', '.join(_explicit())}")
    return length * np.arange(steps + 1) / steps


def motion_from(
    kernels: Kernels, initial: Initial, times: np.ndarray, follows: bool, integrator: str, tolerances: Tolerances | None = None
) -> TapedMotion | PartitionedMotion:
    """A motion over the times of a grid; follows: whether the position at its start is the model's own."""
    if is_taped(kernels, integrator):
        return TapedMotion(checked_compiled(kernels), initial, times, follows, integrator, tolerances)
    return PartitionedMotion(kernels, initial, times, follows)


def is_taped(kernels: Kernels, integrator: str) -> bool:
    """Whether the steps of a run in C are differentiated. Raises ModelError where neither these nor those of Python are."""
    written = is_written_out(kernels, Method.of("lagrange", integrator))
    if not written and integrator != "rk4":
        raise ModelError(f"{kernels.name}: its motion is not written out in C, so derivatives go through steps of rk4, not of {integrator}")
    return written


def _explicit() -> list[str]:
    return [name for name, entry in INTEGRATORS.items() if entry.tableau]
