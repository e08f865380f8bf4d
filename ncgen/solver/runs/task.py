"""What an engine carries out, in C or in Python: the same for all of them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from math import ceil
from typing import TYPE_CHECKING, Any

import numpy as np

from ncgen.mechanism.break_times import NO_BREAKS
from ncgen.mechanism.conditions_in_c import Conditions
from ncgen.mechanism.kernels import Kernels
from ncgen.mechanism.run_arguments import NO_INPUTS, RunInputs
from ncgen.methods.method import Method
from ncgen.solver.positions.rank import rank_at
from ncgen.solver.runs.signals import Signals
from ncgen.solver.runs.stop import StopCondition
from ncgen.solver.runs.tolerances import Tolerances

if TYPE_CHECKING:
    from ncgen.mechanism.prepared_run import PreparedRun, RunCall
    from ncgen.mechanism.runtime import Dynamics

SPAN_TOLERANCE = 1e-6
"""A span that is longer than a number of steps by less than this share of one has no step more."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Task:
    """A method, from a start over a time grid.

    grid (points,): s; q (n,): m and rad; p (n_p,): parameters
    movable (points,): a mask of instants that need not be exact: C moves them, in the grid, to where its steps end
    velocities: in the same per second, of all coordinates (n,), or with coordinate partitioning of the independent ones (nz,)
    max_step: s, or inf; tolerances: where the method has error control
    number: C's type; stop: where to end before
    progress: called now and then with the time reached. What is raised meanwhile ends the run and is raised, the path holding what was
        reached
    signals: what drives the mechanism, if anything does
    breaks (B, 2): the breaks of the laws in time (s), as `break_times` finds them; jumps (J, 2): those at which a driver's velocity jumps
    rank: of Φ_q, None where it is not known yet
    before: when the run began (s), of which this is a part, and how many steps it has taken so far
    steps_to_rows: whether a method with a fixed step takes one from each time of the grid to the next, whatever max_step is
    calls_c: whether an integrator in Python takes accelerations and projections of C
    conditions: of events, and of the stop, at the first of which C ends this part of the run; first_step: what C tries first (s), 0 for its
        own choice
    inspected: ascending numbers of the instants at which C inspects a run over the whole grid, None where it does not
    sibling: None, or a task that differs in its velocities alone, whose runs in C this one may take
    stop_when_stiff: whether dopri5 and dop853 in C end where an implicit method would serve better
    """

    method: Method
    grid: np.ndarray
    q: np.ndarray
    velocities: np.ndarray
    p: np.ndarray
    max_step: float
    tolerances: Tolerances
    number: str = "double"
    stop: StopCondition | None = None
    progress: Callable[[float], None] | None = None
    stop_when_stiff: bool = False
    signals: Signals | None = None
    breaks: np.ndarray = field(default_factory=lambda: NO_BREAKS)
    movable: np.ndarray | None = None
    jumps: np.ndarray = field(default_factory=lambda: NO_BREAKS)
    rank: int | None = None
    before: tuple[float, int] = (0.0, 0)
    steps_to_rows: bool = False
    calls_c: bool = False
    conditions: Conditions | None = None
    first_step: float = 0.0
    inspected: np.ndarray | None = None
    sibling: Task | None = None

    def rank_at(self, kernels: Kernels, q: np.ndarray, t: float) -> int:
        """The rank of Φ_q where the run, or what is left of it, begins: at q (n,) and t (s), unless it is known already."""
        return rank_at(kernels, q, t, self.p)[0] if self.rank is None else self.rank

    def movable_from(self, row: int) -> np.ndarray:
        """The mask from a row on."""
        movable = np.zeros(len(self.grid), dtype=bool) if self.movable is None else self.movable
        return movable[row:] if row else movable

    def looked_at(self, row: int, times: np.ndarray) -> None:
        """Rows from one on are of these times (s), of which movable may be others than were asked for."""
        rows = self.grid[row : row + len(times)]
        if self.number == "float":  # which rounds those that were asked for
            np.copyto(rows, times, where=self.movable_from(row)[: len(times)])
        else:
            rows[:] = times

    @property
    def step_in_c(self) -> float:
        """`max_step` of `ncgen_options`."""
        return -1.0 if self.steps_to_rows else 0.0 if np.isinf(self.max_step) else self.max_step

    @property
    def steps(self) -> int:
        """How many steps a stepper takes: one to each row, or equal ones of at most max_step, which as in C end with the grid."""
        return len(self.grid) - 1 if self.steps_to_rows else max(1, ceil((self.grid[-1] - self.grid[0]) / self.max_step - SPAN_TOLERANCE))

    @property
    def step(self) -> float | None:
        """The length (s) of the steps of a method that has a fixed one."""
        if not self.method.has_fixed_step:
            return None
        equal = self.method.is_stepper and not self.steps_to_rows
        return float(self.grid[-1] - self.grid[0]) / self.steps if equal else self.max_step

    @property
    def watched(self) -> Conditions | None:
        """The conditions at the first of which C ends the run."""
        return self.conditions or (self.stop.conditions if self.stop else None)

    @property
    def arrival(self) -> float | None:
        """Where steps with error control are to arrive (s); None where a stop may end the run before."""
        return None if self.conditions or self.stop or self.method.has_fixed_step else float(self.grid[-1])

    def begun(self, **numbers: Any) -> Task:
        """The same for a run with other numbers (`grid`, `movable`, `q`, `velocities`, `p`, `rank`, `tolerances` of the same kind), and
        with others who watch it: what was prepared stays."""
        task, _ = object.__new__(Task), self.runs
        vars(task).update(vars(self), calls={}, **numbers)
        return task

    def with_velocities(self, velocities: np.ndarray) -> Task:
        """The same from other velocities at the same start; runs in C take the rest from this task."""
        return self.begun(velocities=velocities, sibling=self)

    def again(self, grid: np.ndarray, progress: Callable[[float], None] | None) -> Task:
        """The same for a run with these numbers once more; grid: of the same times, which this run may move."""
        task, _ = object.__new__(Task), self.calls
        object.__setattr__(task, "__dict__", vars(self).copy())  # takes a third of the time of an update
        vars(task)["grid"], vars(task)["progress"] = grid, progress
        return task

    @cached_property
    def runs(self) -> dict[Dynamics, PreparedRun]:
        """Runs in C that were prepared for this task, by state derivatives."""
        return {}

    @cached_property
    def calls(self) -> dict[tuple[Kernels, str], RunCall]:
        """Runs in C over the whole grid from the start of this task, by kernels and the form of accelerations."""
        return {}

    def inputs_in_c(self, rule: Callable[[np.ndarray, np.ndarray], np.ndarray] | None) -> RunInputs:
        """What changes parameters on the way, with a rule of positions."""
        if not (self.signals or rule or len(self.breaks)):
            return NO_INPUTS
        return RunInputs(signals=self.signals.functions if self.signals else (), breaks=self.breaks, rule=rule)
