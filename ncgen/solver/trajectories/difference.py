"""Two motions compared with each other: how far they are apart, where, and when."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ncgen.errors import ModelError
from ncgen.solver.argument_checks import listed_names

if TYPE_CHECKING:
    from ncgen.solver.trajectories.trajectory import Trajectory

MAX_LISTED = 5
"""Coordinates that a difference names when it is printed."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Difference:
    """The first motion less the second, at those instants t (K,) in s of the first that both have.

    q, qd (K, n): in m and rad, and per second, in the order of `coordinates`; sizes (n,): the coordinates' natural sizes
    """

    coordinates: tuple[str, ...]
    t: np.ndarray
    q: np.ndarray
    qd: np.ndarray
    sizes: np.ndarray

    @property
    def largest(self) -> dict[str, tuple[float, float]]:
        """{coordinate: (the largest difference without its sign, when)}, and of velocities as `rate(…)`; the largest in natural sizes
        comes first."""
        names = (*self.coordinates, *(f"rate({name})" for name in self.coordinates))
        apart = np.abs(np.hstack([self.q, self.qd]))
        at = apart.argmax(axis=0)
        order = np.argsort(-apart.max(axis=0) / np.tile(self.sizes, 2), kind="stable")
        return {names[k]: (float(apart[at[k], k]), float(self.t[at[k]])) for k in order.tolist()}

    def __str__(self) -> str:
        largest = [*self.largest.items()][:MAX_LISTED]
        width = max((len(name) for name, _ in largest), default=0)
        lines = [f"{name:<{width}}  {value:.3e} at {t:g} s" for name, (value, t) in largest]
        return "\n".join([f"{len(self.t)} instants from {self.t[0]:g} to {self.t[-1]:g} s; the largest differences", *lines])


def difference(one: Trajectory, other: Trajectory) -> Difference:
    """One motion less another of the same coordinates. Between the other's instants stand the cubics through its positions and
    velocities, and these cubics' own rates.

    Raises ModelError where the coordinates are others, or no instant is common to both.
    """
    if one.coordinates != other.coordinates:
        apart = [name for name in (*one.coordinates, *other.coordinates) if (name in one) != (name in other)]
        contrast = f"{listed_names(apart)} only in one of them" if apart else "in another order"
        raise ModelError(f"{one.name} and {other.name} cannot be compared: the models differ in their coordinates, {contrast}")
    common = (one.t >= other.t[0]) & (one.t <= other.t[-1])
    if not common.any():
        spans = [f"{run.t[0]:g} to {run.t[-1]:g} s" for run in (one, other)]
        raise ModelError(f"{one.name}: two motions without a common instant, {spans[0]} and {spans[1]}; run them over the same time")
    t = one.t[common]
    q, qd = _at(other, t)
    return Difference(coordinates=one.coordinates, t=t, q=one.q[common] - q, qd=one.qd[common] - qd, sizes=one.kernels.column_sizes)


def _at(run: Trajectory, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Positions and velocities at instants within a motion; those of its own instants as they are."""
    index = np.searchsorted(run.t, t)
    is_output = run.t[index] == t
    q, qd = run.q[index], run.qd[index]
    if not is_output.all():
        from scipy.interpolate import CubicHermiteSpline

        between = CubicHermiteSpline(run.t, run.q, run.qd)
        q[~is_output], qd[~is_output] = between(t[~is_output]), between(t[~is_output], 1)
    return q, qd
