"""Loops that are closed in a robot's model after it was read: the robot is assembled and becomes the model again."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

from ncgen.errors import ModelError, shown
from ncgen.exchange.robots.natural import model_of
from ncgen.exchange.robots.robot import Robot, frame_of
from ncgen.model import Model
from ncgen.model.arithmetic import unit

KINDS = {"weld": "fixed", "ball": "spherical", "hinge": "revolute", "point": "spherical"}
"""{word of `Model.close`: kind of joint}."""


def built(robot: Robot, arguments: tuple[Any, ...]) -> Model:
    """The model of a robot, which can close loops. arguments: of `model_of`, after the robot"""
    model = model_of(robot, *arguments)
    model.closing = partial(closed, Reading(robot, arguments, len(model.facts)))
    return model


@dataclass(frozen=True)
class Reading:
    """How a model was made of a robot: arguments of `model_of` after the robot; facts: how many the model had then."""

    robot: Robot
    arguments: tuple[Any, ...]
    facts: int


def closed(reading: Reading, model: Model, ends: tuple[object, object], kind: str, axis: Sequence[float], name: str) -> Model:
    """The model with one loop more.

    Raises ModelError for a frame that the file does not have, a loop that cannot close, with its gap, and one that changes nothing.
    """
    from ncgen.exchange.robots.closures import Closure, closures_of, with_closures

    robot = reading.robot
    if len(model.facts) != reading.facts:
        raise ModelError(f"close {name}: the robot is assembled anew, and the model has more than its file; close loops before that")
    if name in {joint.name for joint in (*robot.joints, *robot.loops)}:
        raise ModelError(f"close {name}: there is a joint of that name already; choose another")
    two_ends = []
    for end in ends:
        frame = frame_of(robot, end) if isinstance(end, str) else None
        if frame is None:
            raise ModelError(f"close {name}: {shown(end)} is no link or frame of the file; known are {', '.join(model.frames)}")
        two_ends.append(frame)
    (parent, on_parent), (child, on_child) = two_ends
    if parent == child:
        raise ModelError(f"close {name}: both frames are on link {parent}, so it changes nothing; name frames of two links")
    closure = Closure(name=name, kind=KINDS[kind], parent=parent, child=child, on_parent=on_parent, on_child=on_child, axis=unit(axis))
    return built(with_closures(robot, [*closures_of(robot), closure]), reading.arguments)
