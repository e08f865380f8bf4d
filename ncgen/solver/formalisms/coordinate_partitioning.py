"""Forward dynamics by coordinate partitioning: the paper's Table 8, with its state made explicit.

The state is y = [ż; z; W]: velocities and positions of the independent coordinates, and the work W of
drivers and forces without a potential (for the energy balance). With rolling conditions there are fewer
independent velocities than positions, hence two partitions. The warm start of the position problem is
part of a `StepStart`, changed only between steps, so a rejected step leaves no trace.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ncgen.errors import ConvergenceError
from ncgen.mechanism.kernels import Kernels
from ncgen.solver.lapack import dposv
from ncgen.solver.positions.kinematics import Kinematics, factor, kinematics, solve
from ncgen.solver.positions.massless import massless
from ncgen.solver.positions.partition import Partition, Partitions
from ncgen.solver.positions.position import LIMIT, TOLERANCE


@dataclass(frozen=True, eq=False)
class StepStart:
    """Where the Newton iterations of one integration step begin: an accepted state, and the branch parameters."""

    t: float
    q: np.ndarray
    qd: np.ndarray
    p: np.ndarray


@dataclass(frozen=True, eq=False, kw_only=True)
class Motion:
    """Everything about one instant: positions, velocities, accelerations, multipliers, power of drivers and forces; frame: of the
    independent velocities, None where there are none."""

    t: float
    q: np.ndarray
    qd: np.ndarray
    qdd: np.ndarray
    lam: np.ndarray
    power: float
    iterations: int
    frame: Kinematics | None = None


def dependent_position(kernels: Kernels, partition: Partition, start: StepStart, t: float, z: np.ndarray) -> tuple[np.ndarray, int]:
    """q with the given independent coordinates, by Newton from the start extrapolated with its velocities.

    Raises ConvergenceError with the time and the residual.
    """
    q = start.q + (t - start.t) * start.qd
    q[partition.independent] = z
    sizes = kernels.row_sizes
    history = []
    for iteration in range(LIMIT + 1):
        value = kernels.phi(q, t, start.p)
        history.append(float(np.max(np.abs(value) / sizes, initial=0.0)))
        if history[-1] <= TOLERANCE:
            return q, iteration
        if not np.isfinite(history[-1]):
            break
        jacobian = kernels.jacobian(q, t, start.p)[np.ix_(partition.rows, partition.dependent)]
        q[partition.dependent] -= solve(factor(jacobian, kernels.name), value[partition.rows])
    raise ConvergenceError(
        f"{kernels.name}: the position problem does not converge at t = {t:.6g} s, the relative residual is {history[-1]:.2g}; "
        "the mechanism may have locked, or take smaller steps (rtol, max_step)",
        tuple(history),
    )


def motion(kernels: Kernels, partitions: Partitions, start: StepStart, t: float, z: np.ndarray, zd: np.ndarray) -> Motion:
    """Positions, velocities and accelerations of one instant from the independent coordinates."""
    q, iterations = dependent_position(kernels, partitions.position, start, t, z)
    return motion_at(kernels, partitions.velocity, t, q, zd, start.p, iterations)


def motion_at(
    kernels: Kernels, partition: Partition, t: float, q: np.ndarray, zd: np.ndarray, p: np.ndarray | None, iterations: int = 0
) -> Motion:
    """Velocities and accelerations at a consistent position q."""
    frame = kinematics(kernels, partition, q, t, p)
    nu = kernels.nu(q, t, p)
    qd = frame.R @ zd + frame.particular(nu)
    bias = frame.particular(kernels.gamma(q, qd, t, p))
    mass = kernels.mass_matrix(q, t, p)
    force = kernels.force(q, qd, t, p)
    zdd = _independent_acceleration(kernels, frame, mass, force, bias)
    qdd = frame.R @ zdd + bias
    lam = frame.multipliers(force - mass @ qdd, kernels.m)
    power = float(kernels.energy(q, qd, t, p)[2] - nu @ lam)
    return Motion(t=t, q=q, qd=qd, qdd=qdd, lam=lam, power=power, iterations=iterations, frame=frame)


def _independent_acceleration(kernels: Kernels, frame: Kinematics, mass: np.ndarray, force: np.ndarray, bias: np.ndarray) -> np.ndarray:
    """z̈ of (RᵀMR) z̈ = Rᵀ(Q − M Sγ), the paper's eq. 54."""
    reduced = frame.R.T @ mass @ frame.R
    if not len(reduced):
        return np.zeros(0)
    _, zdd, failed = dposv(reduced, frame.R.T @ (force - mass @ bias))
    if failed:
        sizes = kernels.column_sizes[frame.partition.independent]
        raise massless(kernels, sizes[:, None] * reduced * sizes, frame.R * sizes / kernels.column_sizes[:, None])
    return zdd
