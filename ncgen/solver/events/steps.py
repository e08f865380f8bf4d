"""A mechanism with events that is advanced from call to call: the loop from event to event, begun anew where the last call ended."""

from __future__ import annotations

from collections.abc import Hashable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace

import numpy as np

from ncgen.errors import ConvergenceError, ModelError, warn
from ncgen.mechanism.break_times import DOUBLE, MIN_GAP_ROUNDINGS, NO_BREAKS, break_times
from ncgen.mechanism.conditions_in_c import Watched
from ncgen.mechanism.driver_jumps import driver_jumps
from ncgen.mechanism.kernels import Kernels
from ncgen.mechanism.moving import Moving, MovingRow, Stepping
from ncgen.mechanism.time_laws import time_laws
from ncgen.methods.method import Method
from ncgen.solver.engines import acceleration_forms, capabilities, compiled
from ncgen.solver.engines.segments import in_segments
from ncgen.solver.events.loop import EventLoop
from ncgen.solver.events.modes import rank_of
from ncgen.solver.events.passage import Passage
from ncgen.solver.events.state import State
from ncgen.solver.formalisms import accelerations_by
from ncgen.solver.formalisms.impulse import Impulse
from ncgen.solver.runs.path import Path
from ncgen.solver.runs.task import Task
from ncgen.solver.runs.tolerances import Tolerances
from ncgen.solver.trajectories.happening import Happening
from ncgen.solver.trajectories.output_values import uses_loads
from ncgen.toolchain.abi import NUMBERS, runtime_abi


@dataclass(frozen=True, eq=False, kw_only=True)
class Past:
    """What a state has of events: at, where the loop was; signs (C,): sides of the conditions; held: numbers of what was held; stopped:
    whether an event ended the motion; happened: all events so far"""

    at: State
    signs: np.ndarray
    held: tuple[int, ...]
    stopped: bool
    happened: tuple[Happening, ...]


class Steps:
    """What carries a mechanism over its events, in the memory of its simulation.

    happened: all events so far; stopped: whether one of them ended the motion; evaluations, impulses: of the last step
    """

    def __init__(
        self, kernels: Kernels, method: Method, tolerances: Tolerances, now: Moving | MovingRow, modes: dict[Hashable, Stepping]
    ) -> None:
        """modes: how the mechanism moves with what is held, by that; filled here, and shared by simulations that never move at one time"""
        self._modes = modes
        self._kernels, self._method, self._tolerances, self._now = kernels, method, tolerances, now
        self._has_breaks = time_laws(kernels).has_breaks
        self.happened: tuple[Happening, ...] = ()
        self.stopped, self.evaluations = False, 0
        self.impulses: tuple[Impulse, ...] = ()
        self._watched: tuple[Watched, Stepping | None] | None = None  # between two changes
        self._begin()

    # -- where it is ---------------------------------------------------------------------------

    @staticmethod
    def is_past(value: object) -> bool:
        """Whether it is what `past` returns."""
        return isinstance(value, Past)

    @property
    def past(self) -> Past:
        """As a state keeps it."""
        loop = self._loop
        return Past(at=loop.at, signs=loop.signs, held=loop.held, stopped=self.stopped, happened=self.happened)

    def go_back(self, past: Past) -> None:
        """To what a state kept; the simulation's own numbers are the caller's."""
        self._loop.go_to(past.at, past.signs, past.held)
        self.stopped, self.happened, self._watched = past.stopped, past.happened, None

    def accelerations(self) -> np.ndarray:
        """(n,) with the present inputs and what is held."""
        with self._or_back():
            self._follow()
        at = self._loop.at
        return accelerations_by("lagrange").motion(self._loop.mode, at.q, at.qd, at.t, at.p, {}).qdd

    def check_outputs(self) -> None:
        """Raise ModelError for outputs of joint loads where gaps rest, joints stick, or friction follows loads."""
        if (self._loop.held or self._loop.functions.loaded) and uses_loads(self._kernels.model):
            raise ModelError(f"{self._kernels.name}: outputs of joint loads need a motion in which no gap and no joint is held or rubs")

    def _follow(self) -> None:
        """Take on what the simulation was given since the last step: a state begins anew, and inputs may bring about events."""
        now, at = self._now, self._loop.at
        if not self._is_where_it_was():
            self._begin()
        elif self.stopped:
            return
        elif not (np.array_equal(now.p, at.p) or self._loop.accept(now.p.copy())):
            self._loop.work = now.work
            self._note(self._loop.change(now.p.copy()))

    def _is_where_it_was(self) -> bool:
        """Whether the simulation has the state that the last step or event left."""
        now, at = self._now, self._loop.at
        return now.t == at.t and np.array_equal(now.q, at.q) and np.array_equal(now.qd, at.qd)

    def _begin(self) -> None:
        now = self._now
        loop = EventLoop(self._engine, self._kernels, State(t=now.t, q=now.q.copy(), qd=now.qd.copy(), p=now.p.copy()), Passage())
        loop.work = now.work
        stopped = loop.begin()
        self._loop = loop
        self._note(stopped)

    def _note(self, stopped: bool) -> None:
        """Show the state after events in the simulation's memory."""
        loop, now, passage = self._loop, self._now, self._loop.passage
        self.stopped, self._watched = stopped, None
        self.happened += tuple(passage.happened)
        loop.passage = Passage()
        now.t, now.work, now.next_step = loop.at.t, loop.work, loop.first_step
        now.q[:], now.qd[:], now.p[:] = loop.at.q, loop.at.qd, loop.at.p
        if passage.rests:
            warn(f"{self._kernels.name}: {passage.rests}")

    # -- steps ---------------------------------------------------------------------------------

    def go_on(self, h: float) -> bool:
        """On by h seconds, or to the event that ends the motion, which inputs may bring about at once; False where one has ended it before.

        Raises ConvergenceError or DomainError where it cannot go on, ModelError for a state that cannot begin; then nothing has moved.
        """
        with self._or_back():
            if self.stopped and self._is_where_it_was():
                return False
            self._follow()
            if not (self.stopped or self._has_moved(h)):
                self._run(self._now.t + h)
            return True

    @contextmanager
    def _or_back(self) -> Iterator[None]:
        """Where something is raised all is as it was."""
        now, past = self._now, self.past
        numbers = now.t, now.work, now.next_step, now.q.copy(), now.qd.copy(), now.p.copy()
        try:
            yield
        except BaseException:
            now.t, now.work, now.next_step, now.q[:], now.qd[:], now.p[:] = numbers
            self.go_back(past)
            raise

    def _has_moved(self, h: float) -> bool:
        """Whether a step without events has succeeded, as most do; else nothing has moved."""
        now, loop = self._now, self._loop
        if self._has_breaks or (prepared := self._watched or self._watch()) is None:
            return False
        watched, mode = prepared
        numbers = now.t, now.work, now.next_step
        status, ends, evaluations = now.go_on_to_event(h, watched, mode)
        if status != "ok" or ends:
            self._watched = None
            now.t, now.work, now.next_step = numbers
            now.q[:], now.qd[:] = loop.at.q, loop.at.qd
            return False
        loop.at = replace(loop.at, t=now.t, q=now.q.copy(), qd=now.qd.copy())
        loop.signs = watched.signs[: loop.functions.count]
        watched.report()
        self._watched, self.evaluations, self.impulses = prepared, evaluations, ()
        return True

    def _watch(self) -> tuple[Watched, Stepping | None] | None:
        """What C watches, and how the mechanism moves in its mode, None for its own; None where loads call Python."""
        loop = self._loop
        conditions, loads = loop.watched()
        if loads and loads.calls_python:
            return None
        mode = None if loop.mode is self._kernels else self._mode()
        return Watched(conditions, runtime_abi("double"), NUMBERS["double"]), mode

    def _mode(self) -> Stepping:
        loop, tolerances = self._loop, self._tolerances
        key = loop.held, loop.at.locked, self._kernels.of_rows(loop.at.p).tobytes()
        if key not in self._modes:
            dynamics = acceleration_forms.all_coordinates(loop.mode, form=acceleration_forms.form_of(loop.mode, self._method))
            sizes = tolerances.in_c(self._kernels.column_sizes, self._kernels.column_sizes)["sizes"]
            self._modes[key] = Stepping(
                dynamics, self._method.integrator.name, rank_of(self._kernels, loop.mode, loop.at), tolerances.rtol, tolerances.atol, sizes,
                capabilities.closeness("double"),
            )  # fmt: skip
        return self._modes[key]

    def _run(self, t_end: float) -> None:
        loop, task, path = self._loop, self._task(t_end), Path.empty(self._kernels.n, None)
        loop.work, loop.first_step = self._now.work, self._now.next_step
        if reason := loop.run(path, task):
            raise ConvergenceError(f"{self._kernels.name}: {reason}; take other steps or tolerances")
        if path.stopped is None:
            loop.arrive(replace(loop.at, t=t_end, q=path.q[-1], qd=path.qd[-1]), float(path.work[-1]))
        self.evaluations, self.impulses = path.evaluations, tuple(path.impulses)
        self._note(path.stopped is not None)

    def _task(self, t_end: float) -> Task:
        kernels, at, breaks = self._kernels, self._loop.at, NO_BREAKS
        if self._has_breaks:
            margin = 2 * MIN_GAP_ROUNDINGS * DOUBLE * max(abs(at.t), abs(t_end))  # a step may have ended at the middle of one
            breaks = break_times(kernels, at.p, at.t - margin, t_end)
        jumps = driver_jumps(kernels, at.p, at.q, breaks)
        times, step = np.array([at.t, t_end]), t_end - at.t
        longest = step if self._method.has_fixed_step else np.inf
        return Task(
            method=self._method,
            grid=times,
            q=at.q,
            velocities=at.qd,
            p=at.p,
            max_step=longest,
            tolerances=self._tolerances,
            breaks=breaks,
            jumps=jumps,
        )

    def _engine(self, path: Path, kernels: Kernels, task: Task) -> str | None:
        def moved(path: Path, kernels: Kernels, task: Task) -> str | None:
            return compiled.run_constrained(path, kernels, task, acceleration_forms.form_of(kernels, task.method))

        return in_segments(moved, path, kernels, task, task.jumps)
