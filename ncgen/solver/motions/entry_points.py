"""Entry points for motions: one function for one state, and for rows of states.

`has_rows` decides which of the two a call is. Modules are loaded when a call needs them.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cache
from typing import TYPE_CHECKING, Any, Unpack, overload

from numpy.typing import ArrayLike

from ncgen.errors import ConvergenceError, ModelError
from ncgen.mechanism.kernels import Kernels
from ncgen.solver.argument_checks import ArrayOrNamed, checked_kernels, count
from ncgen.solver.batch_rows import WITH_ROWS, has_rows, refuse_batch_options, states_of
from ncgen.solver.groups import MotionArguments, OneMotion, OneStart, OneState, StartArguments, takes, without_unused
from ncgen.solver.runs.progress_reports import ProgressOption
from ncgen.toolchain.undisturbed import undisturbed

if TYPE_CHECKING:
    from ncgen.solver.motions.batch import BatchAccelerations, BatchTrajectory, StateAccelerations
    from ncgen.solver.motions.simulation import Simulation
    from ncgen.solver.motions.simulations import Simulations
    from ncgen.solver.trajectories.trajectory import Trajectory

PARTITIONING = "coordinate-partitioning"
"""The formalism of a batch."""


@overload
def simulate(
    kernels: Kernels,
    duration: float,
    *,
    points: int | ArrayLike | None = None,
    stop: Mapping[str, Any] | None = None,
    threads: None = None,
    progress: ProgressOption = None,
    **arguments: Unpack[OneMotion],
) -> Trajectory: ...
@overload
def simulate(
    kernels: Kernels,
    duration: float,
    *,
    points: int | ArrayLike | None = None,
    stop: Mapping[str, Any] | None = None,
    threads: int | None = None,
    progress: ProgressOption = None,
    **arguments: Unpack[MotionArguments],
) -> Any: ...
@takes(MotionArguments)
def simulate(
    kernels: Kernels,
    duration: float,
    *,
    points: int | ArrayLike | None = None,
    stop: Mapping[str, Any] | None = None,
    threads: int | None = None,
    progress: ProgressOption = None,
    **arguments: Unpack[MotionArguments],
) -> Trajectory | BatchTrajectory:
    """Simulate a mechanism and return its trajectory on a time grid, or those of many states.

    Parameters
    ----------
    kernels : Kernels
        Compiled mechanism, from `ncgen.compile`.
    duration : float
        Length of the motion in s.
    points : int or array_like, shape (points,), optional
        Number of equidistant output times, or the output times themselves in s, from `t0` to the end. Default: 101; of a batch 2.
    stop : {coordinate: value}, optional
        End where a coordinate, or a velocity {"rate(psi)": 0.0}, passes a value; with a direction, {"psi": (1.2, "rising")} or
        "falling". The last output time is the time of the event, and `stopped` of the trajectory is True. Within a step the first
        passage of the interpolant is found by bounds, not by samples, however short it is. With coordinate partitioning a dependent
        coordinate is interpolated by a polynomial of degree 8 through nine states of the step. Not in a batch.
    threads : int, optional
        Number of threads of a batch. Default: one on every processor that this process may use.
    progress : callable or bool, optional
        Called again and again with the time reached, in s; True for a bar in a terminal or a notebook. In a batch it is called with the
        fraction of the states that are done, and what it raises, or Ctrl-C, is raised again with the results in its `trajectory`.
    **arguments : MotionArguments
        The start and the method. Rows make a batch: an array of two dimensions in `q0`, `zd0`, `qd0` or `p`, or one of one dimension by
        name, such as p={"k": stiffnesses}; what has no rows is the same for all states. Each state of a batch is a run with coordinate
        partitioning, whose independent coordinates are chosen at the first regular state; where they become ill-conditioned, that state is
        simulated alone in C. So is a state that is found stiff, unless an integrator is named. With events it is a run over all
        coordinates, which C carries from event to event; with friction, locks, ratchets or an input that changes with time the states are
        simulated in a loop. The `integrator` of a batch is dopri5 (default) or dop853, each state with its own steps, or rk4 with the fixed
        step `max_step`.

    Returns
    -------
    Trajectory or BatchTrajectory
        Positions, velocities and work at the output times; accelerations and reactions on demand. With rows a BatchTrajectory: a state
        that fails, takes a million steps, or is ended by an event, leaves the others as they are, and its `status` says why.

    Raises
    ------
    ModelError
        For invalid arguments, and where no state of a batch has a start.
    ConvergenceError
        Where the start cannot be assembled, with the names of the constraints, or the motion cannot continue, with the time.
    SingularError
        Where the start is singular.
    Interrupted
        At Ctrl-C; it is a KeyboardInterrupt, and its `run` is the trajectory up to there.

    Warns
    -----
    UserWarning
        Where the energy of the result says that it cannot be right, and where another formalism would be many times faster.
    """
    if not has_rows(arguments):
        if threads is not None:
            refuse_batch_options("simulate", threads=threads)
        return _simulate_one()(kernels, duration, points=101 if points is None else points, stop=stop, progress=progress, **arguments)
    from ncgen.solver.motions.batch import simulate_batch

    if stop is not None:
        raise ModelError(f"simulate: stop is given {WITH_ROWS}; define an event of the model, which ends each state by itself")
    options = {**arguments}
    if isinstance(formalism := options.get("formalism"), str) and formalism == PARTITIONING:
        del options["formalism"]
    options = without_unused("simulate", options, ("formalism", "engine", "number", "options", "closing"), WITH_ROWS)
    return simulate_batch(kernels, duration, points=2 if points is None else points, threads=threads, progress=progress, **options)


@cache
def _simulate_one() -> Callable[..., Trajectory]:
    """`simulate_one`, loaded when a call needs it."""
    with undisturbed():
        from ncgen.solver.motions.simulate import simulate_one
    return simulate_one


NOT_STEPPED = ("formalism", "engine", "number", "options", "max_step")
"""Arguments of a method that make no difference where a simulation is moved step by step."""


@overload
def start(kernels: Kernels, variants: None = None, *, threads: None = None, **arguments: Unpack[OneMotion]) -> Simulation: ...
@overload
def start(kernels: Kernels, variants: int, *, threads: int | None = 1, **arguments: Unpack[MotionArguments]) -> Simulations: ...
@overload
def start(kernels: Kernels, variants: None = None, *, threads: int | None = 1, **arguments: Unpack[MotionArguments]) -> Any: ...
@takes(MotionArguments, unused=NOT_STEPPED)
def start(
    kernels: Kernels, variants: int | None = None, *, threads: int | None = 1, **arguments: Unpack[MotionArguments]
) -> Simulation | Simulations:
    """Start a simulation that waits for its first step, or many of one mechanism.

    Parameters
    ----------
    kernels : Kernels
        Compiled mechanism.
    variants : int, optional
        Number N of simulations that begin at the same start. Not needed where the start has rows.
    threads : int, optional
        Number of threads of many simulations; None for one on every processor.
    **arguments : MotionArguments
        The start and the method. With rows in `q0`, `zd0`, `qd0` or `p`, as of `simulate`, each row starts a simulation. `inputs` are
        numbers, {name: value}, of many simulations also {name: values (N,)}; each keeps its value until a step gives it another.
        `integrator` is an explicit one in C: "auto" takes as many steps within a step as `rtol` asks for; with rk4 a step is one of this
        method, so that its cost is always the same. `rtol` and `atol` are tolerances of every step.

    Returns
    -------
    Simulation or Simulations
        The mechanism at `t0`; with rows or `variants` N of them.

    Raises
    ------
    ModelError
        For invalid arguments, and where C alone cannot move the mechanism.
    ConvergenceError, SingularError
        As `simulate` does for a start.
    """
    if variants is None and not has_rows(arguments):
        from ncgen.solver.motions.simulation import start_one

        refuse_batch_options("start", threads=threads)
        return start_one(kernels, **arguments)
    from ncgen.solver.motions.simulations import start_batch

    states = states_of(checked_kernels(kernels).name, arguments)
    if variants is not None and has_rows(arguments) and count(variants, "variants") != len(states):
        raise ModelError(f"start: variants is {variants}, and the start has {len(states)} rows; leave variants out")
    return start_batch(kernels, len(states) if variants is None else variants, states, threads)


@overload
def accelerations(
    kernels: Kernels,
    q: OneState,
    zd: OneState,
    *,
    velocities: bool = False,
    threads: None = None,
    out: None = None,
    **arguments: Unpack[OneStart],
) -> StateAccelerations: ...
@overload
def accelerations(
    kernels: Kernels,
    q: ArrayOrNamed,
    zd: ArrayOrNamed,
    *,
    velocities: bool = False,
    threads: int | None = 1,
    out: BatchAccelerations | None = None,
    **arguments: Unpack[StartArguments],
) -> Any: ...
@takes(StartArguments, unused=("q0", "zd0", "qd0", "closing"), former={"t": "t0"})
def accelerations(
    kernels: Kernels,
    q: ArrayOrNamed,
    zd: ArrayOrNamed,
    *,
    velocities: bool = False,
    threads: int | None = 1,
    out: BatchAccelerations | None = None,
    **arguments: Unpack[StartArguments],
) -> StateAccelerations | BatchAccelerations:
    """Compute the state derivative of one state or of many, for an integrator, an optimiser or a sampler of your own.

    Parameters
    ----------
    kernels : Kernels
        Compiled mechanism.
    q : array_like, shape (n,) or (B, n), or {name: values}
        Positions in m and rad, nearly assembled: dependent coordinates are projected onto the constraints by Newton's method.
    zd : array_like, shape (nz,) or (B, nz), or {name: values}
        Velocities of the independent coordinates in m/s and rad/s, in the order of `z`.
    velocities : bool
        Whether to return all velocities.
    threads : int, optional
        Number of threads of a batch; None for one on every processor that this process may use.
    out : BatchAccelerations, optional
        Earlier results of a batch, whose arrays are filled again and whose independent coordinates stay. With q = out.q positions stay in
        place, which is faster.
    **arguments : StartArguments
        `p`, the time `t0`, `inputs` as numbers, and `z`, chosen at the first regular state if not given. Rows make a batch, as of
        `simulate`.

    Returns
    -------
    StateAccelerations or BatchAccelerations
        Assembled position and accelerations; with rows those of every state, and its status.

    Raises
    ------
    ModelError
        For invalid arguments.
    ConvergenceError
        Where one state has no accelerations.
    """
    from ncgen.solver.motions.batch import StateAccelerations, accelerations_batch

    if has_rows({**arguments, "q": q, "zd": zd}, ("q", "zd", "p")):
        return accelerations_batch(kernels, q, zd, velocities=velocities, threads=threads, out=out, **arguments)
    refuse_batch_options("accelerations", threads=threads, out=out)
    batch = accelerations_batch(kernels, _one_row(q), zd, velocities=velocities, **arguments)
    if not batch.ok[0]:
        raise ConvergenceError(f"{kernels.name}: the state has no accelerations ({batch.status[0]}); start from a regular position")
    return StateAccelerations(batch.q[0], None if batch.qd is None else batch.qd[0], batch.zdd[0], batch.independent)


def _one_row(q: ArrayOrNamed) -> ArrayOrNamed:
    """Return one state as a batch of one."""
    return {name: [value] for name, value in q.items()} if isinstance(q, Mapping) else [q]  # type: ignore[list-item]
