"""A motion on all coordinates with its derivatives, in C: what is differentiated are the steps of the run, with their projection onto the
constraints (`ncgen/runtime/src/ncgen_adjoint.c`).

A mechanism starts at independent coordinates z and their rates. With V(q, q̇, p), the velocities that the joints allow nearest to given
ones, the columns R of allowed motions and N(q, p), a step of Newton's method, where E takes the independent ones:

    dq = (1 − R E) N_p dp + R dz          dq̇ = (1 − R E) (V_q dq + V_p dp) + R dż
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol, TypeAlias

import numpy as np

from ncgen.errors import ConvergenceError, ModelError
from ncgen.mechanism.break_times import outside_breaks
from ncgen.mechanism.library import CompiledKernels
from ncgen.mechanism.run_arguments import InitialState, RunInputs
from ncgen.mechanism.sweep import DUAL_STEP, Sweep
from ncgen.mechanism.taped import Driven, Segmented, taped
from ncgen.solver.derivatives.jumps import Jumps
from ncgen.solver.engines.acceleration_forms import all_coordinates
from ncgen.solver.engines.capabilities import closeness
from ncgen.solver.finite import on_the_way
from ncgen.solver.positions.kinematics import Kinematics, kinematics
from ncgen.solver.positions.partition import Partitions, determined
from ncgen.solver.positions.rank import freedom_at
from ncgen.solver.runs.run import Initial
from ncgen.solver.runs.signals import Signals
from ncgen.solver.runs.start import begin
from ncgen.solver.runs.tolerances import Tolerances

Change: TypeAlias = Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]
"""From changes of q and q̇ at all instants, (K, n) each, to those of a number's derivatives by them."""

REMEDIES = defaultdict(lambda: "take shorter steps", full="take a shorter motion, or a larger rtol", short="end it before")
"""What to do about a run that did not arrive, by its status."""


@dataclass(frozen=True, eq=False)
class StartFrames:
    """What derivatives need at the start: R of positions and of velocities, (…, n, nz) each, and how the position follows parameters,
    (…, n, n_p), None where it is given."""

    positions: np.ndarray
    velocities: np.ndarray
    by_parameters: np.ndarray | None


class ReverseSweep(Protocol):
    """The reverse sweep through what a mechanism does at its start, one or many of them."""

    def velocities_back(self, weights: np.ndarray) -> tuple[np.ndarray, np.ndarray]: ...

    def closing_back(self, weights: np.ndarray) -> np.ndarray: ...


def start_back(
    back: ReverseSweep, partitions: Partitions, start: StartFrames, weights: np.ndarray, reads: bool = True
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """How a sum with these weights (…, 2 n) of q and q̇ at the start changes with p, z and ż: the transpose of what stands above.

    reads: whether closed positions may change with parameters
    """
    by_q, rest = np.split(weights, 2, axis=-1)
    by_rates = _transposed(start.velocities, rest)
    rest = rest.copy()
    rest[..., partitions.velocity.independent] -= by_rates
    more, by_p = back.velocities_back(rest)
    by_q = more + by_q
    by_z = _transposed(start.positions, by_q)
    by_q[..., partitions.position.independent] -= by_z
    if reads:
        by_p = by_p + back.closing_back(by_q)
    if start.by_parameters is not None:
        by_p = by_p + _transposed(start.by_parameters[..., partitions.position.independent, :], by_z)
    return by_p, by_z, by_rates


def _transposed(matrix: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Aᵀ x over leading axes."""
    return (np.swapaxes(matrix, -1, -2) @ x[..., None])[..., 0]


@dataclass(frozen=True, eq=False)
class _Start(StartFrames):
    """Of one motion, with the factors behind R."""

    frames: tuple[Kinematics, Kinematics]


class NotTaped(ModelError):
    """A step of a run went otherwise than its tape."""


class TapedMotion:
    """A motion, seen at the instants of a grid: one step of the method from each to the next, or with tolerances as many as that takes.

    t (K,), q, qd (K, n); names: of the columns of derivatives: parameters, z, rate(z)
    """

    def __init__(
        self,
        kernels: CompiledKernels,
        initial: Initial,
        times: np.ndarray,
        start_follows: bool,
        method: str = "rk4",
        tolerances: Tolerances | None = None,
        signals: Signals | None = None,
    ) -> None:
        """start_follows: whether the position at the start is the model's own, which may change with parameters; signals: what drives it"""
        begun = begin(kernels, initial, partitioned=True)
        self.kernels, self.p, self.t, self.signals = kernels, begun.p, times, signals
        self._partitions, self._begun, self._follows = determined(begun.partitions), begun, start_follows
        self.names = self._partitions.columns(kernels)
        allowed = tolerances.in_c(kernels.column_sizes, kernels.column_sizes) if tolerances else None
        rank = freedom_at(kernels, begun.q, times[0], begun.p).rank
        dynamics = all_coordinates(kernels, form="emitted")
        start = InitialState(begun.q, begun.qd, begun.p)
        self.jumps = Jumps.of(kernels, begun.p, begun.q, times, signals)
        inputs = RunInputs(signals=signals.functions if signals else (), breaks=self.jumps.rows)
        options = {"rank": rank, "tolerance": closeness("double"), "inputs": inputs}
        jumping = self.jumps if self.jumps.breaks.moved else None
        self._run = taped(dynamics, method, outside_breaks(self.jumps.rows, times), start, allowed, jumps=jumping, **options)
        self._check()

    @property
    def q(self) -> np.ndarray:
        return self._run.outcome.q

    @property
    def qd(self) -> np.ndarray:
        return self._run.outcome.qd

    def along(self, directions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Changes of q and q̇ at all instants, (K, n, D) each, along directions, (columns, D); those by z and its rates may be left out."""
        changes = self._run.forward(*self._seeds(directions))
        self.jumps.check_along(directions)
        return changes

    def _seeds(self, directions: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Changes of q and q̇ at the start, (n, D) each, and of p, (n_p, D), along directions."""
        position, velocity = self._partitions.position.independent, self._partitions.velocity.independent
        padded = np.zeros((len(self.names), directions.shape[1]))
        padded[: len(directions)] = directions
        dp, dz, rates = np.split(padded, [len(self.p), len(self.p) + len(position)])
        dq = dqd = np.zeros((self.kernels.n, dp.shape[1]))
        if not (self._start_reads_parameters or np.any(padded[len(self.p) :])):
            return dq, dqd, dp
        start = self._start
        if start.by_parameters is not None:
            dz = dz + start.by_parameters[position] @ dp
        if self._rows_read_parameters:
            dq = self._run.closing_along(dp)
        dq = dq + start.positions @ (dz - dq[position])
        dqd = self._run.velocities_along(dq, dp)
        return dq, dqd + start.velocities @ (rates - dqd[velocity]), dp

    def backward(self, by_q: np.ndarray, by_qd: np.ndarray, by: Iterable[str] | None = None) -> tuple[np.ndarray, Driven]:
        """Derivatives of a number by what has a name (columns,), and by what drove the run, from those by q and q̇ at all instants, (K, n)
        each.

        by: names that are wanted, None for all. Raises ModelError where there is no derivative by one of them; that by others is NaN
        """
        *by_state, by_p, driven = self._run.backward(by_q, by_qd)
        self.jumps.check(by)
        by_start, by_z, by_rates = self._start_back(np.concatenate(by_state))
        return np.concatenate([by_p + by_start, by_z, by_rates]), driven

    def second(self, by_q: np.ndarray, by_qd: np.ndarray, change: Change, directions: np.ndarray) -> np.ndarray:
        """How the derivatives of a number change along directions (columns, D), (columns, D): the reverse sweep, in dual numbers.

        by_q, by_qd: its derivatives by q and q̇ at all instants, (K, n) each; change: how they change with q and q̇
        """
        if isinstance(self._run, Segmented):
            raise ModelError(
                f"{self.kernels.name}: {len(self.t) - 1} steps are too many for second derivatives; take fewer, or a shorter motion"
            )
        self.jumps.check_second()
        seeds = self._seeds(directions)
        q, qd, sweeps = self._run.second(*seeds)
        second_derivatives = np.empty(directions.shape)
        for k, sweep in enumerate(sweeps):
            changes = change(q[:, :, k], qd[:, :, k])
            weights = (weight + DUAL_STEP * 1j * more for weight, more in zip((by_q, by_qd), changes, strict=True))
            *by_state, by_p, _ = sweep.backward(self._run.at_all_steps(*weights))
            start = self._start_along(*(seed[:, k] for seed in seeds))
            by_start, by_z, by_rates = self._start_back(np.concatenate(by_state), sweep, start)
            second_derivatives[:, k] = np.imag(np.concatenate([by_p + by_start, by_z, by_rates])) / DUAL_STEP
        return second_derivatives

    def _start_along(self, dq: np.ndarray, dqd: np.ndarray, dp: np.ndarray) -> _Start:
        """What there is at the start, in dual numbers."""
        kernels, start = self.kernels, self._start
        arguments = {"t": self.t[0], "q": self._begun.q, "qd": np.zeros(kernels.n), "p": self.p}

        def acceleration(allowed: np.ndarray) -> np.ndarray:
            """How Φ_q q̈ − γ changes while nothing moves."""
            by_q, by_p = (kernels.dense_tangent(name, qdd=allowed, **arguments) for name in ("phidd_q", "phidd_p"))
            return by_q @ dq + by_p @ dp

        still = acceleration(np.zeros(kernels.n))
        R = []
        for frame in start.frames:
            changes = [-frame.particular(acceleration(np.ascontiguousarray(column)) - still) for column in frame.R.T]
            R.append(frame.R + DUAL_STEP * 1j * np.array(changes).reshape(-1, kernels.n).T)
        return _Start(R[0], R[1], kernels.start_p(self.p + DUAL_STEP * 1j * dp) if self._follows else None, start.frames)

    def _start_back(
        self, weights: np.ndarray, sweep: Sweep | None = None, start: _Start | None = None
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """As of `start_back`; sweep, start: in dual numbers where the weights (2 n,) are."""
        return start_back(sweep or self._run.back, self._partitions, start or self._start, weights, self._rows_read_parameters)

    @property
    def _rows_read_parameters(self) -> bool:
        """Whether closed positions and allowed velocities may change with parameters."""
        return len(self.kernels.of_rows(self.p)) > 0

    @property
    def _start_reads_parameters(self) -> bool:
        """Whether the start may change with parameters."""
        return self._rows_read_parameters or (self._follows and bool(np.any(self._start.by_parameters)))

    @cached_property
    def _start(self) -> _Start:
        parts = self._partitions.position, self._partitions.velocity
        first, second = (kinematics(self.kernels, partition, self._begun.q, self.t[0], self.p) for partition in parts)
        return _Start(first.R, second.R, self.kernels.start_p(self.p) if self._follows else None, (first, second))

    def _check(self) -> None:
        """Raises DomainError, ConvergenceError or NotTaped where the run did not arrive, or not by steps that have derivatives."""
        done, kernels = self._run.outcome, self.kernels
        if done.status != "ok":
            done.completed()
            q, qd, _ = done.last
            problem = on_the_way(kernels, q, qd, done.reached, done.tried, self.p)
            raise problem or ConvergenceError(
                f"{kernels.name}: the motion cannot continue beyond t = {done.reached:.6g} s ({done.status}); {REMEDIES[done.status]}"
            )
        if (t := self._run.not_differentiable) is not None:
            raise NotTaped(
                f"{kernels.name}: the motion is next to a singular position at t = {t:.6g} s, or to one that the emitted order of "
                "elimination does not suit, where derivatives have no correct digits; end the motion before, start elsewhere, or take rk4"
            )
