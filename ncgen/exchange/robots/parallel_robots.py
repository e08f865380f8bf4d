"""Loops and motors of Gepetto's parallel robots: the YAML next to a URDF (github.com/Gepetto/example-parallel-robots).

Read is what these files use of YAML: keys at the beginning of a line, lists in brackets over any number of lines, texts with or without
quotation marks, comments.

    closed_loop: [['rod_A', 'rod_B'], ...]    # pairs of links that coincide
    type: ['6d', ...]                         # a weld, or 3d, a ball
    name_mot: ['knee', ...]                   # joints that have a motor
    joint_name: [...]                         # joints that are something else than the URDF says
    joint_type: ['SPHERICAL', ...]            # or FIXED, or UJOINT_XY: hinges about x and y of the joint's frame
"""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import NoReturn

import numpy as np

from ncgen.errors import ModelError, shown
from ncgen.exchange.robots.closures import Closure
from ncgen.exchange.robots.placement import Placement
from ncgen.exchange.robots.robot import Joint, Robot
from ncgen.exchange.text import placed, text_of

TYPES = {"6d": "fixed", "3d": "spherical"}
"""{type of a loop, in small letters: kind of joint}."""

AXES = {"X": np.array([1.0, 0.0, 0.0]), "Y": np.array([0.0, 1.0, 0.0]), "Z": np.array([0.0, 0.0, 1.0])}

KEYS = ("closed_loop", "type", "name_mot", "joint_name", "joint_type")

TOKEN = re.compile(
    r"""\s+|#[^\n]*|(?P<mark>[\[\],])|(?P<key>(?<=\n)\w+(?=:))|(?P<colon>:)|'(?P<one>[^'\n]*)'|"(?P<two>[^"\\\n]*)"|(?P<bare>[\w./+-]+)"""
)


def with_yaml(robot: Robot, path: Path) -> tuple[Robot, list[Closure]]:
    """The robot with joints and motors as its file says, and the loops. Raises ModelError with file and line."""
    tables = _Parser(text_of(path), path).tables()
    reader = _Tables(robot, path, tables)
    return reader.robot_with_joints(), reader.loops()


class _Parser:
    """Keys with lists of texts, or of lists of texts."""

    def __init__(self, text: str, path: Path) -> None:
        self.path, self.text = path, "\n" + text
        self.tokens: list[tuple[str, str, int]] = []
        position = 0
        while position < len(self.text):
            match = TOKEN.match(self.text, position)
            line = self.text.count("\n", 0, position)
            if match is None:
                self._refuse(line, f"{shown(self.text[position])} is not read here; keys have lists of texts in brackets")
            if match.lastgroup:
                self.tokens.append((match.lastgroup, match[match.lastgroup], line))
            position = match.end()
        self.at = 0

    def tables(self) -> dict[str, list[str | list[str]]]:
        by_key: dict[str, list[str | list[str]]] = {}
        while self.at < len(self.tokens):
            kind, key, line = self._next()
            if kind != "key" or self._next()[0] != "colon":
                self._refuse(line, f"{shown(key)} stands where a key should be; write KEY: [...]")
            if key not in KEYS:
                self._refuse(line, f"there is no key {shown(key)}; known are {', '.join(KEYS)}")
            if key in by_key:
                self._refuse(line, f"the key {key} stands twice; leave one out")
            by_key[key] = self._list(0)
        return by_key

    def _list(self, depth: int) -> list[str | list[str]]:
        kind, text, line = self._next()
        if text != "[" or kind != "mark" or depth > 1:
            self._refuse(line, f"{shown(text)} stands where a list should begin; write [...]")
        items: list[str | list[str]] = []
        while True:
            kind, text, line = self._next()
            if (kind, text) == ("mark", "]"):
                return items
            if (kind, text) == ("mark", "["):
                self.at -= 1
                items.append([each for each in self._list(depth + 1) if isinstance(each, str)])
            elif kind in ("one", "two", "bare"):
                items.append(text)
            else:
                self._refuse(line, f"{shown(text)} stands in a list; give texts with commas between them")
            kind, text, line = self._next()
            if (kind, text) == ("mark", "]"):
                return items
            if (kind, text) != ("mark", ","):
                self._refuse(line, f"{shown(text)} stands where a comma should be")

    def _next(self) -> tuple[str, str, int]:
        if self.at == len(self.tokens):
            self._refuse(None, "a list has no end; close its bracket")
        self.at += 1
        return self.tokens[self.at - 1]

    def _refuse(self, line: int | None, problem: str) -> NoReturn:
        raise ModelError(placed(self.path.name, line, problem))


class _Tables:
    """What the lists mean for a robot."""

    def __init__(self, robot: Robot, path: Path, lists: dict[str, list[str | list[str]]]) -> None:
        self.robot, self.path, self.lists = robot, path, lists

    def robot_with_joints(self) -> Robot:
        names, types = self._texts("joint_name"), self._texts("joint_type")
        if len(names) != len(types):
            self._refuse(f"joint_name has {len(names)} texts and joint_type {len(types)}; give one type a joint")
        by_name, motors = {joint.name: joint for joint in self.robot.joints}, self._texts("name_mot")
        changed = {name: self._changed(by_name[name], kind) for name, kind in zip(names, types, strict=True) if name in by_name}
        joints = tuple(changed.get(joint.name, joint) for joint in self.robot.joints)
        absent = sum(name not in by_name for name in {*names, *motors})
        omitted = (f"joints of {self.path.name} that {self.robot.name} does not have ({absent})",) if absent else ()
        motors = tuple(name for name in motors if name in by_name)
        return replace(self.robot, joints=joints, motors=motors, omitted=(*self.robot.omitted, *omitted))

    def _changed(self, joint: Joint, kind: str) -> Joint:
        plain = replace(joint, limits=None, friction=0.0, damping=0.0)
        if kind == "SPHERICAL":
            return replace(plain, kind="spherical")
        if kind == "FIXED":
            return replace(plain, kind="fixed")
        first, second = (kind[-2:-1], kind[-1:]) if kind.startswith("UJOINT_") and len(kind) == len("UJOINT_XY") else ("", "")
        if first not in AXES or second not in AXES or first == second:
            self._refuse(f"joint {joint.name}: there is no type {shown(kind)}; known are SPHERICAL, FIXED, UJOINT_XY and other axes")
        return replace(plain, kind="universal", axis=AXES[first], second=AXES[second])

    def loops(self) -> list[Closure]:
        pairs, types = self.lists.get("closed_loop", []), self._texts("type")
        if types and len(types) != len(pairs):
            self._refuse(f"closed_loop has {len(pairs)} pairs and type {len(types)} texts; give one type a pair")
        return [self._loop(number, pair, (types or ["6d"] * len(pairs))[number - 1]) for number, pair in enumerate(pairs, 1)]

    def _loop(self, number: int, pair: str | list[str], kind: str) -> Closure:
        where = f"closed_loop {number}"
        if isinstance(pair, str) or len(pair) != 2:
            self._refuse(f"{where}: {shown(pair)} given; name two links")
        parent, child = (self._link(name, where) for name in pair)
        if kind.lower() not in TYPES:
            self._refuse(f"{where}: there is no type {shown(kind)}; known are 6d and 3d")
        return Closure(
            name="_".join(pair),
            kind=TYPES[kind.lower()],
            parent=parent,
            child=child,
            on_parent=Placement(),
            on_child=Placement(),
            where=f"{self.path.name}, {where}",
        )

    def _link(self, name: str, where: str) -> str:
        """A link by its name, or by that of the joint which carries it, as Pinocchio's frames are called."""
        child = next((joint.child for joint in self.robot.joints if joint.name == name), None)
        if name not in self.robot.links and child is None:
            self._refuse(f"{where}: there is no link or joint {shown(name)} in {self.robot.name}")
        return name if child is None or name in self.robot.links else child

    def _texts(self, key: str) -> list[str]:
        texts = [each for each in self.lists.get(key, []) if isinstance(each, str)]
        if len(texts) != len(self.lists.get(key, [])):
            self._refuse(f"{key} has a list in it; give texts")
        return texts

    def _refuse(self, problem: str) -> NoReturn:
        raise ModelError(placed(self.path.name, None, problem))
