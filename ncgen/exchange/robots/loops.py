"""Loops described next to a robot's file whose format knows none, in a small table of TOML:

    [[connect]]               # a ball: a point of the parent is one of the child, too
    name = "rod_end"
    parent = "crank"
    child = "slider"
    point = [0.1, 0.0, 0.0]   # m, in the parent's frame of the file

    [[revolute]]              # the same and an axis, in the parent's frame
    [[prismatic]]
    axis = [0.0, 1.0, 0.0]

    [[weld]]                  # nothing moves; without a point

The point of the child is what stands there when all joints are at 0. Or two frames are named, which are links of the file:

    [[weld]]                  # revolute and prismatic have an axis in both, else z; sites and frames of a file may be named, too
    parent_frame = "rod_end"
    child_frame = "slider_pin"

and the robot is assembled: its joints begin where the frames meet (`ncgen.exchange.robots.closures`).

Of Gepetto's parallel robots (github.com/Gepetto/example-parallel-robots) the `robot.yaml` next to `robot.urdf` is read as it is.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import NoReturn

import numpy as np

from ncgen.errors import ModelError, shown
from ncgen.exchange.robots.closures import Closure, closures_of, with_closures
from ncgen.exchange.robots.loop_files import YAML
from ncgen.exchange.robots.parallel_robots import with_yaml
from ncgen.exchange.robots.placement import Placement
from ncgen.exchange.robots.robot import Robot, frame_of
from ncgen.exchange.text import NotToml, placed, text_of, toml
from ncgen.model.arithmetic import norm, unit
from ncgen.model.values import MAX_NUMBER

KINDS = {"connect": "spherical", "revolute": "revolute", "prismatic": "prismatic", "weld": "fixed"}
"""{word: kind of joint}."""

KEYS = ("name", "parent", "child", "point", "axis", "parent_frame", "child_frame")


def closed(robot: Robot, path: Path) -> Robot:
    """The robot with the loops of a table, assembled. Raises ModelError with the file, and the loop by its kind and number."""
    if path.suffix in YAML:
        robot, loops = with_yaml(robot, path)
    else:
        try:
            table = toml(text_of(path))
        except NotToml as error:
            raise ModelError(placed(path.name, error.line, str(error))) from None
        reader = _Reader(robot, robot.frames(Placement()), path)
        loops = [
            reader.loop(kind, number, each) for kind, tables in table.items() for number, each in enumerate(reader.tables(kind, tables), 1)
        ]
    names = [joint.name for joint in (*robot.joints, *robot.loops)] + [loop.name for loop in loops]
    for loop in loops:
        if names.count(loop.name) > 1:
            raise ModelError(placed(path.name, None, f"there are two joints {shown(loop.name)}; rename the loop"))
    return with_closures(robot, [*closures_of(robot), *loops])


class _Reader:
    def __init__(self, robot: Robot, frames: Mapping[str, Placement], path: Path) -> None:
        self.robot, self.frames, self.path = robot, frames, path

    def tables(self, kind: str, tables: object) -> list[dict[str, object]]:
        if kind not in KINDS:
            self.refuse(f"there is no kind of loop {shown(kind)}; known are {', '.join(KINDS)}")
        if not isinstance(tables, list) or not all(isinstance(table, dict) for table in tables):
            self.refuse(f"{kind} is no list of tables; write [[{kind}]]")
        return tables

    def loop(self, kind: str, number: int, table: Mapping[str, object]) -> Closure:
        where = f"{kind} {number}"
        if unknown := [key for key in table if key not in KEYS]:
            self.refuse(f"{where}: {shown(unknown[0])} is not known; give {', '.join(KEYS)}")
        by_frames = "parent_frame" in table or "child_frame" in table
        if by_frames:
            one, other = (self._frame(table, f"{key}_frame", where) for key in ("parent", "child"))
            ends, placements = (one[0], other[0]), [one[1], other[1]]
        else:
            ends, placements = tuple(self._link(table, key, where) for key in ("parent", "child")), []
        if ends[0] == ends[1]:
            self.refuse(f"{where}: it joins link {ends[0]} to itself; name two links")
        if by_frames and (mixed := next((key for key in ("parent", "child", "point") if key in table), None)):
            self.refuse(f"{where}: it has frames and {mixed}; leave {mixed} out")
        has_point = by_frames or kind in ("weld", "prismatic")
        point = self._three(table.get("point", [0.0, 0.0, 0.0] if has_point else None), f"{where}: point")
        has_axis = not by_frames and kind in ("revolute", "prismatic")
        axis = self._three(table.get("axis", None if has_axis else [0.0, 0.0, 1.0]), f"{where}: axis")
        if not norm(axis) > 0:
            self.refuse(f"{where}: its axis is 0 0 0; give a direction")
        name = table.get("name", f"{kind}{number}")
        if not isinstance(name, str):
            self.refuse(f"{where}: its name is {shown(name)}; give a text")
        if by_frames:
            on_parent, on_child = placements
        else:
            on_parent = (self.robot.links[ends[0]].origin or Placement()) @ Placement(position=point)
            on_child = self.frames[ends[1]].inverse() @ self.frames[ends[0]] @ on_parent
        return Closure(
            name=name,
            kind=KINDS[kind],
            parent=ends[0],
            child=ends[1],
            on_parent=on_parent,
            on_child=on_child,
            axis=unit(axis),
            where=f"{self.path.name}, {where}",
        )

    def _link(self, table: Mapping[str, object], key: str, where: str) -> str:
        name = table.get(key)
        if not isinstance(name, str) or name not in self.robot.links:
            self.refuse(f"{where}: its {key} {shown(name)} is no link of {self.robot.name}")
        return name

    def _frame(self, table: Mapping[str, object], key: str, where: str) -> tuple[str, Placement]:
        name = table.get(key)
        frame = frame_of(self.robot, name) if isinstance(name, str) else None
        return frame or self.refuse(f"{where}: its {key} {shown(name)} is no link or frame of {self.robot.name}")

    def _three(self, value: object, key: str) -> np.ndarray:
        if (
            not isinstance(value, list)
            or len(value) != 3
            or not all(isinstance(x, (int, float)) and not isinstance(x, bool) and abs(x) <= MAX_NUMBER for x in value)
        ):
            self.refuse(f"{key} is {shown(value)}; give three numbers of at most {MAX_NUMBER:g}")
        return np.array(value, dtype=float)

    def refuse(self, problem: str) -> NoReturn:
        raise ModelError(placed(self.path.name, None, problem))
