"""One instant of a motion on independent coordinates, and its derivative through the position problem (implicit function theorem):

dq = R dz − S Φ_p dp          dq̇ = R dż − S (½ Φ̈_q̇ dq + Φ̇_p dp)
[M Φ_qᵀ; Φ_q 0] [dq̈; dλ] = −[K dq + C dq̇ + b_p dp; Φ̈_q dq + Φ̈_q̇ dq̇ + Φ̈_p dp]
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from ncgen.mechanism.kernels import Kernels
from ncgen.mechanism.reactive import ReactiveForce
from ncgen.solver.formalisms.coordinate_partitioning import StepStart, dependent_position, motion_at
from ncgen.solver.positions.kinematics import kinematics
from ncgen.solver.positions.partition import Partition, Partitions

TANGENTS = ("stiffness", "damping", "phidd_q", "phidd_qd", "phi_p", "phid_p", "phidd_p", "balance_p")


class PartitionedStage:
    """The state derivative at one instant, f(y) = [z̈; ż], with what its derivative needs: that from `_linearise` on."""

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

    def __init__(self, kernels: Kernels, partition: Partition, guess: StepStart, t: float, y: np.ndarray, p: np.ndarray) -> None:
        nz = len(partition.independent)
        self.kernels, self.partition, self.nz, self.t, self.p = kernels, partition, nz, t, p
        self.y = y
        self.q, _ = dependent_position(kernels, partition, guess, t, y[nz:])
        now = motion_at(kernels, partition, t, self.q, y[:nz], p)
        self.qd, self.qdd, self.lam = now.qd, now.qdd, now.lam
        self.frame = now.frame or kinematics(kernels, partition, self.q, t, p)
        self.slope = np.concatenate([now.qdd[partition.independent], y[:nz]])

    @property
    def partitions(self) -> Partitions:
        """The partition, for positions and velocities."""
        return Partitions(self.partition, self.partition)

    def _linearise(self) -> None:
        """The factors and the tangents, when they are first needed."""
        if hasattr(self, "mass"):
            return
        kernels, q, qd, qdd, t, p = self.kernels, self.q, self.qd, self.qdd, self.t, self.p
        self.mass = kernels.mass_matrix(q, t, p)
        R = self.frame.R
        self.reduced = cho_factor(R.T @ self.mass @ R) if self.nz else None
        arguments = {"t": t, "q": q, "qd": qd, "qdd": qdd, "lam": self.lam, "p": p}
        for name in TANGENTS:
            setattr(self, name, kernels.dense_tangent(name, **arguments))
        if friction := ReactiveForce.only(kernels.model.callbacks):
            by_q, by_qd, by_p = np.split(friction.jacobian(t, q, qd, p), [len(q), 2 * len(q)], axis=1)
            self.stiffness, self.damping, self.balance_p = self.stiffness - by_q, self.damping - by_qd, self.balance_p - by_p

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
