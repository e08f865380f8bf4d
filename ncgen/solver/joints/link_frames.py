"""Frames of a robot's links: pose, velocity, Jacobian and its derivative in joint space.

Jacobians have the velocity of the frame's origin above the angular velocity, and are expressed in one of three ways, as in Pinocchio:
"world-aligned" (along the global axes), "local" (along the frame's own axes), "world" (the velocity of what of the body is at the global
origin, along the global axes).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from ncgen.errors import ModelError
from ncgen.solver import argument_checks
from ncgen.solver.frames import transformation

if TYPE_CHECKING:
    from ncgen.model import Model
    from ncgen.model.bodies import BodyFrame
    from ncgen.solver.joints.joint_kinematics import JointKinematics

Reference: TypeAlias = Literal["world-aligned", "local", "world"]
REFERENCES = ("world-aligned", "local", "world")


def frame_named(model: Model, name: str) -> BodyFrame:
    """A frame of a model where it begins. Raises ModelError for a name that it does not have."""
    if isinstance(name, str) and name in model.frames:
        return model.frames[name]
    inner = [each for each in model.frames if isinstance(name, str) and each.endswith(f":{name}")]
    known = f"say {' or '.join(inner)}" if inner else argument_checks.offer(name, list(model.frames), "known:")
    raise ModelError(f"{model.name} has no frame {argument_checks.echo(name)}; {known}")


class LinkFrame:
    """A frame of a link. name: of the link in the robot's file; body: the body that it moves with, "ground" for what rests."""

    def __init__(self, space: JointKinematics, name: str) -> None:
        self.space, self.name, self._initial = space, name, frame_named(space.kernels.model, name)
        self.body = self._initial.body
        links = space.tree.links
        self._link = next((number for number, link in enumerate(links) if link.body.name == self.body), None)
        self._path = [] if self._link is None else list(space.tree.paths[self._link])

    def __repr__(self) -> str:
        return f"<LinkFrame {self.name} on {self.body}>"

    def pose(self, q: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
        """Rotation (…, 3, 3), the frame's axes as columns in global axes, and position (…, 3) in m, at natural coordinates q (…, n_q)."""
        q, start = self.space._array(q), self._initial
        if self._link is None:
            rotation, position = (np.broadcast_to(x, (*q.shape[:-1], *x.shape)).copy() for x in (start.rotation, start.position))
            return rotation, position
        point = self.space.tree.links[self._link].body.points[0]
        turn = transformation(self.space.kernels, self.body, q, self.space.p)
        return turn @ start.rotation, self.space.element(point, q) + turn @ (start.position - point.initial)

    def jacobian(self, q: ArrayLike, reference: Reference = "world-aligned") -> np.ndarray:
        """Velocity of the origin and angular velocity for rate 1 of every joint, (…, 6, n); m/s and rad/s a unit of the rate."""
        q, reference = self.space._array(q), self._checked(reference)
        return self._moved(q, self._rates(q)[0], reference)

    def velocity(self, q: ArrayLike, v: ArrayLike, reference: Reference = "world-aligned") -> np.ndarray:
        """Velocity of the origin (m/s) and angular velocity (rad/s), (…, 6), at rates v (…, n)."""
        q, v, reference = self.space._array(q), self.space._over_rates(v, "v"), self._checked(reference)
        spread, drift = self._rates(q)
        rates = np.einsum("...kn,...n->...k", spread, v) + drift
        return self._moved(q, rates[..., None], reference)[..., 0]

    def jacobian_derivative(self, q: ArrayLike, v: ArrayLike, reference: Reference = "world-aligned") -> np.ndarray:
        """How the Jacobian changes with time (…, 6, n) at rates v (…, n).

        Screws (u, r × u) are of second degree in natural coordinates, so their central difference along a motion is their derivative for
        any step, to rounding. Where loops are closed the rates of the tree for those of the independent joints change, too.
        """
        space, reference = self.space, self._checked(reference)
        q, v = space._array(q), space._over_rates(v, "v")
        rates = space.velocities(q, v)
        step = 1.0 / np.maximum(1.0, np.max(np.abs(rates), axis=-1, keepdims=True))
        ahead, behind = (self._screws(q + sign * step * rates) for sign in (1.0, -1.0))
        along, turning = ((a - b) / (2.0 * step[..., None]) for a, b in zip(ahead, behind, strict=True))
        if reference != "world":
            moving = self.velocity(q, v)
            _, axes = self._screws(q)
            position = self.pose(q)[1]
            along = along + np.cross(turning, position[..., None, :]) + np.cross(axes, moving[..., None, :3])
        spread, _ = self._rates(q)
        halves = [np.swapaxes(half, -1, -2) @ spread for half in (along, turning)]
        if reference == "local":
            back, now = np.swapaxes(self.pose(q)[0], -1, -2), self.jacobian(q)
            spin = self.velocity(q, v)[..., 3:, None]
            parts = (now[..., :3, :], now[..., 3:, :])
            halves = [back @ (half - np.cross(spin, block, axis=-2)) for half, block in zip(halves, parts, strict=True)]
        return np.concatenate(halves, axis=-2) + self._moved(q, space._spread_rate(q, v)[..., self._path, :], reference)

    def _screws(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Velocity of what is at the global origin, and angular velocity, of the joints that carry the frame (…, k, 3)."""
        screws = self.space.screws(q)[..., self._path, :]
        return screws[..., 3:], screws[..., :3]

    def _rates(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Rates of the joints that carry the frame for those of the space (…, k, n), and where these are 0 (…, k)."""
        spread, drift = self.space._spread(q)
        return spread[..., self._path, :], drift[..., self._path]

    def _moved(self, q: np.ndarray, rates: np.ndarray, reference: Reference) -> np.ndarray:
        """Velocity of the origin and angular velocity (…, 6, m) at m rates of each joint that carries the frame (…, k, m)."""
        along, turning = self._screws(q)
        rotation, position = self.pose(q)
        if reference != "world":
            along = along + np.cross(turning, position[..., None, :])
        halves = [np.swapaxes(half, -1, -2) @ rates for half in (along, turning)]
        if reference == "local":
            halves = [np.swapaxes(rotation, -1, -2) @ half for half in halves]
        return np.concatenate(halves, axis=-2)

    @staticmethod
    def _checked(reference: Reference) -> Reference:
        if reference not in REFERENCES:
            raise ModelError(f"reference: {argument_checks.echo(reference)} is not one of {', '.join(REFERENCES)}")
        return reference
