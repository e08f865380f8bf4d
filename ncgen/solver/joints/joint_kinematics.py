"""Velocities, Jacobians and inverse kinematics over the joint velocities."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import ArrayLike

from ncgen.errors import ModelError
from ncgen.files import argument_was
from ncgen.mechanism.shared_docstrings import shares
from ncgen.model.elements import Point
from ncgen.solver import argument_checks
from ncgen.solver.frames import transformation
from ncgen.solver.joints.joint_names import carried, refuse_thin
from ncgen.solver.joints.joint_positions import ARGUMENTS, JointPositions
from ncgen.solver.joints.link_frames import LinkFrame

if TYPE_CHECKING:
    from ncgen.solver.joints.inverse_kinematics import Target

FRAMES = ("global", "local", "spatial")
"""In which axes a Jacobian may be given."""


@shares(**ARGUMENTS)
class JointKinematics(JointPositions):
    """Positions, velocities and Jacobians: what `JointSpace` answers without forces."""

    @argument_was("place", "position")
    def inverse_kinematics(
        self,
        point: str | Mapping[str, Target],
        position: ArrayLike | None = None,
        rotation: ArrayLike | None = None,
        body: str | None = None,
        start: Mapping[str, float] | None = None,
        limits: bool = True,
    ) -> dict[str, float]:
        """Compute values of the joints that bring frames to poses, or a point to a position.

        The solution is by least squares from a start, and from some next to it. Joints that are at a limit are named in a warning.

        Parameters
        ----------
        point : str or dict
            Targets {frame: (rotation (3, 3), position (3,) in m)} as `LinkFrame.pose` gives them, None for any rotation or position; or
            the name of a point, to which the next three arguments belong.
        position : array_like, optional
            Position (3,) of the point in m.
        rotation : array_like, optional
            Rotation (3, 3) of the body since the initial position; None for any.
        body : str, optional
            The body of the point; by default that nearest to the ground.
        start : dict of str to float, optional
            Values of joints to begin with; others are those of the initial position.
        limits : bool, optional
            Whether to keep to the limits of the robot's file (`model.limits`).

        Returns
        -------
        dict of str to float
            Values (m, rad) by the names of rates.

        Raises
        ------
        ConvergenceError
            If the target is not reached; the message has what is left, and the joints at limits.
        """
        from ncgen.solver.joints.inverse_kinematics import aims_of, values_for

        return values_for(self, aims_of(self, point, position, rotation, body), self._joint_values(start, "start"), limits)

    def centre_of_mass(self, q: ArrayLike) -> np.ndarray:
        """Compute the centre of mass of all bodies that move.

        Returns
        -------
        numpy.ndarray
            Positions (m), shape (…, 3).
        """
        mass, first, _ = self._momenta(q)
        return first / mass

    @abstractmethod
    def _spread(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """R (…, rates of the tree, n) and what its rates are where those of the joints are 0 (…, rates of the tree)."""

    @abstractmethod
    def _spread_rate(self, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        """How R changes with time at rates v of the joints (…, rates of the tree, n)."""

    @abstractmethod
    def _own(self) -> Mapping[int, int]:
        """{coordinate of no body: number of its rate among the tree's}."""

    def screws(self, q: ArrayLike) -> np.ndarray:
        """Compute the screw of every rate of the tree of bodies.

        Returns
        -------
        numpy.ndarray
            Angular velocity, and velocity at the origin, of what a rate moves, shape (…, -, 6). Without loops the rates are those of
            the joints.
        """
        rows = self._of("joint_screws", q)
        return rows.reshape(*rows.shape[:-1], -1, 6)

    def velocities(self, q: ArrayLike, v: ArrayLike) -> np.ndarray:
        """Compute the velocities of all natural coordinates from those of the joints.

        Returns
        -------
        numpy.ndarray
            Velocities, shape (…, n_q).
        """
        q, v = self._array(q), self._over_rates(v, "v")
        spread, drift = self._spread(q)
        rates = np.einsum("...kn,...n->...k", spread, v) + drift
        screws = self.screws(q)
        twists = [np.einsum("...k,...ki->...i", rates[..., path], screws[..., path, :]) for path in self.tree.paths]
        qd = np.empty(np.broadcast_shapes(q.shape[:-1], v.shape[:-1]) + q.shape[-1:])
        for c, (element, axis) in self._where.items():
            twist = twists[self.tree.home[element]]
            qd[..., c] = carried(twist, self.element(element, q), isinstance(element, Point))[..., axis]
        for c, k in self._own().items():
            qd[..., c] = rates[..., k]
        return qd

    def jacobian(
        self, point: str, q: ArrayLike, body: str | None = None, frame: Literal["global", "local", "spatial"] = "global"
    ) -> np.ndarray:
        """Compute the Jacobian of a point of a body.

        Parameters
        ----------
        point : str
            Name of a point of the model.
        body : str, optional
            The body of the point; by default that nearest to the ground.
        frame : {"global", "local", "spatial"}, optional
            Global: of the point along global axes; local: along axes that turn with the body and are global initially; spatial: of the
            body at the origin, along global axes.

        Returns
        -------
        numpy.ndarray
            Velocity of the point, and angular velocity of the body, for rate 1 of every joint, shape (…, 6, n).
        """
        if not (isinstance(frame, str) and frame in FRAMES):
            raise ModelError(f"frame: {argument_checks.echo(frame)!r} is not one of {', '.join(FRAMES)}")
        q, element, link = self._array(q), self.point(point), self.link(point, body)
        path = self.tree.paths[link]
        screws, spread = self.screws(q)[..., path, :], self._spread(q)[0][..., path, :]
        turning, along = screws[..., :3], screws[..., 3:]
        if frame != "spatial":
            along = along + np.cross(turning, self.element(element, q)[..., None, :])
        halves = [np.einsum("...ki,...kn->...in", half, spread) for half in (along, turning)]
        if frame == "local":
            back = np.swapaxes(transformation(self.kernels, self.tree.links[link].body.name, q, self.p), -1, -2)
            halves = [back @ half for half in halves]
        return np.concatenate(halves, axis=-2)

    def frame(self, name: str) -> LinkFrame:
        """Return the frame of a link of the robot's file, also of one that is fixed to another.

        Parameters
        ----------
        name : str
            Name of the link or frame.

        Returns
        -------
        LinkFrame
            The frame with its pose, velocity and Jacobian.

        Raises
        ------
        ModelError
            If the file has no such link.
        """
        return LinkFrame(self, name)

    def centre_of_mass_jacobian(self, q: ArrayLike) -> np.ndarray:
        """Compute the Jacobian of the centre of mass.

        Returns
        -------
        numpy.ndarray
            Velocity for rate 1 of every joint, shape (…, 3, n).
        """
        mass, _, matrix = self._momenta(q)
        return np.einsum("...ki,...kn->...in", matrix[..., :3], self._spread(self._array(q))[0]) / mass[..., None]

    def _momenta(self, q: ArrayLike) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Mass (…, 1), first moment about the origin (…, 3), momenta about the origin of the tree's rates (…, -, 6)."""
        refuse_thin(self.kernels, self.tree)
        values = self._of("joint_momenta", q)
        if not np.all(values[..., 0] > 0):
            raise ModelError(f"{self.kernels.name}: nothing has mass; give a body one")
        return values[..., :1], values[..., 1:4], values[..., 4:].reshape(*values.shape[:-1], -1, 6)
