"""Motions of many states with the ways back through them: in lanes and threads where the motion is emitted, else one after the other.

Each state has the numbers of its own motion (`taped_motion`), to rounding, whatever stands next to it. A state that comes to where the
emitted motion does not do has a run of its own.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, ThreadPoolExecutor, wait
from dataclasses import dataclass
from functools import cached_property
from typing import TypeAlias, TypeVar

import numpy as np

from ncgen.errors import NcgenError
from ncgen.mechanism.break_times import break_times_of_each
from ncgen.mechanism.kernel_batch import thread_count
from ncgen.mechanism.kernels import Kernels
from ncgen.mechanism.motions import LaneRuns, Motions
from ncgen.solver.derivatives.partitioned_motion import PartitionedMotion
from ncgen.solver.derivatives.sensitivity import is_taped, motion_from
from ncgen.solver.derivatives.taped_motion import StartFrames, TapedMotion, start_back
from ncgen.solver.engines.acceleration_forms import all_coordinates
from ncgen.solver.engines.capabilities import checked_compiled
from ncgen.solver.motions.batch import INTERRUPTED
from ncgen.solver.motions.states import CommonCoordinates, States
from ncgen.solver.positions.kinematics import kinematics_of_many
from ncgen.solver.runs.run import Initial

Item = TypeVar("Item")
Result = TypeVar("Result")

Weighed: TypeAlias = Callable[[np.ndarray, np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]
"""From the numbers of some states, and their q and q̇, (states, K, n) each, to how a number of each changes with these."""

Rows: TypeAlias = tuple[np.ndarray, np.ndarray]
"""Where q and q̇ of states go, (states, K, n) each."""


@dataclass(frozen=True, eq=False)
class Swept:
    """derivatives (B, columns): of a number of each state, NaN where there are none; status (B,): "ok", or why; alone (B,): states
    with a run of their own."""

    derivatives: np.ndarray
    status: list[str]
    alone: np.ndarray


@dataclass(frozen=True, eq=False)
class _Asked:
    """What a sweep is to do with a run; members as of `TapedBatch.sweep`."""

    weigh: Weighed | None
    rows: Rows | None

    def of(self, states: slice | int) -> Rows | None:
        """Where those of some states go."""
        return self.rows and (self.rows[0][states], self.rows[1][states])

    def no_rows(self, i: int) -> None:
        """A state has none."""
        for rows in self.rows or ():
            rows[i] = np.nan


@dataclass(frozen=True, eq=False, kw_only=True)
class TapedBatch:
    """Of states over the times (K,) s of a grid, by steps of an explicit method.

    follows: whether positions at the start are the model's own, which may change with parameters
    """

    kernels: Kernels
    states: States
    times: np.ndarray
    method: str
    follows: bool
    threads: int | None = None

    @property
    def choice(self) -> CommonCoordinates:
        return self.states.choice

    @property
    def names(self) -> tuple[str, ...]:
        """Of the columns of derivatives: parameters, z, rate(z)."""
        return self.choice.partitions.columns(self.kernels)

    @cached_property
    def _motions(self) -> Motions | None:
        """In lanes, None where the motion is not emitted or too long for them, or where laws of time have breaks in it."""
        breaks = break_times_of_each(self.kernels, self.states.p, *self.times[[0, -1]].tolist())
        if not is_taped(self.kernels, self.method) or any(map(len, breaks or ())):
            return None
        motions = Motions(all_coordinates(checked_compiled(self.kernels), form="emitted"), self.method, self.times)
        return motions if motions.may_run else None

    def sweep(self, weigh: Weighed | None, progress: Callable[[float], None] | None = None, rows: Rows | None = None) -> Swept:
        """Run all, and go back through each with the weights that `weigh` gives, called by several threads; None: do not go back.

        progress: called with the share of the states that are done. What it or `weigh` raises ends the sweep
        rows: where all q and q̇ go, NaN for states that have none; None where they are not kept
        """
        count, request = len(self.states.q), _Asked(weigh, rows)
        swept = Swept(np.full((count, len(self.names)), np.nan), [INTERRUPTED] * count, np.ones(count, dtype=bool))
        report = progress or (lambda fraction: None)
        if self._motions:
            self._motions.prepare(back=weigh is not None)
            self._in_lanes(self._motions, request, swept, report)
        for i, fault in self.states.faults.items():
            swept.status[i], swept.alone[i] = fault, False
            request.no_rows(i)
        left = np.flatnonzero(swept.alone).tolist()
        for k, i in enumerate(left):
            swept.status[i] = self._alone(i, request, swept.derivatives)
            report(1.0 - (len(left) - k - 1) / count)
        return swept

    def _in_lanes(self, motions: Motions, request: _Asked, swept: Swept, report: Callable[[float], None]) -> None:
        """Parts of the states, side by side in threads; what is raised in one of them is raised here, and ends the others."""
        total, threads = len(self.states.q), thread_count(self.threads, self.kernels.name)
        fair = -(-total // (threads * motions.lanes)) * motions.lanes
        size, done = min(fair, motions.part(request.weigh is not None)), 0
        parts = [slice(first, min(first + size, total)) for first in range(0, total, size)]
        for selection in side_by_side(lambda selection: self._part(motions, selection, request, swept), parts, min(threads, len(parts))):
            done += selection.stop - selection.start
            report(done / total)

    def _part(self, motions: Motions, selection: slice, request: _Asked, swept: Swept) -> slice:
        """Some states in lanes; those that have been run are not left to run alone."""
        kernels, states, partitions, t = self.kernels, self.states, self.choice.partitions, float(self.times[0])
        q, zd, p = states.q[selection], states.zd[selection], states.p[selection]
        nu = kernels.batch.nu(q, t, p)
        try:
            velocities, driven = kinematics_of_many(kernels, partitions.velocity, q, t, p, nu)
            same = partitions.position is partitions.velocity
            positions = velocities if same else kinematics_of_many(kernels, partitions.position, q, t, p, nu)[0]
        except np.linalg.LinAlgError:
            return selection
        with np.errstate(invalid="ignore", over="ignore"):  # a state that is no number is reported by its run
            qd = (velocities @ zd[:, :, None])[:, :, 0] + driven
        runs = motions.run(q, qd, p, request.weigh is not None, request.of(selection))
        fine = selection.start + np.flatnonzero(~runs.other)
        if request.weigh is not None and len(fine):
            frames = StartFrames(positions, velocities, kernels.start_p(p) if self.follows else None)
            swept.derivatives[fine] = self._back(runs, frames, request.weigh, fine, selection.start)
        swept.alone[fine] = False
        for i in fine.tolist():
            swept.status[i] = "ok"
        return selection

    def _back(self, runs: LaneRuns, frames: StartFrames, weigh: Weighed, fine: np.ndarray, first: int) -> np.ndarray:
        """Derivatives (fine, columns) of the states that have been run, of which the first of the part is number `first`."""
        if len(fine) == len(runs.q):
            selected, weights = slice(None), weigh(fine, runs.q, runs.qd)
        else:
            selected, weights = fine - first, (np.zeros_like(runs.q), np.zeros_like(runs.q))
            for all_of_them, computed in zip(weights, weigh(fine, runs.q[selected], runs.qd[selected]), strict=True):
                all_of_them[selected] = computed
        at_start, at_start_qd, by_p = runs.backward(*weights)
        by_start, *by_state = start_back(runs, self.choice.partitions, frames, np.hstack([at_start, at_start_qd]))
        return np.hstack([by_p + by_start, *by_state])[selected]

    def _alone(self, i: int, request: _Asked, derivatives: np.ndarray) -> str:
        """A run of a state's own; its status."""
        request.no_rows(i)
        try:
            motion = self._motion(i)
            q, qd = motion.q, motion.qd  # a motion in Python runs when it is first asked for them
        except NcgenError as error:
            return str(error)
        if set(motion.names) != set(self.names):
            others = ", ".join(name for name in motion.names if name not in self.names)
            return f"{self.kernels.name}: {others} are independent here, not those of the batch; take gradient for this state"
        for rows, history in zip(request.rows or (), (q, qd)):
            rows[i] = history
        if request.weigh is not None:
            by_q, by_qd = request.weigh(np.array([i]), q[None], qd[None])
            try:
                derivatives[i, [self.names.index(name) for name in motion.names]] = motion.backward(by_q[0], by_qd[0])[0]
            except NcgenError as error:
                return str(error)
        return "ok"

    def _motion(self, i: int) -> TapedMotion | PartitionedMotion:
        states, q0, z = self.states, None if self.follows else self.states.q[i], self.choice.names
        initial = Initial.from_arguments(self.kernels, q0=q0, zd0=states.zd[i], p=states.p[i], z=z, t0=float(self.times[0]))
        return motion_from(self.kernels, initial, self.times, self.follows, self.method)


def side_by_side(task: Callable[[Item], Result], items: Sequence[Item], threads: int) -> Iterator[Result]:
    """What a task gives for each item, as it comes, from threads; the calling one hears signals meanwhile. What is raised in one of them,
    or here, ends the others with what they have begun."""
    if threads == 1:
        yield from map(task, items)
        return
    with ThreadPoolExecutor(threads) as pool:
        waiting = {pool.submit(task, item) for item in items}
        try:
            while waiting:
                done, waiting = wait(waiting, return_when=FIRST_COMPLETED)
                yield from (one.result() for one in done)
        finally:
            pool.shutdown(wait=False, cancel_futures=True)
