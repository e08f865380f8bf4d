"""Simulations of many initial states or parameter sets of one mechanism, several side by side."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, Unpack

import numpy as np
from numpy.typing import ArrayLike

from ncgen.errors import ModelError, NcgenError, warn
from ncgen.mechanism.break_times import break_times_of_each
from ncgen.mechanism.driver_jumps import has_driver_jumps, may_jump
from ncgen.mechanism.kernels import Kernels
from ncgen.mechanism.run_arguments import InitialState
from ncgen.methods.method import Method
from ncgen.methods.table import AUTO, INTEGRATORS
from ncgen.model.argument_readers import truth
from ncgen.solver.argument_checks import ArrayOrNamed, checked_kernels, finite, has_events, names_of
from ncgen.solver.engines.compiled import GROWTH
from ncgen.solver.groups import MotionArguments, StartArguments
from ncgen.solver.motions.event_batches import INTERRUPTED, not_begun, status_of, through_events
from ncgen.solver.motions.simulate import simulate_one
from ncgen.solver.motions.states import CommonCoordinates, States, those_in_lanes
from ncgen.solver.positions.position import TOLERANCE
from ncgen.solver.runs.progress_reports import ProgressOption, reporting
from ncgen.solver.runs.run import Run
from ncgen.solver.runs.settings import COMPILED, count
from ncgen.solver.runs.signals import Signal, signals_of
from ncgen.solver.runs.tolerances import Tolerances
from ncgen.solver.trajectories.happening import Happening
from ncgen.solver.trajectories.trajectory import Trajectory

if TYPE_CHECKING:
    from ncgen.mechanism.batch_runs import LaneOutcome

IN_LANES = "dopri5"
"""What runs in lanes where the integrator is left open; states that it finds stiff are simulated alone by the default call."""

MOST_STEPS = 1_000_000
"""Steps with error control after which a state of a batch is given up."""


@dataclass(frozen=True, eq=False, kw_only=True)
class BatchTrajectory:
    """The motions of B states.

    t (points,): the time grid (s); q, qd (B, points, n); work (B, points): J, of drivers and forces without a potential
    independent: names of the independent coordinates
    status (B,): "ok", "interrupted", or a sentence that says why a state did not arrive; its rows from there on are NaN
    steps (B,): accepted ones
    alone (B,): states that could not go on with the others, mostly since their independent coordinates became bad or a driver's velocity
        jumps, so that they were simulated one at a time; with a model that has events those that C does not carry
    events (B,): what happened at the model's events, of each state in the order of time; () for a model without events
    """

    kernels: Kernels
    t: np.ndarray
    q: np.ndarray
    qd: np.ndarray
    work: np.ndarray
    independent: tuple[str, ...]
    status: tuple[str, ...]
    steps: np.ndarray
    alone: np.ndarray
    events: tuple[tuple[Happening, ...], ...] = ()

    def __repr__(self) -> str:
        return f"<BatchTrajectory {self.kernels.name}: {int(self.ok.sum())} of {len(self.q)} states arrived at {self.t[-1]:g} s>"

    @property
    def ok(self) -> np.ndarray:
        """Which states arrived, (B,)."""
        return np.array([s == "ok" for s in self.status])


@dataclass(frozen=True, eq=False)
class StateAccelerations:
    """The state derivative of one state: q (n,), assembled; zdd (nz,): accelerations of the independent coordinates.

    qd (n,): all velocities, None if they were not asked for; independent: names of the independent coordinates
    """

    q: np.ndarray
    qd: np.ndarray | None
    zdd: np.ndarray
    independent: tuple[str, ...]


@dataclass(frozen=True, eq=False, kw_only=True)
class BatchAccelerations:
    """What B states of a mechanism do: q (B, n), closed; zdd (B, nz): accelerations of the independent coordinates.

    qd (B, n): all velocities, None if they were not asked for; independent: names of the independent coordinates
    ok (B,): False where a position does not close, the mechanism is singular or a number is not finite; rows are NaN there
    status (B,): "ok", or which of these: "not converged", "singular" or "domain"
    """

    q: np.ndarray
    qd: np.ndarray | None
    zdd: np.ndarray
    codes: np.ndarray = field(repr=False)
    choice: CommonCoordinates = field(repr=False)

    def __repr__(self) -> str:
        return f"<BatchAccelerations of {', '.join(self.independent)}: {int(self.ok.sum())} of {len(self.q)} states>"

    @property
    def ok(self) -> np.ndarray:
        """Which states have accelerations, (B,)."""
        return self.codes == 0

    @property
    def status(self) -> tuple[str, ...]:
        """Words for every state."""
        from ncgen.mechanism.library import STATUS

        return tuple(STATUS[code] for code in self.codes.tolist())

    @property
    def independent(self) -> tuple[str, ...]:
        """Names of the independent coordinates."""
        return self.choice.names


def accelerations_batch(
    kernels: Kernels,
    q: ArrayOrNamed,
    zd: ArrayOrNamed,
    *,
    velocities: bool = False,
    threads: int | None = 1,
    out: BatchAccelerations | None = None,
    **arguments: Unpack[StartArguments],
) -> BatchAccelerations:
    """Compute the state derivatives of a batch; arguments, results and errors as of `accelerations` with rows."""
    p, t, z, inputs = arguments.get("p"), arguments.get("t0", 0.0), arguments.get("z"), arguments.get("inputs")
    values = checked_kernels(kernels).p0.copy()
    if signals_of(kernels, inputs, values):
        raise ModelError("inputs: accelerations needs numbers, or rows of p with a value for every state")
    t, z, threads = finite(t, "t0"), names_of(z, "z", kernels.coordinates), checked_threads(threads)
    velocities = truth(velocities, "velocities")
    if out is not None and (z or out.choice.kernels is not kernels):
        raise ModelError(f"{kernels.name}: out has results of {out.choice.kernels.name} with its own z; leave z or out out")
    if out is None:
        states = States.of(kernels, Method.of("coordinate-partitioning", "dopri5"), q0=q, zd0=zd, p=p, t0=t, z=z)
    else:
        states = States.of(kernels, None, out.choice, q0=q, zd0=zd, p=p, t0=t)
    states = _with_inputs(kernels, states, inputs, values)
    if out is not None:
        arrays = _places(kernels, out, states)
    else:
        arrays = np.empty(states.q.shape), np.empty(states.q.shape) if velocities else None, np.empty(states.zd.shape)
    codes = states.choice.lanes.accelerate(t, states.q, states.zd, states.p, arrays, threads, tolerance=TOLERANCE)
    q, qd, zdd = arrays
    return BatchAccelerations(q=q, qd=qd, zdd=zdd, codes=codes, choice=states.choice)


def _places(kernels: Kernels, out: BatchAccelerations, states: States) -> tuple[np.ndarray, np.ndarray | None, np.ndarray]:
    """The arrays of results of before, where C may write. Raises ModelError for others."""
    from ncgen.mechanism.arguments import writable

    if len(out.q) != len(states.q):
        raise ModelError(f"{kernels.name}: out has results of {len(out.q)} states; {len(states.q)} are needed, or leave it out")
    q, zd, p = states.q, states.zd, states.p
    stays = q.ctypes.data == out.q.ctypes.data and q.shape == out.q.shape
    writable(out.q, q.shape, f"{kernels.name}: out.q", (zd, p) if stays else (q, zd, p))
    if out.qd is not None:
        writable(out.qd, q.shape, f"{kernels.name}: out.qd", (q, zd, p, out.q))
    writable(out.zdd, zd.shape, f"{kernels.name}: out.zdd", (q, zd, p, out.q))
    return out.q, out.qd, out.zdd


def simulate_batch(
    kernels: Kernels,
    duration: float,
    *,
    points: int | ArrayLike = 2,
    threads: int | None = None,
    progress: ProgressOption = None,
    **arguments: Unpack[MotionArguments],
) -> BatchTrajectory:
    """Simulate a batch; arguments, results and errors as of `simulate` with rows."""
    inputs = arguments.get("inputs")
    in_common: dict[str, Any] = {**arguments, "formalism": "coordinate-partitioning"}
    q0, zd0, qd0, p = (in_common.pop(name, None) for name in ("q0", "zd0", "qd0", "p"))
    run = Run.from_arguments(checked_kernels(kernels), duration, points=points, progress=progress, **in_common)
    threads, method = checked_threads(threads), in_lanes(kernels, run)
    states = States.of(kernels, method, assembled=True, q0=q0, zd0=zd0, p=p, t0=run.initial.t, z=run.initial.z, qd0=qd0)
    states = _with_inputs(kernels, states, inputs, run.initial.p)
    if not np.isfinite(states.zd).all(axis=1).any():
        argument = "zd0" if qd0 is None else "qd0"
        raise ModelError(f"{kernels.name}: {argument} has numbers that are not finite in every state; correct them")
    with reporting(progress, f"simulating {len(states.q)} states of {kernels.name}", 0.0, 1.0) as advance:
        return side_by_side(kernels, run, method, states, threads, advance, inputs if run.signals else None)


def _with_inputs(kernels: Kernels, states: States, inputs: Mapping[str, Signal] | None, values: np.ndarray) -> States:
    """Return states whose parameters have the named inputs' values of p (n_p,)."""
    if not inputs:
        return states
    columns, p = [kernels.parameters.index(name) for name in inputs], states.p.copy()
    p[:, columns] = values[columns]
    return replace(states, p=p)


def side_by_side(
    kernels: Kernels,
    run: Run,
    method: Method,
    states: States,
    threads: int | None,
    progress: Callable[[float], None] | None,
    inputs: Mapping[str, Signal] | None = None,
) -> BatchTrajectory:
    """The motions of states that have a choice of independent coordinates in common, each with the bits that it has in any other batch.

    run: its times and tolerances; threads, progress: as of `simulate`; inputs: what changes with time, which lanes cannot follow
    """
    events: dict[int, tuple[Happening, ...]] = {}
    if has_events(kernels.model):
        done, events = through_events(kernels, run, method, states, threads, progress, inputs)
    elif inputs:
        done = not_begun(run, states)
    else:
        done = _begun(kernels, run, method, states, threads, progress)
    exhausted = np.flatnonzero((done.steps >= MOST_STEPS) & (np.array(done.status) != "ok"))
    for i in exhausted:
        done.status[i] = (
            f"{kernels.name}: {MOST_STEPS} steps came no further than t = {done.reached[i]:.6g} s; the state may be stiff, simulate it "
            "alone with integrator='radau', or take larger tolerances"
        )
    for i, fault in states.faults.items():
        done.status[i] = fault
    alone = np.array([status not in ("ok", INTERRUPTED) for status in done.status])
    alone[[*exhausted, *states.faults, *events]] = False
    batch = _Batch(kernels=kernels, grid=run.times.copy(), states=states, done=done, alone=alone, progress=progress, events=events)
    options = dict(
        t0=run.initial.t, points=run.times, integrator=method.integrator.name if run.settings.integrator else AUTO,
        rtol=run.settings.rtol, atol=run.settings.atol, max_step=run.settings.max_step, inputs=inputs,
    )  # fmt: skip
    try:
        if INTERRUPTED in done.status:
            raise done.raised or KeyboardInterrupt()
        batch.go_on_alone(run.duration, options)
    except BaseException as raised:
        vars(raised)["trajectory"] = batch.trajectory()
        raise
    return batch.trajectory()


def _begun(
    kernels: Kernels, run: Run, method: Method, states: States, threads: int | None, progress: Callable[[float], None] | None
) -> LaneOutcome:
    """What came of states in lanes; those in which a driver's velocity jumps have not begun, since lanes take no impulses."""
    breaks = break_times_of_each(kernels, states.p, run.times[0], run.times[-1])
    if breaks is None or not may_jump(kernels):
        return _in_lanes(kernels, run, method, states, threads, progress, breaks)
    pairs = enumerate(zip(states.p, states.q, breaks, strict=True))
    smooth = [i for i, each in pairs if not has_driver_jumps(kernels, *each)]
    done = not_begun(run, states)
    if not smooth:
        return done
    some = replace(states, q=states.q[smooth], zd=states.zd[smooth], p=states.p[smooth], faults={})
    outcome = _in_lanes(kernels, run, method, some, threads, progress, [breaks[i] for i in smooth])
    for name in ("q", "qd", "work", "steps", "reached"):
        getattr(done, name)[smooth] = getattr(outcome, name)
    for i, status in zip(smooth, outcome.status, strict=True):
        done.status[i] = status
    return replace(done, raised=outcome.raised)


def _in_lanes(
    kernels: Kernels, run: Run, method: Method, states: States, threads: int | None, progress: Callable[[float], None] | None,
    breaks: list[np.ndarray] | None,
) -> LaneOutcome:  # fmt: skip
    sizes = kernels.column_sizes[states.choice.indices]
    tolerances = Tolerances.of(run, kernels.length, float(np.finfo(float).eps)).in_c(sizes, sizes)
    return states.choice.lanes.simulate(
        method.integrator.name, run.times, InitialState(states.q, states.zd, states.p), threads, progress, breaks, tolerance=TOLERANCE,
        max_growth=GROWTH, max_step=0.0 if np.isinf(run.settings.max_step) else run.settings.max_step, max_steps=MOST_STEPS,
        stop_when_stiff=int(run.settings.integrator is None), **tolerances,
    )  # fmt: skip


def in_lanes(kernels: Kernels, run: Run) -> Method:
    """The method of a batch, by IN_LANES where the integrator is left open. Raises ModelError where the formalism is."""
    if run.settings.formalism is None:
        raise ModelError(f"{kernels.name}: a batch has no choice of its own; name one of {those_in_lanes()}")
    return Method(run.settings.formalism, run.settings.integrator or INTEGRATORS[IN_LANES])


@dataclass(kw_only=True)
class _Batch:
    """A batch after its run in lanes. alone: states that are still to be simulated one at a time."""

    kernels: Kernels
    grid: np.ndarray
    states: States
    done: LaneOutcome
    alone: np.ndarray
    progress: Callable[[float], None] | None
    events: dict[int, tuple[Happening, ...]]

    def trajectory(self) -> BatchTrajectory:
        done = self.done
        names, status = self.states.choice.names, tuple(done.status)
        events = tuple(self.events.get(i, ()) for i in range(len(status))) if has_events(self.kernels.model) else ()
        return BatchTrajectory(
            kernels=self.kernels,
            t=self.grid,
            q=done.q,
            qd=done.qd,
            work=done.work,
            independent=names,
            status=status,
            steps=done.steps,
            alone=self.alone,
            events=events,
        )

    def go_on_alone(self, duration: float, options: dict[str, Any]) -> None:
        """Simulate those that could not go on with the others; what they warn of is reported once."""
        done, left = self.done, np.flatnonzero(self.alone).tolist()
        for i in left:
            done.status[i] = INTERRUPTED  # until it is done
        warned = []
        for k, i in enumerate(left):
            if self.progress:
                self.progress(1.0 - (len(left) - k) / len(done.status))
            with warnings.catch_warnings(record=True) as caught:
                warnings.simplefilter("always")
                done.status[i] = self._simulate(i, duration, options)
            warned += [f"state {i}: {caught[0].message}"] if caught else []
        if self.progress:
            self.progress(1.0)
        if warned:
            summary = f"{len(warned)} of {len(left)} states simulated alone had warnings; {warned[0]}"
            warn(f"{self.kernels.name}: {summary}")

    def _simulate(self, i: int, duration: float, options: dict[str, Any]) -> str:
        """Simulate one state; its status."""
        states = self.states
        start = dict(q0=states.q[i], zd0=states.zd[i], p=states.p[i], z=states.choice.names)
        try:
            run = simulate_one(self.kernels, duration, engine=COMPILED, **start, **options)  # in Python a hopeless state takes very long
        except NcgenError as error:
            return str(error)
        except (ArithmeticError, np.linalg.LinAlgError) as error:
            return f"{self.kernels.name}: a calculation failed ({' '.join(str(error).split())}); correct this state"
        return self._take(i, run)

    def _take(self, i: int, run: Trajectory) -> str:
        """Keep what one state gave, as far as it is on the grid; its status."""
        done, count = self.done, len(run.t) if run.t[-1] == self.grid[len(run.t) - 1] else len(run.t) - 1
        done.q[i, :count], done.qd[i, :count], done.work[i, :count] = run.q[:count], run.qd[:count], run.work[:count]
        done.steps[i], self.events[i] = run.statistics.steps, run.events
        return status_of(self.kernels, count == len(self.grid), run.events, float(run.t[-1]))


def checked_threads(threads: int | None) -> int | None:
    """How many threads, None for all. Raises ModelError for anything but a positive whole number."""
    return None if threads is None else count(threads, "threads", 1, "give a positive whole number, or None for all processors")
