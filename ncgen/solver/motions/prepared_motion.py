"""What is known of a run before it begins: checked arguments, the method, the start, and what an engine is asked for. It is found once for
equal arguments, and cached with the kernels, so that a short run does not cost more than its motion."""

from __future__ import annotations

from copy import copy
from dataclasses import replace
from functools import cached_property
from types import NoneType
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ncgen.errors import counted
from ncgen.mechanism.break_times import break_times
from ncgen.mechanism.driver_jumps import driver_jumps
from ncgen.mechanism.kernels import Kernels
from ncgen.methods.method import Method
from ncgen.methods.table import AUTO
from ncgen.solver.argument_checks import ArrayOrNamed
from ncgen.solver.engines import acceleration_forms, capabilities
from ncgen.solver.positions.massless import check_mass
from ncgen.solver.positions.negative_mass import doubtful
from ncgen.solver.positions.rank import REMEMBERED, rank_at
from ncgen.solver.runs.alarms import Limits
from ncgen.solver.runs.choice import Choice, choose, stiff_choice
from ncgen.solver.runs.grid import MOST_CACHED_POINTS, RunTimes
from ncgen.solver.runs.run import Initial, Run
from ncgen.solver.runs.settings import CACHED, COMPILED, EMITTED, Form
from ncgen.solver.runs.start import Start, start_of
from ncgen.solver.runs.task import Task
from ncgen.solver.runs.tolerances import Tolerances

MAX_PARTITIONED_DOF = 100
"""Degrees of freedom from which coordinate partitioning, whose matrices are dense, is worth a warning."""

KEY_TYPES = frozenset((str, int, float, bool, NoneType))
"""Types of arguments of which equal values are the same one, so that they are keys of a cache."""


VELOCITIES = ("zd0", "qd0")
"""Arguments that differ from call to call where nothing else does."""


class RunPlan(NamedTuple):
    """What carries a run out.

    form: of the state derivative in C; refused: why C cannot carry it out, or None; task: what an engine is asked for
    """

    form: Form
    refused: str | None
    task: Task


class PreparedMotion:
    """A run but for what happens in it. May be used by several threads at a time.

    run: as it was asked for; choice: of the method that it begins with; start: where it starts; rows: times (s) of its rows
    warnings: what there is to say at every call
    given_breaks: None, or the breaks of a run that takes one step from each of its times to the next
    """

    def __init__(self, kernels: Kernels, run: Run, rows: RunTimes | None = None, given_breaks: np.ndarray | None = None) -> None:
        self.kernels, self.run, self.given_breaks = kernels.driven_by(run.signals), run, given_breaks
        self.choice = choose(run.settings)
        is_partitioned = not self.choice.method.is_constrained
        self.start = start_of(self.kernels, run.initial, is_partitioned)
        # other times than those that are asked for would change the steps of methods with a fixed one
        self.rows = rows or (run.grid.plain if self.choice.method.has_fixed_step else run.grid.monitored)
        self._advice: tuple[str, ...] = ()
        if is_partitioned and (freedom := kernels.n - kernels.m) > MAX_PARTITIONED_DOF:
            self._advice = (
                f"{kernels.name}: coordinate partitioning solves densely for {counted(freedom, 'degree of freedom')} in every evaluation; "
                "formalism='lagrange' solves sparsely, many times faster",
            )
        self.warnings = (*self.start.warnings, *self._advice)
        self._plans: dict[Choice, RunPlan] = {}
        self._sibling: PreparedMotion | None = None
        self._explained: dict[tuple[Choice, str], str] = {}
        self._limits: dict[str, Limits] = {}

    @classmethod
    def of_arguments(cls, kernels: Kernels, duration: float, points: int | ArrayLike = 101, **arguments: Any) -> PreparedMotion:
        """Of the arguments of `simulate_one`, of equal numbers and names the same object. Raises ModelError."""

        def find() -> PreparedMotion:
            return cls._of_run(kernels, Run.from_arguments(kernels, duration, points=points, **arguments))

        kinds = (type(duration), type(points), *map(type, arguments.values()))
        if type(points) is int and points > MOST_CACHED_POINTS:
            return find()
        if KEY_TYPES.issuperset(kinds):
            key = kernels, kernels.effort, duration, points, *arguments, *arguments.values(), *kinds
            return kernels.remember("motions", key, find, CACHED)
        others = {name: value for name, value in arguments.items() if name not in VELOCITIES}
        if len(others) < len(arguments) and KEY_TYPES.issuperset((type(points), *map(type, others.values()))):
            velocities = {name: arguments.get(name) for name in VELOCITIES}
            return cls.of_arguments(kernels, duration, points, **others).with_velocities(**velocities)
        return find()

    @classmethod
    def _of_run(cls, kernels: Kernels, run: Run) -> PreparedMotion:
        """Of a run as it was asked for; of equal settings, grids, stops and starts the same object."""
        if run.signals or not run.grid.is_small:
            return cls(kernels, run)
        start = start_of(kernels, run.initial, not choose(run.settings).method.is_constrained)
        key = kernels, kernels.effort, run.settings, run.grid, run.stop, start
        return kernels.remember("motions from starts", key, lambda: cls(kernels, run), REMEMBERED)

    def with_velocities(self, zd0: ArrayOrNamed | None, qd0: ArrayOrNamed | None) -> PreparedMotion:
        """The same from the same position with other velocities; of equal ones the same object. Raises ModelError."""
        kernels, run = self.kernels, self.run
        initial = run.initial.with_velocities(kernels, zd0, qd0)
        start = start_of(kernels, initial, not self.choice.method.is_constrained, self.start)
        return kernels.remember("motions with velocities", (self, start), lambda: self._from(initial, start), REMEMBERED)

    def _from(self, initial: Initial, start: Start) -> PreparedMotion:
        """The same from another start at the same position."""
        assert self.mass_is_doubtful is not None and self.tolerances and self.breaks is not None  # what both have in common, found here
        other = copy(self)
        other.run, other.start, other.warnings = replace(self.run, initial=initial), start, (*start.warnings, *self._advice)
        other._plans, other._sibling = {}, self
        return other

    @cached_property
    def mass_is_doubtful(self) -> bool:
        """Whether the mass matrix may leave a motion without inertia on the way. Raises SingularError where it does at the start."""

        def find() -> bool:
            check_mass(self.kernels, self.start.q, self.run.initial.t, self.start.p)
            return bool(doubtful(self.kernels))

        return self.kernels.remember("masses at starts", self.start, find, REMEMBERED)

    @cached_property
    def breaks(self) -> np.ndarray:
        """The breaks (B, 2) of the laws in time (s), as of `break_times`."""
        if self.given_breaks is not None:
            return self.given_breaks
        functions = self.run.signals.laws if self.run.signals else ()
        ends = float(self.rows.times[0]), float(self.rows.times[-1])
        return break_times(self.kernels, self.start.p, *ends, functions, capabilities.rounding(self.run.settings.number))

    @cached_property
    def jumps(self) -> np.ndarray:
        """Those of the breaks (J, 2) at which the velocity of a driver jumps."""
        return driver_jumps(self.kernels, self.start.p, self.start.q, self.breaks)

    @cached_property
    def tolerances(self) -> Tolerances:
        """What an integrator with error control may be wrong by."""
        return Tolerances.of(self.run, self.kernels.length, capabilities.rounding(self.run.settings.number))

    @cached_property
    def mobility(self) -> tuple[int, bool]:
        """The rank of Φ_q, and whether the start is a singular position."""
        kernels, start, t = self.kernels, self.start, self.run.initial.t
        return kernels.remember("mobility at starts", start, lambda: rank_at(kernels, start.q, t, start.p), REMEMBERED)

    @cached_property
    def _inspected(self) -> np.ndarray | None:
        """Numbers of the rows at which C inspects the run: where parameters change, or with other numbers than doubles, it does not."""
        return np.array(self.rows.looked_at) if self.run.settings.number == "double" and not self.run.signals else None

    def plan(self, choice: Choice) -> RunPlan:
        """Return what carries the run out by the method of a choice, its own or the one that it continues with. Raises ModelError."""
        plan = self._plans.get(choice)
        if plan is not None:
            return plan
        run, start, kernels, is_constrained = self.run, self.start, self.kernels, choice.method.is_constrained
        is_new = kernels.backend != "c" or (start.partitions and run.settings.engine in EMITTED)  # which may be refused
        if self._sibling and is_constrained and not is_new:
            common = self._sibling.plan(choice)
            plan = self._plans[choice] = common._replace(task=common.task.with_velocities(start.qd))
            return plan
        known = run.settings, choice, kernels.effort, self.given_breaks is None
        common = self._plan(choice) if is_new else kernels.remember("plans", known, lambda: self._plan(choice), CACHED)
        task = common.task.begun(
            grid=self.rows.times,
            q=start.q,
            velocities=start.qd if is_constrained or choice is not self.choice else start.rates,
            p=start.p,
            stop=run.stop,
            signals=run.signals,
            tolerances=self.tolerances,
            breaks=self.breaks,
            movable=self.rows.is_extra,
            jumps=self.jumps,
            inspected=self._inspected,
            rank=self.mobility[0] if is_constrained and choice is self.choice else None,
        )
        plan = common._replace(task=task)
        if not is_new:
            self._plans[choice] = plan
        return plan

    def _plan(self, choice: Choice) -> RunPlan:
        """What does not depend on the numbers of a run; found once for its settings and a compiled mechanism."""
        settings = self.run.settings
        refused = "asked for" if settings.engine == "python" else self.refusal(choice)
        task = Task(
            method=choice.method,
            grid=self.run.grid.times,
            q=self.start.q,
            velocities=self.start.qd,
            p=self.start.p,
            max_step=settings.max_step,
            tolerances=self.tolerances,
            number=settings.number,
            stop_when_stiff=stiff_choice(settings, choice, recurs=True) is not None,
            steps_to_rows=self.given_breaks is not None,
        )
        return RunPlan(self.form(choice), refused, task)

    def form(self, choice: Choice) -> Form:
        """What state derivative C is given: as named, else one that is emitted where there is one over all coordinates."""
        settings = self.run.settings
        if settings.engine in EMITTED:
            return settings.engine
        is_open = settings.engine in (AUTO, COMPILED) and settings.number == "double"
        return acceleration_forms.form_of(self.kernels, choice.method) if is_open else "dense"

    def refusal(self, choice: Choice) -> str | None:
        """Why C cannot carry the run out by the method of a choice, None where it can."""
        settings, partitions = self.run.settings, self.start.partitions
        refused = capabilities.refusal(self.kernels, choice.method, settings.engine, settings.number)
        return refused or (capabilities.refusal_of_size(self.kernels, partitions, settings.engine) if partitions else None)

    def limits(self, method: Method) -> Limits:
        """Up to which what C sees of a motion by a method leaves no doubt."""
        limits = self._limits.get(method.integrator.name)
        if limits is None:
            limits = self._limits[method.integrator.name] = Limits.of(self.tolerances, method, self.rows.duration)
        return limits

    def explained(self, choice: Choice, engine: str) -> str:
        """The method and the engine, and why they were taken."""
        text = self._explained.get((choice, engine))
        if text is None:
            text = self._explained[choice, engine] = acceleration_forms.explained(self.kernels, choice, self.run.settings, engine)
        return text
