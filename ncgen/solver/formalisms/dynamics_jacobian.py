"""Exact ∂ẏ/∂y from the tangent kernels, by the implicit function theorem.

The balance M q̈ + Φ_qᵀλ − Q = 0 and Φ̈ = 0 stay zero when q and q̇ change, hence with K, C, Φ̈_q and Φ̈_q̇ of the tangent kernels

    [M Φ_qᵀ; Φ_q 0] [dq̈; dλ] = −[K; Φ̈_q] dq − [C; Φ̈_q̇] dq̇.

Of independent coordinates z, dq = R dz and Φ_q dq̇ = −Φ̇_q dq, dq̇ on them being dż. Nothing depends on the work W, whose own row
is left zero.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ncgen.mechanism.kernels import Kernels
from ncgen.solver.formalisms.coordinate_partitioning import Motion
from ncgen.solver.formalisms.instant import Baumgarte, scaled_mass
from ncgen.solver.formalisms.kkt import KKT
from ncgen.solver.positions.kinematics import kinematics
from ncgen.solver.positions.partition import Partition, Partitions


def acceleration_jacobians(
    kernels: Kernels, now: Motion, p: np.ndarray | None = None, rows: np.ndarray | None = None, gains: Baumgarte | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """∂q̈/∂q and ∂q̈/∂q̇, (n, n) each, at a motion; rows, gains: those in use and Baumgarte's, as for `instant`.

    Forces of Python functions are not in it. Raises SingularError where accelerations are not determined.
    """
    identity, none = np.eye(kernels.n), np.zeros((kernels.n, kernels.n))
    change = acceleration_changes(kernels, now, (np.hstack([identity, none]), np.hstack([none, identity])), p, rows, gains)
    return change[:, : kernels.n], change[:, kernels.n :]


def acceleration_changes(
    kernels: Kernels,
    now: Motion,
    along: tuple[np.ndarray, np.ndarray],
    p: np.ndarray | None = None,
    rows: np.ndarray | None = None,
    gains: Baumgarte | None = None,
) -> np.ndarray:
    """dq̈ (n, k) with changes of q and q̇, (n, k) each, in k directions; the rest as above."""
    t, q, qd, (dq, dqd) = now.t, now.q, now.qd, along
    rows = np.arange(kernels.m) if rows is None else rows
    columns, sizes = kernels.column_sizes, kernels.row_sizes[rows]
    jacobian = kernels.jacobian(q, t, p)
    opened = kernels.phidd_q(q, qd, now.qdd, t, p) @ dq + kernels.phidd_qd(q, qd, t, p) @ dqd
    if gains is not None:
        opened += 2 * gains.xi * gains.omega * (rate_slope(kernels, now, p) @ dq + jacobian @ dqd)
        opened += gains.omega**2 * _position_rows(kernels, jacobian) @ dq
    mass, unit = scaled_mass(kernels, q, t, p)
    system = KKT(mass, jacobian[rows] * columns / sizes[:, None], kernels)
    pulled = kernels.stiffness(q, qd, now.qdd, now.lam, t, p) @ dq + kernels.damping(q, qd, t, p) @ dqd
    return columns[:, None] * system.solve(-columns[:, None] * pulled / unit, -opened[rows] / sizes[:, None])[0]


def input_accelerations(kernels: Kernels, now: Motion, p: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """∂q̈/∂u by the inputs, (n, inputs): they stand in forces alone, so that [M Φ_qᵀ; Φ_q 0] [dq̈; dλ] = [Q_u; 0] du. rows: those in use."""
    columns, sizes, count = kernels.column_sizes, kernels.row_sizes[rows], len(kernels.inputs)
    mass, unit = scaled_mass(kernels, now.q, now.t, p)
    system = KKT(mass, kernels.jacobian(now.q, now.t, p)[rows] * columns / sizes[:, None], kernels)
    balance = kernels.balance_p(now.q, now.qd, now.qdd, now.lam, now.t, p).toarray()[:, len(p) - count :]
    return columns[:, None] * system.solve(-columns[:, None] * balance / unit, np.zeros((len(rows), count)))[0]


def multiplier_changes(kernels: Kernels, partition: Partition, now: Motion, p: np.ndarray, changes: Sequence[np.ndarray]) -> np.ndarray:
    """dλ (m, k) with changes of q, q̇, q̈ and p in k directions that the balance allows; rows that are not kept get zero."""
    t, q, qd = now.t, now.q, now.qd
    derivatives = (
        kernels.stiffness(q, qd, now.qdd, now.lam, t, p),
        kernels.damping(q, qd, t, p),
        kernels.mass_matrix(q, t, p),
        kernels.balance_p(q, qd, now.qdd, now.lam, t, p),
    )
    right = np.sum([derivative @ change for derivative, change in zip(derivatives, changes, strict=True)], axis=0)
    frame = kinematics(kernels, partition, q, t, p)
    return -frame.multipliers(right, kernels.m)


def rate_slope(kernels: Kernels, now: Motion, p: np.ndarray | None = None) -> np.ndarray:
    """∂(Φ_q q̇ − ν)/∂q, (m, n): half of ∂Φ̈/∂q̇ for equations of position, whose Φ̈ is quadratic in q̇."""
    derivative = kernels.phidd_qd(now.q, now.qd, now.t, p).toarray() / 2
    if len(kernels.holonomic) < kernels.m:
        rolling = np.setdiff1d(np.arange(kernels.m), kernels.holonomic)
        # Φ̈ = Φ_q q̈ − γ: what q̈ = q̇ adds to its slope is that of Φ_q q̇.
        moving, still = (kernels.phidd_q(now.q, now.qd, x, now.t, p).toarray() for x in (now.qd, 0.0 * now.qd))
        derivative[rolling] = (moving - still)[rolling]
    return derivative


def full_jacobian(
    kernels: Kernels, now: Motion, p: np.ndarray | None = None, rows: np.ndarray | None = None, gains: Baumgarte | None = None
) -> np.ndarray:
    """∂ẏ/∂y of y = [q̇; q; W]."""
    n = kernels.n
    by_q, by_qd = acceleration_jacobians(kernels, now, p, rows, gains)
    result = np.zeros((2 * n + 1, 2 * n + 1))
    result[:n, :n], result[:n, n : 2 * n] = by_qd, by_q
    result[n : 2 * n, :n] = np.eye(n)
    return result


def partitioned_jacobian(kernels: Kernels, partitions: Partitions, now: Motion, p: np.ndarray | None = None) -> np.ndarray:
    """∂ẏ/∂y of y = [ż; z; W]."""
    velocities, positions = partitions.velocity.independent, partitions.position.independent
    q_by_z, qd_by_zd, qd_by_z = independent_motions(kernels, partitions, now, p)
    count = len(velocities)
    along = np.hstack([np.zeros(qd_by_zd.shape), q_by_z]), np.hstack([qd_by_zd, qd_by_z])
    change = acceleration_changes(kernels, now, along, p, partitions.velocity.rows)
    result = np.zeros((count + len(positions) + 1,) * 2)
    result[:count, :-1] = change[velocities]
    result[count:-1, :count] = qd_by_zd[positions]
    result[count:-1, count:-1] = qd_by_z[positions]
    return result


def independent_motions(
    kernels: Kernels, partitions: Partitions, now: Motion, p: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """∂q/∂z, ∂q̇/∂ż and ∂q̇/∂z over all coordinates."""
    position = kinematics(kernels, partitions.position, now.q, now.t, p)
    rate = kinematics(kernels, partitions.velocity, now.q, now.t, p)
    bias = rate_slope(kernels, now, p) @ position.R
    return position.R, rate.R, -rate.particular(bias)


def _position_rows(kernels: Kernels, jacobian: np.ndarray) -> np.ndarray:
    """∂Φ/∂q: Φ_q, but zero for rolling conditions, which are not equations of position."""
    result = np.zeros_like(jacobian)
    result[kernels.holonomic] = jacobian[kernels.holonomic]
    return result
