"""A run on its way: what an engine is asked for, which engine makes it, and the trajectory that comes of it."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from ncgen.errors import ConvergenceError, ModelError, SingularError
from ncgen.mechanism.break_times import outside_breaks
from ncgen.mechanism.kernels import Kernels
from ncgen.methods.method import Method
from ncgen.methods.table import AUTO
from ncgen.solver.argument_checks import has_events
from ncgen.solver.engines import acceleration_forms, compiled
from ncgen.solver.events.passage import Passage, check_events
from ncgen.solver.motions.prepared_motion import PreparedMotion
from ncgen.solver.positions.negative_mass import refuse_negative_ahead
from ncgen.solver.positions.partition import choose_partitions, determined
from ncgen.solver.runs.choice import IMPLICIT, stiff_choice
from ncgen.solver.runs.divergence import divergence
from ncgen.solver.runs.grid import RunTimes
from ncgen.solver.runs.path import Path
from ncgen.solver.runs.settings import Form, Settings
from ncgen.solver.runs.task import Task
from ncgen.solver.trajectories.energy import Instants
from ncgen.solver.trajectories.grid_motion import Statistics, made
from ncgen.solver.trajectories.trajectory import Trajectory
from ncgen.toolchain.preparation import preparation_seconds

if TYPE_CHECKING:
    from ncgen.solver.engines.segments import Engine

STEP_COUNT_TOLERANCE = 1 + 1e-12
"""A step that is longer than a grid's by this share: as many steps as there are instants, whatever rounding does."""


def _with_neighbours(breaks: np.ndarray, times: np.ndarray) -> np.ndarray:
    """Breaks, and the times of a grid before and after each: between these steps of a method in SciPy's manner are equal."""
    before = times[np.maximum(np.searchsorted(times, breaks[:, 0], side="left") - 1, 0)]
    after = times[np.minimum(np.searchsorted(times, breaks[:, 1], side="right"), len(times) - 1)]
    rows = np.concatenate([breaks, *(np.column_stack([each, each]) for each in (before, after))])
    return np.unique(rows, axis=0)


NOTHING_MET = Passage()
"""What a run without events meets; nobody writes to it."""


def _remedy(settings: Settings) -> str:
    """What to ask for where a run in C is not possible."""
    return "engine='auto'" if settings.number == "double" else "number='double'"


class Stopwatch:
    """The time of a run, and apart from it that of generating and compiling what it needed first."""

    def __init__(self) -> None:
        self._begun, self._prepared = time.perf_counter(), preparation_seconds()

    def read(self) -> tuple[float, float]:
        """Return the seconds of the run without preparation, and those of preparation."""
        preparation = preparation_seconds() - self._prepared
        return time.perf_counter() - self._begun - preparation, preparation


class RunUnderWay:
    """One run on its way: the path so far, and which engine makes it.

    choice: of the method that continues; times: of its rows (s), of which C moves some to where its steps end
    """

    def __init__(self, motion: PreparedMotion, progress: Callable[[float], None] | None) -> None:
        self.kernels, self.motion, self.progress = motion.kernels, motion, progress
        self.choice, self.engine = motion.choice, "c"
        self.times = motion.rows.times.copy()
        self.path = Path.empty(self.kernels.n, motion.start.partitions)
        self.has_events = has_events(self.kernels.model)
        self.passage = Passage() if self.has_events else NOTHING_MET

    def advance(self) -> None:
        """Fill the path, in C where that can be, else in Python. Raises what the engines raise."""
        motion, kernels, settings = self.motion, self.kernels, self.motion.run.settings
        self._plan = motion.plan(self.choice)
        form, refused, _ = self._plan
        if self.has_events:
            check_events(kernels, self.choice.method, motion.run)
        if refused and settings.needs_c:
            number = "" if settings.number == "double" else f" with {settings.number}"
            raise ModelError(f"{kernels.name} cannot be simulated in C{number}: {refused}; use {_remedy(settings)}")
        if refused and self.has_events:
            raise ModelError(f"{kernels.name} cannot be simulated in C, which events need: {refused}")
        if refused is None:
            refused = self._by_form(form)
            if refused and form != "dense" and self._may_begin_again():
                form = "dense"
                self._begin_again()
                refused = self._by_form(form)
            form = self._form_now(form)
            if refused and self.has_events:
                raise ConvergenceError(f"{kernels.name}: {refused}, and events need C; take smaller steps (max_step) or another integrator")
            if refused and settings.needs_c:
                raise ConvergenceError(f"{kernels.name}: {refused}; with {_remedy(settings)} it continues in Python")
        if refused is not None:
            self._check_reference(refused)
            if self.choice.method.is_constrained:
                self.path = Path.empty(kernels.n, motion.start.partitions)  # what C has left of it is done again
            self._in_python()
        self.engine = f"python: {refused}" if refused else "c" if form == "dense" else form

    def _by_form(self, form: Form) -> str | None:
        """Why C did not come to the end, with the implicit method where the mechanism is stiff; None where it did."""
        refused = self._in_c(form)
        return self._go_on_implicit(form) if refused == compiled.STIFFNESS_REASON else refused

    def _may_begin_again(self) -> bool:
        """True for a run with events, which Python does not have, of the default engine; functions are not called again, since they may
        remember what they were called with."""
        is_open = self.has_events and self.motion.run.settings.engine == AUTO
        return is_open and not any(event.is_called for event in self.kernels.model.events.values())

    def _begin_again(self) -> None:
        """Forget what has happened, so that the run can be repeated with the factored matrix."""
        motion = self.motion
        self.choice, self._plan = motion.choice, motion.plan(motion.choice)
        self.times, self.path, self.passage = motion.rows.times.copy(), Path.empty(self.kernels.n, motion.start.partitions), Passage()

    def _check_reference(self, refused: str) -> None:
        """Raise for a method that the reference in Python does not have; refused: why C does not carry the run out, or where it stopped."""
        name, method = self.kernels.name, self.choice.method
        if method.integrator.in_python:
            return
        if self.motion.run.settings.engine == "python":
            raise ModelError(f"{name}: {method} is in C only; use engine='auto'")
        if len(self.path.q):
            raise ConvergenceError(f"{name}: {refused}; take smaller steps (max_step) or another integrator")
        raise ModelError(f"{name}: {method} is in C only, and {refused}; install gcc or clang, or take the integrator dop853")

    def diverged(self) -> ConvergenceError | None:
        """What to say where the path's end shows that its fixed steps were too long for the motion; None otherwise."""
        method, run = self.choice.method, self.motion.run
        step = run.settings.max_step if method.has_fixed_step else None
        return divergence(self.kernels, self.path, float(self.times[0]), method, step, self.motion.start.p)

    def refuse_negative(self) -> None:
        """Raise SingularError where the path ends before a position at which the mass matrix is not positive definite."""
        if end := len(self.path.q):
            t = self.times[max(0, min(end - 1, len(self.times) - 2)) :][:2]
            refuse_negative_ahead(self.kernels, self.path.q[-1], self.path.qd[-1], float(t[0]), float(t[-1] - t[0]), self.motion.start.p)

    def _go_on_implicit(self, form: Form) -> str | None:
        """Take the implicit method from where the path has come to: why that cannot be done in C, or None.

        form: of the accelerations so far
        """
        path, before = self.path, self.choice.method
        t = float(self.times[len(path.q) - 1])
        with self._going_on(t, before):
            if not self._becomes_implicit(recurs=form != "dense"):
                return compiled.STIFFNESS_REASON
            if self.choice.method.is_constrained:
                return self._in_c(self._form_now(form))
            path.partitions = choose_partitions(self.kernels, path.q[-1], t, self.motion.start.p, self.motion.run.initial.z)
            return self.motion.refusal(self.choice) or self._in_c("dense")

    @contextmanager
    def _going_on(self, t: float, before: Method) -> Iterator[None]:
        """Say of errors of the implicit method that it took over from another one at time t (s)."""
        try:
            yield
        except (SingularError, ModelError, ConvergenceError) as error:
            raise ConvergenceError(
                f"{self.kernels.name}: beyond t = {t:.6g} s steps of {before} become tiny and {IMPLICIT} does not go on; the "
                "mechanism comes to a singular position there, or rtol asks for less than rounding leaves"
            ) from error

    def _form_now(self, form: Form) -> Form:
        """The form of accelerations for the method that continues, where one by tables may have none; form: of those so far."""
        return self.motion.form(self.choice) if form == "tree" else form

    def _becomes_implicit(self, recurs: bool) -> bool:
        """Whether the run continues by the implicit method, which it does not where its method was named; recurs: as of `stiff_choice`."""
        other = stiff_choice(self.motion.run.settings, self.choice, recurs)
        if other is not None:
            self.choice, self._plan = other, self.motion.plan(other)
        return other is not None

    def _through_events(self, engine: Engine, kernels: Kernels, task: Task, may_change: bool) -> str | None:
        """Let an engine complete the path from event to event; may_change: whether the run may continue by the implicit method, over all
        coordinates."""
        from ncgen.solver.events.loop import through_events

        first = self.choice.method
        changed: float | None = None  # from this time on the implicit method carries the run

        def implicit_task(t: float) -> Task | None:
            nonlocal changed
            with self._going_on(t, first):
                if not self._becomes_implicit(recurs=True):
                    return None
                changed = t
                return self._task()

        def one_part(path: Path, kernels: Kernels, task: Task) -> str | None:
            if changed is None:
                return engine(path, kernels, task)
            with self._going_on(changed, first):
                if reason := engine(path, kernels, task):
                    raise ConvergenceError(reason)
            return None

        return through_events(one_part, self.path, kernels, task, self.passage, implicit_task if may_change else None)

    def _in_c(self, form: Form) -> str | None:
        """Why C did not come to the end, or None."""
        kernels, task, jumps = self.kernels, self._task(), self.motion.jumps
        engine = whole = partial(self._part_in_c, form)
        if len(jumps):
            from ncgen.solver.engines.segments import in_segments

            whole = partial(in_segments, engine, ends=jumps)
        if self.has_events:
            return self._through_events(whole, kernels, task, may_change=form != "dense")
        return whole(self.path, kernels, task)

    def _part_in_c(self, form: Form, path: Path, kernels: Kernels, task: Task) -> str | None:
        """Complete a path in C, as an engine; form: of the accelerations of the run's own kernels."""
        if not task.method.is_constrained:
            return compiled.run(path, self.kernels, task, "dense" if form == "tree" else form)
        is_own = kernels is self.kernels or form == "dense"
        form = self._form_now(form) if is_own else acceleration_forms.form_of(kernels, task.method)
        return compiled.run_constrained(path, kernels, task, form)

    def _in_python(self) -> None:
        from ncgen.solver.engines import reference, segments

        task = replace(self._task(), calls_c=self.motion.run.settings.engine == AUTO and not self.choice.method.integrator.in_c)

        def engine(path: Path, kernels: Kernels, task: Task) -> None:
            begun = float(task.grid[len(path.q)])
            reference.run(path, kernels.driven_by(task.signals.begun_at(begun)) if task.signals and len(breaks) else kernels, task)

        ends = breaks = self.motion.breaks
        if task.steps_to_rows:
            ends, task = _with_neighbours(ends, task.grid), replace(task, max_step=task.max_step * STEP_COUNT_TOLERANCE)
        segments.in_segments(engine, self.path, self.kernels, task, ends)

    def _task(self) -> Task:
        """What is asked of an engine."""
        task = self._plan.task.again(self.times, self.progress)
        return task if task.method.is_constrained or self.choice is self.motion.choice else task.begun(velocities=self._rates())

    def _rates(self) -> np.ndarray:
        """Velocities of the independent coordinates at the start."""
        return self.motion.start.qd[determined(self.path.partitions).velocity.independent]

    def _rows(self) -> tuple[np.ndarray, np.ndarray, list[int]]:
        """Times of the path's rows, and the numbers of those that were asked for, and of those at which the energy is looked at."""
        path, reached = self.path, len(self.path.q)
        if path.stopped is None and reached == len(self.times):
            return self.times, self.motion.rows.wanted, self.motion.rows.looked_at
        times, is_extra = self.times[:reached], self.motion.rows.is_extra[:reached]
        if path.stopped is not None:
            times, is_extra = np.append(times[:-1], path.stopped), np.append(is_extra[:-1], False)
        rows = RunTimes(times, is_extra)
        return times, rows.wanted, rows.looked_at

    def inspected(self) -> Instants:
        """The instants at which the energy is looked at, and the run's ends."""
        times, _, rows = self._rows()
        if len(self.motion.jumps):
            times = outside_breaks(self.motion.breaks, times)  # a row at a jump is of the time before it
        else:
            known = {times.item(row): row for row in rows}  # rows that C moved to the same end of a step are the same
            rows = [*known.values()]
        path = self.path
        return Instants(times, path.q, path.qd, path.work, rows)

    def trajectory(self, clock: Stopwatch) -> Trajectory:
        """The motion at the instants that were asked for, as far as it came."""
        path, motion, method = self.path, self.motion, self.choice.method
        times, wanted, _ = self._rows()
        steps, evaluations, newton_steps, changes, repeated = path.counts
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
        passage, p = self.passage, motion.start.p
        kernels = passage.driving(self.kernels, p)
        modes = [replace(each, kernels=passage.driving(each.kernels, p)) for each in passage.modes]
        return made(
            Trajectory,
            kernels=kernels,
            t=times.take(wanted),
            q=path.q.take(wanted, axis=0),
            qd=path.qd.take(wanted, axis=0),
            work=path.work.take(wanted),
            p=p.copy(),
            partitions=path.partitions,
            statistics=spent,
            formalism=method.formalism.name,
            integrator=method.integrator.name,
            engine=self.engine,
            chosen=motion.run.initial.z or self.kernels.model.chosen_independent,
            moved_by=kernels,
            options={**method.options},
            stopped=path.stopped is not None,
            number=motion.run.settings.number,
            made_with=motion.explained(self.choice, self.engine),
            impulses=tuple(path.impulses),
            events=tuple(passage.happened),
            modes=tuple(modes),
            changed=bool(passage.changes),
            user_formalism=method.formalism if method.formalism.user_object else None,
        )
