"""Robots from SDF, the format of Gazebo (sdformat.org), versions 1.2 to 1.12; joints may close loops.

A model, nested models, several in a world, and those of included files. A joint whose child is carried already closes a loop; a joint is
turned where else nothing would carry a link. What no joint ties to the world is a free body. `vocabulary/sdf.txt` says what becomes of
every word.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from ncgen.errors import shown
from ncgen.exchange.robots.accounting import account, counted, vocabulary
from ncgen.exchange.robots.looks import Shape, Unseen, looked, seen, unseen
from ncgen.exchange.robots.markup import UNLIMITED, Markup, refusals
from ncgen.exchange.robots.placement import Placement
from ncgen.exchange.robots.robot import Coupling, Joint, Link, Mimic, Robot, hung
from ncgen.exchange.robots.sdf_links import look_of, mass_of, number_of
from ncgen.exchange.robots.sdf_models import Document, document_of
from ncgen.exchange.robots.sdf_scopes import MODEL, WORLD, Entry, flag
from ncgen.exchange.robots.spanning import spanned
from ncgen.exchange.robots.stops import not_built
from ncgen.model.arithmetic import dot
from ncgen.model.names import numbered

KINDS = {
    "fixed": "fixed", "revolute": "revolute", "continuous": "revolute", "prismatic": "prismatic", "ball": "spherical",
    "universal": "universal", "revolute2": "universal", "screw": "screw",
}  # fmt: skip
"""Joint types of the format, and what they are here."""

GEARBOX = "gearbox"
"""The joint type that moves nothing: it couples two hinges."""

ACTING = ("revolute", "continuous", "prismatic", "screw")
"""Joints that have one coordinate, along which something can act."""

ALIGNED = 1 - 1e-9
"""Cosine of the angle from which on two axes are one."""

GRAVITY = (0.0, 0.0, -9.8)
"""Of a world that says nothing (m/s²)."""

EARTH = (0.0, 0.0, -9.81)
"""Where a file has no world (m/s²)."""

PITCH = 1.0
"""Of a screw that says nothing (m a turn)."""

AXES_OF_MODEL = (1, 4)
"""The last version whose axes are those of the model."""


def robot_of(root: Markup, path: Path) -> Robot:
    """The robot of a file, from its root element. Raises ModelError with file and line."""
    return _Reader(root, path).robot()


def problems_of(root: Markup, path: Path) -> list[str]:
    """What is wrong with links and joints, each looked at by itself, where models and names are right."""
    reader = _Reader(root, path)
    links = {entry.element: entry for entry in reader.entries("link")}
    joints = {entry.element: entry for entry in reader.moving}
    return [*refusals(lambda each: reader.link(links[each]), links), *refusals(lambda each: reader.joint(joints[each]), joints)]


class _Reader:
    def __init__(self, root: Markup, path: Path) -> None:
        self.path = path
        self.document: Document = document_of(root, path)
        self.looks: list[Shape | Unseen] = []
        self.unmoved = 0
        joints = list(self.entries("joint"))
        self.gears = [each for each in joints if _type(each.element) == GEARBOX]
        self.moving = [each for each in joints if each not in self.gears]

    def entries(self, kind: str) -> Iterator[Entry]:
        """Everything of a kind, outer models first."""
        yield from dict.fromkeys(entry for scope in self.document.scope.scopes() for entry in scope.entries[kind].values())

    def robot(self) -> Robot:
        entries = {entry.full: entry for entry in self.entries("link")}
        if not entries:
            next(iter(self.document.scope.models.values())).element.refuse("<model> has no <link>; give it one")
        links = {name: self.link(entry) for name, entry in entries.items()}
        resting = [name for name, entry in entries.items() if entry.scope.static]
        joints = [joint for entry in self.moving if (joint := self.joint(entry)) is not None]
        placements = {name: entry.scope.place(entry.element.name(), entry.element) for name, entry in entries.items()}
        sites = self._sites(placements)
        links = {name: replace(link, sites=sites.get(name, {})) for name, link in links.items()}
        gears = tuple(self._gear(each, joints) for each in self.gears)
        welds = [
            Joint(name=numbered(f"{name}.rests", entries.__contains__), kind="fixed", parent=WORLD, child=name, placement=placements[name])
            for name in resting
        ]
        joints = [*welds, *joints]
        if any(WORLD in (joint.parent, joint.child) for joint in joints):
            links, placements = {WORLD: Link(name=WORLD, mass=None), **links}, {WORLD: Placement(), **placements}
        return replace(self._tree(links, joints, placements), rows=gears, resting=sites.get(WORLD, {}))

    def _sites(self, placements: Mapping[str, Placement]) -> dict[str, dict[str, Placement]]:
        """{link: {frame that moves with it: where it is in the link}}, those of the world among them. Raises ModelError for one that is
        placed or attached nowhere. placements: of links in the world"""
        sites: dict[str, dict[str, Placement]] = {}
        for entry in self.entries("frame"):
            name = entry.element.name()
            placement = entry.scope.place(name, entry.element)
            home = entry.scope.body(name) or (WORLD if entry.scope.static else None)
            if home is None:
                entry.element.refuse(f"frame {name}: what it is attached to moves with no link; name a link, a joint, a frame or a model")
            sites.setdefault(home, {})[entry.full] = placements[home].inverse() @ placement if home != WORLD else placement
        return sites

    def _tree(self, links: dict[str, Link], joints: list[Joint], placements: dict[str, Placement]) -> Robot:
        """A tree of what hangs together; what else moves freely hangs on the world."""
        tree, loops = spanned(links, joints, WORLD)
        carried = {joint.child for joint in tree}
        roots = [name for name in links if name not in carried]
        floats = roots[0] != WORLD and len(roots) == 1
        if not floats:
            if WORLD not in links:
                links, placements = {WORLD: Link(name=WORLD, mass=None), **links}, {WORLD: Placement(), **placements}
            free = (name for name in roots if name != WORLD)
            tree += [
                Joint(
                    name=numbered(f"{name}.free", links.__contains__), kind="floating", parent=WORLD, child=name, placement=placements[name]
                )
                for name in free
            ]
        omitted = self._omitted([*tree, *loops])
        robot = Robot(
            name=self._name(), links=links, joints=tuple(tree), loops=tuple(loops), gravity=self._gravity(), floats=floats, omitted=omitted
        )
        return hung(robot, placements)

    def _name(self) -> str:
        """That of the only model that moves, else of the world."""
        models = list(self.document.scope.models.values())
        moving = [model for model in models if not model.static] or models
        return moving[0].name if len(moving) == 1 else self.document.world.attributes.get("name") or self.path.stem

    def _gravity(self) -> tuple[float, float, float]:
        world = self.document.world
        if world.tag != "world":
            return EARTH
        settings = world.first("physics")
        gravity = world.first("gravity") or (settings.first("gravity") if settings else None)
        if gravity is None:
            return GRAVITY
        x, y, z = gravity.content(3)
        return x, y, z

    def _omitted(self, joints: list[Joint]) -> tuple[str, ...]:
        words = vocabulary("sdf")
        findings = [finding for root in self.document.roots for finding in account(root, words, "root")]
        resting = ["joints of models that rest"] * self.unmoved
        return (*counted([*not_built(joints), *findings, *resting]), *unseen(self.looks))

    # -- links and joints ----------------------------------------------------------------------

    def link(self, entry: Entry) -> Link:
        """A link with its mass and looks."""
        appearances = [looked(lambda visual=visual: look_of(visual, entry)) for visual in entry.element.all("visual")]
        self.looks += appearances
        mass = mass_of(entry)
        lifted = (mass,) if mass and flag(entry.element, "gravity") is False else ()
        return Link(name=entry.full, mass=mass, where=entry.element.place, shapes=seen(appearances), lifted=lifted)

    def joint(self, entry: Entry) -> Joint | None:
        """A joint, its placement in the world; None where both links rest."""
        each, kind = entry.element, _type(entry.element)
        name = each.name()
        if kind not in KINDS:
            each.refuse(f"joint {name}: the type {shown(kind)} is not read; known are {', '.join((*KINDS, GEARBOX))}")
        parent, child = self._end(entry, "parent"), self._end(entry, "child")
        axis, second = each.first("axis"), each.first("axis2")
        dynamics = axis.first("dynamics") if axis and kind in ACTING else None
        if parent == child:
            each.refuse(f"joint {name}: its parent and its child are both {parent}; a joint is between two links")
        joint = Joint(
            name=entry.full,
            kind=KINDS[kind],
            parent=parent,
            child=child,
            placement=entry.scope.place(name, each),
            axis=self._axis(entry, axis) if kind not in ("fixed", "ball") else np.array([0.0, 0.0, 1.0]),
            second=self._axis(entry, second) if KINDS[kind] == "universal" else None,
            damping=number_of(dynamics, "damping"),
            stiffness=number_of(dynamics, "spring_stiffness"),
            rest=number_of(dynamics, "spring_reference"),
            pitch=_pitch(each) if kind == "screw" else 0.0,
            limits=_limits(axis) if kind in ACTING else None,
            friction=number_of(dynamics, "friction"),
            effort=_effort(axis) if kind in ACTING else None,
            mimic=self._mimic(entry, axis) if kind in ACTING else None,
            where=each.place,
        )
        if entry.scope.static:
            self.unmoved += 1
            return None
        return joint.turned() if joint.child == WORLD else joint

    def _end(self, entry: Entry, tag: str) -> str:
        """The link that a joint's end moves with."""
        end_name = entry.element.only(tag).text.strip()
        body = entry.scope.body(end_name)
        if body is None:
            entry.element.refuse(f"joint {entry.element.name()}: its {tag} {shown(end_name)} is no link, frame or model here")
        return body

    def _axis(self, entry: Entry, axis: Markup | None) -> np.ndarray:
        """In the joint's frame."""
        joint, scope = entry.element, entry.scope
        if axis is None:
            joint.refuse(f"joint {joint.name()}: it has no axis; give it one")
        element = axis.only("xyz")
        direction = element.unit(element.content(3), joint.name())
        base = element.attributes.get("expressed_in")
        if flag(axis, "use_parent_model_frame") or scope.version <= AXES_OF_MODEL:
            base = MODEL
        if not base:
            return direction
        return scope.place(joint.name(), joint).inverse().along(scope.place(base, joint).along(direction))

    def _mimic(self, entry: Entry, axis: Markup | None) -> Mimic | None:
        """Which joint an axis follows: x = multiplier · (other − reference) + offset."""
        mimic = axis.first("mimic") if axis is not None else None
        if mimic is None:
            return None
        name = mimic.name("joint")
        other = entry.scope.find(name)
        if not isinstance(other, Entry) or other.element.tag != "joint":
            mimic.refuse(f"joint {entry.element.name()}: there is no joint {shown(name)} to mimic")
        if (mimic.attributes.get("axis") or "axis") != "axis":
            mimic.refuse(f"joint {entry.element.name()}: only the first axis of joint {shown(name)} can be followed")
        factor = number_of(mimic, "multiplier", 1.0)
        return Mimic(other.full, factor, number_of(mimic, "offset") - factor * number_of(mimic, "reference"))

    def _gear(self, entry: Entry, joints: list[Joint]) -> Coupling:
        """The child's angle relative to the reference body is −ratio times the parent's, each about an axis of the gearbox's own."""
        each = entry.element
        name, body = each.name(), self._end(entry, "gearbox_reference_body")
        shares: dict[str, float] = {}
        for tag, axis, factor in (("parent", "axis", number_of(each, "gearbox_ratio", 1.0)), ("child", "axis2", 1.0)):
            link = self._end(entry, tag)
            about = entry.scope.place(name, each).along(self._axis(entry, each.first(axis)))
            hinges = (joint for joint in joints if joint.kind == "revolute" and {joint.parent, joint.child} == {link, body})
            along = {joint.name: dot(joint.placement.along(joint.axis), about) * (1 if joint.child == link else -1) for joint in hinges}
            hinge = next((joint for joint, cosine in along.items() if abs(cosine) > ALIGNED), None)
            if hinge is None:
                each.refuse(f"joint {name}: no hinge along its {axis} joins its {tag} {shown(link)} to {shown(body)}; give it one")
            shares[hinge] = shares.get(hinge, 0.0) + factor * float(np.sign(along[hinge]))
        return Coupling(name=f"gearbox {name}", shares=shares, offset=0.0, where=each.place)


def _type(joint: Markup) -> str:
    return joint.name("type").lower()


def _pitch(joint: Markup) -> float:
    """m a turn; `thread_pitch` is in rad/m, and left-handed where it is positive."""
    if (pitch := joint.first("screw_thread_pitch")) is not None:
        return pitch.content(1)[0]
    if (pitch := joint.first("thread_pitch")) is None:
        return PITCH
    radians = pitch.content(1)[0]
    if radians == 0.0:
        pitch.refuse(f"joint {joint.name()}: its thread_pitch is 0 rad/m; give another number, or screw_thread_pitch in m a turn")
    return -2 * np.pi / radians


def _limits(axis: Markup | None) -> tuple[float, float] | None:
    """Those of a joint, which may be infinite as 1e16, or None."""
    limit = axis.first("limit") if axis is not None else None
    if limit is None or (limit.first("lower") is None and limit.first("upper") is None):
        return None
    lower, upper = (each.limit(each.text, tag) if (each := limit.first(tag)) else end for tag, end in LIMITS.items())
    return None if lower <= -UNLIMITED and upper >= UNLIMITED else (lower, upper)


def _effort(axis: Markup | None) -> tuple[float, float] | None:
    """None where it is unlimited: negative or infinite."""
    effort_element = limit.first("effort") if axis is not None and (limit := axis.first("limit")) is not None else None
    effort = -1.0 if effort_element is None else effort_element.limit(effort_element.text, "effort")
    return (-effort, effort) if 0 <= effort < UNLIMITED else None


LIMITS = {"lower": -UNLIMITED, "upper": UNLIMITED}
"""Of a joint, where the file says none."""
