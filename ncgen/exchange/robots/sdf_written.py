"""A robot as SDF: links with explicit inertias, joints placed in the model, loops among them."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from ncgen.errors import ModelError
from ncgen.exchange.robots.looks import Shape, rgba_of
from ncgen.exchange.robots.placement import Placement
from ncgen.exchange.robots.robot import Joint, Link, Mass, Mimic, Robot
from ncgen.exchange.robots.sdf import KINDS
from ncgen.exchange.robots.sdf_links import ENTRIES
from ncgen.exchange.robots.sdf_scopes import MODEL, WORLD
from ncgen.exchange.robots.xml_text import document, element, number_text

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
            raise ModelError(f"joint {joint.name}: SDF has no link that moves freely next to others; connect it by a joint")
    free = {joint.parent for joint in robot.joints if joint.kind == "floating"}
    joints += [_joint_text(loop, robot.base @ loop.placement) for loop in robot.loops]
    hidden = free | ({WORLD} if not robot.floats else set())
    if not robot.floats and robot.root != WORLD and not free:
        joints.insert(0, _joint_text(Joint(name=f"{robot.root}_rests", kind="fixed", parent=WORLD, child=robot.root), robot.base))
    links = [_link_text(link, frames[name]) for name, link in robot.links.items() if name not in hidden]
    model = element("model", [*links, *joints], name=robot.name)
    return document(element("sdf", [element("world", [element("gravity", [_written(robot.gravity)]), model], name="world")], version="1.7"))


def _written(values: Iterable[float]) -> str:
    return " ".join(number_text(x) for x in values)


def _placed(frame: Placement, **attributes: str) -> str:
    return element("pose", [_written((*frame.position, *frame.rpy))], **attributes)


def _visual_text(shape: Shape, number: int) -> str:
    from xml.sax.saxutils import escape  # which imports all that speaks HTTP

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
    if mass is None and link.name != WORLD:  # else it would have 1 kg
        mass = Mass(0.0, np.zeros(3), np.zeros((3, 3)))
    if mass is not None:
        (xx, xy, xz), (_, yy, yz), (_, _, zz) = mass.tensor
        named = zip(ENTRIES, (xx, yy, zz, xy, xz, yz), strict=True)
        inertia = element("inertia", [element(name, [_written((value,))]) for name, value in named])
        parts.append(element("inertial", [_placed(Placement(position=mass.com)), element("mass", [_written((mass.mass,))]), inertia]))
    return element("link", parts, name=link.name)


def _mimic_text(mimic: Mimic) -> str:
    numbers = {"multiplier": mimic.factor, "offset": mimic.offset, "reference": 0.0}
    return element("mimic", [element(name, [_written((value,))]) for name, value in numbers.items()], joint=mimic.joint)


def _joint_text(joint: Joint, frame: Placement) -> str:
    """frame: of the joint in the model."""
    kind = WORDS.get(joint.kind, joint.kind)
    for words, value in (("a rotor", joint.armature), (f"a {kind} joint", kind not in KINDS)):
        if value:
            raise ModelError(f"joint {joint.name}: SDF cannot say {words}; write MJCF (.xml)")
    parts = [element("parent", [joint.parent]), element("child", [joint.child]), _placed(frame, relative_to=MODEL)]
    if kind in ("revolute", "prismatic", "universal", "screw"):
        dynamics = {
            "damping": joint.damping,
            "spring_stiffness": joint.stiffness,
            "spring_reference": joint.rest if joint.stiffness else 0.0,
        }
        tags = [element(name, [_written((value,))]) for name, value in dynamics.items() if value]
        moved = [element("dynamics", tags)] if tags else []
        moved += [_mimic_text(joint.mimic)] if joint.mimic else []
        parts.append(element("axis", [element("xyz", [_written(joint.axis)]), *moved]))
    if joint.second is not None:
        parts.append(element("axis2", [element("xyz", [_written(joint.second)])]))
    if kind == "screw":
        parts.append(element("screw_thread_pitch", [_written((joint.pitch,))]))
    return element("joint", parts, name=joint.name, type=kind)
