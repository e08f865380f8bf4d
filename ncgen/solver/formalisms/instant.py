"""The equations of motion at one instant, without units.

M q̈ + Φ_qᵀ λ = Q and Φ_q q̈ = γ with lengths measured in the mechanism's size, rows in their natural sizes and inertia in
its largest entry: a formalism that decides by size (a rank, a penalty, a regularisation) decides the same in any units.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ncgen.mechanism.kernels import Kernels


@dataclass(frozen=True, eq=False, kw_only=True)
class InstantMatrices:
    """mass (n, n), jacobian (k, n), force (n,), gamma (k,): M, Φ_q, Q and γ without units, of the `rows` (k,) in use.

    unit: that of inertia (kg)
    """

    kernels: Kernels
    mass: np.ndarray
    jacobian: np.ndarray
    force: np.ndarray
    gamma: np.ndarray
    unit: float
    rows: np.ndarray

    def accelerations(self, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """q̈ (n,) and λ (m,) in their units, from those without; rows that are not in use get zero."""
        lam = np.zeros(self.kernels.m)
        lam[self.rows] = self.unit * y / self.kernels.row_sizes[self.rows]
        return self.kernels.column_sizes * x, lam


@dataclass(frozen=True)
class Baumgarte:
    """The stabilised acceleration equation Φ̈ + 2 ξ ω Φ̇ + ω² Φ = 0: ω (1/s) and ξ."""

    omega: float
    xi: float

    def __call__(self, kernels: Kernels, jacobian: np.ndarray, q: np.ndarray, qd: np.ndarray, t: float, p: np.ndarray | None) -> np.ndarray:
        """What is taken from γ, shape (m,)."""
        rate = jacobian @ qd - kernels.nu(q, t, p)
        return 2 * self.xi * self.omega * rate + self.omega**2 * kernels.phi(q, t, p)


def instant(
    kernels: Kernels,
    q: np.ndarray,
    qd: np.ndarray,
    t: float = 0.0,
    p: np.ndarray | None = None,
    rows: np.ndarray | None = None,
    stabilised: Baumgarte | None = None,
) -> InstantMatrices:
    """The equations at a position and a velocity, which need not satisfy the constraints.

    rows: those in use (default: all). Rows that others imply where Φ = 0 may contradict them where it is not.
    """
    jacobian, gamma = kernels.jacobian(q, t, p), kernels.gamma(q, qd, t, p)
    if stabilised is not None:
        gamma = gamma - stabilised(kernels, jacobian, q, qd, t, p)
    rows = np.arange(kernels.m) if rows is None else rows
    columns, sizes = kernels.column_sizes, kernels.row_sizes[rows]
    mass, unit = scaled_mass(kernels, q, t, p)
    force = columns * kernels.force(q, qd, t, p) / unit
    return InstantMatrices(
        kernels=kernels,
        mass=mass,
        jacobian=jacobian[rows] * columns / sizes[:, None],
        force=force,
        gamma=gamma[rows] / sizes,
        unit=unit,
        rows=rows,
    )


def scaled_mass(kernels: Kernels, q: np.ndarray, t: float = 0.0, p: np.ndarray | None = None) -> tuple[np.ndarray, float]:
    """M without units, its largest diagonal entry 1, and that entry in the mechanism's units."""
    columns = kernels.column_sizes
    mass = columns[:, None] * kernels.mass_matrix(q, t, p) * columns
    unit = float(np.max(np.diag(mass), initial=0.0)) or 1.0
    return mass / unit, unit
