"""Inverse dynamics: the motor forces that a given motion needs.

Motors act along coordinates (a torque on a relative angle, say). With R from any partition the equations of
motion without multipliers are Rᵀ(M q̈ − Q) = Rᵀ Q_motor, one equation a degree of freedom.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ncgen.errors import ModelError, SingularError
from ncgen.solver.branches import refresh_branches
from ncgen.solver.partition import choose_partition, kinematics
from ncgen.solver.protocol import Kernels
from ncgen.solver.trajectory import Trajectory


@dataclass(frozen=True)
class MotorForces:
    """names: coordinates with a motor; forces (K, len(names)) in N or N m; lam (K, m): multipliers of the rows."""

    names: tuple[str, ...]
    forces: np.ndarray
    lam: np.ndarray

    def __getitem__(self, name: str) -> np.ndarray:
        return self.forces[:, self.names.index(name)]


def inverse_dynamics(run: Trajectory, motors=None) -> MotorForces:
    """Motor forces along `motors` (default: the independent coordinates) that make the motion of a trajectory.

    Forces of the model (gravity, springs, its own torques) act as well; what comes out is what is missing.
    To see a motion with other forces, replace its kernels: `dataclasses.replace(run, kernels=without_motors)`.
    Raises ModelError if there are not as many motors as degrees of freedom.
    """
    kernels = run.kernels
    names = tuple(motors or run.independent)
    instants = zip(run.t, run.q, run.qd, run.qdd, strict=True)
    results = [motor_forces(kernels, names, t, q, qd, qdd, refresh_branches(kernels, q, run.p)) for t, q, qd, qdd in instants]
    return MotorForces(names, np.array([f for f, _ in results]), np.array([lam for _, lam in results]))


def motor_forces(kernels: Kernels, motors, t, q, qd, qdd, p=None) -> tuple[np.ndarray, np.ndarray]:
    """Motor forces (len(motors),) and multipliers (m,) at one instant."""
    unknown = [name for name in motors if name not in kernels.index]
    if unknown:
        raise ModelError(f"motor on {unknown[0]}: {kernels.name} has no such free coordinate")
    partition = choose_partition(kernels, q, t, p, motors)
    frame = kinematics(kernels, partition, q, t, p)
    if len(motors) != frame.R.shape[1]:
        raise ModelError(f"{len(motors)} motors for {frame.R.shape[1]} degrees of freedom; give one each")
    missing = kernels.mass_matrix(q, t, p) @ qdd - kernels.force(q, qd, t, p)
    where = [kernels.index[name] for name in motors]
    try:
        forces = np.linalg.solve(frame.R[where].T, frame.R.T @ missing)
    except np.linalg.LinAlgError:
        raise SingularError(f"{kernels.name}: the motors on {', '.join(motors)} cannot hold this position") from None
    motor = np.zeros(kernels.n)
    motor[where] = forces
    return forces, frame.multipliers(motor - missing, kernels.m)
