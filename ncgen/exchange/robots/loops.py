"""Loops said beside a robot's file whose format knows none, in a small table of TOML:

    [[connect]]               # a ball: a point of the parent is one of the child, too
    name = "rod_end"
    parent = "crank"
    child = "slider"
    point = [0.1, 0.0, 0.0]   # m, in the parent's frame of the file

    [[revolute]]              # the same and an axis, in the parent's frame
    [[prismatic]]
    axis = [0.0, 1.0, 0.0]

    [[weld]]                  # nothing moves; without a point

Loops close where all joints are at 0: the point of the child is what stands there then.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import NoReturn

import numpy as np

from ncgen.errors import ModelError, shown
from ncgen.exchange.robots.placement import Placement
from ncgen.exchange.robots.robot import Joint, Robot
from ncgen.exchange.text import NotToml, placed, text_of, toml
from ncgen.files import is_file
from ncgen.model.arithmetic import norm, unit
from ncgen.model.values import LARGEST

KINDS = {"connect": "spherical", "revolute": "revolute", "prismatic": "prismatic", "weld": "fixed"}
"""{word: kind of joint}."""

KEYS = ("name", "parent", "child", "point", "axis")

SUFFIX = ".loops.toml"


def beside(path: Path) -> Path | None:
    """The table that belongs to a robot's file, if there is one."""
    found = path.with_suffix(SUFFIX)
    return found if is_file(found) else None


def closed(robot: Robot, path: Path) -> Robot:
    """The robot with the loops of a table. Raises ModelError with the file, and the loop by its kind and number."""
    try:
        said = toml(text_of(path))
    except NotToml as error:
        raise ModelError(placed(path.name, error.line, str(error))) from None
    reader = _Reader(robot, robot.frames(Placement()), path)
    loops = [
        reader.loop(kind, number, table) for kind, tables in said.items() for number, table in enumerate(reader.tables(kind, tables), 1)
    ]
    names = [joint.name for joint in (*robot.joints, *robot.loops, *loops)]
    for loop in loops:
        if names.count(loop.name) > 1:
            raise ModelError(placed(path.name, None, f"there are two joints {shown(loop.name)}; rename the loop"))
    return replace(robot, loops=(*robot.loops, *loops))


class _Reader:
    def __init__(self, robot: Robot, frames: Mapping[str, Placement], path: Path) -> None:
        self.robot, self.frames, self.path = robot, frames, path

    def tables(self, kind: str, tables: object) -> list[dict[str, object]]:
        if kind not in KINDS:
            self.refuse(f"there is no kind of loop {shown(kind)}; known are {', '.join(KINDS)}")
        if not isinstance(tables, list) or not all(isinstance(table, dict) for table in tables):
            self.refuse(f"{kind} is no list of tables; write [[{kind}]]")
        return tables

    def loop(self, kind: str, number: int, table: Mapping[str, object]) -> Joint:
        where = f"{kind} {number}"
        if unknown := [key for key in table if key not in KEYS]:
            self.refuse(f"{where}: {shown(unknown[0])} is not known; give {', '.join(KEYS)}")
        ends = []
        for key in ("parent", "child"):
            name = table.get(key)
            if not isinstance(name, str) or name not in self.robot.links:
                self.refuse(f"{where}: its {key} {shown(name)} is no link of {self.robot.name}")
            ends.append(name)
        if ends[0] == ends[1]:
            self.refuse(f"{where}: it joins link {ends[0]} to itself; name two links")
        point = self._three(table.get("point", [0.0, 0.0, 0.0] if kind in ("weld", "prismatic") else None), f"{where}: point")
        axis = self._three(table.get("axis", None if kind in ("revolute", "prismatic") else [0.0, 0.0, 1.0]), f"{where}: axis")
        if not norm(axis) > 0:
            self.refuse(f"{where}: its axis is 0 0 0; give a direction")
        name = table.get("name", f"{kind}{number}")
        if not isinstance(name, str):
            self.refuse(f"{where}: its name is {shown(name)}; give a text")
        place = self.frames[ends[0]] @ Placement(position=point)
        return Joint(name, KINDS[kind], ends[0], ends[1], place, unit(axis), where=f"{self.path.name}, {where}")

    def _three(self, given: object, what: str) -> np.ndarray:
        if (
            not isinstance(given, list)
            or len(given) != 3
            or not all(isinstance(x, (int, float)) and not isinstance(x, bool) and abs(x) <= LARGEST for x in given)
        ):
            self.refuse(f"{what} is {shown(given)}; give three numbers of at most {LARGEST:g}")
        return np.array(given, dtype=float)

    def refuse(self, problem: str) -> NoReturn:
        raise ModelError(placed(self.path.name, None, problem))
