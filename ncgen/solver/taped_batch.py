"""Motions of many states with the ways back through them: in lanes and threads where the motion is written out, else one after the other.

Each state has the numbers of its own motion (`taped_motion`), to rounding, whatever stands beside it. A state that comes to where the
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
from ncgen.mechanism.batch import thread_count
from ncgen.mechanism.kernels import Kernels
from ncgen.mechanism.motions import LaneRuns, Motions
from ncgen.solver.batch import INTERRUPTED, Choice, States
from ncgen.solver.compiled import all_coordinates, checked_compiled
from ncgen.solver.partition import kinematics_of_many
from ncgen.solver.partitioned_motion import PartitionedMotion
from ncgen.solver.run import Initial
from ncgen.solver.sensitivity import is_taped, motion_from
from ncgen.solver.taped_motion import StartFrames, TapedMotion, start_back

Item = TypeVar("Item")
Result = TypeVar("Result")

Weighed: TypeAlias = "Callable[[np.ndarray, np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray] | None]"
"""From the numbers of some states, and their q and q̇, (states, K, n) each, to how a number of each changes with these, or None where nobody
asks for derivatives."""


@dataclass(frozen=True, eq=False)
class Swept:
    """slopes (B, columns): derivatives of a number of each state, NaN where there are none; status (B,): "ok", or why; alone (B,): states
    with a run of their own."""

    slopes: np.ndarray
    status: list[str]
    alone: np.ndarray


@dataclass(frozen=True, eq=False)
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
    def choice(self) -> Choice:
        return self.states.choice

    @property
    def names(self) -> tuple[str, ...]:
        """Of the columns of derivatives: parameters, z, rate(z)."""
        z = self.choice.partitions.position.names(self.kernels)
        return *self.kernels.parameters, *z, *(f"rate({name})" for name in self.choice.names)

    @cached_property
    def _motions(self) -> Motions | None:
        """In lanes, None where the motion is not written out or too long for them."""
        if not is_taped(self.kernels, self.method):
            return None
        motions = Motions(all_coordinates(checked_compiled(self.kernels), form="emitted"), self.method, self.times)
        return motions if motions.may_run else None

    def sweep(self, weigh: Weighed, back: bool = True, progress: Callable[[float], None] | None = None) -> Swept:
        """Run all, and go back through what `weigh` has weights of; back: whether it ever has. Whatever it raises ends the sweep.

        progress: called with the share of the states that are done
        """
        tell = progress or (lambda share: None)
        count = len(self.states.q)
        found = Swept(np.full((count, len(self.names)), np.nan), [INTERRUPTED] * count, np.zeros(count, dtype=bool))
        for i, fault in self.states.faults.items():
            found.status[i] = fault
        left = np.setdiff1d(np.arange(count), list(self.states.faults)).astype(int)
        if self._motions and len(left):
            self._motions.prepare(back)
            self._in_lanes(self._motions, weigh, left, found, tell)
            left = np.flatnonzero(found.alone)
        found.alone[left] = True
        for k, i in enumerate(left.tolist()):
            found.status[i] = self._alone(i, weigh, found.slopes)
            tell(1.0 - (len(left) - k - 1) / count)
        return found

    def _in_lanes(self, motions: Motions, weigh: Weighed, left: np.ndarray, found: Swept, tell: Callable[[float], None]) -> None:
        """Parts of the states, side by side in threads; what is raised in one of them is raised here, and ends the others."""
        threads = thread_count(self.threads, self.kernels.name)
        fair = -(-len(left) // (threads * motions.lanes)) * motions.lanes
        size, total = min(fair, motions.part), 0
        parts = np.split(left, range(size, len(left), size))
        for count in side_by_side(lambda part: self._part(motions, weigh, part, found), parts, min(threads, len(parts))):
            total += count
            tell(total / len(self.states.q))

    def _part(self, motions: Motions, weigh: Weighed, part: np.ndarray, found: Swept) -> int:
        """Some states in lanes; how many they were. Those that have to run alone are marked."""
        kernels, states, partitions, t = self.kernels, self.states, self.choice.partitions, float(self.times[0])
        q, zd, p = states.q[part], states.zd[part], states.p[part]
        nu = kernels.batch.nu(q, t, p)
        try:
            velocities, driven = kinematics_of_many(kernels, partitions.velocity, q, t, p, nu)
            same = partitions.position is partitions.velocity
            positions = velocities if same else kinematics_of_many(kernels, partitions.position, q, t, p, nu)[0]
        except np.linalg.LinAlgError:
            found.alone[part] = True
            return len(part)
        runs = motions.run(q, (velocities @ zd[:, :, None])[:, :, 0] + driven, p)
        frames = StartFrames(positions, velocities, kernels.start_p(p) if self.follows else None)
        self._back(runs, frames, weigh, part, found)
        return len(part)

    def _back(self, runs: LaneRuns, frames: StartFrames, weigh: Weighed, part: np.ndarray, found: Swept) -> None:
        found.alone[part[runs.other]] = True
        fine = np.flatnonzero(~runs.other)
        if not len(fine):
            return
        weights = weigh(part[fine], *((runs.q, runs.qd) if len(fine) == len(part) else (runs.q[fine], runs.qd[fine])))
        if weights is not None:
            by_q, by_qd = (_at(fine, a, runs.q.shape) for a in weights)
            at_start, at_start_qd, by_p = runs.backward(by_q, by_qd)
            by_start, *by_state = start_back(runs, self.choice.partitions, frames, np.hstack([at_start, at_start_qd]))
            found.slopes[part[fine]] = np.hstack([by_p + by_start, *by_state])[fine]
        for i in part[fine].tolist():
            found.status[i] = "ok"

    def _alone(self, i: int, weigh: Weighed, slopes: np.ndarray) -> str:
        """A run of a state's own; its status."""
        try:
            motion = self._motion(i)
        except NcgenError as error:
            return str(error)
        if set(motion.names) != set(self.names):
            others = ", ".join(name for name in motion.names if name not in self.names)
            return f"{self.kernels.name}: {others} are independent here, not those of the batch; take gradient for this state"
        weights = weigh(np.array([i]), motion.q[None], motion.qd[None])
        if weights is not None:
            slopes[i, [self.names.index(name) for name in motion.names]] = motion.backward(weights[0][0], weights[1][0])
        return "ok"

    def _motion(self, i: int) -> TapedMotion | PartitionedMotion:
        states, q0, z = self.states, None if self.follows else self.states.q[i], self.choice.names
        initial = Initial.asked(self.kernels, q0=q0, zd0=states.zd[i], p=states.p[i], z=z, t0=float(self.times[0]))
        return motion_from(self.kernels, initial, self.times, self.follows, self.method)


def _at(fine: np.ndarray, weights: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
    """Weights of some states among those of all; 0 elsewhere."""
    if len(fine) == shape[0]:
        return weights
    found = np.zeros(shape)
    found[fine] = weights
    return found


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
