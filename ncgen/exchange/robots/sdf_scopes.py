"""Scopes of SDF: what a name means in a model, and where that stands.

Every model has names of its own, links, joints and frames apart from each other; `a::b` is b of the nested model a. What stands where is
given relative to what `relative_to` names, else of a link to its model, of a joint to its child, of a frame to what it is attached to.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from ncgen.errors import shown
from ncgen.exchange.robots.markup import MAX_DEPTH, Markup
from ncgen.exchange.robots.placement import Placement
from ncgen.model.arithmetic import norm

WORLD, MODEL = "world", "__model__"

NAMED_TAGS = ("link", "joint", "frame")
"""What has a name in a model, in the order of looking it up: up to SDF 1.6 two may have one, and then it means the first."""

NOT_ONE = 1e-3
"""How far a quaternion's length may be from 1."""


@dataclass(eq=False)
class Entry:
    """An element that has a name; full: with those of all models around it; scope: where the names are looked up that it mentions."""

    element: Markup
    full: str
    scope: Scope


@dataclass(eq=False, kw_only=True)
class Scope:
    """A model, or with `parent` None the world around all models.

    prefix: stands before names of what is in it; file, version: where it was read
    pose, relative_to, placement_frame: where its frame, or that one of its frames, stands in the parent
    canonical: name of the link that its frame moves with; static: it does not move
    entries: {kind: {name: entry}}; models: {name: nested one}
    merged: what is in it is the parent's, but its frame is its own; alone: its own names are looked up all the same
    """

    element: Markup
    file: Path
    version: tuple[int, ...]
    parent: Scope | None = None
    name: str = ""
    prefix: str = ""
    pose: Placement = field(default_factory=Placement)
    relative_to: str = ""
    placement_frame: str = ""
    canonical: str = ""
    static: bool = False
    merged: bool = False
    alone: bool = False
    entries: dict[str, dict[str, Entry]] = field(default_factory=lambda: {kind: {} for kind in NAMED_TAGS})
    models: dict[str, Scope] = field(default_factory=dict)
    stands: Placement | None = None
    known: dict[Entry, Placement] = field(default_factory=dict)
    waiting: list[str] = field(default_factory=list)

    def scopes(self) -> Iterator[Scope]:
        """This one and all nested ones."""
        yield self
        for inner in self.models.values():
            yield from inner.scopes()

    def add(self, element: Markup, owner: Scope) -> None:
        """Give an element its name. owner: in which its own names are looked up. Raises ModelError where the name is taken."""
        name, known = element.name(), self.entries[element.tag]
        if name in known:
            element.refuse(f"there are two {element.tag}s {shown(name)}; rename one")
        known[name] = Entry(element, self.prefix + name, owner)

    def find(self, name: str) -> Entry | Scope | None:
        """What a name means here."""
        if name == MODEL:
            return self
        if self.merged and not self.alone and self.parent:
            return self.parent.find(name)
        for kind in NAMED_TAGS:
            if name in self.entries[kind]:
                return self.entries[kind][name]
        head, mark, rest = name.partition("::")
        inner = self.models.get(head)
        return inner.find(rest) if mark and inner else inner

    # -- where things are ----------------------------------------------------------------------

    def place(self, name: str, asks: Markup) -> Placement:
        """What has a name here, in the world, all coordinates at 0. asks: the element that mentions it, for messages"""
        if name == WORLD:
            return Placement()
        place_found = self.find(name)
        if place_found is None:
            label = f"{asks.tag} {asks.attributes.get('name', '')}".strip()
            asks.refuse(f"{label}: there is no link, joint or frame {shown(name)}")
        return place_found.stood() if isinstance(place_found, Scope) else self._stood(place_found)

    def _stood(self, entry: Entry) -> Placement:
        """Where an element stands."""
        home, element = entry.scope, entry.element
        if entry not in home.known:
            with self._waited(element.name(), element):
                pose = element.first("pose")
                home.known[entry] = home.place(relative_of(pose) or _carrier(element), element) @ pose_of(pose)
        return home.known[entry]

    def stood(self) -> Placement:
        """Where the model's frame stands."""
        if self.stands is None:
            if self.parent is None:
                return Placement()
            with self._waited(self.name, self.element):
                base = self.parent.place(self.relative_to or MODEL, self.element)
                inside = self._of_itself(self.placement_frame) if self.placement_frame else Placement()
                self.stands = base @ self.pose @ inside.inverse()
        return self.stands

    def _of_itself(self, frame: str) -> Placement:
        """A frame of the model in the model's own."""
        self.stands, self.alone = Placement(), True
        own_frame = self.place(frame, self.element)
        self.stands, self.alone = None, False
        for inner in self.scopes():
            inner.stands = None
            inner.known.clear()
        return own_frame

    @contextmanager
    def _waited(self, name: str, element: Markup) -> Iterator[None]:
        """While something is placed: what needs itself for it is refused."""
        label = f"{element.tag} {name}"
        if name in self.waiting:
            element.refuse(f"{label} is placed relative to itself, by way of {', '.join(shown(n) for n in self.waiting[:3])}")
        if len(self.waiting) > MAX_DEPTH:
            element.refuse(f"{label} is placed relative to more than {MAX_DEPTH} others, one after the other; a robot needs no such chain")
        self.waiting.append(name)
        yield
        self.waiting.pop()

    # -- what moves with what ------------------------------------------------------------------

    def body(self, name: str, depth: int = 0) -> str | None:
        """The full name of the link that something moves with: `WORLD` for what rests, None where there is none."""
        if name == WORLD:
            return WORLD
        entry = self.find(name)
        if entry is None or depth > MAX_DEPTH:
            return None
        if isinstance(entry, Scope):
            return entry.base(depth + 1)
        return entry.full if entry.element.tag == "link" else entry.scope.body(_carrier(entry.element), depth + 1)

    def base(self, depth: int = 0) -> str | None:
        """The full name of the link that a model's frame moves with: the one that it says, else its first one."""
        if self.parent is None:
            return WORLD
        if self.canonical:
            return self.body(self.canonical, depth + 1)
        if self.entries["link"]:
            return self.body(next(iter(self.entries["link"])), depth + 1)
        return next(filter(None, (inner.base(depth + 1) for inner in self.models.values())), None)


def _carrier(element: Markup) -> str:
    """What a link, joint or frame is placed in, and a joint or frame moves with, unless it says something else."""
    if element.tag == "joint":
        return element.only("child").text.strip()
    return (element.attributes.get("attached_to") if element.tag == "frame" else None) or MODEL


def relative_of(pose: Markup | None) -> str:
    """What a pose is relative to by its own word, or nothing; up to 1.6 the attribute is called frame."""
    if pose is None:
        return ""
    return pose.attributes.get("relative_to") or pose.attributes.get("frame") or ""


def pose_of(pose: Markup | None) -> Placement:
    """x y z and roll pitch yaw (rad, or degrees if it says so), or a quaternion x y z w; without text no motion."""
    if pose is None or not pose.text.strip():
        return Placement()
    degrees = truth(pose.attributes.get("degrees") or "false", pose)
    match pose.attributes.get("rotation_format") or "euler_rpy":
        case "euler_rpy":
            numbers = pose.content(6)
            angles = tuple(math.radians(angle) for angle in numbers[3:]) if degrees else numbers[3:]
            return Placement.of_rpy(numbers[:3], angles)
        case "quat_xyzw" if not degrees:
            px, py, pz, x, y, z, w = pose.content(7)
            if abs(norm([x, y, z, w]) - 1) > NOT_ONE:
                pose.refuse(f"the quaternion has length {norm([x, y, z, w]):g}; divide it by that")
            return Placement.of_quaternion(np.array([px, py, pz]), np.array([w, x, y, z]))
        case "quat_xyzw":
            pose.refuse("a quaternion has no degrees; leave out the attribute degrees")
        case other:
            pose.refuse(f"a rotation is euler_rpy or quat_xyzw, not {shown(other)}")


def truth(text: str, element: Markup) -> bool:
    """true or 1, false or 0."""
    word = text.strip().lower()
    if word not in ("true", "1", "false", "0"):
        element.refuse(f"<{element.tag}>: {shown(text.strip())} is neither true nor false")
    return word in ("true", "1")


def flag(inside: Markup | None, tag: str) -> bool | None:
    """What an element of truth says; None where it is not there."""
    element = inside.first(tag) if inside is not None else None
    return None if element is None else truth(element.text, element)
