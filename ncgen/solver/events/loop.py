"""A run from event to event: C ends at the first condition that is fulfilled, the actions follow, and C begins anew at that instant."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ncgen.errors import ModelError
from ncgen.mechanism.kernels import Kernels
from ncgen.solver.events.actions import CLOSED, Instant, number_of
from ncgen.solver.events.conditions import NOISE, EventFunctions, State
from ncgen.solver.events.passage import Passage
from ncgen.solver.formalisms import accelerations_by
from ncgen.solver.runs.path import Path
from ncgen.solver.runs.task import Task
from ncgen.solver.trajectories.happening import Search

if TYPE_CHECKING:
    from ncgen.solver.engines.segments import Engine

AT_REST = 50.0
"""A bounce that stays lower than this many times what has no sign is none: from then on the gap is said to rest."""


def through_events(engine: Engine, path: Path, kernels: Kernels, task: Task, passage: Passage) -> str | None:
    """Complete an empty path as an engine does, with the events of the model.

    Returns why the engine stopped before the end, or None. Raises what it raises.
    """
    return _Loop(engine, path, kernels, task, passage).run()


class _Loop:
    """The state of a run between two events: at, work (J), signs (C,): sides on which conditions begin, rank of Φ_q."""

    def __init__(self, engine: Engine, path: Path, kernels: Kernels, task: Task, passage: Passage) -> None:
        self.engine, self.path, self.kernels, self.task, self.passage = engine, path, kernels, task, passage
        self.functions = EventFunctions(kernels)
        self.at = State(float(task.grid[0]), task.q, task.velocities, task.p)
        self.rank = task.rank_at(kernels, task.q, float(task.grid[0]))
        self.work, self.first_step = 0.0, 0.0
        self.signs = np.zeros(len(self.functions.events), dtype=int)
        self.off = np.zeros(len(self.functions.events), dtype=bool)

    def run(self) -> str | None:
        end = float(self.task.grid[-1])
        if self._begin():
            return self._finish()
        while True:
            part = Path.empty(self.kernels.n, None)
            reason = self._part(part)
            if reason or part.stopped is None:
                return reason
            due: dict[int, Search] = {k: self.functions.searches[k] for k in part.crossed if k < len(self.functions.events)}
            if self._act(due) or len(part.crossed) > len(due):
                return self._finish()
            if not self.at.t < end:
                self._rows_at_end()
                return None

    # -- parts ---------------------------------------------------------------------------------

    def _part(self, part: Path) -> str | None:
        """Let the engine go on from here to the next event or the end, and add its rows to the path."""
        task, first, path = self.task, len(self.path.q), self.path
        ahead = task.grid[first:]
        fresh = int(not (len(ahead) and ahead[0] == self.at.t))
        times = np.concatenate([[self.at.t] * fresh, ahead])
        here = replace(
            task, grid=times, looks=np.append(np.zeros(fresh, dtype=bool), task.looks_from(first)), q=self.at.q, velocities=self.at.qd,
            p=self.at.p, rank=self.rank, conditions=self.functions.watched(self.signs, task.stop, self.off), first_step=self.first_step,
            stop_when_stiff=False,
        )  # fmt: skip
        try:
            return self.engine(part, self.kernels, here)
        finally:
            count = len(part.q) - (part.stopped is not None)
            rows = slice(fresh, max(count, fresh))
            path.extend(part.q[rows], part.qd[rows], part.work[rows] + self.work, part.counts)
            path.take_counts(part)
            task.looked_at(first, here.grid[rows])
            if part.stopped is not None:
                self.at = State(part.stopped, part.q[-1], part.qd[-1], self.at.p)
                self.work += float(part.work[-1])
                if not part.crossed:  # something was raised
                    self._finish()
            self.first_step = part.next_step

    def _rows_at_end(self) -> None:
        """The last row of the grid is that of the event itself."""
        rest = len(self.task.grid) - len(self.path.q)
        self.path.extend(np.repeat(self.at.q[None], rest, axis=0), np.repeat(self.at.qd[None], rest, axis=0), [self.work] * rest, [0] * 5)

    def _finish(self) -> None:
        """End the path here."""
        path, grid = self.path, self.task.grid
        while len(path.q) and grid[len(path.q) - 1] >= self.at.t:
            path.take_last()
        path.stop(self.at.t, self.at.q, self.at.qd, self.work)

    # -- instants ------------------------------------------------------------------------------

    def _begin(self) -> bool:
        """Events at the start: a condition that is zero there and moves on in its direction. Returns whether the run ends there.

        Raises ModelError for a gap that an impact is to close and that is open by less than nothing.
        """
        functions, at = self.functions, self.at
        values, scales = functions.values(at)[0], functions.scales(at)
        rates, _ = functions.rates(at, self._accelerations())
        due: dict[int, Search] = {}
        for k, event in enumerate(functions.events):
            is_zero = abs(values[k]) <= CLOSED * scales[k]
            if event.impact and values[k] < 0 and not is_zero:
                raise ModelError(
                    f"event {event.name}: the gap is {values[k]:.6g} at the start; begin where it is not below 0, or make it another event"
                )
            if is_zero and rates[k] and (np.sign(rates[k]) == functions.directions[k] or not functions.directions[k]):
                due[k] = "start"
            self.signs[k] = 1 if event.impact else int(np.sign(rates[k])) if is_zero else 0
        return self._act(due) if due else False

    def _act(self, due: dict[int, Search]) -> bool:
        """Carry out events; returns whether the run ends with them."""
        before = self.at
        instant = Instant(self.functions, before)
        instant.happen(due)
        self.at = instant.at
        self.work -= sum(each.energy_lost for each in instant.happened)
        if not np.array_equal(before.p, self.at.p):
            self.passage.changes.append((self.at.t, self.at.p))
        self._set_signs(due)
        rests = self._resting(due)
        for each in instant.happened:
            limit = rests.get(each.name)
            self.passage.happened.append(replace(each, limit=limit) if limit is not None else each)
        if rests:
            name, limit = next(iter(rests.items()))
            self.passage.rests = f"event {name}: bounces accumulate at t = {limit:.9g} s, where the run ends"
        return instant.stops or bool(rests)

    def _set_signs(self, due: dict[int, Search]) -> None:
        """The side on which each condition goes on: beyond zero for those that happened, else where it is."""
        now = self.functions.values(self.at)[0]
        clear = np.abs(now) > CLOSED * self.functions.scales(self.at)
        self.signs = np.where(clear, np.sign(now), self.signs).astype(int)
        for k in due:
            way = self.functions.directions[k]
            self.signs[k] = int(way) if way else (int(np.sign(now[k])) if clear[k] else 0)

    def _resting(self, due: dict[int, Search]) -> dict[str, float]:
        """{name: limit time (s)} of gaps that closed and whose next bounce cannot be told from none."""
        found = {}
        impacts = [k for k in due if self.functions.events[k].impact]
        if not impacts:
            return found
        rates, second = self.functions.rates(self.at, self._accelerations())
        scales = self.functions.scales(self.at)
        for k in impacts:
            event = self.functions.events[k]
            restitution = number_of(self.kernels, event.impact.restitution, self.at, f"event {event.name}")  # type: ignore[union-attr]
            speed, pull = max(float(rates[k]), 0.0), -float(second[k])
            if pull > 0 and speed**2 / (2 * pull) <= AT_REST * NOISE[self.functions.degree] * scales[k]:
                found[event.name] = self.at.t + (2 * speed / pull / (1 - restitution) if restitution < 1 else 0.0)
        return found

    def _accelerations(self) -> np.ndarray:
        at = self.at
        return accelerations_by("lagrange").motion(self.kernels, at.q, at.qd, at.t, self.kernels.present(at.t, at.p), {}).qdd
