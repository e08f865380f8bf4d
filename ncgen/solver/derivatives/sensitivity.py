"""Exact derivatives of a motion with respect to parameters and initial state: forward and adjoint.

Where the mechanism's motion is emitted the steps of the run in C are differentiated (`taped_motion`), else those of a run in
Python (`partitioned_motion`). Forward all directions are carried along with the motion; the adjoint sweep goes back through it once,
whatever the number of parameters.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from functools import partial
from typing import Any, TypeAlias, Unpack

import numpy as np

from ncgen.errors import MAX_ECHO, ModelError, shortened
from ncgen.mechanism.kernels import Kernels
from ncgen.methods.method import Method
from ncgen.methods.table import INTEGRATORS, Integrator
from ncgen.program.motions import step_equations
from ncgen.solver.argument_checks import checked_kernels, echo, has_events, names_of, numbers_of, refuse_events, values_by_name
from ncgen.solver.derivatives.event_motion import FINE, EventMotion, EventSensitivity
from ncgen.solver.derivatives.objective import check_objective, filled, of_objective
from ncgen.solver.derivatives.partitioned_motion import PartitionedMotion, TrapezoidalMotion
from ncgen.solver.derivatives.stepped_motion import SteppedMotion
from ncgen.solver.derivatives.taped_motion import NotTaped, TapedMotion
from ncgen.solver.engines.acceleration_forms import has_emitted_recursion
from ncgen.solver.engines.capabilities import checked_compiled
from ncgen.solver.groups import MotionArguments, StartArguments, takes
from ncgen.solver.motions.simulate import simulate_steps
from ncgen.solver.runs.grid import MOST_NUMBERS
from ncgen.solver.runs.run import Initial
from ncgen.solver.runs.settings import count, positive, relative_tolerance
from ncgen.solver.runs.signals import Signals, signals_of
from ncgen.solver.runs.tolerances import Tolerances
from ncgen.solver.trajectories.trajectory import Trajectory

NOT_DIFFERENTIATED = ("formalism", "engine", "number", "atol", "max_step")
"""Arguments of a method that make no difference where its steps are differentiated."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Sensitivities:
    """A motion and its derivatives at K instants; columns in the order of `names`: parameters, z at the start, ż at the start.

    t (K,); q, qd (K, n); q_by, qd_by (K, n, columns); events: of a model with events, how all that happened changes
    """

    t: np.ndarray
    q: np.ndarray
    qd: np.ndarray
    q_by: np.ndarray
    qd_by: np.ndarray
    names: tuple[str, ...]
    events: tuple[EventSensitivity, ...] = ()

    def __repr__(self) -> str:
        return f"<Sensitivities by {shortened(', '.join(self.names), MAX_ECHO)}: {len(self.t)} instants to {self.t[-1]:g} s>"


@dataclass(frozen=True, eq=False)
class Gradient:
    """The value of an objective and its derivatives by name: parameters, `z` and `rate(z)` of the independent coordinates.

    Of an input that changes with time, derivatives say what adding one number to it at all times does; by_inputs {name: (samples,)}
    says it of every value of those that are tables.
    """

    value: float
    derivatives: dict[str, float]
    by_inputs: dict[str, np.ndarray] = field(default_factory=dict)

    def __repr__(self) -> str:
        return f"<Gradient of {self.value:.6g} by {shortened(', '.join(self.derivatives), MAX_ECHO)}>"


@dataclass(frozen=True, eq=False)
class Hessian:
    """The value of an objective, its derivatives by name, and how these change along directions: products (columns, D), rows in the order
    of `names`. Along all of them one by one this is the Hessian."""

    value: float
    derivatives: dict[str, float]
    products: np.ndarray
    names: tuple[str, ...]

    def __repr__(self) -> str:
        return f"<Hessian of {self.value:.6g} by {shortened(', '.join(self.names), MAX_ECHO)}: {self.products.shape[1]} directions>"


@takes(MotionArguments, unused=NOT_DIFFERENTIATED, integrator="rk4", rtol=None)
def sensitivities(
    kernels: Kernels, duration: float, steps: int, *, by: str | Iterable[str] | None = None, **arguments: Unpack[MotionArguments]
) -> Sensitivities:
    """Differentiate a whole motion, with derivatives carried along with it.

    Parameters
    ----------
    kernels : Kernels
        Compiled mechanism.
    duration : float
        Length of the motion in s.
    steps : int
        Number of equal steps; the motion is returned at all K = steps + 1 times.
    by : str or iterable of str, optional
        Names of the columns: parameters, independent coordinates z, and rate(z). Default: all. Each costs as much.
    **arguments : MotionArguments
        The start and the method. `integrator` (default rk4) is an explicit Runge-Kutta method, or rattle, energy-momentum,
        generalized-alpha or trapezoidal, the last on independent coordinates. `rtol` (default: one step each) is for methods that
        estimate their error: every step is divided into as many as the whole motion takes, as `simulate` does, and the derivatives are
        those of these steps with fixed lengths. `options` are those of methods that discretise the constrained equations. `inputs`: the
        derivative by an input that changes with time is that by a number added to it at all times.

    Returns
    -------
    Sensitivities
        The motion and its derivatives. Those by a parameter are taken at the same z of the start, unless the model's own initial
        position has parameters and `q0` is not given: then z starts where they put it.

    Raises
    ------
    ModelError
        For invalid arguments, and where the motion cannot be differentiated.
    ConvergenceError, SingularError
        As `simulate`.
    """
    motion = motion_of(kernels, duration, steps, **arguments)
    names = motion.names if by is None else names_of(by, "by", motion.names, "parameter or initial value")
    directions = np.eye(len(motion.names))[:, [motion.names.index(name) for name in names]]
    q_by, qd_by = motion.along(directions)
    events = motion.events_along(directions) if isinstance(motion, EventMotion) else ()
    return Sensitivities(t=motion.t, q=motion.q, qd=motion.qd, q_by=q_by, qd_by=qd_by, names=names, events=events)


def gradient_one(
    kernels: Kernels,
    duration: float,
    steps: int,
    objective: Callable[[np.ndarray, np.ndarray], tuple],
    by: str | Iterable[str] | None,
    **arguments: Unpack[MotionArguments],
) -> Gradient:
    """Compute the gradient of one motion; arguments and errors as of `gradient` without rows."""
    checked_kernels(kernels)
    check_objective(objective)
    motion = motion_of(kernels, duration, steps, **arguments)
    names = motion.names if by is None else names_of(by, "by", motion.names, "parameter or initial value")
    value, by_q, by_qd = of_objective(objective, motion.q, motion.qd)
    derivatives, driven = motion.backward(by_q, by_qd, names)
    by_inputs = motion.signals.by_values(driven.t, driven.begun, driven.values) if motion.signals else {}
    return Gradient(value, {name: float(derivatives[motion.names.index(name)]) for name in names}, by_inputs)


@takes(MotionArguments, unused=(*NOT_DIFFERENTIATED, "options"), integrator="rk4", rtol=None)
def hessian(
    kernels: Kernels,
    duration: float,
    steps: int,
    objective: Callable[[np.ndarray, np.ndarray], tuple],
    directions: np.ndarray | None = None,
    **arguments: Unpack[MotionArguments],
) -> Hessian:
    """Compute how the gradient of a number that depends on a motion changes along directions: exact second derivatives.

    Parameters
    ----------
    kernels : Kernels
        Compiled mechanism.
    duration : float
        Length of the motion in s.
    steps : int
        Number of equal steps, K = steps + 1 times.
    objective : callable
        Function (q, qd), each (K, n), to (value, its derivatives by q and by qd, change), where change(dq, dqd) returns how these two
        derivatives change with q and qd; None is zero, such as the change of a weighted sum.
    directions : array, shape (columns, D), optional
        Changes of parameters, z and rates at the start, in the order of `names` of the result. Default: all, one by one.
    **arguments : MotionArguments
        The start and the method, as of `sensitivities`; `integrator` is an explicit Runge-Kutta method.

    Returns
    -------
    Hessian
        The value, its derivatives, and their changes along the directions.

    Raises
    ------
    ModelError
        As `sensitivities`, and where the motion is not computed by code that is generated for it.
    ConvergenceError, SingularError
        As `sensitivities`.
    """
    _differentiable(arguments.get("integrator", "rk4"), twice=True)
    checked_kernels(kernels)
    check_objective(objective)
    refuse_events(kernels.model, "hessian")
    motion = motion_of(kernels, duration, steps, **arguments)
    if not isinstance(motion, TapedMotion):
        raise ModelError(
            f"{kernels.name}: its motion is not emitted in C, or comes to where its order of elimination does not suit, "
            "so it has no second derivatives; take differences of gradient"
        )
    count = len(motion.names)
    along = np.eye(count) if directions is None else numbers_of(directions, "directions")
    if along.ndim != 2 or len(along) != count:
        rows = shortened(", ".join(motion.names), MAX_ECHO)
        raise ModelError(f"directions: they have shape {along.shape}; give ({count}, D), a row for each of {rows}")
    value, by_q, by_qd, change = of_objective(objective, motion.q, motion.qd, "change")

    def changed(dq: np.ndarray, dqd: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        changes_of_derivatives = (None, None) if change is None else change(dq, dqd)
        if not (isinstance(changes_of_derivatives, (tuple, list)) and len(changes_of_derivatives) == 2):
            raise ModelError(
                f"objective: its change returned {echo(changes_of_derivatives)}; it must return two arrays, or None for what is zero"
            )
        first, second = (filled(array, dq, "change of its derivatives") for array in changes_of_derivatives)
        return first, second

    products = motion.second(by_q, by_qd, changed, along)
    return Hessian(value, dict(zip(motion.names, motion.backward(by_q, by_qd)[0].tolist(), strict=True)), products, motion.names)


Motion: TypeAlias = TapedMotion | PartitionedMotion | SteppedMotion | EventMotion
"""A motion that can be differentiated."""


def motion_of(kernels: Kernels, duration: float, steps: int, integrator: str = "rk4", **arguments: Any) -> Motion:
    """A motion that can be differentiated; arguments and errors as of `sensitivities`."""
    start: dict[str, Any] = {name: arguments[name] for name in StartArguments.__annotations__ if name in arguments and name != "inputs"}
    rtol, options, inputs = arguments.get("rtol"), arguments.get("options"), arguments.get("inputs")
    since_start, entry = instants(checked_kernels(kernels), duration, steps), _differentiable(integrator)
    tolerances = None if rtol is None else Tolerances.promised(relative_tolerance(rtol), since_start[-1])
    if tolerances and not (entry.tableau and entry.coefficients.errors):
        estimating = ", ".join(name for name, other in INTEGRATORS.items() if other.tableau and other.coefficients.errors)
        raise ModelError(f"rtol: {integrator} does not estimate its error; leave rtol out, or take {estimating}")
    if has_events(kernels.model) and not entry.tableau:
        refuse_events(kernels.model, f"a derivative by steps of {integrator}")
    initial = Initial.from_arguments(kernels, **start)
    times, follows, signals = initial.t + since_start, start.get("q0") is None, signals_of(kernels, inputs, initial.p)
    if not entry.tableau:
        method = Method.of("lagrange" if entry.steps == ("lagrange",) else "coordinate-partitioning", entry.name, options)
        return _implicit_motion(kernels, initial, times, follows, method, signals, {"options": options, "inputs": inputs, **start})
    if values_by_name(options, "options"):
        raise ModelError(f"options: {integrator} has none")
    make = partial(motion_from, integrator=integrator, tolerances=tolerances, signals=signals)
    if has_events(kernels.model):
        simulation = start | ({"inputs": inputs} if inputs is not None else {}) | {"rtol": FINE if rtol is None else min(rtol, FINE)}
        return EventMotion(kernels, initial, times, follows, signals, make, simulation)
    return make(kernels, initial, times, follows)


def instants(kernels: Kernels, duration: float, steps: int) -> np.ndarray:
    """(K,) s from the start of a motion that can be differentiated; errors as of `sensitivities`."""
    length, steps = positive(duration, "duration", "number of seconds"), count(steps, "steps", 1, "a motion has at least 1")
    if (steps + 1) * (2 * kernels.n + 1) > MOST_NUMBERS:
        raise ModelError(f"steps: {echo(steps)} given; a motion takes more than {MOST_NUMBERS * 8 / 2**30:.3g} GiB, take fewer")
    return length * np.arange(steps + 1) / steps


def motion_from(
    kernels: Kernels, initial: Initial, times: np.ndarray, follows: bool, integrator: str, tolerances: Tolerances | None = None,
    signals: Signals | None = None,
) -> TapedMotion | PartitionedMotion:  # fmt: skip
    """A motion by explicit steps over the times of a grid; follows: whether the position at its start is the model's own. The steps are
    those of C, or of Python where C has none that can be differentiated and the method is rk4."""
    if is_taped(kernels, integrator):
        try:
            return TapedMotion(checked_compiled(kernels), initial, times, follows, integrator, tolerances, signals)
        except NotTaped:
            if integrator != "rk4" or kernels.model.callbacks:
                raise
    return PartitionedMotion(kernels, initial, times, follows, signals)


def is_taped(kernels: Kernels, integrator: str) -> bool:
    """Whether steps of an explicit method in C are differentiated. Raises ModelError where neither these nor those of Python are, and for
    methods of other kinds."""
    if not _differentiable(integrator).tableau:
        explicit = ", ".join(name for name, entry in INTEGRATORS.items() if entry.tableau)
        raise ModelError(f"integrator: {integrator!r} given; derivatives of many motions go through steps of {explicit}")
    method, rolls = Method.of("lagrange", integrator), len(kernels.holonomic) != kernels.m
    written = has_emitted_recursion(kernels, method, 0 if rolls or integrator != "rk4" else 1)  # Python has neither
    if not written and integrator != "rk4":
        raise ModelError(f"{kernels.name}: its motion is not emitted in C, so derivatives go through steps of rk4, not of {integrator}")
    return written


def _differentiable(integrator: str, twice: bool = False) -> Integrator:
    """The entry of a method whose steps have derivatives, or second ones. Raises ModelError."""
    known = {
        name: entry
        for name, entry in INTEGRATORS.items()
        if entry.tableau or (entry.has_fixed_step and not twice and (entry.is_ordinary or name in step_equations.METHODS))
    }
    if not isinstance(integrator, str):
        raise ModelError(f"integrator: {echo(integrator)} given; give a name, one of {', '.join(known)}")
    if integrator in known:
        return known[integrator]
    why = ""
    if integrator in INTEGRATORS and not INTEGRATORS[integrator].has_fixed_step:
        why = f"; {integrator} ends its iterations at the tolerance, so that its steps solve no equations that could be differentiated"
    subject = "second derivatives" if twice else "derivatives"
    raise ModelError(f"integrator: {integrator!r} given; {subject} go through steps of {', '.join(known)}{why}")


def _implicit_motion(
    kernels: Kernels, initial: Initial, times: np.ndarray, follows: bool, method: Method, signals: Signals | None,
    arguments: dict[str, Any],
) -> SteppedMotion | TrapezoidalMotion:  # fmt: skip
    """By steps of `simulate`; arguments: of it, besides the method."""

    def run(ends: np.ndarray, breaks: np.ndarray) -> Trajectory:
        return simulate_steps(kernels, ends, breaks, formalism=method.formalism.name, integrator=method.integrator.name, **arguments)

    if method.integrator.is_ordinary:
        return TrapezoidalMotion(kernels, initial, times, follows, run, signals)
    return SteppedMotion(kernels, initial, times, follows, run, method, signals)
