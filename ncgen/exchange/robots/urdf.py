"""Robots from URDF, the unified robot description format of ROS (wiki.ros.org/urdf/XML).

Read are links' inertias, what is seen of them (`<visual>`), and all joints. `vocabulary/urdf.txt` says what becomes of every word.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import numpy as np

from ncgen.errors import ModelError
from ncgen.exchange.robots.accounting import account, counted, vocabulary
from ncgen.exchange.robots.looks import Shape, Unseen, colour_of, looked, mesh, rgba_of, seen, shape, unseen
from ncgen.exchange.robots.markup import Markup, refusals
from ncgen.exchange.robots.placement import Placement
from ncgen.exchange.robots.robot import Joint, Link, Mass, Mimic, Robot, unique
from ncgen.exchange.robots.stops import not_built
from ncgen.exchange.robots.xml_text import document, element

KINDS = {
    "fixed": "fixed",
    "revolute": "revolute",
    "continuous": "revolute",
    "prismatic": "prismatic",
    "planar": "planar",
    "floating": "floating",
}
"""Joint types of the format, and what they are here."""

ACTING = ("revolute", "continuous", "prismatic")
"""Joints that have one coordinate, along which something can act."""

UNLIMITED = 1e9
"""How far a slider may go where nothing says so (m)."""


def robot_of(root: Markup, path: Path) -> Robot:
    """The robot of a file, from its root element. Raises ModelError with file and line."""
    shapes_of = {
        each.name(): [looked(lambda visual=visual: _look(visual, root, path)) for visual in each.all("visual")] for each in root.all("link")
    }
    links = [_link(each, shapes_of[each.name()]) for each in root.all("link")]
    joints = [_joint(each) for each in root.all("joint")]
    if not links:
        root.refuse("<robot> has no <link>; give it one")
    unique(links, "link")
    unique(joints, "joint")
    name = root.attributes.get("name") or path.stem
    unseen_shapes = unseen(each for each_link in shapes_of.values() for each in each_link)
    omitted = counted([*not_built(joints), *account(root, vocabulary("urdf"), "robot")]) + unseen_shapes
    return Robot(name=name, links={link.name: link for link in links}, joints=tuple(joints), omitted=omitted).ordered()


def problems_of(root: Markup, path: Path) -> list[str]:
    """What is wrong with links and joints, each looked at by itself."""
    return [*refusals(lambda each: _link(each, ()), root.all("link")), *refusals(_joint, root.all("joint"))]


def _pose(each: Markup) -> Placement:
    origin = each.first("origin")
    zeros = (0.0, 0.0, 0.0)
    return Placement() if origin is None else Placement.of_rpy(origin.numbers("xyz", 3, zeros), origin.numbers("rpy", 3, zeros))


def _link(each: Markup, shapes: Iterable[Shape | Unseen]) -> Link:
    inertial = each.first("inertial")
    return Link(name=each.name(), mass=None if inertial is None else _mass(inertial), where=each.place, shapes=seen(shapes))


def _look(visual: Markup, root: Markup, path: Path) -> Shape | Unseen:
    geometry = visual.first("geometry")
    inside = geometry.children[0] if geometry and geometry.children else None
    placement, colour = _pose(visual), _colour(visual, root)
    if inside is None or "quat_xyzw" in (visual.first("origin") or visual).attributes:
        return Unseen("none")
    match inside.tag:
        case "box":
            return shape("box", inside.numbers("size", 3, (0.0, 0.0, 0.0)), placement, colour)
        case "sphere":
            return shape("sphere", (inside.number("radius"),), placement, colour)
        case "cylinder" | "capsule" as kind:
            return shape(kind, (inside.number("radius"), inside.number("length")), placement, colour)
        case "mesh":
            return mesh(inside.attributes.get("filename", ""), inside.numbers("scale", 3, (1.0, 1.0, 1.0)), placement, colour, path)
        case other:
            return Unseen(other)


def _colour(visual: Markup, root: Markup) -> str | None:
    """Of a visual's material, which may be told once for the whole robot."""
    material = visual.first("material")
    name = material.attributes.get("name") if material else None
    known = (other for other in root.all("material") if name and other.attributes.get("name") == name)
    for each in filter(None, (material, *known)):
        if colour := each.first("color"):
            return colour_of(colour.numbers("rgba", 4, (0.5, 0.5, 0.5, 1.0)))
    return None


def _mass(inertial: Markup) -> Mass | None:
    """None where nothing of it is more than 0."""
    element = inertial.first("inertia")
    mass = inertial.only("mass").number("value")
    if mass < 0:
        inertial.refuse(f"the mass is {mass:g} kg; give a positive number")
    moments = (element.number(name, 0.0) if element else 0.0 for name in ("ixx", "iyy", "izz", "ixy", "ixz", "iyz"))
    return Mass.of(mass, moments, _pose(inertial))


def _joint(each: Markup) -> Joint:
    kind = each.name("type")
    if kind not in KINDS:
        each.refuse(f"joint {each.name()}: there is no type {kind}; known are {', '.join(KINDS)}")
    dynamics = each.first("dynamics") if kind in ACTING else None
    mimic = each.first("mimic")
    return Joint(
        name=each.name(),
        kind=KINDS[kind],
        parent=each.only("parent").name("link"),
        child=each.only("child").name("link"),
        placement=_pose(each),
        axis=_axis(each) if kind not in ("fixed", "floating") else np.array([1.0, 0.0, 0.0]),
        damping=dynamics.number("damping", 0.0) if dynamics else 0.0,
        limits=_limits(each.first("limit")) if kind in ("revolute", "prismatic") else None,
        effort=_effort(each.first("limit")) if kind in ACTING else None,
        friction=dynamics.number("friction", 0.0) if dynamics else 0.0,
        mimic=Mimic(mimic.name("joint"), mimic.number("multiplier", 1.0), mimic.number("offset", 0.0)) if mimic else None,
        where=each.place,
    )


def _limits(limit: Markup | None) -> tuple[float, float] | None:
    if limit is None:
        return None
    lower, upper = (limit.limit(limit.attributes.get(end, "0"), end) for end in ("lower", "upper"))
    return lower, upper


def _effort(limit: Markup | None) -> tuple[float, float] | None:
    """None where it is 0, which files write that do not know it."""
    effort = 0.0 if limit is None else limit.limit(limit.attributes.get("effort", "0"), "effort")
    return (-effort, effort) if effort > 0 else None


def _axis(joint: Markup) -> np.ndarray:
    element = joint.first("axis")
    return joint.unit((1.0, 0.0, 0.0) if element is None else element.numbers("xyz", 3, (1.0, 0.0, 0.0)), joint.name())


# -- writing -----------------------------------------------------------------------------------


def text_of(robot: Robot) -> str:
    """A robot as URDF. Raises ModelError naming a joint that the format cannot say. Gravity is the simulator's there."""
    robot = robot.grounded()
    return document(element("robot", [*map(_link_text, robot.links.values()), *map(_joint_text, robot.joints)], name=robot.name))


def _visual_text(shape: Shape) -> list[str]:
    """Nothing for an ellipsoid, which the format does not have."""
    match shape.kind:
        case "box":
            inside = element("box", size=shape.sizes)
        case "cylinder":
            inside = element("cylinder", radius=shape.sizes[0], length=shape.sizes[1])
        case "sphere":
            inside = element("sphere", radius=shape.sizes[0])
        case "mesh":
            inside = element("mesh", filename=shape.file, scale=shape.sizes)
        case _:
            return []
    colour = [element("material", [element("color", rgba=rgba_of(shape.colour))], name=shape.colour)] if shape.colour else []
    origin = element("origin", xyz=shape.placement.position, rpy=shape.placement.rpy)
    return [element("visual", [origin, element("geometry", [inside]), *colour])]


def _link_text(link: Link) -> str:
    mass, visuals = link.mass, [text for shape in link.shapes for text in _visual_text(shape)]
    if mass is None:
        return element("link", visuals, name=link.name)
    (ixx, ixy, ixz), (_, iyy, iyz), (_, _, izz) = mass.tensor
    inertia = element("inertia", ixx=ixx, ixy=ixy, ixz=ixz, iyy=iyy, iyz=iyz, izz=izz)
    inertial = element("inertial", [element("origin", xyz=mass.com), element("mass", value=mass.mass), inertia])
    return element("link", [inertial, *visuals], name=link.name)


def _joint_text(joint: Joint) -> str:
    kind = "continuous" if joint.kind == "revolute" else joint.kind
    for words, value in (("a ball", joint.kind == "spherical"), ("a spring", joint.stiffness), ("a rotor", joint.armature)):
        if value:
            raise ModelError(f"joint {joint.name}: URDF cannot say {words}; write MJCF (.xml)")
    parts = [element("parent", link=joint.parent), element("child", link=joint.child)]
    parts.append(element("origin", xyz=joint.placement.position, rpy=joint.placement.rpy))
    if kind in ("continuous", "prismatic", "planar"):
        parts.append(element("axis", xyz=joint.axis))
    if kind == "prismatic":  # which must have limits there
        parts.append(element("limit", lower=-UNLIMITED, upper=UNLIMITED, effort=0, velocity=0))
    if joint.damping:
        parts.append(element("dynamics", damping=joint.damping))
    if joint.mimic:
        parts.append(element("mimic", joint=joint.mimic.joint, multiplier=joint.mimic.factor, offset=joint.mimic.offset))
    return element("joint", parts, name=joint.name, type=kind)
