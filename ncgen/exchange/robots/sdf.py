"""Robots from SDF, the format of Gazebo (sdformat.org), one model a file; joints may close loops.

Links, joints and frames say where they are in the model, or in one another (`relative_to`). A joint whose child is carried already closes a
loop. Without a joint to the world the robot is a free body.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from xml.sax.saxutils import escape

import numpy as np

from ncgen.errors import ModelError, shown
from ncgen.exchange.robots.accounting import counted
from ncgen.exchange.robots.looks import Shape, Unseen, colour_of, mesh, rgba_of, seen, shape, unseen
from ncgen.exchange.robots.markup import DEEPEST, UNLIMITED, Markup, refusals
from ncgen.exchange.robots.placement import Placement
from ncgen.exchange.robots.robot import Coupling, Joint, Link, Mass, Mimic, Robot, hung, unique
from ncgen.exchange.robots.stops import FRICTION
from ncgen.exchange.robots.written import document, element, number_text
from ncgen.model.arithmetic import dot

KINDS = {
    "fixed": "fixed", "revolute": "revolute", "continuous": "revolute", "prismatic": "prismatic", "ball": "spherical",
    "universal": "universal", "revolute2": "universal", "screw": "screw",
}  # fmt: skip
"""Joint types of the format, and what they are here."""

OMITTED = {
    "limit": "limits of joints", "collision": "collision shapes", "sensor": "sensors", "plugin": "plugins", "light": "lights",
}  # fmt: skip
"""What is not modelled: tags, and words for them."""

GEARBOX = "gearbox"
"""The joint type that moves nothing: it couples two hinges."""

ACTING, FORCES = ("revolute", "continuous", "prismatic", "screw"), ("damping", "spring_stiffness")
"""Joints that have one coordinate, along which something can act, and what can."""

ALIGNED = 1 - 1e-9
"""Cosine of the angle from which on two axes are one."""

WORLD, MODEL = "world", "__model__"


def robot_of(root: Markup, path: Path) -> Robot:
    """The robot of a file, from its root element. Raises ModelError with file and line."""
    world = root.first("world") or root
    models = world.all("model")
    if len(models) != 1:
        root.refuse(f"{len(models)} models; a robot's file has one")
    (model,) = models
    for tag, what in (("include", "included files are not read"), ("model", "nested models are not read")):
        if found := model.first(tag):
            found.refuse(f"{what}; write its links and joints out")
    return _Reader(root, world, model, path).robot()


def problems_of(root: Markup, path: Path) -> list[str]:
    """What is wrong with links and joints, each looked at by itself, where there is one model."""
    world = root.first("world") or root
    models = world.all("model")
    if len(models) != 1:
        return []
    reader = _Reader(root, world, models[0], path)
    return [*refusals(reader._link, models[0].all("link")), *refusals(reader._joint, reader.moving)]


class _Reader:
    def __init__(self, root: Markup, world: Markup, model: Markup, path: Path) -> None:
        self.root, self.world, self.model, self.path = root, world, model, path
        self.looks: list[Shape | Unseen] = []
        self.version = tuple(int(part) for part in root.attributes.get("version", "1.7").split(".") if part.isdigit())
        self.named = {each.name(): each for each in (*model.all("link"), *model.all("joint"), *model.all("frame"))}
        gears = [each for each in model.all("joint") if each.attributes.get("type") == GEARBOX]
        self.gears, self.moving = gears, [each for each in model.all("joint") if each not in gears]
        self.known: dict[str, Placement] = {MODEL: Placement()}
        self.stands = _pose(model.first("pose"))
        self.waiting: list[str] = []

    def robot(self) -> Robot:
        links = [self._link(each) for each in self.model.all("link")]
        joints = [self._joint(each) for each in self.moving]
        if not links:
            self.model.refuse("<model> has no <link>; give it one")
        unique(links, "link")
        unique(joints, "joint")
        static = self.model.first("static")
        hangs = any(joint.parent == WORLD for joint in joints)
        floats = not hangs and not (static is not None and static.text.strip() in ("1", "true"))
        if hangs:
            links.insert(0, Link(WORLD, None))
        gravity = self.world.first("gravity")
        field = gravity.content(3) if gravity is not None else (0.0, 0.0, -9.81)
        gears = tuple(self._gear(each, joints) for each in self.gears)
        return replace(self._tree(links, joints, (field[0], field[1], field[2]), floats), rows=gears)

    def _tree(self, links: list[Link], joints: list[Joint], gravity: tuple[float, float, float], floats: bool) -> Robot:
        """The first joint of every link carries it, others close loops."""
        tree: list[Joint] = []
        carried: set[str] = set()
        for joint in joints:
            if joint.child not in carried:
                carried.add(joint.child)
                tree.append(joint)
        loops = tuple(joint for joint in joints if joint not in tree)
        named = {link.name: link for link in links}
        robot = Robot(self.model.name(), named, tuple(tree), loops, gravity=gravity, floats=floats, omitted=self._omitted())
        found = hung(robot, {name: self._place(name) for name in named})
        return replace(found, base=self.stands @ found.base)

    def _omitted(self) -> tuple[str, ...]:
        several = (each for each in self.model.all("joint") if each.attributes.get("type") not in ACTING)
        damped = sum(_number(each, name) != 0.0 for joint in several for each in joint.walk() if each.tag == "dynamics" for name in FORCES)
        words = (f"damping and springs of joints of several freedoms ({damped})",) if damped else ()
        dynamics = (each for each in self.model.walk() if each.tag == "dynamics")
        frictions = sum(_number(each, "friction") != 0.0 for each in dynamics)
        said = [*(OMITTED[each.tag] for each in self.model.walk() if each.tag in OMITTED), *[FRICTION] * frictions]
        return (*counted(said), *words, *unseen(self.looks))

    # -- where things are ----------------------------------------------------------------------

    def _place(self, name: str) -> Placement:
        """A link, joint or frame in the model, all coordinates at 0."""
        if name == WORLD:
            return self.known[MODEL]
        if name not in self.known:
            each = self.named[name]
            if name in self.waiting:
                each.refuse(f"{each.tag} {name} is placed relative to itself, by way of {', '.join(shown(n) for n in self.waiting[:3])}")
            if len(self.waiting) > DEEPEST:
                each.refuse(
                    f"{each.tag} {name} is placed relative to more than {DEEPEST} others, one after the other; a robot needs no such row"
                )
            self.waiting.append(name)
            self.known[name] = self._read(each)
            self.waiting.pop()
        return self.known[name]

    def _read(self, each: Markup) -> Placement:
        pose = each.first("pose")
        default = {"joint": lambda: each.only("child").text.strip(), "frame": lambda: each.attributes.get("attached_to") or MODEL}
        base = (pose.attributes.get("relative_to") if pose else None) or default.get(each.tag, lambda: MODEL)()
        if base not in self.named and base not in (MODEL, WORLD):
            each.refuse(f"{each.tag} {each.name()}: there is no link, joint or frame {shown(base)}")
        return self._place(base) @ _pose(pose)

    # -- links and joints ----------------------------------------------------------------------

    def _link(self, each: Markup) -> Link:
        inertial = each.first("inertial")
        looks = [self._look(visual) for visual in each.all("visual")]
        self.looks += looks
        return Link(each.name(), None if inertial is None else _mass(inertial), each.place, seen(looks))

    def _look(self, visual: Markup) -> Shape | Unseen:
        """What is seen of a link, in its frame."""
        geometry, material, pose = (visual.first(tag) for tag in ("geometry", "material", "pose"))
        inside = geometry.children[0] if geometry and geometry.children else None
        diffuse = material.first("diffuse") if material else None
        colour = colour_of(diffuse.content(len(diffuse.text.split()))) if diffuse and len(diffuse.text.split()) in (3, 4) else None
        place = _pose(pose)
        if inside is None:
            return Unseen("none")
        match inside.tag:
            case "box":
                return shape("box", inside.only("size").content(3), place, colour)
            case "sphere":
                return shape("sphere", inside.only("radius").content(1), place, colour)
            case "ellipsoid":
                return shape("ellipsoid", inside.only("radii").content(3), place, colour)
            case "cylinder" | "capsule" as kind:
                return shape(kind, [*inside.only("radius").content(1), *inside.only("length").content(1)], place, colour)
            case "mesh":
                scale = inside.first("scale")
                return mesh(inside.only("uri").text, scale.content(3) if scale else (1.0, 1.0, 1.0), place, colour, self.path)
            case other:
                return Unseen(other)

    def _joint(self, each: Markup) -> Joint:
        """With its own placement in the model in place of that in its parent."""
        name, kind = each.name(), each.name("type")
        if kind not in KINDS:
            each.refuse(f"joint {name}: the type {shown(kind)} is not read; known are {', '.join((*KINDS, GEARBOX))}")
        ends = {tag: each.only(tag).text.strip() for tag in ("parent", "child")}
        for tag, link in ends.items():
            if link != WORLD and (link not in self.named or self.named[link].tag != "link"):
                each.refuse(f"joint {name}: its {tag} {shown(link)} is no link of this model")
        axis, second = each.first("axis"), each.first("axis2")
        pitch = each.first("screw_thread_pitch")
        dynamics = axis.first("dynamics") if axis and kind in ACTING else None
        joint = Joint(
            name,
            KINDS[kind],
            ends["parent"],
            ends["child"],
            self._place(name),
            self._axis(each, axis) if kind not in ("fixed", "ball") else np.array([0.0, 0.0, 1.0]),
            self._axis(each, second) if KINDS[kind] == "universal" else None,
            damping=_number(dynamics, "damping"),
            stiffness=_number(dynamics, "spring_stiffness"),
            rest=_number(dynamics, "spring_reference"),
            pitch=pitch.content(1)[0] if pitch else 0.0,
            limits=_limits(axis) if kind in ACTING else None,
            friction=_number(dynamics, "friction"),
            mimic=_mimic(axis) if kind in ACTING else None,
            where=each.place,
        )
        return joint.turned() if joint.child == WORLD else joint

    def _gear(self, each: Markup, joints: list[Joint]) -> Coupling:
        """The child's angle beside the reference body is −ratio times the parent's, each about an axis of the gearbox's own."""
        name, body = each.name(), each.only("gearbox_reference_body").text.strip()
        shares: dict[str, float] = {}
        for tag, axis, share in (("parent", "axis", _number(each, "gearbox_ratio", 1.0)), ("child", "axis2", 1.0)):
            link = each.only(tag).text.strip()
            about = self._place(name).along(self._axis(each, each.first(axis)))
            hinges = (joint for joint in joints if joint.kind == "revolute" and {joint.parent, joint.child} == {link, body})
            along = {joint.name: dot(joint.placement.along(joint.axis), about) * (1 if joint.child == link else -1) for joint in hinges}
            hinge = next((joint for joint, cosine in along.items() if abs(cosine) > ALIGNED), None)
            if hinge is None:
                each.refuse(f"joint {name}: no hinge along its {axis} joins its {tag} {shown(link)} to {shown(body)}; give it one")
            shares[hinge] = shares.get(hinge, 0.0) + share * float(np.sign(along[hinge]))
        return Coupling(name, shares, where=each.place)

    def _axis(self, joint: Markup, axis: Markup | None) -> np.ndarray:
        """In the joint's frame."""
        if axis is None:
            joint.refuse(f"joint {joint.name()}: it has no axis; give it one")
        element = axis.only("xyz")
        found = element.unit(element.content(3), joint.name())
        base = element.attributes.get("expressed_in")
        if base is not None and base not in self.named and base != MODEL:
            element.refuse(f"joint {joint.name()}: there is no link, joint or frame {shown(base)}")
        flag = axis.first("use_parent_model_frame")
        if self.version <= (1, 4) or (flag is not None and flag.text.strip() in ("1", "true")):
            base = MODEL
        return found if base is None else self._place(joint.name()).inverse().along(self._place(base).along(found))


def _mimic(axis: Markup | None) -> Mimic | None:
    """Which joint an axis follows (SDF 1.10 on)."""
    said = axis.first("mimic") if axis is not None else None
    if said is None:
        return None
    factor = _number(said, "multiplier", 1.0)
    return Mimic(said.name("joint"), factor, _number(said, "offset") - factor * _number(said, "reference"))


def _limits(axis: Markup | None) -> tuple[float, float] | None:
    """Those of a joint, which may be infinite as 1e16, or None."""
    limit = axis.first("limit") if axis is not None else None
    if limit is None or (limit.first("lower") is None and limit.first("upper") is None):
        return None
    lower, upper = (each.limit(each.text, tag) if (each := limit.first(tag)) else end for tag, end in LIMITS.items())
    return None if lower <= -UNLIMITED and upper >= UNLIMITED else (lower, upper)


LIMITS = {"lower": -UNLIMITED, "upper": UNLIMITED}
"""Of a joint, where the file says none."""


def _pose(pose: Markup | None) -> Placement:
    if pose is None or not pose.text.strip():
        return Placement()
    if pose.attributes.get("rotation_format", "euler_rpy") != "euler_rpy" or pose.attributes.get("degrees", "0") not in ("0", "false"):
        pose.refuse("poses are read as x y z roll pitch yaw in m and rad; write it so")
    numbers = pose.content(6)
    return Placement.of_rpy(numbers[:3], numbers[3:])


def _mass(inertial: Markup) -> Mass | None:
    """None where nothing of it is more than 0. Without a number the mass is 1 kg and the tensor that of SDF's default."""
    mass, inertia = inertial.first("mass"), inertial.first("inertia")
    kilograms = mass.content(1)[0] if mass is not None else 1.0
    if kilograms < 0:
        inertial.refuse(f"the mass is {kilograms:g} kg; give a positive number")
    return Mass.of(kilograms, (_number(inertia, *entry) for entry in ENTRIES.items()), _pose(inertial.first("pose")))


ENTRIES = {"ixx": 1.0, "iyy": 1.0, "izz": 1.0, "ixy": 0.0, "ixz": 0.0, "iyz": 0.0}
"""Of a tensor of inertia, with the format's defaults (kg m²)."""


def _number(inside: Markup | None, tag: str, default: float = 0.0) -> float:
    found = inside.first(tag) if inside is not None else None
    return default if found is None else found.content(1)[0]


# -- writing -----------------------------------------------------------------------------------

WORDS = {"spherical": "ball"}
"""The format's words where they are other ones."""


def text_of(robot: Robot) -> str:
    """A robot as SDF 1.7, loops among its joints. Raises ModelError naming a joint that the format cannot say."""
    frames = robot.frames(robot.base)
    joints = []
    for joint in robot.joints:
        if joint.kind != "floating":
            joints.append(_joint_text(joint, frames[joint.child]))
        elif joint.parent != robot.root or robot.links[robot.root].mass or sum(j.parent == robot.root for j in robot.joints) > 1:
            raise ModelError(f"joint {joint.name}: SDF cannot say that a link moves freely beside others; a robot hangs together")
    free = {joint.parent for joint in robot.joints if joint.kind == "floating"}
    joints += [_joint_text(loop, robot.base @ loop.placement) for loop in robot.loops]
    hidden = free | ({WORLD} if not robot.floats else set())
    if not robot.floats and robot.root != WORLD and not free:
        joints.insert(0, _joint_text(Joint(f"{robot.root}_rests", "fixed", WORLD, robot.root), robot.base))
    links = [_link_text(link, frames[name]) for name, link in robot.links.items() if name not in hidden]
    model = element("model", [*links, *joints], name=robot.name)
    return document(element("sdf", [element("world", [element("gravity", [_written(robot.gravity)]), model], name="world")], version="1.7"))


def _written(values: Iterable[float]) -> str:
    return " ".join(number_text(x) for x in values)


def _placed(frame: Placement, **attributes: str) -> str:
    return element("pose", [_written((*frame.position, *frame.rpy))], **attributes)


def _visual_text(shape: Shape, number: int) -> str:
    names = {"box": ["size"], "cylinder": ["radius", "length"], "sphere": ["radius"], "ellipsoid": ["radii"], "mesh": ["scale"]}[shape.kind]
    sizes = [shape.sizes] if len(names) == 1 else [(size,) for size in shape.sizes]
    inside = [element("uri", [escape(f"file://{shape.file}")])] if shape.file else []
    inside += [element(name, [_written(size)]) for name, size in zip(names, sizes, strict=True)]
    colour = [element("material", [element("diffuse", [_written(rgba_of(shape.colour))])])] if shape.colour else []
    return element(
        "visual", [_placed(shape.placement), element("geometry", [element(shape.kind, inside)]), *colour], name=f"visual{number}"
    )


def _link_text(link: Link, frame: Placement) -> str:
    mass = link.mass
    parts = [_placed(frame), *(_visual_text(shape, number) for number, shape in enumerate(link.shapes, 1))]
    if mass is not None:
        (xx, xy, xz), (_, yy, yz), (_, _, zz) = mass.tensor
        named = zip(ENTRIES, (xx, yy, zz, xy, xz, yz), strict=True)
        inertia = element("inertia", [element(name, [_written((value,))]) for name, value in named])
        parts.append(element("inertial", [_placed(Placement(position=mass.com)), element("mass", [_written((mass.mass,))]), inertia]))
    return element("link", parts, name=link.name)


def _mimic_text(mimic: Mimic) -> str:
    said = {"multiplier": mimic.factor, "offset": mimic.offset, "reference": 0.0}
    return element("mimic", [element(name, [_written((value,))]) for name, value in said.items()], joint=mimic.joint)


def _joint_text(joint: Joint, frame: Placement) -> str:
    """frame: of the joint in the model."""
    kind = WORDS.get(joint.kind, joint.kind)
    for what, value in (("a rotor", joint.armature), (f"a {kind} joint", kind not in KINDS)):
        if value:
            raise ModelError(f"joint {joint.name}: SDF cannot say {what}; write MJCF (.xml)")
    parts = [element("parent", [joint.parent]), element("child", [joint.child]), _placed(frame, relative_to=MODEL)]
    if kind in ("revolute", "prismatic", "universal", "screw"):
        dynamics = {
            "damping": joint.damping,
            "spring_stiffness": joint.stiffness,
            "spring_reference": joint.rest if joint.stiffness else 0.0,
        }
        said = [element(name, [_written((value,))]) for name, value in dynamics.items() if value]
        moved = [element("dynamics", said)] if said else []
        moved += [_mimic_text(joint.mimic)] if joint.mimic else []
        parts.append(element("axis", [element("xyz", [_written(joint.axis)]), *moved]))
    if joint.second is not None:
        parts.append(element("axis2", [element("xyz", [_written(joint.second)])]))
    if kind == "screw":
        parts.append(element("screw_thread_pitch", [_written((joint.pitch,))]))
    return element("joint", parts, name=joint.name, type=kind)
