"""The reference engine: coordinate partitioning in Python, stepped by SciPy's integrators.

It is there to be read and to hold the C engine against, and it runs what C does not.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from typing import TypeAlias

import numpy as np
from scipy.integrate import OdeSolver

from ncgen.errors import ConvergenceError, DomainError, SingularError
from ncgen.mechanism.kernels import Kernels
from ncgen.solver.finite import on_the_way, watched
from ncgen.solver.formalisms.coordinate_partitioning import Motion, Start, motion, motion_at
from ncgen.solver.formalisms.dynamics_jacobian import partitioned_jacobian
from ncgen.solver.integrators.shared_tolerance import sharing
from ncgen.solver.integrators.solvers import Pace, ode_solver, takes_jacobian
from ncgen.solver.positions.branches import refresh_branches
from ncgen.solver.positions.partition import BETTER, Partitions, determined, other_partitions, quality, stuck_message
from ncgen.solver.runs.path import Path
from ncgen.solver.runs.stop import Stop
from ncgen.solver.runs.task import Task

State: TypeAlias = tuple[np.ndarray, np.ndarray, Motion, float]
"""q (n,), q̇ (n,), the motion there, and work (J)."""

DEGRADED = 0.7
"""Another partition is looked for when the quality falls below this share of what it was when chosen: late changes
cost more in short steps than early ones in restarts."""

RETRIES = 8
"""How often a step whose position problem fails is tried again, each time four times shorter."""


def run(path: Path, kernels: Kernels, task: Task) -> None:
    """Complete a path over a time grid, from its last row on if it has any, to its end or to a `Stop`.

    Raises ConvergenceError or SingularError with the time where the motion cannot go on, DomainError naming what is not a
    number there. Whatever is raised, by `progress` or by Ctrl-C as well, the path holds what was reached.
    """
    kernels, work, partitions = watched(kernels), 0.0, determined(path.partitions)
    q, zd = task.q, task.velocities
    if len(path.q):
        q, qd, work = path.take_last()
        zd = qd[partitions.velocity.independent]
    engine = _Run(kernels, task, partitions)
    try:
        engine.integrate(q, zd, task.grid[len(path.q) :])
    except BaseException:
        engine.hand_over(path, work)
        if engine.reached:
            here, own = engine.reached
            path.break_off(task.grid, here.t, here.q, here.qd, work + own)
        raise
    engine.hand_over(path, work)


class _Run:
    """One integration: counters, the current partition, the start of the current step, and what was found so far.

    motions, work: at the times of the grid; reached: motion and work at the end of the last step
    """

    def __init__(self, kernels: Kernels, task: Task, partitions: Partitions) -> None:
        self.kernels, self.task, self.partitions = kernels, task, partitions
        self.integrator = task.method.integrator
        self.solver: Callable[..., OdeSolver] = sharing(ode_solver(self.integrator), task.tolerances.span, task.before)
        self.end = task.grid[-1]
        self.stopped: float | None = None
        self.motions: list[Motion] = []
        self.work: list[float] = []
        self.reached: tuple[Motion, float] | None = None
        self.jacobians = self.steps = self.evaluations = self.newton = self.changes = self.rejections = 0

    def hand_over(self, path: Path, work: float) -> None:
        """Put what was found into a path; work: done before."""
        if self.motions:
            path.extend([m.q for m in self.motions], [m.qd for m in self.motions], np.array(self.work) + work, self.counts)
        path.stopped = self.stopped
        path.jacobians += self.jacobians
        path.partitions = self.partitions

    def integrate(self, q: np.ndarray, zd: np.ndarray, grid: np.ndarray) -> None:
        """Find motions and work at the times of the grid, or at those before the stop and there."""
        t, p, stop, progress = grid[0], self.task.p, self.task.stop, self.task.progress
        here = motion_at(self.kernels, self.partitions.velocity, t, q, zd, p)
        self.start = Start(t, here.q, here.qd, p)
        self.pace = Pace(t, self.end - t)
        self.reference = self._quality(self.partitions, here)
        solver = self._solver(t, here, 0.0)
        self._note(here, 0.0)
        self.reached = here, 0.0
        while solver.status == "running":
            solver = self._step(solver, here)
            before, here = here, self._motion(solver.t, solver.y)
            found = self._stop(solver, stop, before, here) if stop else None
            between = None
            while (done := len(self.motions)) < len(grid) and (grid[done] < found[0] if found else grid[done] <= solver.t):
                instant, y = grid[done], solver.y
                if instant != solver.t:
                    between = between or solver.dense_output()
                    y = between(instant)
                self._note(self._motion(instant, y), float(y[-1]))
            if found:
                self._note(*found[1][2:])
                return
            self.reached = here, float(solver.y[-1])
            self._accept(here)
            if progress:
                progress(solver.t)
            if solver.status == "running" and self._repartition(here):
                solver = self._solver(here.t, here, solver.y[-1])

    def _note(self, motion: Motion, work: float) -> None:
        self.motions.append(motion)
        self.work.append(work)

    def _stop(self, solver: OdeSolver, stop: Stop, before: Motion, here: Motion) -> tuple[float, State] | None:
        """(time, (q, q̇, motion, work)) at which the last step passed the stop, or None."""
        between = solver.dense_output()

        def state(t: float) -> State:
            y = between(t)
            now = self._motion(t, y)
            return now.q, now.qd, now, float(y[-1])

        ends = (before.q, before.qd, before, 0.0), (here.q, here.qd, here, float(solver.y[-1]))
        found = stop.find(before.t, here.t, *ends, state)
        self.stopped = found[0] if found else None
        return found

    @property
    def counts(self) -> list[int]:
        return [self.steps, self.evaluations, self.newton, self.changes, self.rejections]

    def _solver(self, t: float, here: Motion, work: float, first_step: float | None = None) -> OdeSolver:
        velocities, positions = self.partitions.velocity.independent, self.partitions.position.independent
        self.orientation = 0  # of this partition, from its first evaluation on
        y = np.concatenate([here.qd[velocities], here.q[positions], [work]])
        sizes = self.kernels.column_sizes
        options = self.task.tolerances.for_scipy(sizes[velocities], sizes[positions])
        if takes_jacobian(self.integrator, self.kernels):
            options["jac"] = self._jacobian
        return self.solver(self._derivative, t, y, self.end, first_step=first_step, max_step=self.task.max_step, **options)

    def _jacobian(self, t: float, y: np.ndarray) -> np.ndarray:
        self.jacobians += 1
        return partitioned_jacobian(self.kernels, self.partitions, self._motion(t, y), self.start.p)

    def _step(self, solver: OdeSolver, here: Motion) -> OdeSolver:
        """One accepted step; returns the solver that made it, a fresh one if the position problem failed on the way."""
        work, message = solver.y[-1], None
        for attempt in range(RETRIES + 1):
            try:
                with warnings.catch_warnings():
                    warnings.simplefilter("ignore", RuntimeWarning)  # SciPy warns of NaN; it is reported below
                    message = solver.step()
                break
            except (ConvergenceError, SingularError, DomainError) as error:
                if attempt == RETRIES:
                    if isinstance(error, DomainError):
                        raise
                    raise type(error)(stuck_message(self.kernels, here.t, self.task.step)) from error
                self.rejections += 1
                self._repartition(here, any_better=True)
                length = min(getattr(solver, "h_abs", np.inf), self.end - here.t) / 4 ** (attempt + 1)
                solver = self._solver(here.t, here, work, first_step=length)
        self.steps += 1
        creeps = self.pace.creeps(solver.t)
        if creeps or solver.status == "failed" or not np.all(np.isfinite(solver.y)):
            step = self.task.step if message else None
            message = message or ("steps become tiny" if creeps else "the state is not finite")
            raise on_the_way(self.kernels, here.q, here.qd, here.t, solver.t, self.start.p) or ConvergenceError(
                stuck_message(self.kernels, here.t, step)
                if step
                else f"{self.kernels.name}: the integration stops at t = {solver.t:.6g} s ({message}); "
                "the motion may become singular there, or try another integrator or tolerance"
            )
        return solver

    def _derivative(self, t: float, y: np.ndarray) -> np.ndarray:
        self.evaluations += 1
        now = self._motion(t, y)
        velocities, positions = self.partitions.velocity.independent, self.partitions.position.independent
        return np.concatenate([now.qdd[velocities], now.qd[positions], [now.power]])

    def _motion(self, t: float, y: np.ndarray) -> Motion:
        count = len(self.partitions.velocity.independent)
        now = motion(self.kernels, self.partitions, self.start, t, y[count:-1], y[:count])
        self.newton += now.iterations
        self.orientation = self.orientation or now.orientation
        if now.orientation != self.orientation:
            raise SingularError(
                f"{self.kernels.name}: a position beyond a singular one of the dependent coordinates, perhaps on another branch"
            )
        return now

    def _accept(self, here: Motion) -> None:
        self.start = Start(here.t, here.q, here.qd, refresh_branches(self.kernels, here.q, self.start.p))

    def _quality(self, partitions: Partitions, here: Motion) -> float:
        return min(quality(self.kernels, p, here.q, here.t, self.start.p) for p in {partitions.position, partitions.velocity})

    def _repartition(self, here: Motion, any_better: bool = False) -> bool:
        """Change to other independent coordinates for the same motion, if the present ones have become bad."""
        now = self._quality(self.partitions, here)
        if now > DEGRADED * self.reference and not any_better:
            return False
        try:
            other = other_partitions(self.kernels, self.partitions, here.q, here.t, self.start.p)
        except SingularError:
            return False  # no choice is good here: the steps will show whether the motion can go on
        possible = self._quality(other, here)
        if possible < BETTER * now:
            return False
        self.partitions, self.reference = other, possible
        self.changes += 1
        return True
