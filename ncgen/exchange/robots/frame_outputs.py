"""Frames of a robot as outputs of its model, for runs and for all exports: NAME.x, NAME.y, NAME.z, and NAME.r11 to NAME.r33."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from ncgen.errors import ModelError
from ncgen.exchange.robots.passive import expressions
from ncgen.model import Model
from ncgen.model.bodies import BodyFrame
from ncgen.model.elements import AXES, Combination
from ncgen.solver.argument_checks import echo
from ncgen.solver.joints.link_frames import frame_named

if TYPE_CHECKING:
    from ncgen.model.values import Driven


def add_frame_outputs(model: Model, names: Sequence[str]) -> None:
    """Outputs of each frame's position (m, global) and rotation (its axes are the columns). Raises ModelError for what is no frame."""
    if isinstance(names, str) or not all(isinstance(name, str) for name in names):
        raise ModelError(f"frames: {echo(names)} given; give a list of names")
    for name in dict.fromkeys(names):
        frame = frame_named(model, name)
        if frame.body == model.ground.name:
            columns: list[Sequence[Driven]] = [list(map(float, column)) for column in (frame.position, *frame.rotation.T)]
        else:
            position, axes = carried(model, frame)
            columns = [expressions(each).flat() for each in (position, *axes)]
        for i, axis in enumerate(AXES):
            model.output(f"{name}.{axis}", columns[0][i], "m")
        for i in range(3):
            for j in range(3):
                model.output(f"{name}.r{i + 1}{j + 1}", columns[1 + j][i], "1")
        model.frames[name] = frame._replace(is_output=True)


def carried(model: Model, frame: BodyFrame) -> tuple[Combination, list[Combination]]:
    """The origin and the three axes of a frame as they move with its body."""
    body = model.bodies[frame.body]
    axes = [model.direction_of(body, axis, "axis") for axis in frame.rotation.T.tolist()]
    return model.attached(body, frame.position.tolist(), "frame"), axes
