"""Simulation over all coordinates: y = [q̇; q; W] with accelerations from any formalism.

Nothing in the state knows of the constraints, so after every accepted step position and velocity are projected onto
them, unless the formalism itself holds them (Baumgarte, penalty). Interpolated instants are projected as well.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from functools import partial

import numpy as np
from scipy.integrate import OdeSolver

from ncgen.errors import ConvergenceError, DomainError, SingularError
from ncgen.mechanism.kernels import Kernels
from ncgen.solver.engines.motion_in_c import MotionInC
from ncgen.solver.finite import on_the_way, watched
from ncgen.solver.formalisms import accelerations_by
from ncgen.solver.formalisms.coordinate_partitioning import Motion
from ncgen.solver.formalisms.dynamics_jacobian import full_jacobian
from ncgen.solver.formalisms.projection import project
from ncgen.solver.integrators.shared_tolerance import sharing
from ncgen.solver.integrators.solvers import Pace, ode_solver, replace_state, takes_jacobian
from ncgen.solver.positions.branches import refresh_branches
from ncgen.solver.positions.rank import best_rows, scaled_jacobian
from ncgen.solver.runs.divergence import unsolved_step
from ncgen.solver.runs.path import Path
from ncgen.solver.runs.stop import Stop
from ncgen.solver.runs.task import Task


def run(path: Path, kernels: Kernels, task: Task) -> None:
    """Fill an empty path over a time grid, to its end or to a `Stop`.

    Raises ConvergenceError or SingularError with the time where the motion cannot go on, DomainError naming what is not a
    number there. Whatever is raised, by `progress` or by Ctrl-C as well, the path holds what was reached.
    """
    run = _Run(path, kernels, task)
    try:
        run.integrate()
    except BaseException:
        if run.reached:
            t, y = run.reached
            path.break_off(task.grid, t, y[run._q], y[: kernels.n], float(y[-1]))
        raise


RETRIES = 8
"""How often a step with a term that is not a number is tried again, each time four times shorter."""


class _Run:
    """One integration: counters, the parameters of the current step, and the time and state `reached`."""

    def __init__(self, path: Path, kernels: Kernels, task: Task) -> None:
        self.path, self.kernels, self.task, self.method, self.p = path, watched(kernels), task, task.method, task.p
        self.accelerations = accelerations_by(self.method.formalism.name)
        self.rank = task.rank_at(kernels, task.q, task.grid[0])
        self.reached: tuple[float, np.ndarray] | None = None
        self.projecting = self.method.options["stabilisation"] == "projection"
        self.rows: np.ndarray | None = None
        self.solver: OdeSolver | None = None
        self.evaluations = 0
        self.in_c = MotionInC.of(kernels, task, self.rank)

    def integrate(self) -> None:
        task, grid, stop = self.task, self.task.grid, self.task.stop
        self._choose_rows(task.q, grid[0])
        sizes = self.kernels.column_sizes
        options = {**task.tolerances.for_scipy(sizes, sizes), "max_step": task.max_step}
        if takes_jacobian(self.method.integrator, self.kernels):
            options["jac"] = self._jacobian
        make = partial(
            sharing(ode_solver(self.method.integrator), task.tolerances.span, task.before), self._derivative, t_bound=grid[-1], **options
        )
        solver = self.solver = make(t0=grid[0], y0=np.concatenate([task.velocities, task.q, [0.0]]))
        self._record([solver.y])
        start, before = self.reached = solver.t, solver.y
        taken, self.pace = 0, Pace(grid[0], grid[-1] - grid[0])
        while solver.status == "running":
            solver = self._step(solver, make, start, before)
            taken += 1
            y = self._closed(solver.t, solver.y)
            found = self._stop(solver, stop, start, before, y) if stop else None
            end = found[0] if found else solver.t
            ahead = grid[len(self.path.q) :]
            inner = ahead[ahead < end]
            if len(inner):
                between = solver.dense_output()
                self._record([self._closed(t, between(t)) for t in inner])
            if found:
                q, qd, y = found[1]
                self.path.stop(end, q, qd, float(y[-1]))
                break
            if self.projecting and y is not solver.y:
                replace_state(solver, y)
            if len(self.path.q) < len(grid) and grid[len(self.path.q)] == solver.t:
                self._record([y])
            start, before = self.reached = solver.t, y
            self.p = refresh_branches(self.kernels, y[self._q], self.p)
            self._choose_rows(y[self._q], solver.t)
            if task.progress:
                task.progress(solver.t)
        self.path.counts = self.path.counts + [taken, self.evaluations, 0, 0, 0]

    def _stop(
        self, solver: OdeSolver, stop: Stop, start: float, before: np.ndarray, after: np.ndarray
    ) -> tuple[float, tuple[np.ndarray, np.ndarray, np.ndarray]] | None:
        """(time, (q, q̇, y)) at which the last step passed the stop, or None."""
        between = solver.dense_output()

        def parts(y: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
            return y[self._q], y[: self.kernels.n], y

        return stop.find(start, solver.t, parts(before), parts(after), lambda t: parts(self._closed(t, between(t))))

    @property
    def _q(self) -> slice:
        return slice(self.kernels.n, -1)

    def _record(self, states: list[np.ndarray]) -> None:
        if states:
            y = np.array(states)
            self.path.extend(y[:, self._q], y[:, : self.kernels.n], y[:, -1], [0] * 5)

    def _derivative(self, t: float, y: np.ndarray) -> np.ndarray:
        self.evaluations += 1
        if getattr(self.solver, "repeated", False):  # as in C, where it is said why
            y = self._closed(t, y, note=False)
        if self.in_c and (slope := self.in_c.derivative(t, y, self.p)) is not None:
            return slope
        now = self.motion(t, y)
        return np.concatenate([now.qdd, now.qd, [now.power]])

    def motion(self, t: float, y: np.ndarray) -> Motion:
        q, qd = y[self._q], y[: self.kernels.n]
        return self.accelerations.motion(self.kernels, q, qd, t, self.p, self.method.options, self.rows)

    def _jacobian(self, t: float, y: np.ndarray) -> np.ndarray:
        self.path.jacobians += 1
        gains = self.accelerations.gains(self.method.options)
        return full_jacobian(self.kernels, self.motion(t, y), self.p, self.rows, gains)

    def _choose_rows(self, q: np.ndarray, t: float) -> None:
        """Of redundant rows those farthest from dependent: off the constraints, where a method's stages are, the others contradict them."""
        if self.rank < self.kernels.m and self.method.formalism.name != "penalty":  # which needs all of them, as in C
            self.rows = best_rows(scaled_jacobian(self.kernels, q, t, self.p), self.rank)

    def _step(self, solver: OdeSolver, make: Callable[..., OdeSolver], start: float, y: np.ndarray) -> OdeSolver:
        """One accepted step from a state; returns the solver that made it, a fresh one if a term was not a number on the way."""
        message = None
        for attempt in range(RETRIES + 1):
            try:
                with warnings.catch_warnings():
                    warnings.simplefilter("ignore", RuntimeWarning)  # SciPy warns of NaN; it is reported below
                    message = solver.step()
                break
            except SingularError as error:
                raise SingularError(f"{error}; at t = {start:.6g} s") from error
            except DomainError:
                if attempt == RETRIES:
                    raise
                length = min(getattr(solver, "h_abs", np.inf), solver.t_bound - start) / 4 ** (attempt + 1)
                solver = self.solver = make(t0=start, y0=y, first_step=length)
        creeps = self.pace.creeps(solver.t)
        if creeps or solver.status == "failed" or not np.all(np.isfinite(solver.y)):
            step = self.task.step if message else None
            message = message or ("steps become tiny" if creeps else "the state is not finite")
            raise on_the_way(self.kernels, y[self._q], y[: self.kernels.n], start, solver.t, self.p) or ConvergenceError(
                unsolved_step(self.kernels.name, start, step)
                if step
                else f"{self.kernels.name}: the integration stops at t = {solver.t:.6g} s ({message}); "
                "the motion may become singular there, or try another integrator or tolerance"
            )
        return solver

    def _closed(self, t: float, y: np.ndarray, note: bool = True) -> np.ndarray:
        """The state on the constraints; itself if nothing is to be done. note: the statistics count it"""
        if not self.projecting:
            return y
        if self.in_c and (closed := self.in_c.closed(t, y, self.p)) is not None:
            if note:
                self.path.note_projection(closed[1])
            return closed[0]
        qd, q = y[: self.kernels.n], y[self._q]
        found = project(self.kernels, q, qd, t, self.p)
        if found.q is q and found.qd is qd:
            return y
        if note:
            self.path.note_projection(found.moved, found.steps)
        return np.concatenate([found.qd, found.q, y[-1:]])
