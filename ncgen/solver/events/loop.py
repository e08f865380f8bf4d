"""A run from event to event: C ends at the first condition that is fulfilled, the actions follow, and C begins anew at that instant."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ncgen.errors import ConvergenceError, ModelError
from ncgen.mechanism.chain_in_c import is_at_rest, is_zero, time_of_bounces
from ncgen.mechanism.conditions_in_c import UNWATCHED, Conditions
from ncgen.mechanism.kernels import Kernels
from ncgen.mechanism.sliding_in_c import unseen_velocities
from ncgen.solver.engines.compiled import STIFFNESS_REASON
from ncgen.solver.events.active_constraints import ActiveConstraints
from ncgen.solver.events.conditions import VALUE_ROUNDING, EventFunctions
from ncgen.solver.events.instants import Instant
from ncgen.solver.events.modes import LoadConditions, Mode, load_conditions, rank_of
from ncgen.solver.events.passage import Passage
from ncgen.solver.events.state import Occurrence, State
from ncgen.solver.formalisms import accelerations_by
from ncgen.solver.runs.path import Path
from ncgen.solver.runs.stop import StopCondition
from ncgen.solver.runs.task import Task
from ncgen.solver.trajectories.happening import Happening, Search

if TYPE_CHECKING:
    from ncgen.solver.engines.segments import Engine


def through_events(
    engine: Engine, path: Path, kernels: Kernels, task: Task, passage: Passage, when_stiff: Callable[[float], Task | None] | None = None
) -> str | None:
    """Complete an empty path as an engine does, with the events of the model.

    when_stiff: gives the task by an implicit method with which the run continues from a time (s) on, where the mechanism is found stiff
    Returns why the engine stopped before the end, or None. Raises what it raises.
    """
    loop = EventLoop(engine, kernels, State(t=float(task.grid[0]), q=task.q, qd=task.velocities, p=task.p), passage)
    loop.when_stiff = when_stiff
    loop._see(task)
    ends = loop.begin()
    return loop.run(path, task, ends)


MOST_REPEATED = 100
"""Instants one after the other that the time may have not to move between."""


class EventLoop:
    """The state of a run between two events: at, work (J), signs (C,): sides on which conditions begin; what is held, and the kernels of
    that mode; first_step (s): what C tries first, 0 for its own choice."""

    path: Path
    task: Task
    when_stiff: Callable[[float], Task | None] | None = None

    def __init__(self, engine: Engine, kernels: Kernels, at: State, passage: Passage) -> None:
        self.engine, self.kernels, self.passage = engine, kernels, passage
        self.functions = EventFunctions(kernels)
        self.active_constraints = ActiveConstraints(self.functions)
        self.at, self.work, self.first_step = at, 0.0, 0.0
        self.signs = np.zeros(self.functions.count, dtype=int)
        self.held: tuple[int, ...] = ()
        self.mode = kernels

    def run(self, path: Path, task: Task, ends: bool = False) -> str | None:
        """Complete an empty path over the grid of a task, which begins where the loop is; ends: whether it ends there, too.

        Returns why the engine stopped before the end, or None. Raises what it raises.
        """
        self.path, self.task = path, task
        end = float(task.grid[-1])
        if ends:
            return self._finish()
        repeated = 0
        while True:
            segment, before = Path.empty(self.kernels.n, None), self.at.t
            reason = self._part(segment)
            if reason == STIFFNESS_REASON and self._is_now_implicit():
                continue
            if reason or segment.stopped is None:
                return reason
            stops = self._is_stop(segment.crossed)
            self._see(task, segment)
            if self._act(self._due(segment.crossed), crossed=segment.crossed) or stops:
                return self._finish()
            if is_complete := len(path.q) == len(task.grid):  # C moved the last row to where a law changes: to this instant
                path.take_last()
            if is_complete or not self.at.t < end:
                return self._rows_at_end()
            repeated = repeated + 1 if self.at.t == before else 0
            if repeated > MOST_REPEATED:
                raise self._endless(segment.crossed)

    def _is_now_implicit(self) -> bool:
        """Whether the run continues by an implicit method, from its last row or the last event, whichever is later."""
        path = self.path
        t = max(float(self.task.grid[len(path.q) - 1]), self.at.t) if len(path.q) else self.at.t
        task = self.when_stiff(t) if self.when_stiff else None
        if task is None:
            return False
        self.task, self.first_step = task, 0.0
        if t > self.at.t:
            self.at, self.work = replace(self.at, t=t, q=path.q[-1], qd=path.qd[-1]), float(path.work[-1])
        return True

    def _endless(self, crossed: tuple[int, ...]) -> ConvergenceError:
        """Events that happen at one instant again and again."""
        names = sorted({self.functions.events[k].name for k in crossed if k < len(self.functions.events)}) or ["of held constraints"]
        return ConvergenceError(
            f"{self.kernels.name}: events {', '.join(names)} happen again and again at t = {self.at.t:.6g} s; "
            "change their conditions, or start at another position"
        )

    # -- parts ---------------------------------------------------------------------------------

    def _part(self, segment: Path) -> str | None:
        """Let the engine go on from here to the next event or the end, and add its rows to the path."""
        task, first, path, at = self.task, len(self.path.q), self.path, self.at
        ahead = task.grid[first:]
        fresh = int(not (len(ahead) and ahead[0] == at.t))
        extra_times = np.append(np.zeros(fresh, dtype=bool), task.movable_from(first))
        conditions, loads = self.watched(task.stop)
        part_task = replace(
            task, grid=np.concatenate([[at.t] * fresh, ahead]), movable=extra_times, q=at.q, velocities=at.qd, p=at.p,
            conditions=conditions, rank=rank_of(self.kernels, self.mode, at), first_step=self.first_step,
            stop_when_stiff=task.stop_when_stiff and self.when_stiff is not None, inspected=None, sibling=None,
        )  # fmt: skip
        try:
            return self.engine(segment, self.mode, part_task)
        except ConvergenceError:
            if not self._comes_to_rest(segment):
                raise
            return None
        finally:
            count = len(segment.q) - (segment.stopped is not None)
            rows = slice(fresh, max(count, fresh))
            path.extend(segment.q[rows], segment.qd[rows], segment.work[rows] + self.work, segment.counts)
            path.take_counts(segment)
            task.looked_at(first, part_task.grid[rows])
            self.first_step = segment.next_step
            if segment.stopped is not None:
                self.at = replace(at, t=segment.stopped, q=segment.q[-1], qd=segment.qd[-1])
                self.work += float(segment.work[-1])
                if not segment.crossed:  # something was raised
                    self._finish()
            if loads and loads.raised:
                raise loads.raised

    def _see(self, task: Task, segment: Path | None = None) -> None:
        """Note which velocities steps do not tell from none: all of them where no step was short enough."""
        if self.functions.turns:
            is_blind, qd = segment is not None and segment.halted, self.at.qd
            self.active_constraints.unseen = np.abs(qd) if is_blind else self._unseen(task)

    def _unseen(self, task: Task) -> np.ndarray:
        """Velocities (n,) that the steps of a task do not tell from none."""
        step, allowed, sizes = task.step, task.tolerances, self.kernels.column_sizes
        tolerances = (0.0, 0.0) if step is not None else (allowed.rtol, allowed.atol)
        return unseen_velocities(
            tolerances, step or 0.0, sizes if allowed.natural else np.ones_like(sizes), self.at.qd, self._accelerations()
        )

    def _comes_to_rest(self, segment: Path) -> bool:
        """Whether steps became too short where contacts in space come to rest, so that friction has no direction; ends the part there."""
        if segment.halted is None:
            return False
        t, q, qd, _ = segment.halted
        segment.crossed = self.active_constraints.resting(replace(self.at, t=t, q=q, qd=qd))
        if segment.crossed:
            segment.stop(*segment.halted)
        return bool(segment.crossed)

    def _rows_at_end(self) -> None:
        """The last row of the grid is that of the event itself."""
        rest, at = len(self.task.grid) - len(self.path.q), self.at
        self.path.extend(np.repeat(at.q[None], rest, axis=0), np.repeat(at.qd[None], rest, axis=0), np.full(rest, self.work))

    def _finish(self) -> None:
        """End the path here."""
        path, grid = self.path, self.task.grid
        while len(path.q) and grid[len(path.q) - 1] >= self.at.t:
            path.take_last()
        path.stop(self.at.t, self.at.q, self.at.qd, self.work)

    # -- instants ------------------------------------------------------------------------------

    def _due(self, crossed: tuple[int, ...]) -> dict[int, Search]:
        """Conditions of the mechanism that crossed; those of loads become constraints that are released."""
        functions = self.functions
        self.active_constraints.release(self.held, [k - functions.count for k in crossed if k >= functions.count], self.mode, self.at)
        return {k: functions.searches[k] for k in crossed if k < functions.count}

    def _is_stop(self, crossed: tuple[int, ...]) -> bool:
        """Whether the run was told to stop there: that condition follows those of the mechanism and of the loads."""
        loads = self._loads
        return self.task.stop is not None and self.functions.count + (loads.count if loads else 0) in crossed

    def begin(self) -> bool:
        """Events at the start: a condition that is zero there and moves on in its direction. Returns whether the run ends there.

        Raises ModelError for a gap that an impact is to close and that is open by less than nothing.
        """
        functions, start = self.functions, self.at
        self.at = at = self.active_constraints.begin(start)
        rates, _ = functions.rates(at, self._accelerations())
        gaps = np.array([event.impact is not None for event in functions.events], dtype=bool)
        keeps = np.array([gap and self.active_constraints.is_still(k, at) for k, gap in enumerate(gaps)], dtype=bool)
        chain = Instant(functions=functions, at=at).chain
        if (below := chain.first(rates, gaps, keeps, self.signs)) >= 0:
            raise ModelError(
                f"event {functions.events[below].name}: the gap is {functions.values(at)[0][below]:.6g} at the start; "
                "begin where it is not below 0, or make it another event"
            )
        due: dict[int, Search] = dict.fromkeys(np.flatnonzero(chain.due).tolist(), "start")
        self._note_parameters(start)
        self.passage.begun = self.at
        return self._act(due, True) if due or functions.can_hold else False

    def change(self, p: np.ndarray) -> bool:
        """Go on with other parameters p (n_p,), which may bring about events. Returns whether the run ends with them."""
        before = self.functions.values(self.at)[0]
        self.at = replace(self.at, p=p)
        instant = Instant(functions=self.functions, at=self.at)
        due: dict[int, Search] = dict.fromkeys(instant.chain.turned(before), "action")
        if due or self.functions.can_hold:
            return self._act(due)
        self._set_signs(instant)
        return False

    def accept(self, p: np.ndarray) -> bool:
        """Go on with other parameters p (n_p,) that cannot bring about events: no condition reads what has changed, nothing is held, and no
        gap is closed. Returns whether that is so; else nothing has changed."""
        functions, at = self.functions, self.at
        if self.held or at.locked or len(functions.events) < functions.count:
            return False
        if not functions.unread[p != at.p].all():
            return False
        values, scales = functions.weighed(at)
        if functions.rows and any(map(is_zero, values.tolist(), scales.tolist())):
            return False
        self.at = replace(at, p=p)
        return True

    def arrive(self, at: State, work: float) -> None:
        """Take on the state at the end of a run, and work (J), from which the next one begins."""
        self.at, self.work = at, work
        self._set_signs(Instant(functions=self.functions, at=at))

    def watched(self, stop: StopCondition | None = None) -> tuple[Conditions, LoadConditions | None]:
        """What C watches: conditions of the mechanism, then those of the loads of what is held, which are given besides, then a stop."""
        directions, loads = self.active_constraints.directions(self.held, self.at.p), self._loads
        return self.functions.watched(self.signs, stop, directions, loads), loads

    @property
    def _loads(self) -> LoadConditions | None:
        """The conditions of the loads of what is held, or None."""
        held = tuple(self.active_constraints.rows[k] for k in self.held)
        return load_conditions(self.functions, self.mode, held) if held or self.functions.loaded else None

    def go_to(self, at: State, signs: np.ndarray, held: tuple[int, ...]) -> None:
        """Take on a state that the loop was in before."""
        self.at, self.signs, self.held = at, signs, held
        self.mode = self.functions.mode(at, [self.active_constraints.rows[k] for k in held])
        self.active_constraints.look(at, held)

    def _act(self, due: dict[int, Search], is_start: bool = False, crossed: tuple[int, ...] = ()) -> bool:
        """Carry out events, and find the mode that follows; returns whether the run ends with them. crossed: as of `Occurrence`"""
        before = self.at
        instant = Instant(functions=self.functions, at=before, turning=due, held=self.held)
        if is_start:
            instant.begin()
        instant.happen({k: search for k, search in due.items() if k < len(self.functions.events)})
        self.at = instant.at
        rests = self._resting(instant.chain.happened, not np.array_equal(before.qd, self.at.qd))
        ended = [name for name, _ in rests.values() if self.functions.named[name].impact.rest == "end"]  # type: ignore[union-attr]
        resting = [k for k in rests if self.functions.events[k].name not in ended]
        unhit = self.held if np.array_equal(before.qd, self.at.qd) else ()
        active = self.active_constraints.find(self.at, self.held, due, [*resting, *instant.stuck, *unhit], before.qd)
        held, changes = self.held, (active.held, active.at.locked) != (self.held, before.locked)
        self.go_to(active.at, self.signs, active.held)
        self._note(before, instant.happened, active.happened, dict(rests.values()))
        instant.at = self.at
        self._set_signs(instant)
        happened = (*instant.happened, *active.happened)
        stops = instant.stops or bool(ended)
        self.passage.instants.append(
            Occurrence(
                before=before,
                after=self.at,
                held_before=held,
                held=active.held,
                crossed=crossed,
                done=tuple(instant.done),
                stops=stops,
                happened=happened,
            )
        )
        if changes or (is_start and self.functions.loaded):
            self.first_step = 0.0
            self.passage.modes.append(
                Mode(self.at.t, (*self.at.locked, *(self.active_constraints.rows[k].name for k in active.held)), self.mode)
            )
        if ended:
            self.passage.rests = f"event {ended[0]}: bounces accumulate at t = {dict(rests.values())[ended[0]]:.9g} s, where the run ends"
        return stops

    def _note(self, before: State, happened: list[Happening], modes: list[Happening], limits: dict[str, float]) -> None:
        """Add what happened to what the run has met, and its energy to the work."""
        kernels, passage = self.kernels, self.passage
        if happened or before.q is not self.at.q or before.qd is not self.at.qd:  # else only what slips and sticks is other
            energies = [float(np.sum(kernels.energy(at.q, at.qd, at.t, at.p)[:2])) for at in (before, self.at)]
            self.work += energies[1] - energies[0]
        self._note_parameters(before)
        for each in (*happened, *modes):
            passage.happened.append(replace(each, limit=limits.get(each.name)))

    def _note_parameters(self, before: State) -> None:
        """What held from here on, where it is not what held before."""
        if not np.array_equal(before.p, self.at.p):
            self.passage.changes.append((self.at.t, self.at.p))

    def _set_signs(self, instant: Instant) -> None:
        """The side on which each condition continues: that of events follows from what happened."""
        functions, active, chain = self.functions, self.active_constraints, instant.chain
        self.signs = self.signs.copy()
        chain.look()
        chain.set_sides(np.array([self._is_above(k) for k in range(len(functions.events))], dtype=bool), self.signs)
        ways = active.directions(self.held, self.at.p)
        for k in range(len(functions.events), functions.count):
            may_begin = k in functions.turns.values()  # in space it has to become faster first than where it comes to rest
            self.signs[k] = 0 if ways[k] == UNWATCHED or may_begin else -int(ways[k])

    def _is_above(self, k: int) -> bool:
        """Whether the gap of an event closes if it falls from here on: it was let go, or it is closed and does not change."""
        active, at = self.active_constraints, self.at
        return k in active.left or bool(self.functions.events[k].impact and active.is_closed(k, at) and active.is_still(k, at))

    def _resting(self, happened: np.ndarray, is_hit: bool) -> dict[int, tuple[str, float]]:
        """{number: (name, limit time in s)} of gaps that have bounced and whose next bounce cannot be told from none.

        happened (C,): which conditions have; is_hit: whether impulses acted, with which all bounce that are closed
        """
        resting_gaps: dict[int, tuple[str, float]] = {}
        gaps = [k for k, event in enumerate(self.functions.events) if event.impact]
        impacts = [k for k in gaps if happened[k] or (is_hit and self.active_constraints.is_closed(k, self.at))]
        if not impacts:
            return resting_gaps
        rates, second = self.functions.rates(self.at, self._accelerations(impacts))
        values, scales = self.functions.weighed(self.at)
        noise = VALUE_ROUNDING[self.functions.degree]
        for k in impacts:
            if rates[k] < 0 and not happened[k]:
                continue  # it is still to be hit
            if is_at_rest(values[k], scales[k], rates[k], second[k], noise):
                ends = time_of_bounces(rates[k], second[k], self.functions.restitution(k, self.at))
                resting_gaps[k] = self.functions.events[k].name, self.at.t + ends
        return resting_gaps

    def _accelerations(self, hit: Sequence[int] = ()) -> np.ndarray:
        """Those of the present state. hit: gaps that have bounced, so that they are held no more"""
        held = [k for k in self.held if k not in hit]
        mode = self.mode if len(held) == len(self.held) else self.functions.mode(self.at, [self.active_constraints.rows[k] for k in held])
        at = self.at
        return accelerations_by("lagrange").motion(mode, at.q, at.qd, at.t, self.kernels.present(at.t, at.p), {}).qdd
