"""Impulses where the velocity of a driver jumps.

Integrated over the jump the equations of motion are M (q̇⁺ − q̇⁻) + Φ_qᵀ μ = 0 and Φ_q q̇⁺ = ν⁺: the projection of velocities with the
least kinetic energy of the change, whatever the formalism. The work is that of the mean velocity, −μᵀ Φ_q (q̇⁻ + q̇⁺) / 2, which is the
change of kinetic energy exactly.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ncgen.mechanism.kernels import Kernels
from ncgen.solver.formalisms.projection import least_energy, project_position
from ncgen.solver.positions.branches import refresh_branches

VELOCITY_TOLERANCE = 1e-12
"""A velocity off its constraint by less than this share of what it adds up, and an impulse below this share of the largest, is rounding."""


@dataclass(frozen=True)
class Impulse:
    """What a driver does at a jump of velocities.

    t: s; driver: the name of the driven coordinate, or of the constraint that depends on time; size: N s along the coordinate, or N m s
    about the axis of an angle, positive as the coordinate grows: the integral of `run.driver_forces()` over the jump. It is −μ of the row
    """

    t: float
    driver: str
    size: float


@dataclass(frozen=True, eq=False)
class Crossing:
    """Velocities qd (n,) after a jump, the work (J) of its impulses, and those of drivers in the order of their rows."""

    qd: np.ndarray
    work: float
    impulses: tuple[Impulse, ...]


def cross(kernels: Kernels, q: np.ndarray, qd: np.ndarray, before: float, after: float, p: np.ndarray) -> Crossing:
    """Carry velocities over the jump of a driver's velocity.

    q, qd (n,): position and velocities before it (m, rad, and per second); before, after: s, around the jump; p (n_p,): parameters
    Raises SingularError where a motion that the constraints allow has no inertia, ConvergenceError where the position is far from closed.
    """
    p = refresh_branches(kernels, q, p)
    q, _ = project_position(kernels, q, after, p)  # off the constraints redundant rows contradict each other
    rows, sizes = kernels.row_sizes, kernels.column_sizes
    jacobian, nu = kernels.phi_q(q, after, p), kernels.nu(q, after, p)
    rates = jacobian @ qd
    rest = (nu - rates) / rows
    if np.all(np.abs(rest) <= VELOCITY_TOLERANCE * (abs(jacobian) @ np.abs(qd) + np.abs(nu)) / rows):
        return Crossing(qd, 0.0, ())
    change, push = least_energy(kernels, q, after, p).solve(np.zeros(kernels.n), rest)
    unit = float(np.max(sizes**2 * kernels.mass(q, after, p).diagonal(), initial=0.0)) or 1.0  # that `least_energy` measures inertia in
    multipliers = unit * push / rows
    work = -0.5 * float(multipliers @ (rates + nu))
    least, nu_before = VELOCITY_TOLERANCE * float(np.max(np.abs(push))), kernels.nu(q, before, p)
    impulses = tuple(
        Impulse((before + after) / 2, row.owner.name if row.owner.kind == "driver" else row.label, -float(multipliers[i]))
        for i, row in enumerate(kernels.rows)
        if abs(push[i]) > least and (row.owner.kind == "driver" or nu[i] != nu_before[i])
    )
    return Crossing(qd + sizes * change, work, impulses)
