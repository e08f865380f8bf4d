"""A motion on all coordinates with its derivatives, in C: what is differentiated are the steps of the run, with their way back onto the
constraints (`ncgen/runtime/src/ncgen_adjoint.c`).

A mechanism starts at independent coordinates z and their rates. With V(q, q̇, p), the velocities that the joints allow nearest to given
ones, the columns R of allowed motions and N(q, p), a step of Newton's method, where E takes the independent ones:

    dq = (1 − R E) N_p dp + R dz          dq̇ = (1 − R E) (V_q dq + V_p dp) + R dż
"""

from __future__ import annotations

from functools import cached_property

import numpy as np

from ncgen.errors import ConvergenceError, ModelError
from ncgen.mechanism.library import CompiledKernels
from ncgen.mechanism.taped import Taped
from ncgen.solver.compiled import all_coordinates, closeness
from ncgen.solver.finite import on_the_way
from ncgen.solver.partition import Partition, determined, kinematics
from ncgen.solver.rank import freedom
from ncgen.solver.run import Initial
from ncgen.solver.start import begin
from ncgen.solver.tolerances import Tolerances


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
    ) -> None:
        """start_follows: whether the position at the start is the model's own, which may change with parameters."""
        begun = begin(kernels, initial, partitioned=True)
        self.kernels, self.p, self.t = kernels, begun.p, times
        self._partitions, self._begun, self._follows = determined(begun.partitions), begun, start_follows
        z, rates = (part.names(kernels) for part in (self._partitions.position, self._partitions.velocity))
        self.names = (*kernels.parameters, *z, *(f"rate({name})" for name in rates))
        sizes = tolerances.in_c(kernels.column_sizes, kernels.column_sizes) if tolerances else {}
        rank = freedom(kernels, begun.q, times[0], begun.p).rank
        dynamics = all_coordinates(kernels, form="emitted")
        self._run = Taped(dynamics, method, times, begun.q, begun.qd, begun.p, rank=rank, tolerance=closeness("double"), **sizes)
        self._check()

    @property
    def q(self) -> np.ndarray:
        return self._run.outcome.q

    @property
    def qd(self) -> np.ndarray:
        return self._run.outcome.qd

    def forward(self) -> tuple[np.ndarray, np.ndarray]:
        """Derivatives of q and q̇ at all instants, (K, n, columns) each."""
        dq, dqd = self._start_by
        return self._run.forward(dq, dqd, np.eye(len(self.p), len(self.names)))

    def backward(self, by_q: np.ndarray, by_qd: np.ndarray) -> np.ndarray:
        """Derivatives (columns,) of a number, from those by q and q̇ at all instants, (K, n) each."""
        q_bar, qd_bar, p_bar = self._run.backward(by_q, by_qd)
        dq, dqd = self._start_by
        slopes = dq.T @ q_bar + dqd.T @ qd_bar
        slopes[: len(p_bar)] += p_bar
        return slopes

    @cached_property
    def _start_by(self) -> tuple[np.ndarray, np.ndarray]:
        """Derivatives of q and q̇ at the start, (n, columns) each."""
        kernels, begun, parameters = self.kernels, self._begun, len(self.p)
        position, velocity = self._partitions.position, self._partitions.velocity
        closing_p, allowed_q, allowed_p = self._run.at_start()
        dp = np.eye(parameters, len(self.names))
        dz = np.zeros((len(position.independent), len(self.names)))
        dz[:, parameters : parameters + len(dz)] = np.eye(len(dz))
        if self._follows:
            dz += kernels.start_p(begun.p)[position.independent] @ dp
        dzd = np.zeros((len(velocity.independent), len(self.names)))
        dzd[:, parameters + len(dz) :] = np.eye(len(dzd))
        dq = self._with_independent(position, closing_p @ dp, dz)
        return dq, self._with_independent(velocity, allowed_q @ dq + allowed_p @ dp, dzd)

    def _with_independent(self, part: Partition, change: np.ndarray, wanted: np.ndarray) -> np.ndarray:
        """A change that the constraints ask for, and what they allow besides, so that independent ones change as wanted."""
        R = kinematics(self.kernels, part, self._begun.q, self.t[0], self.p).R
        return change + R @ (wanted - change[part.independent])

    def _check(self) -> None:
        """Raises DomainError, ConvergenceError or ModelError where the run did not arrive, or not by steps that have derivatives."""
        done, kernels = self._run.outcome, self.kernels
        if done.status != "ok":
            done.completed()
            q, qd, _ = done.last
            problem = on_the_way(kernels, q, qd, done.reached, done.tried, self.p)
            raise problem or ConvergenceError(
                f"{kernels.name}: the motion cannot go on beyond t = {done.reached:.6g} s ({done.status}); take shorter steps"
            )
        if (t := self._run.not_differentiable) is not None:
            raise ModelError(
                f"{kernels.name}: the motion is beside a singular position at t = {t:.6g} s, where derivatives by what goes before have no "
                "digits left; end it before, or start elsewhere"
            )
