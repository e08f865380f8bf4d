"""Robots as MJCF, the format of MuJoCo: bodies with joints, loops as connections and welds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ncgen.errors import ModelError
from ncgen.exchange.robots.looks import Shape, rgba_of
from ncgen.exchange.robots.placement import Placement
from ncgen.exchange.robots.robot import Joint, Link, Mimic, Robot
from ncgen.exchange.robots.xml_text import document, element
from ncgen.files import is_file

MESHES = (".stl", ".obj", ".msh")
"""Files with meshes that MuJoCo reads."""

MIN_INERTIA = 1e-15
"""MuJoCo's smallest mass and moment of inertia."""

WORDS = {"revolute": "hinge", "prismatic": "slide", "spherical": "ball"}
"""The format's words for joints; a body without one is fixed."""


def text_of(robot: Robot) -> str:
    """A robot as MJCF; loops are connections and welds. Raises ModelError naming a joint or a body that the format cannot say."""
    robot = robot.grounded()
    frames = robot.frames(Placement())
    carried: dict[str, list[Joint]] = {name: [] for name in robot.links}
    for joint in robot.joints:
        carried[joint.parent].append(joint)
    meshes = dict.fromkeys((shape.file, shape.sizes) for link in robot.links.values() for shape in _written(link))
    names = {mesh: f"mesh{number}" for number, mesh in enumerate((mesh for mesh in meshes if mesh[0]), 1)}

    def geoms(name: str) -> list[str]:
        return [_geom_text(shape, names) for shape in _written(robot.links[name])]

    tied = {name for loop in robot.loops for name in (loop.parent, loop.child)}

    def body(joint: Joint) -> str:
        """A link with the joints of those before it that have no mass and carry nothing else."""
        row = [joint]
        while _is_between(robot.links[row[-1].child], carried[row[-1].child]) and row[-1].child not in tied:
            row += carried[row[-1].child]
        name, placement, joints = row[-1].child, Placement(), list[str]()
        for each in reversed(row):  # place: of the link's frame in that of the joint
            joints = _joint_text(each, placement.inverse()) + joints
            placement = each.placement @ placement
        parts = [*joints, *_inertial(robot.links[name]), *geoms(name), *map(body, carried[name])]
        return element("body", parts, name=name, pos=placement.position, quat=placement.quaternion)

    compiler = element("compiler", angle="radian", inertiafromgeom="false")
    parts = [compiler, element("option", gravity=robot.gravity)]
    if names:
        parts.append(element("asset", [element("mesh", name=name, file=file, scale=scale) for (file, scale), name in names.items()]))
    parts.append(element("worldbody", [*geoms(robot.root), *map(body, carried[robot.root])]))
    equalities = [text for loop in robot.loops for text in _loop_text(loop, frames, robot.root)]
    equalities += [_mimic_text(joint.name, joint.mimic) for joint in robot.joints if joint.mimic]
    if equalities:
        parts.append(element("equality", equalities))
    return document(element("mujoco", parts, model=robot.name))


def _written(link: Link) -> list[Shape]:
    """The shapes of a link that the format can say: meshes are there, and in a format that MuJoCo reads."""
    return [shape for shape in link.shapes if not shape.file or (Path(shape.file).suffix.lower() in MESHES and is_file(Path(shape.file)))]


def _geom_text(shape: Shape, meshes: Mapping[tuple[str, tuple[float, ...]], str]) -> str:
    """To look at only: without mass, and it touches nothing."""
    halves = {"cylinder": (1.0, 0.5), "box": (0.5, 0.5, 0.5)}
    sizes = [factor * size for factor, size in zip(halves.get(shape.kind, (1.0,) * len(shape.sizes)), shape.sizes, strict=True)]
    attributes: dict[str, Any] = {"mesh": meshes[shape.file, shape.sizes]} if shape.file else {"size": sizes}
    attributes |= {"rgba": rgba_of(shape.colour)} if shape.colour else {}
    pose = {"pos": shape.placement.position, "quat": shape.placement.quaternion}
    return element("geom", type=shape.kind, **attributes, **pose, mass=0.0, contype=0.0, conaffinity=0.0, group=1.0)


def _loop_text(loop: Joint, frames: dict[str, Placement], root: str) -> list[str]:
    """A ball is a connection, a hinge two of them on its axis; the world's body has no name of the robot's."""
    first, second = ("world" if name == root else name for name in (loop.parent, loop.child))
    if loop.kind == "fixed":
        return [element("weld", name=loop.name, body1=first, body2=second)]
    if loop.kind not in ("spherical", "revolute") or loop.damping or loop.stiffness:
        raise ModelError(
            f"joint {loop.name}: MJCF closes loops by connections and welds, not by a {loop.kind} joint that has more; write SDF"
        )
    at_parent = frames[loop.parent].inverse() @ loop.placement
    anchors = [at_parent.position] if loop.kind == "spherical" else [at_parent.position, at_parent.at(loop.axis)]
    names = [loop.name, f"{loop.name}_axis"]
    return [element("connect", name=name, body1=first, body2=second, anchor=anchor) for name, anchor in zip(names, anchors, strict=False)]


def _mimic_text(name: str, mimic: Mimic) -> str:
    return element("joint", name=f"{name}_follows", joint1=name, joint2=mimic.joint, polycoef=(mimic.offset, mimic.factor, 0.0, 0.0, 0.0))


def _is_between(link: Link, carried: Sequence[Joint]) -> bool:
    """True for a link that only stands between two joints."""
    return link.mass is None and not link.shapes and len(carried) == 1


def _joint_text(joint: Joint, frame: Placement) -> list[str]:
    """frame: of the joint in its body."""
    if joint.kind == "fixed":
        return []
    if joint.kind == "floating":
        return [element("freejoint", name=joint.name)]
    if joint.kind not in WORDS:
        raise ModelError(f"joint {joint.name}: MJCF has no {joint.kind} joint; put bodies without mass between sliders and a hinge")
    attributes: dict[str, Any] = {"pos": frame.position} if frame.position.any() else {}
    attributes |= {} if joint.kind == "spherical" else {"axis": frame.along(joint.axis)}
    attributes |= {name: value for name in ("armature", "damping", "stiffness") if (value := getattr(joint, name))}
    attributes |= {"springref": joint.rest} if joint.stiffness else {}
    return [element("joint", name=joint.name, type=WORDS[joint.kind], **attributes)]


def _inertial(link: Link) -> list[str]:
    mass = link.mass
    if mass is None:
        return []
    least = float(np.linalg.eigvalsh(mass.tensor)[0])
    if not (mass.mass > MIN_INERTIA and least > MIN_INERTIA):
        raise ModelError(
            f"body {link.name}: MJCF takes masses and principal moments of inertia above {MIN_INERTIA:g}; here they are "
            f"{mass.mass:.3g} kg and "
            f"at least {least:.3g} kg m2: give a bar its thickness"
        )
    (xx, xy, xz), (_, yy, yz), (_, _, zz) = mass.tensor
    return [element("inertial", pos=mass.com, mass=mass.mass, fullinertia=(xx, yy, zz, xy, xz, yz))]
