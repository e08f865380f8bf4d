"""A robot as its file says it: links with inertia, and joints between them.

Every format is read into this, and what natural coordinates make of it (`ncgen.exchange.robots.natural`) knows no format.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from ncgen.errors import ModelError, shown
from ncgen.exchange.robots.looks import Shape
from ncgen.exchange.robots.placement import Placement
from ncgen.model.arithmetic import dot, product
from ncgen.model.names import numbered

KINDS = ("fixed", "revolute", "prismatic", "spherical", "planar", "floating", "universal", "screw")
"""How a joint can move; a continuous one is revolute."""


@dataclass(frozen=True, eq=False)
class Mass:
    """mass (kg), com (3,) (m) and tensor about it (3, 3) (kg m²), in the axes of a frame."""

    mass: float
    com: np.ndarray
    tensor: np.ndarray

    @classmethod
    def of(cls, mass: float, moments: Iterable[float], frame: Placement) -> Mass | None:
        """From the mass and the moments xx, yy, zz, xy, xz, yz about the origin of a frame; None where nothing of it is more than 0."""
        xx, yy, zz, xy, xz, yz = moments
        tensor = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        return cls(mass, np.zeros(3), tensor).seen_from(frame) if mass > 0 or tensor.any() else None

    def seen_from(self, frame: Placement) -> Mass:
        """The same, where its own frame stands in another one like this."""
        return Mass(self.mass, frame.at(self.com), product(product(frame.rotation, self.tensor), frame.rotation.T))

    def plus(self, other: Mass) -> Mass:
        """Both together."""
        total = self.mass + other.mass
        com = (self.mass * self.com + other.mass * other.com) / total if total > 0 else self.com
        return Mass(total, com, self.tensor_about(com) + other.tensor_about(com))

    def tensor_about(self, point: np.ndarray) -> np.ndarray:
        """Steiner's tensor about another point."""
        d = self.com - point
        return self.tensor + self.mass * (dot(d, d) * np.eye(3) - np.outer(d, d))


@dataclass(frozen=True, eq=False, kw_only=True)
class Link:
    """mass: None for a link without inertia; where: its place in the file, for messages; shapes: what it looks like, in its frame.

    lifted: masses whose weight is compensated by a force at their centre; their tensors say nothing
    frames: that something is measured in, by names that no other link has
    origin: the frame that the file calls like the link; None where the file has no such link
    sites: other frames that the file names on it
    """

    name: str
    mass: Mass | None
    where: str = ""
    shapes: tuple[Shape, ...] = ()
    lifted: tuple[Mass, ...] = ()
    frames: Mapping[str, Placement] = field(default_factory=dict)
    origin: Placement | None = field(default_factory=Placement)
    sites: Mapping[str, Placement] = field(default_factory=dict)

    def seen_from(self, frame: Placement) -> Link:
        """The same, where its own frame stands in another one like this."""
        mass = None if self.mass is None else self.mass.seen_from(frame)
        shapes, lifted = (tuple(each.seen_from(frame) for each in some) for some in (self.shapes, self.lifted))
        frames, sites = ({name: frame @ placement for name, placement in some.items()} for some in (self.frames, self.sites))
        origin = frame @ self.origin if self.origin else None
        return replace(self, mass=mass, shapes=shapes, lifted=lifted, frames=frames, origin=origin, sites=sites)


@dataclass(frozen=True, eq=False)
class Mimic:
    """The joint that another one follows: coordinate = factor · other + offset (rad or m)."""

    joint: str
    factor: float = 1.0
    offset: float = 0.0


@dataclass(frozen=True, eq=False, kw_only=True)
class Coupling:
    """A row over joints: Σ share · coordinate = offset (rad or m) + c₁ x + c₂ x² + …, where x is the sum over others.

    zeros: {joint: the value from which its coordinate counts}
    shares, others: {joint: share}; powers: c₁, c₂, …
    """

    name: str
    shares: Mapping[str, float]
    offset: float = 0.0
    where: str = ""
    others: Mapping[str, float] = field(default_factory=dict)
    zeros: Mapping[str, float] = field(default_factory=dict)
    powers: tuple[float, ...] = ()


@dataclass(frozen=True, eq=False, kw_only=True)
class Joint:
    """A joint between two links.

    placement: of its frame in the parent's, where all coordinates are 0; the child's frame coincides with it there. Of a joint that closes
        a loop it is in the root's frame.
    axis (3,): a unit vector in the joint's frame; second (3,): the other axis of a universal joint
    armature: of a rotor that turns with the coordinate (kg m²; kg along a distance), ratio of the gear squared in it
    damping: N m s/rad or N s/m; stiffness: N m/rad or N/m, of a spring at rest where the coordinate is `rest`; pitch: m a turn of a screw
    more_damping, more_stiffness: factors of v |v|, v³ and of x², x³ in addition to those of v and x, x from the rest
    limits: lowest and highest value (rad or m); friction: dry, N m or N
    effort: least and greatest force of all its motors (N m, N)
    start: value of the coordinate where the model begins (rad or m)
    """

    name: str
    kind: str
    parent: str
    child: str
    placement: Placement = field(default_factory=Placement)
    axis: np.ndarray = field(default_factory=lambda: np.array([0.0, 0.0, 1.0]))
    second: np.ndarray | None = None
    armature: float = 0.0
    damping: float = 0.0
    stiffness: float = 0.0
    more_damping: tuple[float, ...] = ()
    more_stiffness: tuple[float, ...] = ()
    rest: float = 0.0
    pitch: float = 0.0
    limits: tuple[float, float] | None = None
    friction: float = 0.0
    effort: tuple[float, float] | None = None
    start: float = 0.0
    mimic: Mimic | None = None
    where: str = ""

    @property
    def has_spring(self) -> bool:
        """Whether a spring or a damper acts along it."""
        return bool(self.stiffness or self.damping or any(self.more_damping) or any(self.more_stiffness))

    def turned(self) -> Joint:
        """The same joint with the same coordinate, said from child to parent. Its placement must be one in the world."""
        axis, second = (self.axis, None) if self.second is None else (self.second, -self.axis)
        return replace(self, parent=self.child, child=self.parent, axis=-axis, second=second)


@dataclass(frozen=True, eq=False, kw_only=True)
class Actuator:
    """A motor or a servo: its force is gain · u + bias, both factors times (1, l, l̇) of its length l = Σ share · coordinate, u its input.

    shares: {joint: share}, by which the force acts, too; control, force: least and greatest u, and force
    """

    name: str
    shares: Mapping[str, float]
    gain: tuple[float, float, float] = (1.0, 0.0, 0.0)
    bias: tuple[float, float, float] = (0.0, 0.0, 0.0)
    control: tuple[float, float] | None = None
    force: tuple[float, float] | None = None


@dataclass(frozen=True, eq=False, kw_only=True)
class Sensor:
    """Something that a file measures. kind: of `ncgen.exchange.robots.sensors`

    of: the name of a frame, or {joint: share} of a length; cutoff: the largest reading, 0 for none; field (3,): what a magnetometer feels
    """

    name: str
    kind: str
    of: str | Mapping[str, float] = ""
    cutoff: float = 0.0
    field: tuple[float, float, float] = (0.0, 0.0, 0.0)


@dataclass(frozen=True, eq=False, kw_only=True)
class RobotState:
    """A named state of a file. values, rates: of joints with a coordinate (rad, m, and per second); time: s

    turned: {ball: its rotation (3, 3) and angular velocity (3,), in its child}
    free: {joint: the child's frame in the world, the velocity of its origin there (3,), its angular velocity in the child (3,)}
    inputs: by name
    """

    values: Mapping[str, float]
    rates: Mapping[str, float]
    turned: Mapping[str, tuple[np.ndarray, np.ndarray]] = field(default_factory=dict)
    free: Mapping[str, tuple[Placement, np.ndarray, np.ndarray]] = field(default_factory=dict)
    inputs: Mapping[str, float] = field(default_factory=dict)
    time: float = 0.0


@dataclass(frozen=True, eq=False, kw_only=True)
class Robot:
    """links by name; joints: each with one parent and one child, a tree; loops: joints besides, which close it; rows over coordinates

    base: of the root in the world; gravity: m/s²; floats: whether the root is a free body
    omitted: what the file says and a model does not, in words; starts: states of the file, by name
    actuators: of the file; None in formats without them
    motors: names of joints that have one, where a file next to the robot's says so
    assembled: (joint, how far it was moved, rad or m) to close loops; a joint with several motions stands there several times
    as_given: names of links, by themselves or with what is fixed to them, whose moments of inertia no body has, and are taken all the same
    resting: frames that the file names in the world, where no link rests
    words: what the format calls links and their other frames
    """

    name: str
    links: dict[str, Link]
    joints: tuple[Joint, ...]
    loops: tuple[Joint, ...] = ()
    base: Placement = field(default_factory=Placement)
    gravity: tuple[float, float, float] = (0.0, 0.0, -9.81)
    floats: bool = False
    omitted: tuple[str, ...] = ()
    rows: tuple[Coupling, ...] = ()
    starts: Mapping[str, RobotState] = field(default_factory=dict)
    actuators: tuple[Actuator, ...] | None = None
    sensors: tuple[Sensor, ...] = ()
    motors: tuple[str, ...] = ()
    assembled: tuple[tuple[str, float, str], ...] = ()
    as_given: frozenset[str] = frozenset()
    resting: Mapping[str, Placement] = field(default_factory=dict)
    words: tuple[str, str] = ("link", "frame")

    def ordered(self) -> Robot:
        """The same with every joint after that which carries its parent. Raises ModelError unless the joints make one tree."""
        carried = self._carried()
        roots = [name for name in self.links if name not in carried]
        if not roots:
            raise refused(self.joints[0].where, f"every link hangs on another: joint {self.joints[0].name} is in a circle; cut it")
        root, *others = roots
        if others:
            raise refused(
                self.links[others[0]].where, f"links {root} and {others[0]} both hang on nothing; join them, a robot has one root"
            )
        children: dict[str, list[Joint]] = {name: [] for name in self.links}
        for joint in self.joints:
            children[joint.parent].append(joint)
        order, waiting = [], list(reversed(children[root]))
        while waiting:
            order.append(joint := waiting.pop())
            waiting += reversed(children[joint.child])
        if len(order) < len(self.joints):
            left = next(joint for joint in self.joints if joint not in set(order))
            raise refused(left.where, f"joint {left.name}: its links {left.parent} and {left.child} are in a circle; cut it")
        return replace(self, joints=tuple(order))

    def grounded(self) -> Robot:
        """The same where a root that moves freely hangs by a joint on a link that does not, for formats whose root rests."""
        if not self.floats:
            return self
        world = numbered("world", self.links.__contains__)
        name = numbered(f"joint_{self.root}", {joint.name for joint in (*self.joints, *self.loops)}.__contains__)
        joints = (Joint(name=name, kind="floating", parent=world, child=self.root, placement=self.base), *self.joints)
        loops = tuple(replace(loop, placement=self.base @ loop.placement) for loop in self.loops)
        return replace(
            self, links={world: Link(name=world, mass=None), **self.links}, joints=joints, loops=loops, base=Placement(), floats=False
        )

    @cached_property
    def root(self) -> str:
        """The link that hangs on no other."""
        carried = {joint.child for joint in self.joints}
        return next(name for name in self.links if name not in carried)

    @property
    def follows_from_start(self) -> bool:
        """Whether a joint that mimics another one is not at 0 where that one is."""
        begins = {joint.name: joint.start for joint in self.joints}
        followers = ((joint, joint.mimic) for joint in self.joints if joint.mimic)
        return any(mimic.factor * begins.get(mimic.joint, 0.0) + mimic.offset != joint.start for joint, mimic in followers)

    def frames(self, base: Placement) -> dict[str, Placement]:
        """Those of all links where that of the root stands here and all coordinates are 0. Joints must be ordered."""
        placements = {self.root: base}
        for joint in self.joints:
            placements[joint.child] = placements[joint.parent] @ joint.placement
        return placements

    def _carried(self) -> dict[str, Joint]:
        """{link: the joint that carries it}, with all names looked up."""
        carried: dict[str, Joint] = {}
        for joint in self.joints:
            for name in (joint.parent, joint.child):
                if name not in self.links:
                    raise refused(joint.where, f"joint {joint.name}: there is no link {shown(name)}")
            if joint.child in carried:
                other = carried[joint.child].name
                raise refused(joint.where, f"joint {joint.name}: link {joint.child} hangs on joint {other} already; a tree has one")
            carried[joint.child] = joint
        return carried


def frame_of(robot: Robot, name: str) -> tuple[str, Placement] | None:
    """The link on which a frame of the file is, and its placement there; None where there is no such frame."""
    if name in robot.links:
        return name, robot.links[name].origin or Placement()
    return next(((link.name, link.sites[name]) for link in robot.links.values() if name in link.sites), None)


def refused(where: str, problem: str) -> ModelError:
    """What is wrong, and where it stands in the file if that is known."""
    return ModelError(f"{where}: {problem}" if where else problem)


def hung(robot: Robot, placements: Mapping[str, Placement]) -> Robot:
    """A robot, ordered, whose file says where things are in the world instead of in each other.

    robot: with joints' placements in the world, its masses in frames of the file's own; placements: {link: that frame in the world}
    """
    frames = {**placements, **{joint.child: joint.placement for joint in robot.joints}}

    def moved(link: Link) -> Link:
        return link.seen_from(frames[link.name].inverse() @ placements[link.name])

    links = {name: moved(link) for name, link in robot.links.items()}
    joints = (replace(joint, placement=frames[joint.parent].inverse() @ joint.placement) for joint in robot.joints)
    arranged = replace(robot, links=links, joints=tuple(joints)).ordered()
    base = frames[arranged.root]
    loops = (replace(loop, placement=base.inverse() @ loop.placement) for loop in robot.loops)
    return replace(arranged, base=base, loops=tuple(loops))


def unique(items: Iterable[Link | Joint], kind: str) -> None:
    """Refuse two of the same name."""
    known: set[str] = set()
    for item in items:
        if item.name in known:
            raise ModelError(f"{item.where}: there are two {kind}s {shown(item.name)}; rename one")
        known.add(item.name)


def together(robot: Robot) -> Robot:
    """The robot without fixed joints, and with their children in their parents. Joints must be ordered."""
    home: dict[str, tuple[str, Placement]] = {robot.root: (robot.root, Placement())}
    links = dict(robot.links)
    joints = []
    for joint in robot.joints:
        body, placement = home[joint.parent]
        placed = placement @ joint.placement
        if joint.kind != "fixed":
            home[joint.child] = joint.child, Placement()
            joints.append(replace(joint, parent=body, placement=placed))
            continue
        home[joint.child] = body, placed
        link, more = links[body], links.pop(joint.child).seen_from(placed)
        mass = link.mass.plus(more.mass) if link.mass and more.mass else link.mass or more.mass
        shapes, lifted = (*link.shapes, *more.shapes), (*link.lifted, *more.lifted)
        links[body] = replace(link, mass=mass, shapes=shapes, lifted=lifted, frames={**link.frames, **more.frames})
    for loop in robot.loops:
        if home[loop.parent][0] == home[loop.child][0]:
            raise refused(loop.where, changes_nothing(loop, f"links {loop.parent} and {loop.child} are fixed to each other"))
    loops = tuple(replace(loop, parent=home[loop.parent][0], child=home[loop.child][0]) for loop in robot.loops)
    return replace(robot, links=links, joints=tuple(joints), loops=loops)


def changes_nothing(loop: Joint, why: str) -> str:
    """What is wrong with a joint that closes a loop and holds nothing."""
    return f"joint {loop.name} changes nothing: {why}; leave it out"
