"""Where a simulation starts: a closed position and velocities that the constraints allow.

Velocities are given for the independent coordinates, for any coordinates by name, or for all of them; what the
constraints do not allow is projected, and said.
"""

from __future__ import annotations

import warnings

import numpy as np

from ncgen.errors import ModelError
from ncgen.solver.assembly import assemble
from ncgen.solver.formalisms.instant import scaled_mass
from ncgen.solver.formalisms.kkt import KKT
from ncgen.solver.partition import Partition, kinematics
from ncgen.solver.projection import project_velocity
from ncgen.solver.protocol import Kernels
from ncgen.solver.rank import scaled_jacobian

NOTICEABLE = 1e-9
"""Changes of a given velocity up to this, relative to the largest velocity, are rounding and not reported."""


def closed_position(kernels: Kernels, q, t: float, p) -> np.ndarray:
    """The start closed; a warning says what moved most if it was open."""
    closed = assemble(kernels, q, t, p)
    moved = np.abs(closed - q)
    if np.any(moved > 0):
        most = int(np.argmax(moved))
        warnings.warn(
            f"{kernels.name}: the initial position was open and has been assembled; {kernels.coordinates[most]} moved most, "
            f"by {moved[most]:.3g}",
            stacklevel=3,
        )
    return closed


def velocity_from_rates(kernels: Kernels, partition: Partition, rates, q, t: float, p) -> np.ndarray:
    """All velocities (n,) from those of the independent coordinates."""
    frame = kinematics(kernels, partition, q, t, p)
    return frame.R @ rates + frame.particular(kernels.nu(q, t, p))


def given_velocity(kernels: Kernels, qd0, q, t: float, p) -> np.ndarray:
    """All velocities (n,) from `qd0`, an array over the coordinates or {name: rate}.

    Rates by name leave the others free: they become those of least kinetic energy. A warning with the number says
    where the constraints did not allow what was given.
    """
    wanted = _by_name(kernels, qd0) if isinstance(qd0, dict) else dict(enumerate(_all(kernels, qd0)))
    where, rates = np.array(list(wanted), dtype=int), np.array(list(wanted.values()), dtype=float)
    qd = _least_energy(kernels, where, rates, q, t, p) if isinstance(qd0, dict) else rates
    allowed = project_velocity(kernels, q, qd, t, p)
    changed = np.abs(allowed[where] - rates) / kernels.column_sizes[where]
    if np.max(changed, initial=0.0) > NOTICEABLE * np.max(np.abs(allowed / kernels.column_sizes), initial=0.0):
        most = where[int(np.argmax(changed))]
        warnings.warn(
            f"{kernels.name}: the initial velocities contradict the constraints and have been projected; "
            f"rate({kernels.coordinates[most]}) changed most, from {wanted[most]:.6g} to {allowed[most]:.6g}",
            stacklevel=3,
        )
    return allowed


def _least_energy(kernels: Kernels, where, rates, q, t: float, p) -> np.ndarray:
    """Velocities of least kinetic energy among those with the given rates: the given ones are rows like the others."""
    sizes = kernels.column_sizes
    rows = np.vstack([scaled_jacobian(kernels, q, t, p), np.eye(kernels.n)[where]])
    right = np.concatenate([kernels.nu(q, t, p) / kernels.row_sizes, rates / sizes[where]])
    return sizes * KKT(scaled_mass(kernels, q, t, p)[0], rows, kernels.name).solve(np.zeros(kernels.n), right)[0]


def _by_name(kernels: Kernels, qd0: dict) -> dict[int, float]:
    for name, rate in qd0.items():
        if name not in kernels.index:
            raise ModelError(f"qd0: {kernels.name} has no free coordinate {name}; it has {', '.join(kernels.coordinates)}")
        if not (np.isscalar(rate) and np.isreal(rate) and np.isfinite(rate)):
            raise ModelError(f"qd0: the rate of {name} is {rate!r}; it must be a finite number")
    return {kernels.index[name]: float(rate) for name, rate in qd0.items()}


def _all(kernels: Kernels, qd0) -> np.ndarray:
    try:
        rates = np.asarray(qd0, dtype=float)
    except (TypeError, ValueError):
        rates = np.array([np.nan])
    if rates.shape != (kernels.n,) or not np.all(np.isfinite(rates)):
        raise ModelError(f"qd0: {kernels.n} finite numbers needed, one a free coordinate, or {{name: rate}}")
    return rates
