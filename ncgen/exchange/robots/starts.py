"""Named states of a robot's file as starts of a run: natural coordinates where all joints have the values of the state."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from ncgen.exchange.robots.placement import Placement, rotation_about
from ncgen.exchange.robots.robot import Joint, Robot, RobotState
from ncgen.model.arithmetic import cross
from ncgen.model.elements import Point, Relative, Spatial


@dataclass(frozen=True, eq=False)
class _Moving:
    """A frame in the world, the velocity of its origin (3,) in m/s, and its angular velocity (3,) in rad/s."""

    frame: Placement
    velocity: np.ndarray
    turning: np.ndarray


class NamedStarts(Mapping[str, dict[str, Any]]):
    """Arguments of `ncgen.simulate` for the states of a file, by name, each found when it is asked for: most runs begin elsewhere.

    robot: without fixed joints; frames: of its links where the model begins; members: elements by links; coordinates: by joint
    """

    def __init__(
        self,
        robot: Robot,
        frames: Mapping[str, Placement],
        members: Mapping[str, Iterable[Spatial]],
        coordinates: Mapping[str, Relative],
    ) -> None:
        self._robot, self._frames, self._members, self._coordinates = robot, frames, members, coordinates
        self._known: dict[str, dict[str, Any]] = {}

    def __getitem__(self, name: str) -> dict[str, Any]:
        if name not in self._known:
            self._known[name] = named_start(self._robot.starts[name], self._robot, self._frames, self._positions, self._coordinates)
        return self._known[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._robot.starts)

    def __len__(self) -> int:
        return len(self._robot.starts)

    def __repr__(self) -> str:
        return repr(dict(self))

    def __reduce__(self) -> tuple[type, tuple[dict[str, dict[str, Any]]]]:
        """What copies and pickles have: a dictionary."""
        return dict, (dict(self),)

    @cached_property
    def _positions(self) -> dict[Spatial, tuple[str, np.ndarray]]:
        return positions_in_links(self._members, self._frames)


def positions_in_links(members: Mapping[str, Iterable[Spatial]], frames: Mapping[str, Placement]) -> dict[Spatial, tuple[str, np.ndarray]]:
    """{element: its link, and where it is in the link's frame (3,)}, of elements by links; frames: as of `named_start`."""
    positions: dict[Spatial, tuple[str, np.ndarray]] = {}
    for name, elements in members.items():
        inverse = frames[name].inverse()
        for each in elements:
            positions[each] = name, inverse.at(each.initial) if isinstance(each, Point) else inverse.along(each.initial)
    return positions


def named_start(
    start: RobotState,
    robot: Robot,
    frames: Mapping[str, Placement],
    positions: Mapping[Spatial, tuple[str, np.ndarray]],
    coordinates: Mapping[str, Relative],
) -> dict[str, Any]:
    """Arguments of `ncgen.simulate` for a state of a file.

    robot: without fixed joints; frames: of its links where the model begins; positions: of `positions_in_links`; coordinates: by joint
    """
    still = np.zeros(3)
    moving = {robot.root: _Moving(frames[robot.root], still, still)}
    for joint in robot.joints:
        moving[joint.child] = _carried(moving[joint.parent], joint, start)
    q0, qd0 = dict[str, float](), dict[str, float]()
    for element, (link, local) in positions.items():
        now, is_point = moving[link], isinstance(element, Point)
        arm = now.frame.along(local)
        position, rate = (now.frame.position + arm if is_point else arm), cross(now.turning, arm) + (now.velocity if is_point else 0.0)
        for component, value, change in zip(element.components, position.tolist(), rate.tolist(), strict=True):
            if not component.fixed:
                q0[component.name], qd0[component.name] = value, change
    for joint, coordinate in coordinates.items():
        if joint in start.values:
            q0[coordinate.name], qd0[coordinate.name] = start.values[joint], start.rates.get(joint, 0.0)
    start_values: dict[str, Any] = {"q0": q0}
    start_values |= {"qd0": qd0} if any(qd0.values()) else {}
    return start_values | ({"t0": start.time} if start.time else {})


def _carried(parent: _Moving, joint: Joint, start: RobotState) -> _Moving:
    """A joint's child where the joint has the values of a start."""
    if joint.name in start.free:
        frame, velocity, turning = start.free[joint.name]
        return _Moving(frame, velocity, frame.along(turning))
    at_joint = parent.frame @ joint.placement
    arm = at_joint.position - parent.frame.position
    velocity, turning = parent.velocity + cross(parent.turning, arm), parent.turning
    value, rate = start.values.get(joint.name, joint.start) - joint.start, start.rates.get(joint.name, 0.0)
    axis = at_joint.along(joint.axis)
    if joint.kind == "revolute":
        return _Moving(at_joint @ Placement(rotation_about(joint.axis, value)), velocity, turning + rate * axis)
    if joint.kind == "prismatic":
        slid = value * axis
        return _Moving(at_joint @ Placement(position=value * joint.axis), velocity + rate * axis + cross(turning, slid), turning)
    if joint.name in start.turned:
        rotation, velocity_in_joint = start.turned[joint.name]
        child = at_joint @ Placement(rotation)
        return _Moving(child, velocity, turning + child.along(velocity_in_joint))
    return _Moving(at_joint, velocity, turning)
