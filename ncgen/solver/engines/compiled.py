"""The fast path: a simulation as one call of the C runtime, where a mechanism allows it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ncgen.errors import ConvergenceError, ModelError
from ncgen.mechanism.kernels import Kernels
from ncgen.mechanism.listening import Progress
from ncgen.mechanism.run_arguments import InitialState
from ncgen.solver.finite import on_the_way
from ncgen.solver.formalisms.kkt import MAX_DENSE_UNKNOWNS
from ncgen.solver.formalisms.projection import least_energy
from ncgen.solver.positions.branches import refresh_branches, rule_of
from ncgen.solver.positions.described_position import found_in_described, is_described
from ncgen.solver.positions.open_tree import open_tree
from ncgen.solver.positions.partition import Partitions, PartitionsAt, determined, stuck_message
from ncgen.solver.positions.rank import REMEMBERED
from ncgen.solver.runs.divergence import unsolved_step
from ncgen.solver.runs.path import Path
from ncgen.solver.runs.settings import Form, Partitioned
from ncgen.solver.runs.task import Task
from ncgen.solver.runs.tolerances import Tolerances

if TYPE_CHECKING:
    from ncgen.mechanism.constrained_dynamics import ConstrainedDynamics
    from ncgen.mechanism.prepared_run import PreparedRun, RunCall
    from ncgen.mechanism.run_rows import Outcome
    from ncgen.mechanism.runtime import DenseDynamics, EmittedDynamics
from ncgen.solver.engines.acceleration_forms import all_coordinates
from ncgen.solver.engines.capabilities import closeness
from ncgen.solver.engines.partition_dynamics import dynamics

GROWTH = 2.0
"""Other independent coordinates are looked for when ‖R‖² has grown by this factor: error control sees the independent
coordinates only, and R is what their errors are multiplied by."""

LEAST_ADVANCE, MOST_CREEPS = 1e-3, 10
"""A run that fails is begun again from where it has come to, unless it did so this often without coming farther than this share of its
duration each time."""

MOST_GROWTH = 8.0
"""Where nothing better is found when ‖R‖², or what small pivots count, has grown by this factor once more, after smaller ones, the emitted
order of elimination is no longer trusted."""

REUSE = 0.7
"""A choice of independent coordinates made earlier in the run is taken again if its quality is this share of the best."""

STIFFNESS_REASON = "the mechanism is stiff"
"""The reason of a run that was to end where an implicit integrator would serve better: the path goes on with that."""

FINAL = ("short", "not converged")
"""Statuses of a run that Python's engine, which has the same method, would not carry farther."""

MOST_EMITTED = 6
"""How many choices of independent coordinates are emitted and compiled in one run before the dense path takes over."""


def run_constrained(path: Path, kernels: Kernels, task: Task, form: Form = "dense") -> str | None:
    """Complete a path over a time grid with a formalism over all coordinates, from its last row on if it has any.

    form: of the accelerations
    Returns None, or why the run had to stop before the end of the grid: STIFFNESS_REASON where it was to end so. Raises DomainError where a
    term is not a number, ConvergenceError where steps become too short.
    """
    method, grid, p, work = task.method, task.grid, task.p, 0.0
    if len(path.q):
        q, qd, work = path.take_last()
        begun = len(path.q)
        call = _call(kernels, task, form, (begun, q, qd))
    else:
        begun, call = 0, task.calls.get((kernels, form)) or _whole_call(kernels, task, form)
    done = call.simulate(Progress(task.progress, kernels.name, task.arrival))
    task.looked_at(begun, done.t)
    path.take_run(done, work, bool(method.in_c["project"]))
    if done.stopped:
        path.stop(done.reached, done.last[0], done.last[1], work + done.last[2])
    if done.status == "ok":
        return None
    reason = _ended(path, kernels, grid, done, work, p)
    if done.status in FINAL and task.step:
        path.break_off(grid, done.reached, done.last[0], done.last[1], work + done.last[2])
        raise ConvergenceError(unsolved_step(kernels.name, done.reached, task.step))
    if done.status in FINAL and form != "dense" and method.integrator.tangents == "unless_recursive":
        return _by_the_matrix(path, kernels, task)
    if done.status in FINAL:
        path.halted = done.reached, done.last[0], done.last[1], work + done.last[2]
        raise ConvergenceError(
            f"{kernels.name}: the motion cannot continue beyond t = {done.reached:.6g} s, where steps become too short; the mechanism "
            "comes to a singular position there, or rtol asks for less than rounding leaves"
        )
    return reason


def _whole_call(kernels: Kernels, task: Task, form: Form) -> RunCall:
    """All of a task over all coordinates in C, kept with it for when it comes again."""
    if task.sibling is None:
        call = _call(kernels, task, form, (0, task.q, task.velocities))
    else:
        call = (task.sibling.calls.get((kernels, form)) or _whole_call(kernels, task.sibling, form)).with_velocities(task.velocities)
    task.calls[kernels, form] = call
    return call


def _call(kernels: Kernels, task: Task, form: Form, begun: tuple[int, np.ndarray, np.ndarray]) -> RunCall:
    """The rest of a task over all coordinates in C, but for what it may be looked at by.

    begun: the number of the instant at which it continues, position and velocities then
    """
    dynamics = all_coordinates(kernels, task.number, form, task.method.integrator.name)
    row, q, qd = begun
    times, p = task.grid[row:], task.p
    if dynamics.singular_mass and not dynamics.is_emitted and not task.first_step:
        # C regularises what has no inertia; here a motion that has none, and nothing to hold it, is refused by name. What goes on with
        # the step of a part before it has been checked.
        start, t = task.q, float(task.grid[0])
        key = start.tobytes(), t, p.tobytes()
        kernels.remember("inertia of all motions", key, lambda: _all_have_inertia(kernels, start, t, p), REMEMBERED)
    return _prepared(task, dynamics).call(
        times,
        InitialState(q, qd, p),
        inputs=task.inputs_in_c(rule_of(kernels)),
        conditions=task.watched,
        movable=task.movable_from(row),
        rank=task.rank_at(kernels, q, times[0]),
        errors=task.tolerances.errors,
        inspected=None if row else task.inspected,
    )


def _prepared(task: Task, dynamics: ConstrainedDynamics) -> PreparedRun:
    """The run of a task over all coordinates, but for its numbers."""
    run = task.runs.get(dynamics)
    if run is None:
        method, sizes = task.method, dynamics.kernels.column_sizes
        run = task.runs[dynamics] = dynamics.run_by(
            method.integrator.name, **method.in_c, tolerance=closeness(task.number), max_step=task.step_in_c,
            stop_when_stiff=int(task.stop_when_stiff), first_step=task.first_step, sizes=task.tolerances.in_c(sizes, sizes)["sizes"],
        )  # fmt: skip
    return run


SURE_INERTIA = 1e-8
"""The least eigenvalue of a mass matrix with 1 on its diagonal that rounding has no part in."""


def _all_have_inertia(kernels: Kernels, q: np.ndarray, t: float, p: np.ndarray) -> bool:
    """True. Raises SingularError where a motion that the constraints allow has no inertia."""

    def find() -> bool:
        tree = open_tree(kernels)
        masses = kernels.values("mass", t, q, None, p)
        if tree and tree.least_inertia(q, kernels.mass_pattern, masses) > SURE_INERTIA:
            return True
        return bool(least_energy(kernels, q, t, p))

    is_kept = kernels.n + kernels.m > MAX_DENSE_UNKNOWNS and is_described(kernels, q, t, p)
    return found_in_described(kernels, "inertia of all motions", find) if is_kept else find()


def _by_the_matrix(path: Path, kernels: Kernels, task: Task) -> str | None:
    """The rest of a run whose Newton steps in the degrees of freedom do not converge; its evaluations count as those that fall back."""
    before = path.evaluations
    reason = run_constrained(path, kernels, task)
    path.fallbacks += path.evaluations - before
    return reason


def _ended(path: Path, kernels: Kernels, grid: np.ndarray, done: Outcome, work: float, p: np.ndarray) -> str | None:
    """None for a run that came to its end, or why it did not; DomainError, or what it was ended by, with all that it reached.

    work: done before this run, which its own is added to
    """
    if done.status == "ok":
        return None
    q, qd, last_work = done.last
    if done.status == "stiff":
        return STIFFNESS_REASON
    problem = None if done.status in ("interrupted", "pivot") else on_the_way(kernels, q, qd, done.reached, done.tried, p)
    if problem or done.status == "interrupted":
        path.break_off(grid, done.reached, q, qd, work + last_work)
        raise problem or done.raised or KeyboardInterrupt()
    return f"the run in C stopped at t = {done.reached:.6g} s ({done.status})"


def run(path: Path, kernels: Kernels, task: Task, form: Partitioned) -> str | None:
    """Complete a path over a time grid, from its last row on if it has any, to its end or to a `Stop`; where the independent
    coordinates become bad, go on with others.

    form: of the state derivative
    Returns None, or why the run had to stop before the end of the grid: STIFFNESS_REASON where it was to end so. Raises DomainError where a
    term is not a number, ConvergenceError where steps become too short.
    """
    method, number, p, partitions = task.method, task.number, task.p, determined(path.partitions)
    used_partitions = [partitions]
    grid, growth, begun = np.asarray(task.grid, dtype=float), GROWTH, len(path.q) > 0
    q, qd, zd, work = task.q, np.zeros(kernels.n), task.velocities, 0.0
    if begun:
        q, qd, work = path.take_last()
        zd = qd[partitions.velocity.independent]
    times, movable = grid[len(path.q) :], task.movable_from(len(path.q))
    t, creeps, progress = float(times[0]), 0, Progress(task.progress, kernels.name, task.arrival)
    try:
        while True:
            progress(t)
            call = None if begun else task.calls.get((kernels, form))
            if call is None:
                call = _for_next(kernels, partitions, form, len(used_partitions), q, p, number).run_by(
                    method.integrator.name, max_step=task.step_in_c, tolerance=closeness(number), max_growth=growth,
                    stop_when_stiff=int(task.stop_when_stiff), **_in_c(task.tolerances, kernels, partitions),
                ).call(
                    times, InitialState(q, zd, p), inputs=task.inputs_in_c(rule_of(kernels)), conditions=task.watched, movable=movable,
                    inspected=None if begun else task.inspected,
                )  # fmt: skip
            if not begun:
                task.calls[kernels, form] = call
            done = call.simulate(progress)
            fresh = 0 if times[0] == grid[len(path.q)] else 1  # a first row off the grid is only where the last run stopped
            task.looked_at(len(path.q), done.t[fresh:])
            path.extend(done.q[fresh:], done.qd[fresh:], done.work[fresh:] + work)
            path.count_run(done)
            if done.stopped:
                path.stop(done.reached, done.last[0], done.last[1], work + done.last[2])
            if done.stopped or done.status == "ok" or len(path.q) == len(grid):
                path.inspection = None if begun or done.stopped else done.inspection
                return None
            lost = grid[len(path.q)] < done.reached  # rows inside a step that was taken
            reason = _ended(path, kernels, grid, done, work, p)
            if reason == STIFFNESS_REASON or lost:
                return reason
            is_small = done.reached - t < LEAST_ADVANCE * (grid[-1] - grid[0])
            creeps = creeps + 1 if is_small and done.status in FINAL else 0
            advanced, p = done.reached > t and creeps <= MOST_CREEPS, refresh_branches(kernels, done.last[0], p)
            t, q, qd, work, begun = done.reached, done.last[0], done.last[1], work + done.last[2], True
            before, partitions = partitions, _better(kernels, partitions, used_partitions, q, t, p)
            path.partitions, changed = partitions, partitions is not before
            if not changed and (done.status == "singular ahead" or (not advanced and done.status in (*FINAL, "pivot"))):
                unsolved = done.status == "not converged" and task.step
                raise ConvergenceError(unsolved_step(kernels.name, t, unsolved) if unsolved else stuck_message(kernels, t, task.step))
            if not (advanced or changed):
                return reason
            path.counts[3] += changed
            growth = GROWTH if changed else GROWTH * growth  # nothing better here: look again when it is worse
            form = form if growth <= MOST_GROWTH else "dense"
            zd = qd[partitions.velocity.independent]
            left = np.asarray(grid[len(path.q) :])
            times = np.concatenate([[t], left[left > t]])
            movable = np.append(False, task.movable_from(len(path.q))[left > t])
    except BaseException:
        if path.stopped is None and (len(path.q) or begun):  # else it had not begun
            path.break_off(grid, t, q, qd, work)
        raise


def _for_next(
    kernels: Kernels, partitions: Partitions, form: Partitioned, number_of_choices: int, q: np.ndarray, p: np.ndarray, number: str
) -> DenseDynamics | EmittedDynamics:
    """The state derivative of the choice that a run continues with: dense after many, or where a later one has no order to be emitted."""
    if number_of_choices <= MOST_EMITTED:
        try:
            return dynamics(kernels, partitions, form, q, p, number)
        except ModelError:
            if number_of_choices == 1:  # it was asked for
                raise
    return dynamics(kernels, partitions, "dense", q, p, number)


def _in_c(tolerances: Tolerances, kernels: Kernels, partitions: Partitions) -> dict[str, Any]:
    """Arguments of a run on independent coordinates."""
    return tolerances.in_c(*(kernels.column_sizes[partition.independent] for partition in (partitions.velocity, partitions.position)))


def _better(
    kernels: Kernels, partitions: Partitions, used_partitions: list[Partitions], q: np.ndarray, t: float, p: np.ndarray
) -> Partitions:
    """The best partition at q if it is clearly better than the present one; one used before in this run if it will do."""
    here = PartitionsAt(kernels, q, t, p)
    best, possible = here.better(partitions)
    if best is None:
        return partitions
    known = max(used_partitions, key=here.worth)
    if here.worth(known) >= REUSE * possible:
        return known
    used_partitions.append(best)
    return best
