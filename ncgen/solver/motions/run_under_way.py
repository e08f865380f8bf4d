"""A run on its way: what an engine is asked for, which engine makes it, and the trajectory that comes of it."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from ncgen.errors import ConvergenceError, ModelError, SingularError
from ncgen.mechanism.break_times import break_times, outside_breaks
from ncgen.mechanism.driver_jumps import driver_jumps
from ncgen.mechanism.kernels import Kernels
from ncgen.methods.table import AUTO
from ncgen.solver.argument_checks import has_events
from ncgen.solver.engines import acceleration_forms, capabilities, compiled
from ncgen.solver.events.passage import Passage, check_events
from ncgen.solver.positions.negative_mass import refuse_negative_ahead
from ncgen.solver.positions.partition import choose_partitions, determined
from ncgen.solver.positions.rank import REMEMBERED, rank_at
from ncgen.solver.runs.choice import IMPLICIT, Choice, stiff_choice
from ncgen.solver.runs.divergence import divergence
from ncgen.solver.runs.grid import RunTimes
from ncgen.solver.runs.path import Path
from ncgen.solver.runs.run import Run
from ncgen.solver.runs.settings import CACHED, COMPILED, EMITTED, Form
from ncgen.solver.runs.start import Start
from ncgen.solver.runs.task import Task
from ncgen.solver.runs.tolerances import Tolerances
from ncgen.solver.trajectories.energy import Instants
from ncgen.solver.trajectories.grid_motion import Statistics, made
from ncgen.solver.trajectories.trajectory import Trajectory
from ncgen.toolchain.preparation import preparation_seconds

STEP_COUNT_TOLERANCE = 1 + 1e-12
"""A step that is longer than a grid's by this share: as many steps as there are instants, whatever rounding does."""


def _with_neighbours(breaks: np.ndarray, times: np.ndarray) -> np.ndarray:
    """Breaks, and the times of a grid before and after each: between these steps of a method in SciPy's manner are equal."""
    before = times[np.maximum(np.searchsorted(times, breaks[:, 0], side="left") - 1, 0)]
    after = times[np.minimum(np.searchsorted(times, breaks[:, 1], side="right"), len(times) - 1)]
    rows = np.concatenate([breaks, *(np.column_stack([each, each]) for each in (before, after))])
    return np.unique(rows, axis=0)


class Stopwatch:
    """The time of a run, and apart from it that of generating and compiling what it needed first."""

    def __init__(self) -> None:
        self._begun, self._prepared = time.perf_counter(), preparation_seconds()

    def read(self) -> tuple[float, float]:
        """Return the seconds of the run without preparation, and those of preparation."""
        preparation = preparation_seconds() - self._prepared
        return time.perf_counter() - self._begun - preparation, preparation


class RunPlan(NamedTuple):
    """What runs of the same settings have in common.

    form: of the state derivative in C; refused: why C cannot carry them out, or None; task: of which the numbers change
    """

    form: Form
    refused: str | None
    task: Task


@dataclass(kw_only=True)
class RunUnderWay:
    """One run on its way: the path so far, and which engine makes it.

    given_breaks: None, or the breaks of a run that takes one step from each of its times to the next
    rows: its own instants and those at which it is looked at; times: of these, which C moves to where its steps end
    """

    kernels: Kernels
    run: Run
    choice: Choice
    start: Start
    rows: RunTimes
    progress: Callable[[float], None] | None
    given_breaks: np.ndarray | None = None
    engine: str = "c"

    def __post_init__(self) -> None:
        self.times = self.rows.times.copy()
        self._planned: tuple[Choice, RunPlan] | None = None
        self.path = Path.empty(self.kernels.n, self.start.partitions)
        functions = self.run.signals.laws if self.run.signals else ()
        rounding = capabilities.rounding(self.run.settings.number)
        start, breaks = self.start, self.given_breaks
        if breaks is None:
            breaks = break_times(self.kernels, start.p, float(self.times[0]), float(self.times[-1]), functions, rounding)
        self.breaks = breaks
        self.passage = Passage()
        self.jumps = driver_jumps(self.kernels, start.p, start.q, breaks)
        self.tolerances = Tolerances.of(self.run, self.kernels.length, rounding)

    @property
    def mobility(self) -> tuple[int, bool]:
        """The rank of Φ_q, and whether the start is a singular position."""
        kernels, start, t = self.kernels, self.start, self.run.initial.t
        return kernels.remember("mobility at starts", start, lambda: rank_at(kernels, start.q, t, start.p), REMEMBERED)

    def advance(self) -> None:
        """Fill the path, in C where that can be, else in Python. Raises what the engines raise."""
        run, kernels = self.run, self.kernels
        form, refused, _ = self._plan()
        if has_events(kernels.model):
            check_events(kernels, self.choice.method, run)
        needs_c = run.settings.needs_c
        remedy = "engine='auto'" if run.settings.number == "double" else "number='double'"
        if refused and needs_c:
            number = "" if run.settings.number == "double" else f" with {run.settings.number}"
            raise ModelError(f"{kernels.name} cannot be simulated in C{number}: {refused}; use {remedy}")
        if refused is None:
            refused = self._in_c(form)
            if refused == compiled.STIFFNESS_REASON:
                refused = self._go_on_implicit(form)
                form = self._form() if form == "tree" else form
            if refused and needs_c:
                raise ConvergenceError(f"{kernels.name}: {refused}; with {remedy} it continues in Python")
        if refused is not None:
            self._check_reference(refused)
            if self.choice.method.is_constrained:
                self.path = Path.empty(kernels.n, self.start.partitions)  # what C has left of it is done again
            self._in_python()
        self.engine = f"python: {refused}" if refused else "c" if form == "dense" else form

    def _check_reference(self, refused: str) -> None:
        """Raise for a method that the reference in Python does not have; refused: why C does not carry the run out, or where it stopped."""
        name, method = self.kernels.name, self.choice.method
        if method.integrator.in_python:
            return
        if self.run.settings.engine == "python":
            raise ModelError(f"{name}: {method} is in C only; use engine='auto'")
        if len(self.path.q):
            raise ConvergenceError(f"{name}: {refused}; take smaller steps (max_step) or another integrator")
        raise ModelError(f"{name}: {method} is in C only, and {refused}; install gcc or clang, or take the integrator dop853")

    def diverged(self) -> ConvergenceError | None:
        """What to say where the path's end shows that its fixed steps were too long for the motion; None otherwise."""
        method, run = self.choice.method, self.run
        step = run.settings.max_step if method.has_fixed_step else None
        return divergence(self.kernels, self.path, float(self.times[0]), method, step, self.start.p)

    def refuse_negative(self) -> None:
        """Raise SingularError where the path ends before a position at which the mass matrix is not positive definite."""
        if end := len(self.path.q):
            t = self.times[max(0, min(end - 1, len(self.times) - 2)) :][:2]
            refuse_negative_ahead(self.kernels, self.path.q[-1], self.path.qd[-1], float(t[0]), float(t[-1] - t[0]), self.start.p)

    def _plan(self) -> RunPlan:
        """What does not depend on the numbers of the run; found once for its settings and a compiled mechanism."""
        if self._planned and self._planned[0] is self.choice:
            return self._planned[1]
        start, known = self.start, (self.run.settings, self.choice, self.kernels.effort, self.given_breaks is None)

        def find() -> RunPlan:
            refused = "asked for" if self.run.settings.engine == "python" else self._refusal()
            return RunPlan(self._form(), refused, self._new_task())

        is_new = self.kernels.backend != "c" or (start.partitions and self.run.settings.engine in EMITTED)  # which may be refused
        plan = find() if is_new else self.kernels.remember("plans", known, find, CACHED)
        self._planned = self.choice, plan
        return plan

    def _form(self) -> Form:
        """What state derivative C is given: as named, else one that is emitted where there is one over all coordinates."""
        if self.run.settings.engine in EMITTED:
            return self.run.settings.engine
        is_open = self.run.settings.engine in (AUTO, COMPILED) and self.run.settings.number == "double"
        return acceleration_forms.form_of(self.kernels, self.choice.method) if is_open else "dense"

    def _go_on_implicit(self, form: Form) -> str | None:
        """Take the implicit method from where the path has come to: why that cannot be done in C, or None.

        form: of the accelerations so far
        """
        path, before = self.path, self.choice.method
        t = self.times[len(path.q) - 1]
        try:
            other = stiff_choice(self.run.settings, self.choice, form != "dense")
            if other is None:
                return compiled.STIFFNESS_REASON
            self.choice = other
            if other.method.is_constrained:
                return self._in_c(self._form() if form == "tree" else form)
            path.partitions = choose_partitions(self.kernels, path.q[-1], t, self.start.p, self.run.initial.z)
            return self._refusal() or self._in_c("dense")
        except (SingularError, ModelError, ConvergenceError) as error:
            raise ConvergenceError(
                f"{self.kernels.name}: beyond t = {t:.6g} s steps of {before} become tiny and {IMPLICIT} does not go on; the "
                "mechanism comes to a singular position there, or rtol asks for less than rounding leaves"
            ) from error

    def _refusal(self) -> str | None:
        refused = capabilities.refusal(self.kernels, self.choice.method, self.run.settings.engine, self.run.settings.number)
        return refused or (
            capabilities.refusal_of_size(self.kernels, self.start.partitions, self.run.settings.engine) if self.start.partitions else None
        )

    def _in_c(self, form: Form) -> str | None:
        """Why C did not come to the end, or None."""
        kernels, task, dense = self.kernels, self._task(), "dense" if form == "tree" else form

        def engine(path: Path, moved: Kernels, task: Task) -> str | None:
            if task.method.is_constrained:
                moved_form = form if moved is kernels or form == "dense" else acceleration_forms.form_of(moved, task.method)
                return compiled.run_constrained(path, moved, task, moved_form)
            return compiled.run(path, kernels, task, dense)

        def whole(path: Path, kernels: Kernels, task: Task) -> str | None:
            if not len(self.jumps):
                return engine(path, kernels, task)
            from ncgen.solver.engines.segments import in_segments

            return in_segments(engine, path, kernels, task, self.jumps)

        if not has_events(kernels.model):
            return whole(self.path, kernels, task)
        from ncgen.solver.events.loop import through_events

        return through_events(whole, self.path, kernels, task, self.passage)

    def _in_python(self) -> None:
        from ncgen.solver.engines import reference, segments

        task = replace(self._task(), calls_c=self.run.settings.engine == AUTO and not self.choice.method.integrator.in_c)

        def engine(path: Path, kernels: Kernels, task: Task) -> None:
            begun = float(task.grid[len(path.q)])
            reference.run(path, kernels.driven_by(task.signals.begun_at(begun)) if task.signals and len(self.breaks) else kernels, task)

        ends = self.breaks
        if task.steps_to_rows:
            ends, task = _with_neighbours(ends, task.grid), replace(task, max_step=task.max_step * STEP_COUNT_TOLERANCE)
        segments.in_segments(engine, self.path, self.kernels, task, ends)

    def _task(self) -> Task:
        """What is asked of an engine."""
        start, run, is_constrained = self.start, self.run, self.choice.method.is_constrained
        return self._plan().task.begun(
            grid=self.times,
            q=start.q,
            velocities=start.qd if is_constrained else self._rates(),
            p=start.p,
            stop=run.stop,
            progress=self.progress,
            signals=run.signals,
            tolerances=self.tolerances,
            breaks=self.breaks,
            movable=self.rows.is_extra,
            jumps=self.jumps,
            rank=self.mobility[0] if is_constrained and not len(self.path.q) else None,
        )

    def _new_task(self) -> Task:
        """The same without the numbers."""
        run, start = self.run, self.start
        return Task(
            method=self.choice.method,
            grid=run.grid.times,
            q=start.q,
            velocities=start.qd,
            p=start.p,
            max_step=run.settings.max_step,
            tolerances=self.tolerances,
            number=run.settings.number,
            stop_when_stiff=stiff_choice(run.settings, self.choice, recurs=True) is not None,
            steps_to_rows=self.given_breaks is not None,
        )

    def _rates(self) -> np.ndarray:
        """Velocities of the independent coordinates at the start."""
        return self.start.qd[determined(self.path.partitions).velocity.independent]

    def _rows(self) -> tuple[np.ndarray, np.ndarray, list[int] | None]:
        """Times of the path's rows, and the numbers of those that were asked for, and of those at which the energy is looked at."""
        path, reached = self.path, len(self.path.q)
        if path.stopped is None and reached == len(self.times):
            return self.times, self.rows.wanted, self.rows.looked_at
        times, is_extra = self.times[:reached], self.rows.is_extra[:reached]
        if path.stopped is not None:
            times, is_extra = np.append(times[:-1], path.stopped), np.append(is_extra[:-1], False)
        rows = RunTimes(times, is_extra)
        return times, rows.wanted, rows.looked_at

    def inspected(self) -> Instants:
        """The instants at which the energy is looked at, and the run's ends; all of it where there are no such instants."""
        times, _, rows = self._rows()
        if len(self.jumps):
            times = outside_breaks(self.breaks, times)  # a row at a jump is of the time before it
        elif rows is not None:
            known = {times.item(row): row for row in rows}  # rows that C moved to the same end of a step are the same
            rows = [*known.values()]
        path = self.path
        return Instants(times, path.q, path.qd, path.work, rows)

    def _explained(self) -> str:
        """The method and the engine, and why they were taken."""
        kernels, choice, settings, engine = self.kernels, self.choice, self.run.settings, self.engine
        known = choice, settings, engine
        return kernels.remember("explanations", known, lambda: acceleration_forms.explained(kernels, choice, settings, engine), CACHED)

    def trajectory(self, clock: Stopwatch) -> Trajectory:
        """The motion at the instants that were asked for, as far as it came."""
        path, run, method = self.path, self.run, self.choice.method
        times, wanted, _ = self._rows()
        steps, evaluations, newton_steps, changes, repeated = path.counts.tolist()
        seconds, preparation = clock.read()
        spent = made(
            Statistics,
            steps=steps,
            evaluations=evaluations,
            newton_steps=newton_steps,
            partition_changes=changes,
            repeated_steps=repeated,
            seconds=seconds,
            projections=path.projections,
            largest_projection=path.largest_projection,
            jacobians=path.jacobians,
            fallbacks=path.fallbacks,
            preparation=preparation,
        )
        kernels, passage = self.passage.driving(self.kernels, self.start.p), self.passage
        modes = [replace(each, kernels=passage.driving(each.kernels, self.start.p)) for each in passage.modes]
        return made(
            Trajectory,
            kernels=kernels,
            t=times.take(wanted),
            q=path.q.take(wanted, axis=0),
            qd=path.qd.take(wanted, axis=0),
            work=path.work.take(wanted),
            p=self.start.p.copy(),
            partitions=path.partitions,
            statistics=spent,
            formalism=method.formalism.name,
            integrator=method.integrator.name,
            engine=self.engine,
            chosen=run.initial.z or self.kernels.model.chosen_independent,
            moved_by=kernels,
            options={**method.options},
            stopped=path.stopped is not None,
            number=run.settings.number,
            made_with=self._explained(),
            impulses=tuple(path.impulses),
            events=tuple(passage.happened),
            modes=tuple(modes),
            changed=bool(passage.changes),
            user_formalism=method.formalism if method.formalism.user_object else None,
        )
