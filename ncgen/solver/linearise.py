"""Small motions beside a motion: the state matrix on independent coordinates, its eigenvalues and mode shapes."""

from __future__ import annotations

import warnings
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ncgen.errors import ModelError
from ncgen.mechanism.kernels import Kernels
from ncgen.solver.coordinate_partitioning import motion_at
from ncgen.solver.dynamics_jacobian import independent_motions, partitioned_jacobian
from ncgen.solver.finite import watched
from ncgen.solver.given import Given, checked_kernels
from ncgen.solver.partition import choose_partitions
from ncgen.solver.position import solve_position
from ncgen.solver.run import Initial
from ncgen.solver.start import given_velocity
from ncgen.solver.steady import drift

ZERO = 1e-6
"""Eigenvalues below this, relative to the mechanism's rates, are zeros: places, headings and speeds that nothing holds."""

UNSTEADY = (
    "the motion is neither rest in equilibrium nor steady, so the matrix is that of one instant, and its eigenvalues depend on the "
    "independent coordinates and say nothing about stability"
)


@dataclass(frozen=True, eq=False)
class Linearisation:
    """ẋ = A x for x = [δz; δż], beside a position and velocity.

    matrix: A (positions + velocities)²; positions, velocities: names of the independent coordinates and velocities
    shapes: δq = shapes δx (n, len(x)), over all `coordinates`
    steady: True beside an equilibrium, or a motion that a symmetry of the mechanism carries along (a wheel that rolls, a top that
        precesses): A is then that of a frame that moves along, in which nothing but small motions is left, and constant. Else A is
        that of one instant, and its eigenvalues depend on the independent coordinates
    """

    matrix: np.ndarray
    positions: tuple[str, ...]
    velocities: tuple[str, ...]
    coordinates: tuple[str, ...]
    shapes: np.ndarray
    steady: bool = True

    @cached_property
    def _pairs(self) -> tuple[np.ndarray, np.ndarray]:
        """Eigenvalues and vectors, by frequency, then by decay."""
        values, vectors = np.linalg.eig(self.matrix)
        real, imaginary = np.real(values), np.imag(values)
        order = np.lexsort((np.round(imaginary, 12), real, np.round(np.abs(imaginary), 9)))
        return values[order], vectors[:, order]

    @property
    def eigenvalues(self) -> np.ndarray:
        """All eigenvalues (1/s), complex, by frequency."""
        return self._pairs[0]

    @property
    def _swinging(self) -> np.ndarray:
        """Places of the eigenvalues with a positive imaginary part: one of each pair."""
        values = self.eigenvalues
        return np.flatnonzero(np.imag(values) > 1e-9 * np.max(np.abs(values), initial=0.0))

    @property
    def frequencies(self) -> np.ndarray:
        """Frequencies (Hz) of the modes that swing, ascending: |Im| / 2π."""
        return np.imag(self.eigenvalues[self._swinging]) / (2 * np.pi)

    @property
    def damping_ratios(self) -> np.ndarray:
        """Decay over natural frequency of the modes that swing; negative ones grow."""
        values = self.eigenvalues[self._swinging]
        return -np.real(values) / np.abs(values)

    def mode(self, k: int) -> dict[str, complex]:
        """{coordinate: amplitude} of the k-th mode that swings, the largest amplitude being 1."""
        if not 0 <= k < len(self._swinging):
            raise ModelError(f"mode {k}: there are {len(self._swinging)} modes that swing, numbered from 0")
        shape = self.shapes @ self._pairs[1][:, self._swinging[k]]
        shape = shape / shape[np.argmax(np.abs(shape))]
        return dict(zip(self.coordinates, shape.tolist(), strict=True))

    @property
    def stable(self) -> bool:
        """True if no eigenvalue grows, up to rounding, which of a zero that is there more than once becomes its root."""
        values, count = self.eigenvalues, len(self.positions)
        halves = (np.hsplit(half, [count]) for half in np.vsplit(self.matrix, [count]))
        (own, by_rates), (by_place, damping) = ([np.max(np.abs(part), initial=0.0) for part in half] for half in halves)
        rate = max(np.max(np.abs(values), initial=0.0), own, damping, np.sqrt(by_rates * by_place))
        growing = np.real(values)[np.abs(values) > ZERO * rate]
        return bool(np.max(growing, initial=0.0) <= 1e-8 * np.max(np.abs(values), initial=0.0))


def linearise(
    kernels: Kernels,
    q: Given | None = None,
    qd: Given | None = None,
    t: float = 0.0,
    p: Given | None = None,
    z: str | Iterable[str] | None = (),
) -> Linearisation:
    """Linearise at a position (default: the initial one) and a velocity (n,) (default: rest), which the constraints allow.

    z: names of the independent coordinates (default: the model's, else found by pivoting)
    Beside a motion that is not `steady` the matrix is that of this instant, with a warning. Exact, from the tangent kernels.
    q: numbers (n,) in m and rad, in the order of the coordinates, or {name: number}; qd likewise, per second, and p (n_p,); t: s
    Raises SingularError at a singular position, ModelError where a force of a Python function has no derivative and for what cannot be
    asked, DomainError naming what is not a number or has a derivative that is none.
    """
    initial = Initial.asked(checked_kernels(kernels), q0=q, qd0=qd, z=z, p=p, t0=t, names=("q", "zd", "qd", "t"))
    t, p = initial.t, initial.p
    if kernels.model.callbacks:
        raise ModelError(f"{kernels.name}: forces of Python functions have no derivative; write them as expressions to linearise")
    q = solve_position(kernels, initial.q, t, p).q
    partitions = choose_partitions(kernels, q, t, p, initial.z or kernels.model.chosen_independent)
    velocities, positions = partitions.velocity.independent, partitions.position.independent
    rates = np.zeros(len(velocities)) if initial.qd is None else given_velocity(kernels, initial.qd, q, t, p)[velocities]
    kernels = watched(kernels)
    now = motion_at(kernels, partitions.velocity, t, q, rates, p)
    swapped = partitioned_jacobian(kernels, partitions, now, p)[:-1, :-1]
    moving = drift(kernels, partitions, now, swapped, p)
    if moving is None:
        warnings.warn(f"{kernels.name}: {UNSTEADY}", stacklevel=2)
    else:
        swapped = swapped - moving
    order = np.roll(np.arange(len(swapped)), len(positions))
    shapes = np.hstack([independent_motions(kernels, partitions, now, p)[0], np.zeros((kernels.n, len(velocities)))])
    names = partitions.position.names(kernels), partitions.velocity.names(kernels)
    return Linearisation(swapped[np.ix_(order, order)], *names, kernels.coordinates, shapes, moving is not None)
