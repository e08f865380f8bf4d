"""A motion on independent coordinates with its derivatives, in Python: for kernels of NumPy, and where no motion is emitted.

The motion is the classical Runge-Kutta method's, y = [ż; z], or the trapezoidal rule's, and what is differentiated is that very
computation, stage by stage (`partitioned_stage`).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from functools import cached_property
from itertools import pairwise

import numpy as np

from ncgen.errors import ConvergenceError, ModelError, SingularError
from ncgen.mechanism.kernels import Kernels
from ncgen.mechanism.moving_breaks import Jump
from ncgen.mechanism.reactive import ReactiveForce
from ncgen.mechanism.taped import Driven
from ncgen.methods.table import INTEGRATORS
from ncgen.solver.argument_checks import refuse_callbacks
from ncgen.solver.derivatives.jumps import Jumps, Stepping
from ncgen.solver.derivatives.partitioned_stage import PartitionedStage
from ncgen.solver.finite import watched
from ncgen.solver.formalisms.coordinate_partitioning import StepStart
from ncgen.solver.positions.partition import Partition, Partitions, PartitionsAt, determined, stuck_message
from ncgen.solver.positions.partition_watch import PartitionWatch
from ncgen.solver.runs.run import Initial
from ncgen.solver.runs.signals import Signals
from ncgen.solver.runs.start import begin

NODES, WEIGHTS = (tuple(map(float, numbers)) for numbers in zip(*INTEGRATORS["rk4"].coefficients.successive))
"""The classical Runge-Kutta method: k_i = f(t + c_i h, y + c_i h k_{i−1}), y + h Σ w_i k_i."""

MAX_RESIDUAL = 1e-8
"""What a step of a run may leave of the rule's equations, in natural sizes and relative to what moves: what Newton's method leaves of them,
times a stiff slope."""

LEAST_REGULARITY = 1e-5
"""Regularity of a partition below which a motion on it has no digits left to differentiate."""


class PartitionedMotion:
    """A motion over the steps of a grid, which are split at breaks of laws in time, every stage kept for the derivative's sake. Where its
    independent coordinates become bad it continues with others, as runs do.

    t (K,); q, qd (K, n); names: of the columns of derivatives: parameters, z, rate(z), these at the start
    z_by_p: where z starts, by the parameters
    """

    def __init__(
        self, kernels: Kernels, initial: Initial, times: np.ndarray, start_follows: bool, signals: Signals | None = None
    ) -> None:  # fmt: skip
        """start_follows: whether the position at the start is the model's own, which may change with parameters; signals: what drives it"""
        _check(kernels)
        self.signals = signals
        begun = begin(kernels, initial, partitioned=True)
        self.kernels, self.p, self.t = watched(kernels), begun.p, times
        self.jumps = Jumps.of(kernels, begun.p, begun.q, times, signals)
        self._split = self.jumps.ends(times)
        self._ends, self._seen = self._split.t, self._split.on_grid
        partitions = determined(begun.partitions)
        self.partition, self.names = partitions.position, partitions.columns(kernels)
        independent = self.partition.independent
        self.nz = len(independent)
        by_p = kernels.start_p(self.p) if start_follows else np.zeros((kernels.n, len(self.p)))
        self.z_by_p = by_p[independent]
        self.y0 = np.concatenate([begun.rates, begun.q[independent]])
        self.q0 = begun.q
        self._q: list[np.ndarray] = []
        self._qd: list[np.ndarray] = []
        self._changed: dict[int, PartitionedStage] = {}
        """By the number of a step that begins with other independent coordinates, the stage there in those before."""
        self._history: list[list[PartitionedStage]] | None = None

    @property
    def q(self) -> np.ndarray:
        return self._states[0][self._seen]

    def _at_the_grid(self, rows: list[np.ndarray]) -> np.ndarray:
        """Those of all ends of steps that are at instants of the grid."""
        return np.array(rows)[self._seen]

    @cached_property
    def _jumps(self) -> Mapping[int, Jump]:
        """Jumps that parameters move, by the number of the step that goes across."""
        if not self.jumps.breaks.moved:
            return {}
        return self.jumps(self._ends, *self._states)

    def _across(self, k: int, dy: np.ndarray, dp: np.ndarray, independent: np.ndarray) -> np.ndarray:
        """Changes of y where step k begins, and a jump is behind it."""
        if k not in self._jumps:
            return dy
        return dy + np.pad(self._jumps[k].along(dp)[independent], ((0, self.nz), (0, 0)))

    def _felt(self, k: int, adjoint: np.ndarray, independent: np.ndarray) -> np.ndarray:
        """What a jump where step k begins says of p."""
        if k not in self._jumps:
            return np.zeros(len(self.p))
        weights = np.zeros(self.kernels.n)
        weights[independent] = adjoint[: self.nz]
        return self._jumps[k].felt(weights)

    def _in_others(self, k: int, dy: np.ndarray, dp: np.ndarray, independent: np.ndarray) -> np.ndarray:
        """Changes of y where step k begins, in the independent coordinates with which it does."""
        if k not in self._changed:
            return dy
        _, dq, dqd = self._changed[k].forward(dy, dp)
        return np.vstack([dqd[independent], dq[independent]])

    def _in_those_before(self, k: int, adjoint: np.ndarray, independent: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The transpose of `_in_others`: (ȳ, p̄)."""
        if k not in self._changed:
            return adjoint, np.zeros(len(self.p))
        q_bar, qd_bar = np.zeros(self.kernels.n), np.zeros(self.kernels.n)
        qd_bar[independent], q_bar[independent] = np.split(adjoint, [self.nz])
        return self._changed[k].backward(np.zeros(2 * self.nz), q_bar, qd_bar)

    @property
    def qd(self) -> np.ndarray:
        return self._states[1][self._seen]

    @property
    def _states(self) -> tuple[np.ndarray, np.ndarray]:
        """q and q̇ at all ends of steps, (ends, n) each."""
        self._stages  # noqa: B018 - it runs
        return np.array(self._q), np.array(self._qd)

    @property
    def _stages(self) -> list[list[PartitionedStage]]:
        """Those of every step, found once."""
        if self._history is None:
            self._history = list(self._steps())
        return self._history

    def along(self, directions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Changes of q and q̇ at all instants, (K, n, D) each, along directions, (columns, D)."""
        dy, dp = self._checked(directions)
        q_by, qd_by = [], []
        for k, (stages, h) in enumerate(zip(self._stages, np.diff(self._ends), strict=True)):
            derivatives, total, independent = np.zeros_like(dy), np.zeros_like(dy), stages[0].partition.independent
            dy = self._in_others(k, dy, dp, independent)
            _, *changes_at_start = stages[0].forward(dy, dp) if k in self._jumps else (None,)
            dy = self._across(k, dy, dp, independent)
            for stage, node, weight in zip(stages, NODES, WEIGHTS, strict=True):
                derivatives, *changes = stage.forward(dy + node * h * derivatives, dp)
                changes_at_start = changes_at_start or changes
                total += weight * derivatives
            q_by.append(changes_at_start[0])
            qd_by.append(changes_at_start[1])
            dy = dy + h * total
        _, dq, dqd = self._last.forward(dy, dp)
        return self._at_the_grid([*q_by, dq]), self._at_the_grid([*qd_by, dqd])

    def _checked(self, directions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """How y at the start and p change along directions. Raises ModelError for one along which there is no derivative."""
        self._jumps  # noqa: B018 - what a jump says may be that there is none
        self.jumps.check_along(directions)
        dy, dp = (seeds @ directions for seeds in self._seeds())
        return dy, dp

    def _seeds(self) -> tuple[np.ndarray, np.ndarray]:
        """How y at the start and p change with every column."""
        count, nz, parameters = len(self.names), self.nz, len(self.p)
        dy = np.zeros((2 * nz, count))
        dy[nz:, parameters : parameters + nz] = np.eye(nz)
        dy[:nz, parameters + nz :] = np.eye(nz)
        dy[nz:, :parameters] = self.z_by_p
        return dy, np.eye(parameters, count)

    def backward(self, by_q: np.ndarray, by_qd: np.ndarray, by: Iterable[str] | None = None) -> tuple[np.ndarray, Driven]:
        """Derivatives of a number by what has a name (columns,), and by what drove the run, from those by q and q̇ at all instants, (K, n)
        each; by: as of `TapedMotion`."""
        by_q, by_qd = self._at_all_steps(by_q), self._at_all_steps(by_qd)
        lengths = np.diff(self._ends)
        begun = self._ends[:-1, None]
        t = begun + lengths[:, None] * np.array(NODES)
        driven = Driven(t, np.broadcast_to(begun, t.shape), np.zeros((*t.shape, len(self.kernels.inputs))))
        nothing, still = np.zeros(self.kernels.n), np.zeros(2 * self.nz)
        stages_of_all = self._stages
        adjoint, p_bar = self._last.backward(still, by_q[-1], by_qd[-1])
        for k, stages in reversed(list(enumerate(stages_of_all))):
            later, h, independent = np.zeros_like(adjoint), lengths[k], stages[0].partition.independent
            total = adjoint.copy()
            for i in reversed(range(4)):
                ahead = h * NODES[i + 1] * later if i < 3 else 0.0
                later, by_p = stages[i].backward(h * WEIGHTS[i] * adjoint + ahead, nothing, nothing)
                total += later
                p_bar = p_bar + by_p
                driven.values[k, i] = by_p[len(by_p) - driven.values.shape[2] :]
            from_stage, by_p = stages[0].backward(still, by_q[k], by_qd[k])
            p_bar = p_bar + by_p + self._felt(k, total, independent)
            adjoint, by_p = self._in_those_before(k, total + from_stage, independent)
            p_bar = p_bar + by_p
        self.jumps.check(by)
        return self._by_columns(adjoint, p_bar), driven

    def _at_all_steps(self, rows: np.ndarray) -> np.ndarray:
        """Weights (ends of steps, n) from those at the instants of the grid, (K, n)."""
        weights = np.zeros((len(self._ends), rows.shape[1]))
        weights[self._seen] = rows
        return weights

    def _by_columns(self, adjoint: np.ndarray, p_bar: np.ndarray) -> np.ndarray:
        """From derivatives by y at the start and by p."""
        z, zd = adjoint[self.nz :], adjoint[: self.nz]
        return np.concatenate([p_bar + self.z_by_p.T @ z, z, zd])

    def _steps(self) -> Iterator[list[PartitionedStage]]:
        """The four stages of every step; `_last` is the instant at the end."""
        begin = StepStart(self.t[0], self.q0, np.zeros(self.kernels.n), self.p)
        first = self._stage_at(self.partition, begin, self._ends[0], self.y0, self._present(self._ends[0], self._ends[0]))
        here = self._here(first)
        watch = PartitionWatch(here, first.partitions)
        for k, h in enumerate(np.diff(self._ends)):
            other = self._stage_of_others(first, watch.better(here, first.partitions))
            try:
                stages, following = self._step(other or first, h)
            except (ConvergenceError, SingularError):
                other = None if other else self._stage_of_others(first, watch.search(here, first.partitions))
                if other is None:
                    raise
                stages, following = self._step(other, h)
            if other:
                self._changed[k] = first
            self._keep(stages[0], here)
            yield stages
            first, here = following, self._here(following)
        self._last = first
        self._keep(first, here)

    def _step(self, first: PartitionedStage, h: float) -> tuple[list[PartitionedStage], PartitionedStage]:
        """The stages of a step from its first one, and the stage that follows.

        Raises ConvergenceError or SingularError where these coordinates do not lead through it.
        """
        begin, t, stages = StepStart(first.t, first.q, first.qd, self.p), first.t, [first]
        for node in NODES[1:]:
            y = first.y + node * h * stages[-1].slope
            stages.append(self._stage_at(first.partition, begin, t + node * h, y, self._present(t, t + node * h)))
        y = first.y + h * sum(w * s.slope for w, s in zip(WEIGHTS, stages, strict=True))
        stages.append(self._stage_at(first.partition, begin, t + h, y, self._present(t + h, t + h)))
        if any(stage.frame.has_turned(first.frame) for stage in stages[1:]):
            raise SingularError(stuck_message(self.kernels, t, h))
        return stages[:-1], stages[-1]

    def _stage_of_others(self, stage: PartitionedStage, better: Partitions | None) -> PartitionedStage | None:
        """The same instant on other independent coordinates, where there are better ones."""
        if better is None:
            return None
        at, independent = StepStart(stage.t, stage.q, stage.qd, stage.p), better.position.independent
        return self._stage_at(better.position, at, stage.t, np.concatenate([stage.qd[independent], stage.q[independent]]), stage.p)

    def _here(self, stage: PartitionedStage) -> PartitionsAt:
        """The partitions at the position of a stage."""
        return PartitionsAt(self.kernels, stage.q, stage.t, stage.p)

    def _stage_at(self, partition: Partition, guess: StepStart, t: float, y: np.ndarray, p: np.ndarray) -> PartitionedStage:
        return PartitionedStage(self.kernels, partition, guess, t, y, p)

    def _present(self, begun: float, t: float) -> np.ndarray:
        """p with the inputs of a time inside a step that began at another one."""
        return self.signals.begun_at(begun)(t, self.p) if self.signals else self.p

    def _keep(self, stage: PartitionedStage, here: PartitionsAt) -> None:
        self._check_regularity(stage, here)
        self._q.append(stage.q)
        self._qd.append(stage.qd)

    def _check_regularity(self, stage: PartitionedStage, here: PartitionsAt) -> None:
        if here.regularity(stage.partition) < LEAST_REGULARITY:
            names = ", ".join(stage.partition.names(self.kernels))
            raise ModelError(
                f"{names} do not determine the motion any more at t = {stage.t:.6g} s; "
                "choose other independent coordinates (z), or end it before"
            )


class TrapezoidalMotion(PartitionedMotion):
    """The same by the trapezoidal rule, y₁ = y₀ + h/2 (f₀ + f₁), whose steps come from a run: (1 − h/2 J₁) dy₁ = (1 + h/2 J₀) dy₀ + …"""

    def __init__(
        self, kernels: Kernels, initial: Initial, times: np.ndarray, start_follows: bool, run: Stepping,
        signals: Signals | None = None,
    ) -> None:  # fmt: skip
        """run: on independent coordinates; others as of `PartitionedMotion`"""
        super().__init__(kernels, initial, times, start_follows, signals)
        run_of_steps = run(self._split.of_steps, self.jumps.rows)
        self._run_q, self._run_qd = self._split.spread(run_of_steps.q), self._split.spread(run_of_steps.qd)

    @cached_property
    def _steps_of_run(self) -> list[tuple[PartitionedStage, PartitionedStage] | None]:
        """The first and last stage of every step, None where a jump is crossed.

        Raises ModelError where the run was on other coordinates.
        """
        stages_of_steps, last = list[tuple[PartitionedStage, PartitionedStage] | None](), None
        guess = StepStart(self.t[0], self.q0, np.zeros(self.kernels.n), self.p)
        for k, (t, end) in enumerate(pairwise(self._ends.tolist())):
            if self._split.is_crossed[k]:
                stages_of_steps.append(None)
                continue
            first = self._stage(guess, k, t, t) if last is None or self._split.begins[k] else last
            guess = StepStart(t, first.q, first.qd, self.p)
            last = self._stage(guess, k + 1, t, end)
            self._check_step(first, last, end - t)
            stages_of_steps.append((first, last))
        return stages_of_steps

    def _stage(self, guess: StepStart, k: int, begun: float, t: float) -> PartitionedStage:
        """That of the run at an end of a step which began at a time (s)."""
        independent, q, qd = self.partition.independent, self._run_q[k], self._run_qd[k]
        stage = self._stage_at(self.partition, guess, t, np.concatenate([qd[independent], q[independent]]), self._present(begun, t))
        self._check_regularity(stage, self._here(stage))
        return stage

    def _check_step(self, before: PartitionedStage, after: PartitionedStage, h: float) -> None:
        sizes = np.tile(self.kernels.column_sizes[self.partition.independent], 2)
        remainder, moving = np.abs(after.y - before.y - h / 2 * (before.slope + after.slope)) / sizes, np.abs(before.y / sizes)
        if not np.all(remainder <= MAX_RESIDUAL * (1.0 + np.max(moving, initial=0.0))):
            names = ", ".join(self.partition.names(self.kernels))
            raise ModelError(
                f"the step to t = {after.t:.6g} s went on with other independent coordinates than {names}; choose some that last (z)"
            )

    @property
    def _states(self) -> tuple[np.ndarray, np.ndarray]:
        self._steps_of_run  # noqa: B018 - it checks the run
        return self._run_q, self._run_qd

    def along(self, directions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        dy, dp = self._checked(directions)
        still, before = np.zeros_like(dy), None
        derivative = still
        changes_at: dict[int, list[np.ndarray]] = {}
        for k, (step, h) in enumerate(zip(self._steps_of_run, np.diff(self._ends), strict=True)):
            if step is None:
                dy, before = self._across(k, dy, dp, self.partition.independent), None
                continue
            first, last = step
            if first is not before:
                derivative, *changes = first.forward(dy, dp)
                changes_at.setdefault(k, changes)
            right = dy + h / 2 * (derivative + last.forward(still, dp)[0])
            dy, before = np.linalg.solve(self._matrix(last, h), right), last
            derivative, *changes_at[k + 1] = last.forward(dy, dp)
        rows = [changes_at[k] for k in self._seen.tolist()]
        return np.array([dq for dq, _ in rows]), np.array([dqd for _, dqd in rows])

    def backward(self, by_q: np.ndarray, by_qd: np.ndarray, by: Iterable[str] | None = None) -> tuple[np.ndarray, Driven]:
        by_q, by_qd = self._at_all_steps(by_q), self._at_all_steps(by_qd)
        nothing, still, steps = np.zeros(self.kernels.n), np.zeros(2 * self.nz), [*self._steps_of_run, None]
        t, inputs = np.column_stack([self._ends[:-1], self._ends[1:]]), len(self.kernels.inputs)
        driven = Driven(t, np.broadcast_to(t[:, :1], t.shape), np.zeros((*t.shape, inputs)))
        adjoint, p_bar = np.zeros(2 * self.nz), np.zeros(len(self.p))
        for k, h in reversed(list(enumerate(np.diff(self._ends)))):
            step = steps[k]
            if step is None:
                p_bar = p_bar + self._felt(k, adjoint, self.partition.independent)
                continue
            first, last = step
            if steps[k + 1] is None:  # else it is seen with the first stage of the next step
                more, by_p = last.backward(still, by_q[k + 1], by_qd[k + 1])
                adjoint, p_bar = adjoint + more, p_bar + by_p
            adjoint = np.linalg.solve(self._matrix(last, h).T, adjoint)
            slope_bar = h / 2 * adjoint
            _, at_end = last.backward(slope_bar, nothing, nothing)
            more, at_start = first.backward(slope_bar, by_q[k], by_qd[k])
            driven.values[k] = np.array([at_start, at_end])[:, len(p_bar) - inputs :]
            adjoint, p_bar = adjoint + more, p_bar + at_start + at_end
        self.jumps.check(by)
        return self._by_columns(adjoint, p_bar), driven

    def _matrix(self, stage: PartitionedStage, h: float) -> np.ndarray:
        """1 − h/2 J."""
        every = np.eye(2 * self.nz)
        return every - h / 2 * stage.forward(every, np.zeros((len(self.p), 2 * self.nz)))[0]


def _check(kernels: Kernels) -> None:
    if not ReactiveForce.only(kernels.model.callbacks):
        refuse_callbacks(kernels)
    if len(kernels.holonomic) != kernels.m:
        raise ModelError(f"{kernels.name}: motions with rolling conditions are not differentiated")
