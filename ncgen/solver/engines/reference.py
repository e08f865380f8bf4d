"""The reference: motions in Python, to be read and to hold C against. SciPy's integrators step the state y = [velocities; positions; W].

`Independent` integrates independent coordinates alone, and continues with others where these become bad. `AllCoordinates` integrates all of
them, and projects every accepted state, and every instant in between, onto the constraints, unless the formalism holds them itself. It runs
where there is no compiler, and what only SciPy or SUNDIALS has: over all coordinates this takes accelerations and projections of C.
"""

from __future__ import annotations

import warnings
from abc import ABC, abstractmethod
from typing import TypeAlias

import numpy as np
from scipy.integrate import OdeSolver

from ncgen.errors import ConvergenceError, DomainError, NcgenError, SingularError
from ncgen.mechanism.kernels import Kernels
from ncgen.solver.engines.motion_in_c import MotionInC
from ncgen.solver.finite import on_the_way, watched
from ncgen.solver.formalisms import accelerations_of
from ncgen.solver.formalisms.coordinate_partitioning import Motion, StepStart, motion, motion_at
from ncgen.solver.formalisms.dynamics_jacobian import full_jacobian, partitioned_jacobian
from ncgen.solver.formalisms.projection import project
from ncgen.solver.integrators.shared_tolerance import sharing
from ncgen.solver.integrators.solvers import Pace, ode_solver, replace_state, takes_jacobian
from ncgen.solver.positions.branches import refresh_branches
from ncgen.solver.positions.kinematics import kinematics
from ncgen.solver.positions.partition import Partitions, PartitionsAt, determined, stuck_message
from ncgen.solver.positions.partition_watch import PartitionWatch
from ncgen.solver.positions.rank import scaled_jacobian
from ncgen.solver.positions.row_choice import counting_rows, largest_share
from ncgen.solver.runs.path import Path
from ncgen.solver.runs.task import Task

State: TypeAlias = tuple[np.ndarray, np.ndarray, float]
"""q (n,), q̇ (n,) and work (J)."""

RETRIES = 8
"""How often a step that has no derivative somewhere is tried again, each time four times shorter."""

MUCH_LARGER = 10.0
"""Growth of the shares with which rows that count imply others that asks for another choice of them."""


def run(path: Path, kernels: Kernels, task: Task) -> None:
    """Complete a path over a time grid, from its last row on if it has any, to its end or to a `Stop`.

    Raises ConvergenceError or SingularError with the time where the motion cannot go on, DomainError naming what is not a
    number there. Whatever is raised, by `progress` or by Ctrl-C as well, the path holds what was reached.
    """
    engine = (AllCoordinates if task.method.is_constrained else Independent)(path, kernels, task)
    try:
        engine.integrate()
    except BaseException:
        if engine.reached:
            path.break_off(task.grid, *engine.reached)
        raise
    finally:
        engine.hand_over()


class ReferenceRun(ABC):
    """One integration: counters, the solver, and the time and state `reached` at the end of the last step."""

    def __init__(self, path: Path, kernels: Kernels, task: Task) -> None:
        self.path, self.kernels, self.task, self.p = path, watched(kernels), task, task.p
        self.reached: tuple[float, np.ndarray, np.ndarray, float] | None = None
        self.steps = self.evaluations = self.newton = self.changes = self.repeated = 0

    # -- what a formalism says ----------------------------------------------------------------

    @abstractmethod
    def begin(self, t: float, q: np.ndarray, qd: np.ndarray | None) -> tuple[np.ndarray, np.ndarray]:
        """Get ready at a position and velocities, None for those of the task. Returns both."""

    @property
    @abstractmethod
    def own(self) -> tuple[np.ndarray, np.ndarray]:
        """Which velocities, and which positions, are integrated."""

    @abstractmethod
    def derivative(self, t: float, y: np.ndarray) -> np.ndarray: ...

    @abstractmethod
    def jacobian(self, t: float, y: np.ndarray) -> np.ndarray: ...

    @abstractmethod
    def state(self, t: float, y: np.ndarray) -> State:
        """The state on the constraints."""

    @abstractmethod
    def accept(self, solver: OdeSolver, state: State) -> OdeSolver:
        """Go on from an accepted state, whose parameters are there: with the solver or a fresh one."""

    @abstractmethod
    def stuck(self, error: NcgenError, t: float, is_last: bool) -> NcgenError | None:
        """What to raise where a step from t (s) found no derivative; None where a shorter one may, which is tried next."""

    # -- the integration ----------------------------------------------------------------------

    def integrate(self) -> None:
        """Fill the path, step by step."""
        path, task = self.path, self.task
        q, qd, work = path.take_last() if len(path.q) else (task.q, None, 0.0)
        grid, t = task.grid, float(task.grid[len(path.q)])
        now: State = (*self.begin(t, q, qd), work)
        solver, self.pace = self.fresh(t, now), Pace(t, grid[-1] - t)
        self._record([now])
        self.reached = t, *now
        while solver.status == "running":
            solver = self._step(solver, t, now)
            before, now = now, self.state(solver.t, solver.y)
            event = None
            if task.stop:
                between = solver.dense_output()
                event = task.stop.find(t, solver.t, before, now, lambda t, between=between: self.state(t, between(t)))
            ahead = grid[len(path.q) :]
            inner = ahead[ahead < (event[0] if event else solver.t)]
            if len(inner):
                between = solver.dense_output()
                self._record([self.state(t, between(t)) for t in inner])
            if event:
                path.stop(event[0], *event[1])
                return
            if len(path.q) < len(grid) and grid[len(path.q)] == solver.t:
                self._record([now])
            t = float(solver.t)
            self.reached = t, *now
            self.p = refresh_branches(self.kernels, now[0], self.p)
            solver = self.accept(solver, now)
            if task.progress:
                task.progress(t)

    def fresh(self, t: float, state: State, first_step: float | None = None) -> OdeSolver:
        """A solver at a state."""
        (velocities, positions), sizes, task = self.own, self.kernels.column_sizes, self.task
        q, qd, work = state
        options = task.tolerances.for_scipy(sizes[velocities], sizes[positions]) | {"first_step": first_step, "max_step": task.max_step}
        if takes_jacobian(task.method.integrator, self.kernels):
            options["jac"] = self._counted_jacobian
        make = sharing(ode_solver(task.method.integrator), task.tolerances.span, task.before)
        y = np.concatenate([qd[velocities], q[positions], [work]])
        return make(self._counted_derivative, t, y, task.grid[-1], **options)

    def hand_over(self) -> None:
        """Give the path what was counted."""
        self.path.add_counts([self.steps, self.evaluations, self.newton, self.changes, self.repeated])

    def _counted_derivative(self, t: float, y: np.ndarray) -> np.ndarray:
        self.evaluations += 1
        return self.derivative(t, y)

    def _counted_jacobian(self, t: float, y: np.ndarray) -> np.ndarray:
        self.path.jacobians += 1
        return self.jacobian(t, y)

    def _record(self, states: list[State]) -> None:
        q, qd, work = zip(*states, strict=True)
        self.path.extend(np.array(q), np.array(qd), np.array(work))

    def _step(self, solver: OdeSolver, t: float, state: State) -> OdeSolver:
        """One accepted step from a state; returns the solver that made it, a fresh one if there was no derivative on the way."""
        (q, qd, _), message = state, None
        for attempt in range(RETRIES + 1):
            try:
                with warnings.catch_warnings():
                    warnings.simplefilter("ignore", RuntimeWarning)  # SciPy warns of NaN; it is reported below
                    message = solver.step()
                break
            except (ConvergenceError, SingularError, DomainError) as error:
                raised = self.stuck(error, t, attempt == RETRIES)
                if raised is error:
                    raise
                if raised:
                    raise raised from error
                self.repeated += 1
                length = min(getattr(solver, "h_abs", np.inf), self.task.grid[-1] - t) / 4 ** (attempt + 1)
                solver = self.fresh(t, state, length)
        self.steps += 1
        creeps = self.pace.creeps(solver.t)
        if creeps or solver.status == "failed" or not np.all(np.isfinite(solver.y)):
            message = message or ("steps become tiny" if creeps else "the state is not finite")
            raise on_the_way(self.kernels, q, qd, t, solver.t, self.p) or ConvergenceError(
                f"{self.kernels.name}: the integration stops at t = {solver.t:.6g} s ({message}); "
                "the motion may become singular there, or try another integrator or tolerance"
            )
        return solver


class AllCoordinates(ReferenceRun):
    """y = [q̇; q; W] with the accelerations of a formalism. rows: of redundant ones those that count; None where all do"""

    def __init__(self, path: Path, kernels: Kernels, task: Task) -> None:
        super().__init__(path, kernels, task)
        self.accelerations, self.options = accelerations_of(task.method.formalism), task.method.options
        self.is_projected, self.rows = self.options["stabilisation"] == "projection", None
        self.share, self.rank = 1.0, task.rank_at(kernels, task.q, float(task.grid[0]))
        self.in_c = MotionInC.of(kernels, task, self.rank)

    def begin(self, t: float, q: np.ndarray, qd: np.ndarray | None) -> tuple[np.ndarray, np.ndarray]:
        self._choose_rows(t, q)
        return q, self.task.velocities if qd is None else qd

    @property
    def own(self) -> tuple[np.ndarray, np.ndarray]:
        return np.arange(self.kernels.n), np.arange(self.kernels.n)

    def derivative(self, t: float, y: np.ndarray) -> np.ndarray:
        if self.in_c and (derivative := self.in_c.derivative(t, y, self.p)) is not None:
            return derivative
        now = self._motion(t, y)
        return np.concatenate([now.qdd, now.qd, [now.power]])

    def jacobian(self, t: float, y: np.ndarray) -> np.ndarray:
        return full_jacobian(self.kernels, self._motion(t, y), self.p, self.rows, self.accelerations.gains(self.options))

    def state(self, t: float, y: np.ndarray) -> State:
        qd, q, work = y[: self.kernels.n], y[self.kernels.n : -1], float(y[-1])
        if not self.is_projected:
            return q, qd, work
        if self.in_c and (closed := self.in_c.closed(t, y, self.p)) is not None:
            self.path.note_projection(closed[1])
            return closed[0][self.kernels.n : -1], closed[0][: self.kernels.n], work
        projected = project(self.kernels, q, qd, t, self.p)
        if projected.q is not q or projected.qd is not qd:
            self.path.note_projection(projected.moved, projected.steps)
        return projected.q, projected.qd, work

    def accept(self, solver: OdeSolver, state: State) -> OdeSolver:
        q, qd, work = state
        self._choose_rows(solver.t, q)
        y = np.concatenate([qd, q, [work]])
        if self.is_projected and not np.array_equal(y, solver.y):
            replace_state(solver, y)
        return solver

    def stuck(self, error: NcgenError, t: float, is_last: bool) -> NcgenError | None:
        if isinstance(error, SingularError):
            return SingularError(f"{error}; at t = {t:.6g} s")
        return None if isinstance(error, DomainError) and not is_last else error

    def _motion(self, t: float, y: np.ndarray) -> Motion:
        q, qd = y[self.kernels.n : -1], y[: self.kernels.n]
        return self.accelerations.motion(self.kernels, q, qd, t, self.p, self.options, self.rows)

    def _choose_rows(self, t: float, q: np.ndarray) -> None:
        """Which of redundant rows count: off the constraints, where a method's stages are, the others contradict them. They do as long as
        they imply these with shares that are not much larger than at first.
        """
        if self.rank < self.kernels.m and self.task.method.formalism.name != "penalty":  # which needs all of them, as in C
            jacobian = scaled_jacobian(self.kernels, q, t, self.p)
            if self.rows is None or not largest_share(jacobian, self.rows) < MUCH_LARGER * self.share:
                self.rows = counting_rows(jacobian, self.rank)
                self.share = largest_share(jacobian, self.rows)


class Independent(ReferenceRun):
    """y = [ż; z; W] by coordinate partitioning.

    start: the state from which a step solves the position problem; frame: the kinematics there
    orientation: that of the frame when a motion on the partitions `oriented` began
    """

    def __init__(self, path: Path, kernels: Kernels, task: Task) -> None:
        super().__init__(path, kernels, task)
        self.partitions, self.oriented, self.orientation = determined(path.partitions), None, 0

    def begin(self, t: float, q: np.ndarray, qd: np.ndarray | None) -> tuple[np.ndarray, np.ndarray]:
        rates = self.task.velocities if qd is None else qd[self.partitions.velocity.independent]
        motion = motion_at(self.kernels, self.partitions.velocity, t, q, rates, self.p)
        self.start = StepStart(t, motion.q, motion.qd, self.p)
        self.watch = PartitionWatch(self._here(), self.partitions)
        return motion.q, motion.qd

    @property
    def own(self) -> tuple[np.ndarray, np.ndarray]:
        return self.partitions.velocity.independent, self.partitions.position.independent

    def fresh(self, t: float, state: State, first_step: float | None = None) -> OdeSolver:
        self._begin_step()
        if self.oriented is not self.partitions:
            self.oriented, self.orientation = self.partitions, self.frame.orientation
        return super().fresh(t, state, first_step)

    def derivative(self, t: float, y: np.ndarray) -> np.ndarray:
        now, (velocities, positions) = self._motion(t, y), self.own
        return np.concatenate([now.qdd[velocities], now.qd[positions], [now.power]])

    def jacobian(self, t: float, y: np.ndarray) -> np.ndarray:
        return partitioned_jacobian(self.kernels, self.partitions, self._motion(t, y), self.p)

    def state(self, t: float, y: np.ndarray) -> State:
        now = self._motion(t, y)
        return now.q, now.qd, float(y[-1])

    def accept(self, solver: OdeSolver, state: State) -> OdeSolver:
        q, qd, _ = state
        self.start = StepStart(float(solver.t), q, qd, self.p)
        if solver.status == "running" and self._change_to(self.watch.better(self._here(), self.partitions)):
            return self.fresh(self.start.t, state)
        self._begin_step()
        return solver

    def stuck(self, error: NcgenError, t: float, is_last: bool) -> NcgenError | None:
        if not is_last:
            self._change_to(self.watch.search(self._here(), self.partitions))
            return None
        return error if isinstance(error, DomainError) else type(error)(stuck_message(self.kernels, t, self.task.step))

    def hand_over(self) -> None:
        super().hand_over()
        self.path.partitions = self.partitions

    def _motion(self, t: float, y: np.ndarray) -> Motion:
        count = len(self.partitions.velocity.independent)
        now = motion(self.kernels, self.partitions, self.start, t, y[count:-1], y[:count])
        self.newton += now.iterations
        if now.frame and (now.frame.orientation != self.orientation or now.frame.has_turned(self.frame)):
            raise SingularError(
                f"{self.kernels.name}: the step passed a singular position of the dependent coordinates, perhaps to another branch; "
                "choose other independent coordinates"
            )
        return now

    def _begin_step(self) -> None:
        """What later positions of a step are compared with."""
        self.frame = kinematics(self.kernels, self.partitions.velocity, self.start.q, self.start.t, self.p)

    def _here(self) -> PartitionsAt:
        """The partitions at the start of a step."""
        return PartitionsAt(self.kernels, self.start.q, self.start.t, self.start.p)

    def _change_to(self, better: Partitions | None) -> bool:
        """Go on with other independent coordinates for the same state where there are clearly better ones. Where no choice is good, the
        steps will show whether the motion can go on."""
        if better is None:
            return False
        self.partitions = better
        self.changes += 1
        return True
