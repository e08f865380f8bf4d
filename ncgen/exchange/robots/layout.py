"""Which points and vectors a robot's bodies are described by: as few as there can be.

A hinge is a point on its axis and the axis' direction, both shared by the two bodies that it joins. Where axes of a body meet the point
is one, where they are parallel the direction is. A body whose elements do not tell all of its directions gets unit vectors of its own,
so that it has an affine basis (García de Jalón & Bayo 1994, section 2.2).
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from ncgen.exchange.robots.placement import Placement
from ncgen.exchange.robots.robot import Joint, Robot, changes_nothing, refused
from ncgen.model.arithmetic import cross, dot, norm, product, unit
from ncgen.model.measures import MIN_RELATIVE_LENGTH
from ncgen.model.singular_values import singular_values

POINT_TOLERANCE = 1e-9
"""Points nearer than this, over the robot's size, are one."""

PARALLEL = 1e-11
"""Directions whose sine is smaller are parallel: twelve digits of π/2 are off by 5e-12. With less the model is as the file says."""

PARALLEL_IN_LOOPS = 1e-5
"""The sine of directions where loops are closed: axes that are parallel but for a file's last digits would lock them."""

POINT_OFFSET = 0.1
"""How far along its axis, over the robot's size, a hinge's point goes out of the way of another one."""

MIN_SINGULAR_VALUE = 0.2
"""A basis whose least singular value is smaller, directions having length 1, gets another vector."""


SHARED = ("revolute", "spherical")
"""Kinds of joints that are elements of both bodies, and no rows."""


@dataclass(eq=False)
class PlannedElement:
    """A point (m), or a direction of length 1, where all coordinates are 0. link: with whose frame a point is placed"""

    name: str
    value: np.ndarray
    is_point: bool
    link: str = ""


@dataclass(eq=False)
class RobotSolid:
    """A body and what describes it."""

    name: str
    planned: list[PlannedElement] = field(default_factory=list)

    @property
    def points(self) -> list[PlannedElement]:
        return [element for element in self.planned if element.is_point]

    @property
    def vectors(self) -> list[PlannedElement]:
        return [element for element in self.planned if not element.is_point]

    def take(self, element: PlannedElement) -> PlannedElement:
        """Plan an element, if it is not planned yet."""
        if element not in self.planned:
            self.planned.append(element)
        return element

    def directions(self, shortest: float) -> np.ndarray:
        """Of its vectors and from its first point to others that are farther away than `shortest` (m), of length 1, as rows."""
        segments = [d for p in self.points[1:] if norm(d := p.value - self.points[0].value) > shortest]
        return np.array([unit(d) for d in (*segments, *(v.value for v in self.vectors))]).reshape(-1, 3)


@dataclass(eq=False, kw_only=True)
class Hold:
    """A joint and its places: start on the parent, end on the child, the same one where they are shared; axis with its sign.

    closes: it closes a loop
    """

    joint: Joint
    parent: RobotSolid
    child: RobotSolid
    start: PlannedElement | None = None
    end: PlannedElement | None = None
    axis: PlannedElement | None = None
    sign: float = 1.0
    second: PlannedElement | None = None
    closes: bool = False


@dataclass(eq=False, kw_only=True)
class Layout:
    """ground: what rests, empty where the root moves; solids by link; holds in the order of the joints; frames: of the links.

    size: of the robot (m)
    """

    ground: RobotSolid
    solids: dict[str, RobotSolid]
    holds: list[Hold]
    frames: dict[str, Placement]
    size: float


class Layer:
    """Finds places of a robot without fixed joints. floating: its root moves freely.

    apart: placements of joints change, so that every joint has a point of its own, and vectors alone span bodies
    """

    def __init__(self, robot: Robot, floating: bool, apart: bool = False) -> None:
        self.robot, self.floating, self.apart = robot, floating, apart
        self.frames = robot.frames(robot.base)
        origins = np.array([frame.position for frame in self.frames.values()])
        self.placements = {joint: self.frames[joint.child] for joint in robot.joints} | {
            loop: robot.base @ loop.placement for loop in robot.loops
        }
        hearts = np.array([self._heart(name) for name in self.frames])
        self.size = float(np.ptp(origins, axis=0).max()) or float(np.ptp([*origins, *hearts], axis=0).max()) or 1.0
        self.near, self.parallel = POINT_TOLERANCE * self.size, PARALLEL_IN_LOOPS if robot.loops else PARALLEL
        self.solids = {name: RobotSolid(name) for name in self.frames}
        self.holds: list[Hold] = []
        self.carriers: dict[str, list[Hold]] = defaultdict(list)
        self.hinges: dict[str, list[Joint]] = defaultdict(list)
        for joint in robot.joints:
            if joint.kind == "revolute":
                self.hinges[joint.parent].append(joint)

    def layout(self) -> Layout:
        if self.apart:
            carried = {joint.child for joint in self.robot.joints if joint.kind != "floating"}
            for name in self.frames.keys() - carried if self.floating else self.frames.keys() - carried - {self.robot.root}:
                self.solids[name].take(PlannedElement(f"r_{name}", self.frames[name].position, True, name))
        for joint in (*self.robot.joints, *self.robot.loops):
            self.holds.append(self._hold(joint))
            self.carriers[joint.child].append(self.holds[-1])
        root = self.solids[self.robot.root]
        ground = RobotSolid("ground") if self.floating else self.solids.pop(self.robot.root)
        for name, solid in self.solids.items():
            self._complete(solid, self._heart(name))
        return Layout(ground=ground if self.floating else root, solids=self.solids, holds=self.holds, frames=self.frames, size=self.size)

    # -- joints --------------------------------------------------------------------------------

    def _hold(self, joint: Joint) -> Hold:
        hold = Hold(joint=joint, parent=self.solids[joint.parent], child=self.solids[joint.child], closes=joint in self.robot.loops)
        before = len(hold.parent.planned) + len(hold.child.planned)
        getattr(self, f"_{joint.kind}")(hold)
        if hold.closes and joint.kind in SHARED and len(hold.parent.planned) + len(hold.child.planned) == before:
            raise refused(joint.where, changes_nothing(joint, "its links share its point and axis already"))
        return hold

    def _revolute(self, hold: Hold) -> None:
        self._share_axis(hold)
        hold.start = hold.end = self._shared_point(hold)

    def _spherical(self, hold: Hold) -> None:
        origin = self._origin(hold.joint)
        points = (*hold.parent.points, *hold.child.points)
        known = None if self.apart else next((p for p in points if np.linalg.norm(p.value - origin) < self.near), None)
        hold.start = hold.end = hold.child.take(hold.parent.take(known or self._point(hold, "r", origin)))

    def _universal(self, hold: Hold) -> None:
        self._spherical(hold)
        hold.axis, hold.sign = self._parallel(hold)
        assert hold.joint.second is not None, "a universal joint with one axis"
        hold.second = hold.child.take(PlannedElement(f"v_{hold.joint.name}", self._directed(hold.joint, hold.joint.second), False))

    def _prismatic(self, hold: Hold) -> None:
        self._slide(hold, hold.parent.points)

    _planar = _prismatic

    def _screw(self, hold: Hold) -> None:
        """From a point of the parent on the axis, about which the child turns."""
        origin, axis = self._origin(hold.joint), self._axis(hold.joint)
        self._slide(hold, [p for p in hold.parent.points if np.linalg.norm(cross(p.value - origin, axis)) < self.near])

    def _slide(self, hold: Hold, points: Sequence[PlannedElement]) -> None:
        """A point of the child slides along the joint's axis from one of these of the parent, else from the joint's origin."""
        self._share_axis(hold)
        known = [] if self.apart else points
        hold.start = known[0] if known else hold.parent.take(self._point(hold, "r", self._origin(hold.joint)))
        hold.end = hold.child.take(self._point(hold, "s", hold.start.value))

    def _floating(self, hold: Hold) -> None:
        """Nothing is shared."""

    _fixed = _floating

    def _share_axis(self, hold: Hold) -> None:
        hold.axis, hold.sign = self._parallel(hold)
        hold.child.take(hold.axis)

    def _parallel(self, hold: Hold) -> tuple[PlannedElement, float]:
        """A vector of the parent along a joint's axis, and its sign: one that it or the child has, or a new one."""
        direction = self._axis(hold.joint)
        for vector in (*hold.parent.vectors, *hold.child.vectors):
            if np.linalg.norm(cross(vector.value, direction)) < self.parallel:
                return hold.parent.take(vector), float(np.sign(dot(vector.value, direction)))
        return hold.parent.take(PlannedElement(f"u_{hold.joint.name}", direction, False)), 1.0

    def _shared_point(self, hold: Hold) -> PlannedElement:
        """A point on a hinge's axis: one of the parent's, else where the next axis meets it, else the joint's origin.

        A parent that rests has a point for each of its hinges: it costs nothing, and axes that coincide may be changed apart. Where the
        parent itself hangs on this axis the point is another one: sharing both would join the child to the parent's parent, too.
        """
        origin, axis = self._origin(hold.joint), self._axis(hold.joint)
        taken = next((h.start for h in self.carriers[hold.parent.name] if h.axis is hold.axis), None)
        rests = hold.parent.name == self.robot.root and not self.floating
        shared = () if self.apart else hold.child.points if rests else (*hold.parent.points, *hold.child.points)
        for point in shared:
            if point is not taken and np.linalg.norm(cross(point.value - origin, axis)) < self.near:
                return hold.child.take(hold.parent.take(point))
        if taken and np.linalg.norm(taken.value - origin) < self.near:
            return hold.child.take(hold.parent.take(self._point(hold, "r", origin + POINT_OFFSET * self.size * axis)))
        if self.apart:
            return hold.child.take(hold.parent.take(self._point(hold, "r", origin)))
        meetings = (self._meeting(origin, axis, self._origin(joint), self._axis(joint)) for joint in self.hinges[hold.child.name])
        position = min((m for m in meetings if m is not None), key=lambda m: norm(m - origin), default=origin)
        return hold.child.take(hold.parent.take(self._point(hold, "r", position)))

    def _meeting(self, a: np.ndarray, u: np.ndarray, b: np.ndarray, v: np.ndarray) -> np.ndarray | None:
        """Where two lines meet; None where they are parallel, or pass each other."""
        across = cross(u, v)
        if np.linalg.norm(across) < MIN_SINGULAR_VALUE or abs(dot(b - a, across)) > self.near * np.linalg.norm(across):
            return None
        return a + dot(cross(b - a, v), across) / dot(across, across) * u

    # -- frames --------------------------------------------------------------------------------

    def _origin(self, joint: Joint) -> np.ndarray:
        return self.placements[joint].position

    def _axis(self, joint: Joint) -> np.ndarray:
        return self._directed(joint, joint.axis)

    def _directed(self, joint: Joint, direction: np.ndarray) -> np.ndarray:
        """A direction of a joint's frame in the global one; what is 0 but for rounding is 0."""
        global_direction = self.placements[joint].along(direction)
        global_direction = np.where(np.abs(global_direction) < 1e-15, 0.0, global_direction)
        return unit(global_direction)

    def _point(self, hold: Hold, prefix: str, position: np.ndarray) -> PlannedElement:
        value = np.where(np.abs(position) < 1e-3 * self.near, 0.0, position)
        return PlannedElement(f"{prefix}_{hold.joint.name}", value, True, hold.child.name)

    # -- bodies --------------------------------------------------------------------------------

    def _heart(self, name: str) -> np.ndarray:
        """The centre of mass of a link, or its origin."""
        mass = self.robot.links[name].mass
        return self.frames[name].at(mass.com) if mass else self.frames[name].position

    def _complete(self, solid: RobotSolid, heart: np.ndarray) -> None:
        """A point, and directions that span space."""
        if not solid.points:
            solid.take(PlannedElement(f"r_{solid.name}", heart, True, solid.name))
        shortest = np.inf if self.apart else MIN_RELATIVE_LENGTH * self.size
        while (rows := solid.directions(shortest)).shape[0] < 3 or singular_values(rows)[-1] < MIN_SINGULAR_VALUE:
            number = len(solid.vectors) + 1
            solid.take(PlannedElement(f"e{number}_{solid.name}", _missing(rows, self.frames[solid.name]), False))


def _missing(rows: np.ndarray, frame: Placement) -> np.ndarray:
    """The direction that some span least; of the body's frame where any will do."""
    if len(rows) == 0:
        return frame.rotation[:, 0]
    held = rows[0]
    across = max((cross(held, other) for other in rows), key=norm)
    if norm(across) > MIN_SINGULAR_VALUE:
        return unit(across)
    axis = frame.rotation[:, int(np.argmin(np.abs(product(frame.rotation.T, held))))]
    return unit(axis - dot(axis, held) * held)
