"""Where something stands: a rotation and a position."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from ncgen.model.arithmetic import product, unit
from ncgen.model.shapes import rotation_of

MIN_PITCH_COSINE = 1e-9
"""Cosine of the pitch below which roll and yaw are one."""


def rotation_about(axis: np.ndarray, angle: float) -> np.ndarray:
    """The rotation (3, 3) by an angle (rad) about an axis of length 1: Rodrigues' formula."""
    skew = _skew(axis)
    return np.eye(3) + np.sin(angle) * skew + (1 - np.cos(angle)) * product(skew, skew)


def _skew(v: np.ndarray) -> np.ndarray:
    """The matrix (3, 3) of the cross product with v from the left."""
    x, y, z = v
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


@dataclass(frozen=True, eq=False)
class Placement:
    """A frame in another one. rotation (3, 3): its axes as columns; position (3,): its origin (m)."""

    rotation: np.ndarray = field(default_factory=lambda: np.eye(3))
    position: np.ndarray = field(default_factory=lambda: np.zeros(3))

    @classmethod
    def of_rpy(cls, position: tuple[float, ...], rpy: tuple[float, ...]) -> Placement:
        """From roll, pitch and yaw about the fixed axes x, y, z (rad)."""
        return cls(rotation_of(rpy), np.array(position, dtype=float))

    @classmethod
    def of_quaternion(cls, position: np.ndarray, quaternion: np.ndarray) -> Placement:
        """quaternion: w, x, y, z."""
        w, *along = unit(quaternion)
        skew = _skew(np.array(along))
        return cls(np.eye(3) + 2 * w * skew + 2 * product(skew, skew), np.array(position, dtype=float))

    def __matmul__(self, other: Placement) -> Placement:
        """A frame that is given in this one."""
        return Placement(product(self.rotation, other.rotation), self.at(other.position))

    def at(self, point: np.ndarray) -> np.ndarray:
        """A point of the frame."""
        return self.position + product(self.rotation, point)

    def along(self, direction: np.ndarray) -> np.ndarray:
        """A direction of the frame."""
        return product(self.rotation, direction)

    @property
    def rpy(self) -> tuple[float, float, float]:
        """Roll, pitch and yaw about the fixed axes x, y, z (rad); near a pitch of a quarter turn the roll is 0."""
        (xx, _, _), (yx, yy, yz), (zx, zy, zz) = self.rotation
        level = math.hypot(zy, zz)
        if level < MIN_PITCH_COSINE:
            return 0.0, math.atan2(-zx, level), math.atan2(-self.rotation[0, 1], yy)
        return math.atan2(zy, zz), math.atan2(-zx, level), math.atan2(yx, xx)

    @property
    def quaternion(self) -> tuple[float, float, float, float]:
        """w, x, y, z with w not negative: from the largest of the four, so that no digits are lost."""
        (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = self.rotation
        fours = (
            (1 + xx + yy + zz, zy - yz, xz - zx, yx - xy),
            (zy - yz, 1 + xx - yy - zz, xy + yx, xz + zx),
            (xz - zx, xy + yx, 1 - xx + yy - zz, yz + zy),
            (yx - xy, xz + zx, yz + zy, 1 - xx - yy + zz),
        )
        best = unit(max(fours, key=lambda row: row[fours.index(row)]))
        w, x, y, z = (best if best[0] >= 0 else -best).tolist()
        return w, x, y, z

    def inverse(self) -> Placement:
        return Placement(self.rotation.T, -product(self.rotation.T, self.position))
