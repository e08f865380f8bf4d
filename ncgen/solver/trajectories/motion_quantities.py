"""Points, vectors, bodies, energies and constraint violations along a motion."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Self

import numpy as np

from ncgen.errors import ModelError
from ncgen.model.elements import Element, Point, Vector
from ncgen.solver import frames, geometry
from ncgen.solver.argument_checks import echo, offer
from ncgen.solver.positions.branches import refresh_branches
from ncgen.solver.positions.position import residual
from ncgen.solver.trajectories.energy import Instants, drift, energies
from ncgen.solver.trajectories.grid_motion import GridMotion

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation


@dataclass(frozen=True, eq=False, kw_only=True)
class MotionQuantities(GridMotion):
    """What follows from positions, velocities and accelerations at every time."""

    def point(self, name: str) -> np.ndarray:
        """Return the positions of a point.

        Parameters
        ----------
        name : str
            Name of a point.

        Returns
        -------
        numpy.ndarray
            Global coordinates (m), shape (K, 3).

        Raises
        ------
        ModelError
            If there is no such point.
        """
        return geometry.element(self.kernels, self._named(name, Point), self.q, self.p)

    def vector(self, name: str) -> np.ndarray:
        """Return the components of a unit vector.

        Parameters
        ----------
        name : str
            Name of a vector.

        Returns
        -------
        numpy.ndarray
            Global components, shape (K, 3).

        Raises
        ------
        ModelError
            If there is no such vector.
        """
        return geometry.element(self.kernels, self._named(name, Vector), self.q, self.p)

    def velocity(self, name: str) -> np.ndarray:
        """Return the velocity of a point, or the rate of a unit vector.

        Parameters
        ----------
        name : str
            Name of a point or of a vector.

        Returns
        -------
        numpy.ndarray
            Global components (m/s, or 1/s), shape (K, 3).

        Raises
        ------
        ModelError
            If the model has no such point or vector.
        """
        return geometry.element_rate(self.kernels, self._named(name, Point, Vector), self.qd)

    def acceleration(self, name: str) -> np.ndarray:
        """Return the acceleration of a point, or the second derivative of a unit vector.

        Parameters
        ----------
        name : str
            Name of a point or of a vector.

        Returns
        -------
        numpy.ndarray
            Global components (m/s², or 1/s²), shape (K, 3).

        Raises
        ------
        ModelError
            If the model has no such point or vector.
        """
        return geometry.element_rate(self.kernels, self._named(name, Point, Vector), self.qdd)

    def _named(self, name: str, *kinds: type[Element]) -> Element:
        known = {e.name: e for e in self.model.elements.values() if isinstance(e, kinds)}
        if name not in known:
            kind = " or ".join(kind.__name__.lower() for kind in kinds)
            raise ModelError(f"{self.name} has no {kind} {echo(name)}; {offer(name, tuple(known))}")
        return known[name]

    def rotation(self, body: str) -> Rotation:
        """Return the orientation of a body relative to the initial position.

        Euler angles, Bryant angles and Euler parameters (the paper's eqs 1-5) are its views: `.as_euler("ZXZ")`, `.as_euler("XYZ")`,
        `.as_quat(scalar_first=True)`.

        Parameters
        ----------
        body : str
            Name of a body.

        Returns
        -------
        scipy.spatial.transform.Rotation
            Rotations at K times.
        """
        return frames.rotation(self.kernels, body, self.q, self.p)

    def angular_velocity(self, body: str) -> np.ndarray:
        """Return the angular velocity of a body.

        Parameters
        ----------
        body : str
            Name of a body.

        Returns
        -------
        numpy.ndarray
            Global components (rad/s), shape (K, 3).
        """
        return frames.angular_velocity(self.kernels, body, self.q, self.qd, self.p)

    def energy(self) -> np.ndarray:
        """Return energies and the power of forces without a potential.

        Returns
        -------
        numpy.ndarray
            Kinetic and potential energy (J) and power (W), shape (K, 3).
        """
        return energies(self.kernels, self.t, self.q, self.qd, self.p)

    @cached_property
    def energy_drift(self) -> float:
        """The largest |T + V − W − its start|, relative to the energy that moves (largest T or change of V); 0 where it is rounding."""
        return drift(self.kernels, Instants(self.t, self.q, self.qd, self.work), self.p)

    def thinned(self, count: int) -> Self:
        """Return the same motion at fewer times.

        Parameters
        ----------
        count : int
            How many times to keep.

        Returns
        -------
        Trajectory
            The motion at `count` of its times, or at all if it has fewer.
        """
        kept = np.unique(np.linspace(0, len(self.t) - 1, count).round().astype(int))
        return replace(self, t=self.t[kept], q=self.q[kept], qd=self.qd[kept], work=self.work[kept])

    def violation(self) -> np.ndarray:
        """Return the largest constraint violation at every time.

        Of an angle in the paper's form only the equation that is in force counts.

        Returns
        -------
        numpy.ndarray
            Largest |Φ| relative to the natural sizes of the constraints, shape (K,).
        """
        return np.array(
            [residual(self.kernels, q, t, refresh_branches(self.kernels, q, self.p)) for t, q in zip(self.t, self.q, strict=True)]
        )
