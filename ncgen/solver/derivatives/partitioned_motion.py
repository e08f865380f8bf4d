"""A motion on independent coordinates with its derivatives, in Python: for kernels of NumPy, and where no motion is written out.

The motion is the classical Runge-Kutta method's, y = [ż; z], or the trapezoidal rule's, and what is differentiated is that very
computation, through the solution of the position problem by the implicit function theorem:

    dq = R dz − S Φ_p dp          dq̇ = R dż − S (½ Φ̈_q̇ dq + Φ̇_p dp)
    [M Φ_qᵀ; Φ_q 0] [dq̈; dλ] = −[K dq + C dq̇ + b_p dp; Φ̈_q dq + Φ̈_q̇ dq̇ + Φ̈_p dp]
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from ncgen.errors import ModelError
from ncgen.mechanism.break_times import break_times
from ncgen.mechanism.driver_jumps import refuse_jumps
from ncgen.mechanism.kernels import Kernels
from ncgen.mechanism.taped import Driven
from ncgen.methods.table import INTEGRATORS
from ncgen.solver.finite import watched
from ncgen.solver.formalisms.coordinate_partitioning import Start, dependent_position, motion_at
from ncgen.solver.positions.partition import Kinematics, determined, kinematics, quality
from ncgen.solver.runs.run import Initial
from ncgen.solver.runs.signals import Signals
from ncgen.solver.runs.start import begin
from ncgen.solver.trajectories.trajectory import Trajectory

NODES, WEIGHTS = (tuple(map(float, numbers)) for numbers in zip(*INTEGRATORS["rk4"].coefficients.successive))
"""The classical Runge-Kutta method: k_i = f(t + c_i h, y + c_i h k_{i−1}), y + h Σ w_i k_i."""

TANGENTS = ("stiffness", "damping", "phidd_q", "phidd_qd", "phi_p", "phid_p", "phidd_p", "balance_p")

CLOSED = 1e-8
"""What a step of a run may leave of the rule's equations: what Newton's method leaves of them, times a stiff slope."""

POOR = 1e-5
"""Quality of a partition below which a motion on it has no digits left to differentiate."""


class PartitionedMotion:
    """A motion over equal steps, every stage kept for the derivative's sake.

    t (K,); q, qd (K, n), there once `forward` or `steps` has gone through; names: of the columns of derivatives: parameters, z, rate(z)
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
        refuse_jumps(kernels, begun.p, begun.q, break_times(kernels, begun.p, times[0], times[-1]), "derivatives")
        self.h = (times[-1] - times[0]) / (len(times) - 1)
        self.partition = determined(begun.partitions).position
        independent = self.partition.independent
        self.nz = len(independent)
        by_p = kernels.start_p(self.p) if start_follows else np.zeros((kernels.n, len(self.p)))
        self.z_by_p = by_p[independent]
        names = self.partition.names(kernels)
        self.names = (*kernels.parameters, *names, *(f"rate({name})" for name in names))
        self.y0 = np.concatenate([begun.rates, begun.q[independent]])
        self.q0 = begun.q
        self._q: list[np.ndarray] = []
        self._qd: list[np.ndarray] = []
        self._history: list[list[_Stage]] | None = None

    @property
    def q(self) -> np.ndarray:
        return np.array(self._stages and self._q)

    @property
    def qd(self) -> np.ndarray:
        return np.array(self._stages and self._qd)

    @property
    def _stages(self) -> list[list[_Stage]]:
        """Those of every step, found once."""
        if self._history is None:
            self._history = list(self._steps())
        return self._history

    def along(self, directions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Changes of q and q̇ at all instants, (K, n, D) each, along directions, (columns, D)."""
        dy, dp = (seeds @ directions for seeds in self._seeds())
        q_by, qd_by = [], []
        for stages in self._stages:
            slopes, total = np.zeros_like(dy), np.zeros_like(dy)
            for stage, node, weight in zip(stages, NODES, WEIGHTS, strict=True):
                slopes, dq, dqd = stage.forward(dy + node * self.h * slopes, dp)
                total += weight * slopes
                if node == 0.0:
                    q_by.append(dq)
                    qd_by.append(dqd)
            dy = dy + self.h * total
        _, dq, dqd = self._last.forward(dy, dp)
        return np.array([*q_by, dq]), np.array([*qd_by, dqd])

    def _seeds(self) -> tuple[np.ndarray, np.ndarray]:
        """How y at the start and p change with every column."""
        count, nz, parameters = len(self.names), self.nz, len(self.p)
        dy = np.zeros((2 * nz, count))
        dy[nz:, parameters : parameters + nz] = np.eye(nz)
        dy[:nz, parameters + nz :] = np.eye(nz)
        dy[nz:, :parameters] = self.z_by_p
        return dy, np.eye(parameters, count)

    def backward(self, by_q: np.ndarray, by_qd: np.ndarray) -> tuple[np.ndarray, Driven]:
        """Derivatives of a number by what has a name (columns,), and by what drove the run, from those by q and q̇ at all instants, (K, n)
        each."""
        t = self.t[:-1, None] + self.h * np.array(NODES)
        driven = Driven(t, np.broadcast_to(self.t[:-1, None], t.shape), np.zeros((*t.shape, len(self.kernels.inputs))))
        adjoint, p_bar = self._last.backward(np.zeros(2 * self.nz), by_q[-1], by_qd[-1])
        nothing, h = np.zeros(self.kernels.n), self.h
        for k, stages in reversed(list(enumerate(self._stages))):
            later = np.zeros_like(adjoint)
            total = adjoint.copy()
            for i in reversed(range(4)):
                seen = (by_q[k], by_qd[k]) if i == 0 else (nothing, nothing)
                ahead = h * NODES[i + 1] * later if i < 3 else 0.0
                later, by_p = stages[i].backward(h * WEIGHTS[i] * adjoint + ahead, *seen)
                total += later
                p_bar = p_bar + by_p
                driven.values[k, i] = by_p[len(by_p) - driven.values.shape[2] :]
            adjoint = total
        return self._by_columns(adjoint, p_bar), driven

    def _by_columns(self, adjoint: np.ndarray, p_bar: np.ndarray) -> np.ndarray:
        """From derivatives by y at the start and by p."""
        z, zd = adjoint[self.nz :], adjoint[: self.nz]
        return np.concatenate([p_bar + self.z_by_p.T @ z, z, zd])

    def _steps(self) -> Iterator[list[_Stage]]:
        """The four stages of every step; `_last` is the instant at the end."""
        y, guess = self.y0, Start(self.t[0], self.q0, np.zeros(self.kernels.n), self.p)
        for t in self.t[:-1]:
            stages, slope = [], np.zeros_like(y)
            for node in NODES:
                stage = _Stage(self, guess, t + node * self.h, y + node * self.h * slope, self._present(t, t + node * self.h))
                stages.append(stage)
                slope = stage.slope
            self._keep(stages[0])
            guess = Start(t, stages[0].q, stages[0].qd, self.p)
            y = y + self.h * sum(w * s.slope for w, s in zip(WEIGHTS, stages, strict=True))
            yield stages
        self._last = _Stage(self, guess, self.t[-1], y, self._present(self.t[-1], self.t[-1]))
        self._keep(self._last)

    def _present(self, begun: float, t: float) -> np.ndarray:
        """p with the inputs of a time inside a step that began at another one."""
        return self.signals.begun_at(begun)(t, self.p) if self.signals else self.p

    def _keep(self, stage: _Stage) -> None:
        if quality(self.kernels, self.partition, stage.q, stage.t, self.p) < POOR:
            names = ", ".join(self.partition.names(self.kernels))
            raise ModelError(
                f"{names} do not determine the motion any more at t = {stage.t:.6g} s; choose other independent coordinates (z)"
            )
        self._q.append(stage.q)
        self._qd.append(stage.qd)


class TrapezoidalMotion(PartitionedMotion):
    """The same by the trapezoidal rule, y₁ = y₀ + h/2 (f₀ + f₁), whose steps come from a run: (1 − h/2 J₁) dy₁ = (1 + h/2 J₀) dy₀ + …"""

    def __init__(self, kernels: Kernels, initial: Initial, run: Trajectory, start_follows: bool) -> None:
        """run: `simulate`'s on independent coordinates, whose instants are the ends of its steps."""
        super().__init__(kernels, initial, run.t, start_follows)
        self._run = run

    @cached_property
    def _instants(self) -> list[_Stage]:
        """One stage an instant. Raises ModelError where the run was on other coordinates."""
        independent, found = self.partition.independent, list[_Stage]()
        guess = Start(self.t[0], self.q0, np.zeros(self.kernels.n), self.p)
        for t, q, qd in zip(self.t, self._run.q, self._run.qd, strict=True):
            y = np.concatenate([qd[independent], q[independent]])
            found.append(_Stage(self, guess, t, y, self.p))
            guess = Start(t, q, qd, self.p)
            self._keep(found[-1])
            self._check_step(found[-2:])
        return found

    def _check_step(self, stages: list[_Stage]) -> None:
        before, after = stages[0], stages[-1]
        if len(stages) > 1 and not np.allclose(after.y, before.y + self.h / 2 * (before.slope + after.slope), rtol=0, atol=CLOSED):
            names = ", ".join(self.partition.names(self.kernels))
            raise ModelError(
                f"the step to t = {after.t:.6g} s went on with other independent coordinates than {names}; choose some that last (z)"
            )

    @property
    def _stages(self) -> list[list[_Stage]]:
        return [[stage] for stage in self._instants]

    def along(self, directions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        dy, dp = (seeds @ directions for seeds in self._seeds())
        still, half = np.zeros_like(dy), self.h / 2
        first, *others = self._instants
        slope, dq, dqd = first.forward(dy, dp)
        q_by, qd_by = [dq], [dqd]
        for stage in others:
            right = dy + half * (slope + stage.forward(still, dp)[0])
            dy = np.linalg.solve(self._matrix(stage), right)
            slope, dq, dqd = stage.forward(dy, dp)
            q_by.append(dq)
            qd_by.append(dqd)
        return np.array(q_by), np.array(qd_by)

    def backward(self, by_q: np.ndarray, by_qd: np.ndarray) -> tuple[np.ndarray, Driven]:
        nothing, half = np.zeros(self.kernels.n), self.h / 2
        adjoint, p_bar, slope_bar = np.zeros(2 * self.nz), np.zeros(len(self.p)), np.zeros(2 * self.nz)
        for k, stage in reversed(list(enumerate(self._instants))):
            more, by_p = stage.backward(slope_bar, by_q[k], by_qd[k])
            adjoint, p_bar = adjoint + more, p_bar + by_p
            if k:
                adjoint = np.linalg.solve(self._matrix(stage).T, adjoint)
                slope_bar = half * adjoint
                p_bar = p_bar + stage.backward(slope_bar, nothing, nothing)[1]
        none = np.empty((0, 0))
        return self._by_columns(adjoint, p_bar), Driven(none, none, none[..., None])

    def _matrix(self, stage: _Stage) -> np.ndarray:
        """1 − h/2 J."""
        every = np.eye(2 * self.nz)
        return every - self.h / 2 * stage.forward(every, np.zeros((len(self.p), 2 * self.nz)))[0]


class _Stage:
    """The state derivative at one instant, f(y) = [z̈; ż], with what its derivative needs: that from `_linearise` on."""

    frame: Kinematics
    mass: np.ndarray
    reduced: tuple[np.ndarray, bool] | None
    stiffness: np.ndarray
    damping: np.ndarray
    phidd_q: np.ndarray
    phidd_qd: np.ndarray
    phi_p: np.ndarray
    phid_p: np.ndarray
    phidd_p: np.ndarray
    balance_p: np.ndarray

    def __init__(self, motion: PartitionedMotion, guess: Start, t: float, y: np.ndarray, p: np.ndarray) -> None:
        kernels, partition, nz = motion.kernels, motion.partition, motion.nz
        self.kernels, self.partition, self.nz, self.t, self.p = kernels, partition, nz, t, p
        self.y = y
        self.q, _ = dependent_position(kernels, partition, guess, t, y[nz:])
        now = motion_at(kernels, partition, t, self.q, y[:nz], p)
        self.qd, self.qdd, self.lam = now.qd, now.qdd, now.lam
        self.slope = np.concatenate([now.qdd[partition.independent], y[:nz]])

    def _linearise(self) -> None:
        """The factors and the tangents, when they are first needed."""
        if hasattr(self, "frame"):
            return
        kernels, q, qd, qdd, t, p = self.kernels, self.q, self.qd, self.qdd, self.t, self.p
        self.frame = kinematics(kernels, self.partition, q, t, p)
        self.mass = kernels.mass_matrix(q, t, p)
        R = self.frame.R
        self.reduced = cho_factor(R.T @ self.mass @ R) if self.nz else None
        given = {"t": t, "q": q, "qd": qd, "qdd": qdd, "lam": self.lam, "p": p}
        for name in TANGENTS:
            setattr(self, name, kernels.dense_tangent(name, **given))

    def forward(self, dy: np.ndarray, dp: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """(df, dq, dq̇) along directions dy (2 nz, columns) and dp (parameters, columns)."""
        self._linearise()
        R, nz = self.frame.R, self.nz
        dq = R @ dy[nz:] - self._particular(self.phi_p @ dp)
        dqd = R @ dy[:nz] - self._particular(0.5 * (self.phidd_qd @ dq) + self.phid_p @ dp)
        force = -(self.stiffness @ dq + self.damping @ dqd + self.balance_p @ dp)
        bias = -self._particular(self.phidd_q @ dq + self.phidd_qd @ dqd + self.phidd_p @ dp)
        dzdd = self._reduced(R.T @ (force - self.mass @ bias))
        return np.vstack([dzdd, dy[:nz]]), dq, dqd

    def backward(self, f_bar: np.ndarray, q_bar: np.ndarray, qd_bar: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(ȳ, p̄) of adjoints of f, of q and of q̇: the transpose of `forward`."""
        self._linearise()
        R, nz, rows = self.frame.R, self.nz, self.kernels.m
        force_bar = R @ self._reduced(f_bar[:nz])
        balance = -self.mass @ force_bar
        rows_bar = self.frame.multipliers(balance, rows)
        q_bar = q_bar - self.stiffness.T @ force_bar - self.phidd_q.T @ rows_bar
        qd_bar = qd_bar - self.damping.T @ force_bar - self.phidd_qd.T @ rows_bar
        p_bar = -(self.balance_p.T @ force_bar) - self.phidd_p.T @ rows_bar
        rates_bar = self.frame.multipliers(qd_bar, rows)
        q_bar = q_bar - 0.5 * (self.phidd_qd.T @ rates_bar)
        p_bar = p_bar - self.phid_p.T @ rates_bar - self.phi_p.T @ self.frame.multipliers(q_bar, rows)
        return np.concatenate([R.T @ qd_bar + f_bar[nz:], R.T @ q_bar]), p_bar

    def _particular(self, right: np.ndarray) -> np.ndarray:
        return np.array([self.frame.particular(column) for column in right.T]).T.reshape(len(self.q), right.shape[1])

    def _reduced(self, right: np.ndarray) -> np.ndarray:
        return right if self.reduced is None else cho_solve(self.reduced, right)


def _check(kernels: Kernels) -> None:
    if kernels.model.callbacks:
        raise ModelError(f"{kernels.name}: a force of a Python function has no derivative here; write it as an expression")
    if len(kernels.holonomic) != kernels.m:
        raise ModelError(f"{kernels.name}: motions with rolling conditions are not differentiated")
