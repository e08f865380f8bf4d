"""A mechanism as a robot: what a file of links and joints can say of it.

Every link's frame stands along the global axes in the initial position, at the joint that carries it, so axes and inertias are written as
they are; parameters have their defaults. Joints of an open tree have the names, signs and zeros of the model's coordinates. With loops the
file begins where the model begins: there every joint's coordinate is 0, since only there loops are known to close. Springs' rests move
along. There, in addition to bodies, rods between two points (`m.distance`, bodies of two points) become links on a universal joint and a
ball, measured lengths (`m.length`) pairs of links without mass that slide on each other; in the plane they have hinges.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import sympy

from ncgen.errors import ModelError
from ncgen.exchange.robots.joint_values import motion
from ncgen.exchange.robots.looks import Shape, shapes_on
from ncgen.exchange.robots.model_loads import Acting, acting, gravity_of, mass_of, origin_of
from ncgen.exchange.robots.placement import Placement
from ncgen.exchange.robots.robot import Joint, Link, Mimic, Robot, hung
from ncgen.model import Model
from ncgen.model.arithmetic import across, unit
from ncgen.model.bodies import Body
from ncgen.model.catalogue import ROW_TYPES
from ncgen.model.elements import Angle, Combination, Length, Point, Relative, Spatial, as_combination
from ncgen.model.pairs import SLIDING, Screw, joint_between, sliding_of
from ncgen.model.rows import Row
from ncgen.model.values import as_sympy, evaluate
from ncgen.solver.joints.joint_space import JointsOfTree
from ncgen.symbolic.tree import spanning_tree

WORLD = "world"

KINDS = {(0, 0): "fixed", (1, 1): "revolute", (1, 0): "prismatic", (3, 3): "spherical", (3, 1): "planar", (6, 3): "floating"}
"""{(degrees of freedom, rotations among them): the kind of joint}."""

ROUNDING = 1e-15
"""A coordinate that begins this near to 0 begins there (rad; m)."""

AXIS_TOLERANCE = 1e-9
"""Sine of the angle up to which an axis is that of a joint."""

NORMAL = np.array([0.0, 0.0, 1.0])


def linkage_of(model: Model) -> Robot:
    """The robot that a model is; joints may close loops. Raises ModelError naming a row, a coordinate or a load that it cannot say."""
    return _Linkage(model).robot()


def tree_of(space: JointsOfTree) -> Robot:
    """The robot that an open tree is. Raises ModelError naming a body whose joint it cannot say."""
    return _Linkage(space.kernels.model, space).robot()


@dataclass(eq=False)
class _Part:
    """A link: elements that move with it; body: None of what has no mass."""

    name: str
    elements: list[Spatial]
    body: Body | None = None
    position: np.ndarray = field(default_factory=lambda: np.zeros(3))


class _Linkage:
    """space: of an open tree; None where joints may close loops"""

    def __init__(self, model: Model, space: JointsOfTree | None = None) -> None:
        self.model, self.space = model, space
        self.names = {body.name for body in model.bodies.values()}
        self.tree = space.tree if space else spanning_tree(model)
        self.is_planar = all(body.frame.planar for body in model.bodies.values())
        fixed = [e for e in model.elements.values() if isinstance(e, Spatial) and e.fixed]
        self.world = _Part(self._free(WORLD), fixed, model.ground)
        self.parts = [self.world, *(_Part(link.body.name, link.body.elements, link.body) for link in self.tree.links)]
        self.joints: list[Joint] = []
        self.loops: list[Joint] = []
        self.at: dict[Joint, tuple[_Part, _Part]] = {}
        self.described: set[str] = set()

    def robot(self) -> Robot:
        if not self.space:
            self._refuse()
        for number in range(len(self.tree.links)):
            self._hang(number)
        if not self.space:
            self._add_loops()
        floats = not any(self.world.name in (joint.parent, joint.child) for joint in (*self.joints, *self.loops))
        parts = self.parts[1:] if floats else self.parts
        links = {
            each.name: Link(name=each.name, mass=mass_of(self.model, each.body, each.position), shapes=self._shapes(each)) for each in parts
        }
        robot = Robot(
            name=self.model.name,
            links=links,
            joints=tuple(self.joints),
            loops=tuple(self.loops),
            gravity=gravity_of(self.model),
            floats=floats,
        )
        robot = hung(robot, {solid.name: Placement(position=solid.position) for solid in parts})
        return _with_coordinates(robot, self.space) if self.space else robot

    def _add_loops(self) -> None:
        """What is in a mechanism besides the joints of its tree, and the coordinates of its joints."""
        for number in range(len(self.tree.links)):
            self._close(number)
        self._universals()
        for body in self.tree.loose:
            self._rod(body.name, body.points, body)
        for row in self.model.rows:
            if _is_rod(row):
                self._rod(self._free(f"rod_{row.label.rsplit(' ', 1)[-1]}"), _points(row.direction("a")))
        for element in self.model.elements.values():
            if isinstance(element, Length) and element.name not in self.described:
                self._leg(element)
        self._coordinates()
        self._follow()
        self._hold()

    # -- bodies --------------------------------------------------------------------------------

    def _hang(self, number: int) -> None:
        """The joint of the tree that carries a body; none where it moves freely and loops may hold it."""
        link, solid = self.tree.links[number], self.parts[number + 1]
        parent = self.world if link.parent is None else self.parts[link.parent + 1]
        solid.position = origin_of(link)
        if self.space or len(link.screws) < 6:
            self._join(f"joint_{solid.name}", parent, solid, link.screws)

    def _close(self, number: int) -> None:
        """Joints of what a body shares with others than the one that carries it."""
        link, solid = self.tree.links[number], self.parts[number + 1]
        carrier = set(link.body.elements) if link.parent is None else set(self.tree.links[link.parent].body.elements)
        slides = sliding_of(self.model)
        for other in self.parts[: len(self.tree.links) + 1]:
            home = None if other is self.world else self.parts.index(other) - 1
            shared = [e for e in link.body.elements if e in other.elements]
            own_elements = [e for e in shared if self.tree.home.get(e) == home and (link.parent is None or e not in carrier)]
            if other is solid or home == link.parent or not own_elements:
                continue
            screws = joint_between(link.body, shared, slides.get(frozenset({other.body or link.body, link.body})))
            self._join(self._free(f"loop_{other.name}_{solid.name}"), other, solid, screws, closes=True)

    def _join(self, name: str, parent: _Part, child: _Part, screws: Sequence[Screw], closes: bool = False) -> None:
        turning = [screw for screw in screws if screw.point]
        kind = KINDS.get((len(screws), len(turning)))
        if kind is None:
            raise ModelError(
                f"{self.model.name}: {child.name} has {len(screws)} degrees of freedom ({len(turning)} rotations) relative to "
                f"{parent.name}; files have hinges, sliders, balls, planes and universal joints: put a body without mass between"
            )
        along = {"revolute": screws, "prismatic": screws, "planar": turning}.get(kind)
        axis = unit(along[0].axis.initial) if along else NORMAL
        position = next((screw.point.initial for screw in turning if screw.point), child.position)
        self._add(name, kind, (parent, child), position, closes, axis=axis)

    def _add(self, name: str, kind: str, parts: tuple[_Part, _Part], position: np.ndarray, closes: bool = False, **more: Any) -> None:
        """A joint between a link and the one that it carries. more: as of `Joint`"""
        parent, child = (each.name for each in parts)
        joint = Joint(name=name, kind=kind, parent=parent, child=child, placement=Placement(position=position), **{"axis": NORMAL, **more})
        (self.loops if closes else self.joints).append(joint)
        self.at[joint] = parts

    def _put(self, old: Joint, new: Joint) -> None:
        for joints in (self.joints, self.loops):
            if old in joints:
                joints[joints.index(old)] = new
        self.at[new] = self.at.pop(old)

    # -- rods and legs -------------------------------------------------------------------------

    def _rod(self, name: str, ends: Sequence[Point], body: Body | None = None) -> None:
        """A link between two points; what they belong to carries it."""
        if len(ends) != 2 or (body and body.vectors):
            problem = f"{self.model.name}: {body or name} does not define its orientation"
            raise ModelError(f"{problem}, which files of links and joints need; give the body another vector or point")
        first, second = ends if self._part_of(ends[0]) else (ends[1], ends[0])
        carrier, end = self._part_of(first), self._part_of(second)
        if carrier is None:
            raise ModelError(f"{self.model.name}: {name} is connected to no body; define first the body that carries it")
        rod = _Part(name, [first, second], body, first.initial)
        self.parts.append(rod)
        self._pivot(self._free(f"{name}_{first.name}"), carrier, rod, first.initial, unit(second.initial - first.initial))
        if end is not None:
            self._ball(self._free(f"{name}_{second.name}"), rod, end, second.initial)

    def _leg(self, length: Length) -> None:
        """Two links without mass that slide on each other, with the coordinate's name."""
        row = next((row for row in self.model.rows if row.owner.kind == "coordinate" and row.owner.name == length.name), None)
        if row is None or row.type is None or row.type.key != "length":
            return
        end, start = _points(row.direction("a"))
        name, foot, head = length.name, self._part_of(start), self._part_of(end)
        if foot is None or head is None:
            raise ModelError(f"{self.model.name}: coordinate {name} is measured to {(end if foot else start).name}, which is on no body")
        along = unit(end.initial - start.initial)
        lower = _Part(self._free(f"{name}_lower"), [start], None, start.initial)
        upper = _Part(self._free(f"{name}_upper"), [end], None, start.initial)
        self.parts += [lower, upper]
        self._pivot(self._free(f"{name}_foot"), foot, lower, start.initial, along)
        self._add(name, "prismatic", (lower, upper), start.initial, axis=along, **self._acting(length))
        self._ball(self._free(f"{name}_head"), upper, head, end.initial)
        self.described.add(name)

    def _pivot(self, name: str, parent: _Part, child: _Part, position: np.ndarray, along: np.ndarray) -> None:
        """A hinge in the plane, else a universal joint, across a rod."""
        if self.is_planar:
            self._add(name, "revolute", (parent, child), position)
        else:
            first = across(along)
            self._add(name, "universal", (parent, child), position, axis=first, second=unit(np.cross(along, first)))

    def _ball(self, name: str, rod: _Part, end: _Part, position: np.ndarray) -> None:
        self._add(
            name, "revolute" if self.is_planar else "spherical", (end, rod) if end is self.world else (rod, end), position, closes=True
        )

    def _part_of(self, element: Spatial) -> _Part | None:
        return next((solid for solid in self.parts if element in solid.elements), None)

    # -- coordinates and rows ------------------------------------------------------------------

    def _universals(self) -> None:
        """Balls that a row makes universal joints."""
        for row in self.model.rows:
            if row.owner.joint != "universal":
                continue
            axes = [row.direction(name) for name in ("u", "v")]
            names = {self.world.name if name == self.model.ground.name else name for name in row.owner.bodies}
            for joint in (*self.joints, *self.loops):
                parent, child = self.at[joint]
                if joint.kind == "spherical" and {parent.name, child.name} == names:
                    first, second = axes if self._carries(parent, axes[0]) else axes[::-1]
                    new = replace(joint, kind="universal", axis=unit(first.initial), second=unit(second.initial))
                    self._put(joint, new)
                    self.described.add(row.label)
                    break

    def _coordinates(self) -> None:
        """Joints get the names, signs, springs and dampers of the coordinates that follow them."""
        for element in self.model.elements.values():
            if not isinstance(element, Relative) or element.name in self.described:
                continue
            followed = (self._following(element, joint) for joint in (*self.joints, *self.loops))
            first_followed = next((each for each in followed if each), None)
            if first_followed is None:
                raise ModelError(
                    f"{self.model.name}: coordinate {element.name} is that of no hinge or slider; a file of links and joints cannot say it"
                )
            old, sign = first_followed
            self._put(old, replace(old, name=element.name, axis=sign * old.axis, **self._acting(element)))
            self.described.add(element.name)

    def _following(self, element: Relative, joint: Joint) -> tuple[Joint, float] | None:
        """The joint and the sign of a coordinate in it."""
        parent, child = self.at[joint]
        if isinstance(element, Angle):
            axis, ends, kind = element.axis.initial, (element.start, element.end), "revolute"
        else:
            row = next(row for row in self.model.rows if row.owner.kind == "coordinate" and row.owner.name == element.name)
            if row.type is None or row.type.key != "slide":
                return None
            end, start = _points(row.direction("a"))
            axis, ends, kind = row.direction("n").initial, (as_combination(start), as_combination(end)), "prismatic"
        if joint.kind != kind or np.linalg.norm(np.cross(unit(axis), joint.axis)) > AXIS_TOLERANCE:
            return None
        sign = float(np.sign(unit(axis) @ joint.axis))
        if self._carries(parent, ends[0]) and self._carries(child, ends[1]):
            return joint, sign
        if self._carries(child, ends[0]) and self._carries(parent, ends[1]):
            return joint, -sign
        return None

    def _carries(self, solid: _Part, direction: Combination) -> bool:
        """True if all of a direction moves with a link."""
        return all(e in solid.elements for e in direction.elements)

    def _follow(self) -> None:
        """Joints follow others where a row says so: gears, racks, and what a file's mimics became."""
        for row in self.model.rows:
            shares = self._shares(row)
            if shares is None:
                continue
            (first, a), (second, b) = shares[0]
            joint = next(joint for joint in (*self.joints, *self.loops) if joint.name == first.name)
            if joint.mimic or joint in self.loops:
                raise ModelError(
                    f"{self.model.name}: {row.label}: joint {first.name} cannot follow {second.name} as well; leave one constraint out"
                )
            open_by = a * float(first.initial[0]) + b * float(second.initial[0]) + shares[1]
            self._put(joint, replace(joint, mimic=Mimic(second.name, -b / a, -open_by / a)))

    def _shares(self, row: Row) -> tuple[tuple[tuple[Relative, float], tuple[Relative, float]], float] | None:
        """Two coordinates and their factors in a row over nothing else that is linear in them, and what stands there besides; else None.

        The first one is that of factor 1, if there is one: a file's mimic follows with that.
        """
        if row.type is ROW_TYPES["follow"]:
            elements: dict[object, Relative] = {e.components[0]: e for e in self.model.elements.values() if isinstance(e, Relative)}
            ratio, offset = (evaluate(row.data[name], self.model.parameters, row.label) for name in ("k", "c"))
            return ((elements[row.arguments["s"]], 1.0), (elements[row.arguments["z"]], -ratio)), -offset
        if row.expression is None or row.level != "position" or row.owner.kind not in ("user", "joint"):
            return None
        expression: Any = as_sympy(row.expression)
        expression = expression.xreplace(
            {p.symbol: sympy.Float(evaluate(p, self.model.parameters, row.label)) for p in self.model.parameters.values()}
        )
        relative = [e for e in self.model.elements.values() if isinstance(e, Relative) and e.symbol in expression.free_symbols]
        if len(relative) != 2 or len(expression.free_symbols) != 2:
            return None
        factors = [expression.diff(e.symbol) for e in relative]
        if any(factor.free_symbols for factor in factors):
            return None
        rest = expression.xreplace(dict.fromkeys((e.symbol for e in relative), sympy.S.Zero))
        first, second = sorted(zip(relative, map(float, factors), strict=True), key=lambda each: each[1] != 1.0)
        return (first, second), float(rest)

    def _hold(self) -> None:
        """Bodies that move freely hang on the first joint that names them as its child, where there is one."""
        carried = {joint.child for joint in self.joints}
        for solid in self.parts[1:]:
            if solid.name not in carried and (loop_here := next((loop for loop in self.loops if loop.child == solid.name), None)):
                self.loops.remove(loop_here)
                self.joints.append(loop_here)

    def _refuse(self) -> None:
        """Raise ModelError naming the first row or rotor that the format does not say."""
        model = self.model
        if model.rotors:
            raise ModelError(f"{model.name}: with loops no rotor is written, here that of {model.rotors[0].coordinate.name}; leave it out")
        for row in model.rows:
            is_joint = row.owner.joint in ("universal", *SLIDING)
            if not (_is_rod(row) or is_joint or row.owner.kind in ("body", "coordinate") or self._shares(row)):
                raise ModelError(
                    f"{model.name}: constraint {row.label} ({row.owner}) belongs to no joint; a file of links and joints cannot say it"
                )

    # -- numbers -------------------------------------------------------------------------------

    def _acting(self, coordinate: Relative) -> Acting:
        """At a coordinate that is 0 where the model begins."""
        return acting(self.model, coordinate.name, float(coordinate.initial[0]))

    def _shapes(self, solid: _Part) -> tuple[Shape, ...]:
        body = self.model.ground if solid is self.world else solid.body
        return shapes_on(self.model, body, solid.position) if body else ()

    def _free(self, name: str) -> str:
        while name in self.names:
            name += "_"
        self.names.add(name)
        return name


def _with_coordinates(robot: Robot, space: JointsOfTree) -> Robot:
    """Joints of an open tree get the names, signs and zeros of the coordinates that follow them."""
    kernels, joints = space.kernels, list(robot.joints)
    for coordinate, (rate, factor) in space.followed.items():
        child = next(link.body.name for link, rates in zip(space.tree.links, space.tree.rates, strict=True) if rate in rates)
        number, joint = next((number, joint) for number, joint in enumerate(joints) if joint.child == child)
        if joint.kind in ("revolute", "prismatic"):
            name, start = kernels.coordinates[coordinate], float(kernels.q0[coordinate])
            joint = replace(joint, name=name, axis=joint.axis if factor > 0 else -joint.axis, **acting(kernels.model, name))
            back = motion(joint, np.array([0.0 if abs(start) < ROUNDING else -start]))
            joints[number] = replace(joint, placement=joint.placement @ back)
    return replace(robot, joints=tuple(joints))


def _is_rod(row: Row) -> bool:
    return row.owner.kind == "user" and row.type is not None and row.type.key == "distance"


def _points(segment: Combination) -> list[Point]:
    """The two points of a segment, its end first."""
    ends = sorted(segment.terms, key=lambda term: -float(term[0]))
    if len(ends) != 2 or not all(isinstance(element, Point) for _, element in ends):
        raise ModelError(f"{segment} is not a segment between two points; a file of links and joints cannot say it")
    return [element for _, element in ends if isinstance(element, Point)]
