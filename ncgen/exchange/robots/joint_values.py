"""What joints of a robot do at their values: where the child is, about which axes it turns, and the robot with its joints moved."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from ncgen.exchange.robots.placement import Placement, rotation_about
from ncgen.exchange.robots.robot import Joint, Robot

TURNS = {"revolute": 1, "prismatic": 1, "spherical": 3, "universal": 2, "floating": 6, "planar": 3, "fixed": 0, "screw": 1}
"""Degrees of freedom of kinds of joints."""


def moved(robot: Robot, values: Mapping[str, np.ndarray]) -> Robot:
    """The robot with joints moved by these values, by their names; others stay where they are.

    values: m, rad; rotation vectors of balls, places and rotation vectors of free bodies
    """
    joints = []
    for joint in robot.joints:
        x = values.get(joint.name)
        if x is None or not np.any(x):
            joints.append(joint)
            continue
        placement = joint.placement @ motion(joint, x)
        axis = rotation_about(joint.second, -x[1]) @ joint.axis if joint.kind == "universal" and joint.second is not None else joint.axis
        start = joint.start + float(x[0]) if joint.kind in ("revolute", "prismatic") else joint.start
        joints.append(replace(joint, placement=placement, axis=axis, start=start))
    return replace(robot, joints=tuple(joints))


def motion(joint: Joint, x: np.ndarray) -> Placement:
    """The child's frame in the joint's at values (m, rad)."""
    if joint.kind == "prismatic":
        return Placement(position=x[0] * joint.axis)
    if joint.kind == "floating":
        return Placement(rotation_by(x[3:]), x[:3])
    if joint.kind == "universal":
        assert joint.second is not None, "a universal joint with one axis"
        return Placement(rotation_about(joint.axis, x[0]) @ rotation_about(joint.second, x[1]))
    if joint.kind == "revolute":
        return Placement(rotation_about(joint.axis, x[0]))
    return Placement(rotation_by(x))


def rotation_by(vector: np.ndarray) -> np.ndarray:
    """The rotation (3, 3) by a rotation vector (rad)."""
    angle = float(np.linalg.norm(vector))
    return np.eye(3) if angle == 0.0 else rotation_about(vector / angle, angle)


def rotation_vector(rotation: np.ndarray) -> np.ndarray:
    """The rotation vector (rad) of a rotation, by its quaternion."""
    w, x, y, z = Placement(rotation).quaternion
    size = math.hypot(x, y, z)
    return np.array([x, y, z]) * (2 * math.atan2(size, w) / size if size > 0 else 2.0)


def added(joint: Joint, x: np.ndarray, step: np.ndarray) -> np.ndarray:
    """Values after a step, which is in the child's axes where it turns in space."""
    if joint.kind == "spherical":
        return rotation_vector(rotation_by(x) @ rotation_by(step))
    if joint.kind == "floating":
        turn = rotation_by(x[3:])
        return np.concatenate([x[:3] + turn @ step[:3], rotation_vector(turn @ rotation_by(step[3:]))])
    return x + step


def screws(joint: Joint, frame: tuple[np.ndarray, np.ndarray]) -> list[tuple[np.ndarray, np.ndarray | None]]:
    """(axis, point on it) of what turns, (axis, None) of what slides, in the root's frame; frame: of the child."""
    turn, origin = frame
    if joint.kind == "prismatic":
        return [(turn @ joint.axis, None)]
    if joint.kind == "spherical":
        return [(turn[:, k], origin) for k in range(3)]
    if joint.kind == "floating":
        return [(turn[:, k], where) for where in (None, origin) for k in range(3)]
    axes = [joint.axis] if joint.second is None else [joint.axis, joint.second]
    return [(turn @ axis, origin) for axis in axes]
