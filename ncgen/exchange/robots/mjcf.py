"""Robots from MJCF, the format of MuJoCo, which reads and compiles them itself (`pip install 'ncgen[robots]'`).

A body with several joints becomes a chain of bodies without mass. Connections, welds and couplings of joints (`<equality>`) close loops;
armatures are rotors. Coordinates are 0 in the position that the file describes.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ncgen.errors import ModelError
from ncgen.exchange.robots.looks import Shape, Unseen, colour_of, mesh, rgba_of, seen, shape, unseen
from ncgen.exchange.robots.markup import Markup
from ncgen.exchange.robots.mjcf_compiled import Compiled, compiled, family
from ncgen.exchange.robots.placement import Placement
from ncgen.exchange.robots.robot import Coupling, Joint, Link, Mass, Mimic, Robot, hung
from ncgen.exchange.robots.written import document, element
from ncgen.exchange.text import placed
from ncgen.files import is_file
from ncgen.model.arithmetic import unit
from ncgen.model.values import LARGEST

WORLD = "world"

KINDS = ("floating", "spherical", "prismatic", "revolute")
"""By MuJoCo's numbers of joint types."""

CONNECT, WELD, COUPLING, TENDONS = 0, 1, 2, 3
"""MuJoCo's numbers of equalities."""

NO_GRAVITY = 1 << 7
"""MuJoCo's flag for gravity that is switched off."""

PLANE, MESH, SHAPES = 0, 7, {2: "sphere", 3: "capsule", 4: "ellipsoid", 5: "cylinder", 6: "box"}
"""MuJoCo's numbers of geometries."""

LAST_SEEN = 2
"""Groups of geometries beyond this one are hidden in MuJoCo's viewer, unless they are asked for: collision shapes by custom."""

GREY = [0.5, 0.5, 0.5, 1.0]
"""The colour of what has none."""

MESHES = (".stl", ".obj", ".msh")
"""Files with meshes that MuJoCo reads."""

LEAST = 1e-15
"""MuJoCo's smallest mass and moment of inertia."""

NUMBERS = (
    "body_pos", "body_quat", "body_ipos", "body_iquat", "body_mass", "body_inertia", "jnt_pos", "jnt_axis", "jnt_range", "jnt_stiffness",
    "dof_armature", "dof_damping", "dof_frictionloss", "eq_data",
)  # fmt: skip
"""Arrays of a compiled model that become numbers of ncgen's."""

DIRECTIONS = ("quat", "iquat", "axis")
"""Arrays that MuJoCo gives the length 1, but for those whose length it could not compute."""

WHOSE = {"body": "body", "jnt": "joint", "dof": "joint", "eq": "equality"}
"""{what an array's name begins with: whose its rows are}."""

OVER_JOINT = 1
"""MuJoCo's number of what a fixed tendon goes over."""

BODY = 1
"""MuJoCo's number of the objects that connections may be told by."""


def robot_of(root: Markup, path: Path) -> Robot:
    """The robot of a file. Raises ModelError with what MuJoCo says of it, NcgenError without MuJoCo."""
    files, model = family(root, path), compiled(path)
    _check_numbers(model, path.name)
    return _Reader(model, files, path).robot()


def _check_numbers(model: Compiled, where: str) -> None:
    """Raise ModelError where a number that is read is not finite, or larger than a model's numbers are: MuJoCo takes such ones."""
    owners = {"body": model.nbody, "jnt": model.njnt, "dof": model.nv, "eq": model.neq}
    kinds = {"body": model.body, "jnt": model.joint, "dof": lambda i: model.joint(int(model.dof_jntid[i])), "eq": model.equality}
    for name in NUMBERS:
        kind, _, what = name.partition("_")
        values = np.array(getattr(model, name), dtype=float)
        values = values.reshape(owners[kind], values.size // max(1, owners[kind]))
        large = ~(np.abs(values) <= LARGEST)
        wrong = np.flatnonzero(large.any(axis=1) | ((what in DIRECTIONS) & ~(np.abs(values).max(axis=1, initial=0.0) > 0.4)))
        if len(wrong):
            i = int(wrong[0])
            owner = f"{WHOSE[kind]} {kinds[kind](i).name or f'number {i}'}"
            number = f"the number {values[i][large[i]][0]:g} ({what})" if large[i].any() else f"no direction ({what})"
            raise ModelError(placed(where, None, f"{owner} has {number}; the largest number is {LARGEST:g}, check the unit"))
    for what, values in (("gravity", model.opt.gravity), ("a joint's reference", model.qpos0), ("a tendon's coefficient", model.wrap_prm)):
        if not np.all(np.abs(values) <= LARGEST):
            raise ModelError(placed(where, None, f"{what} is not finite, or larger than {LARGEST:g}; check the unit"))


class _Reader:
    def __init__(self, model: Compiled, files: Sequence[Markup], path: Path) -> None:
        self.m, self.where, self.path = model, path.name, path
        meshes = (each.attributes for root in files for each in root.walk() if each.tag == "mesh")
        self.shifted = {said.get("name") or Path(said.get("file", "")).stem for said in meshes if {"refpos", "refquat"} & said.keys()}
        self.looks = [self._look(g) for g in range(model.ngeom)]
        self.geoms: dict[int, list[int]] = {}
        for g, body in enumerate(model.geom_bodyid):
            self.geoms.setdefault(int(body), []).append(g)
        self.name = files[0].attributes.get("model") or path.stem
        self.bodies = [WORLD, *(model.body(i).name or f"body{i}" for i in range(1, model.nbody))]
        self.places: dict[str, Placement] = {WORLD: Placement()}
        self.links: dict[str, Link] = {WORLD: Link(WORLD, None, shapes=self._seen(0))}
        self.joints: list[Joint] = []
        self.joint_names: list[str] = [model.joint(j).name or f"joint{j}" for j in range(model.njnt)]

    def robot(self) -> Robot:
        for i in range(1, self.m.nbody):
            self._body(i)
        loops, followers, rows = self._equalities()
        joints = tuple(replace(joint, mimic=followers.get(joint.name)) for joint in self.joints)
        off = self.m.opt.disableflags & NO_GRAVITY
        x, y, z = (0.0, 0.0, 0.0) if off else map(float, self.m.opt.gravity)
        robot = Robot(self.name, self.links, joints, tuple(loops), gravity=(x, y, z), omitted=self._omitted(), rows=tuple(rows))
        return hung(robot, self.places)

    def _body(self, i: int) -> None:
        m = self.m
        name, parent = self.bodies[i], self.bodies[m.body_parentid[i]]
        place = self.places[parent] @ Placement.of_quaternion(m.body_pos[i], m.body_quat[i])
        own = range(m.body_jntadr[i], m.body_jntadr[i] + m.body_jntnum[i])
        for count, j in enumerate(own, 1):
            last = count == len(own)
            child = name if last else f"{name}.{self.joint_names[j]}"
            if not last:
                self.places[child], self.links[child] = place, Link(child, None, self.where)
            self.joints.append(self._joint(j, parent, child, place))
            parent = child
        if not own:
            self.joints.append(Joint(f"{name}.fixed", "fixed", parent, name, place, where=self.where))
        self.places[name], self.links[name] = place, Link(name, self._mass(i), self.where, self._seen(i))

    def _seen(self, i: int) -> tuple[Shape, ...]:
        """The shapes of a body."""
        return seen(look for g in self.geoms.get(i, ()) if (look := self.looks[g]))

    def _look(self, g: int) -> Shape | Unseen | None:
        """A shape in its body's frame; None for those that MuJoCo's viewer does not show either, and for planes, which are the ground."""
        m = self.m
        kind, rgba = int(m.geom_type[g]), [float(x) for x in m.geom_rgba[g]]
        if m.geom_group[g] > LAST_SEEN or rgba[3] == 0 or kind == PLANE:
            return None
        place = Placement.of_quaternion(m.geom_pos[g], m.geom_quat[g])
        colour = None if rgba == GREY and m.geom_matid[g] < 0 else colour_of(m.mat_rgba[m.geom_matid[g]] if rgba == GREY else rgba)
        a, b, c = (float(x) for x in m.geom_size[g])
        if kind == MESH:
            return self._mesh(int(m.geom_dataid[g]), place, colour)
        sizes = {"sphere": (a,), "capsule": (a, 2 * b), "ellipsoid": (a, b, c), "cylinder": (a, 2 * b), "box": (2 * a, 2 * b, 2 * c)}
        name = SHAPES.get(kind, "")
        return shape(name, sizes[name], place, colour) if name else Unseen(f"type {kind}")

    def _mesh(self, number: int, place: Placement, colour: str | None) -> Shape | Unseen:
        """Of a file, whose coordinates MuJoCo has moved to the mesh's principal axes."""
        m = self.m
        start = int(m.mesh_pathadr[number])
        name = m.paths[start : m.paths.index(b"\0", start)].decode(errors="replace") if start >= 0 else f"{m.mesh(number).name}, no file"
        if m.mesh(number).name in self.shifted:
            return Unseen("mesh with refpos or refquat")
        moved = Placement.of_quaternion(m.mesh_pos[number], m.mesh_quat[number])
        return mesh(name, [float(x) for x in m.mesh_scale[number]], place @ moved.inverse(), colour, self.path)

    def _mass(self, i: int) -> Mass | None:
        m = self.m
        return Mass.of(float(m.body_mass[i]), (*m.body_inertia[i], 0.0, 0.0, 0.0), Placement.of_quaternion(m.body_ipos[i], m.body_iquat[i]))

    def _joint(self, j: int, parent: str, child: str, place: Placement) -> Joint:
        """Placed in the world."""
        m = self.m
        kind, dof = KINDS[m.jnt_type[j]], m.jnt_dofadr[j]
        joint = Joint(self.joint_names[j], kind, parent, child, place @ Placement(position=np.array(m.jnt_pos[j])), where=self.where)
        if kind in ("floating", "spherical"):
            return replace(joint, placement=place) if kind == "floating" else joint
        spring = float(m.qpos_spring[m.jnt_qposadr[j]] - m.qpos0[m.jnt_qposadr[j]])
        return replace(
            joint,
            axis=unit(m.jnt_axis[j]),
            armature=float(m.dof_armature[dof]),
            damping=float(m.dof_damping[dof]),
            stiffness=float(m.jnt_stiffness[j]),
            rest=spring,
            limits=self._limits(j) if m.jnt_limited[j] else None,
            friction=float(m.dof_frictionloss[dof]),
        )

    def _limits(self, j: int) -> tuple[float, float]:
        """Where the coordinate is 0 in the position of the file."""
        m = self.m
        low, high = (float(value - m.qpos0[m.jnt_qposadr[j]]) for value in m.jnt_range[j])
        return low, high

    def _equalities(self) -> tuple[list[Joint], dict[str, Mimic], list[Coupling]]:
        """Joints that close loops, who follows whom, and rows of coupled tendons over joints."""
        m, loops, followers, rows = self.m, [], {}, []
        for e in range(m.neq):
            name, kind = m.equality(e).name or f"equality{e}", int(m.eq_type[e])
            first, second, data = int(m.eq_obj1id[e]), int(m.eq_obj2id[e]), m.eq_data[e]
            if not m.eq_active0[e]:
                continue
            if kind in (CONNECT, WELD) and int(m.eq_objtype[e]) == BODY:
                anchor = np.array(data[:3]) if kind == CONNECT else np.zeros(3)
                a, b = self.bodies[first], self.bodies[second]
                place = self.places[a] @ Placement(position=anchor)
                loops.append(Joint(name, "spherical" if kind == CONNECT else "fixed", a, b, place, where=self.where))
            elif kind == COUPLING and second >= 0 and not np.any(data[2:5]):
                followers[self.joint_names[first]] = Mimic(self.joint_names[second], float(data[1]), float(data[0]))
            elif kind == TENDONS and not np.any(data[2:5]):
                rows.append(self._tendons(name, first, second, float(data[0]), float(data[1])))
            else:
                raise ModelError(
                    f"{self.where}: equality {name} is of a kind that is not read; connect and weld bodies, couple joints or tendons"
                )
        return loops, followers, rows

    def _tendons(self, name: str, first: int, second: int, offset: float, factor: float) -> Coupling:
        """One tendon's change of length is that of another times a factor, and an offset; second: -1 for none."""
        m = self.m
        shares: dict[str, float] = {}
        for tendon, weight in ((first, 1.0), (second, -factor)):
            for k in range(m.tendon_adr[tendon], m.tendon_adr[tendon] + m.tendon_num[tendon]) if tendon >= 0 else ():
                if int(m.wrap_type[k]) != OVER_JOINT:
                    raise ModelError(f"{self.where}: equality {name} couples tendons through points; only those over joints are read")
                joint = self.joint_names[int(m.wrap_objid[k])]
                shares[joint] = shares.get(joint, 0.0) + weight * float(m.wrap_prm[k])
        return Coupling(name, shares, offset, self.where)

    def _omitted(self) -> tuple[str, ...]:
        m = self.m
        several = [joint for joint in range(m.njnt) if m.jnt_type[joint] < 2]
        springs = sum(m.dof_armature[m.jnt_dofadr[j]] != 0 or m.dof_damping[m.jnt_dofadr[j]] != 0 for j in several)
        counts = {
            "actuators": m.nu,
            "tendons": m.ntendon,
            "sensors": m.nsensor,
            "limits of joints": int(np.sum(m.jnt_limited)),
            "bodies whose weight is compensated": int(np.sum(np.asarray(m.body_gravcomp) != 0)),
            "forces of a fluid": int(m.opt.density > 0 or m.opt.viscosity > 0),
            "friction of joints": int(np.sum(np.asarray(m.dof_frictionloss) != 0)),
            "armature or damping of free and ball joints": int(springs),
            "reference values of joints, whose coordinates begin at 0 here": int(np.sum(self._references() != 0)),
        }
        return (*(f"{what} ({count})" for what, count in counts.items() if count), *unseen(filter(None, self.looks)))

    def _references(self) -> np.ndarray:
        m = self.m
        return np.array([m.qpos0[m.jnt_qposadr[j]] for j in range(m.njnt) if m.jnt_type[j] >= 2])


# -- writing -----------------------------------------------------------------------------------

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
        own, place, joints = row[-1].child, Placement(), list[str]()
        for each in reversed(row):  # place: of the link's frame in that of the joint
            joints = _joint_text(each, place.inverse()) + joints
            place = each.placement @ place
        parts = [*joints, *_inertial(robot.links[own]), *geoms(own), *map(body, carried[own])]
        return element("body", parts, name=own, pos=place.position, quat=place.quaternion)

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
    said: dict[str, Any] = {"mesh": meshes[shape.file, shape.sizes]} if shape.file else {"size": sizes}
    said |= {"rgba": rgba_of(shape.colour)} if shape.colour else {}
    place = {"pos": shape.placement.position, "quat": shape.placement.quaternion}
    return element("geom", type=shape.kind, **said, **place, mass=0.0, contype=0.0, conaffinity=0.0, group=1.0)


def _loop_text(loop: Joint, frames: dict[str, Placement], root: str) -> list[str]:
    """A ball is a connection, a hinge two of them on its axis; the world's body has no name of the robot's."""
    first, second = ("world" if name == root else name for name in (loop.parent, loop.child))
    if loop.kind == "fixed":
        return [element("weld", name=loop.name, body1=first, body2=second)]
    if loop.kind not in ("spherical", "revolute") or loop.damping or loop.stiffness:
        raise ModelError(
            f"joint {loop.name}: MJCF closes loops by connections and welds, not by a {loop.kind} joint that has more; write SDF"
        )
    here = frames[loop.parent].inverse() @ loop.placement
    places = [here.position] if loop.kind == "spherical" else [here.position, here.at(loop.axis)]
    names = [loop.name, f"{loop.name}_axis"]
    return [element("connect", name=name, body1=first, body2=second, anchor=place) for name, place in zip(names, places, strict=False)]


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
    said: dict[str, Any] = {"pos": frame.position} if frame.position.any() else {}
    said |= {} if joint.kind == "spherical" else {"axis": frame.along(joint.axis)}
    said |= {name: value for name in ("armature", "damping", "stiffness") if (value := getattr(joint, name))}
    said |= {"springref": joint.rest} if joint.stiffness else {}
    return [element("joint", name=joint.name, type=WORDS[joint.kind], **said)]


def _inertial(link: Link) -> list[str]:
    mass = link.mass
    if mass is None:
        return []
    least = float(np.linalg.eigvalsh(mass.tensor)[0])
    if not (mass.mass > LEAST and least > LEAST):
        raise ModelError(
            f"body {link.name}: MJCF takes masses and principal moments of inertia above {LEAST:g}; here they are {mass.mass:.3g} kg and "
            f"at least {least:.3g} kg m2: give a bar its thickness"
        )
    (xx, xy, xz), (_, yy, yz), (_, _, zz) = mass.tensor
    return [element("inertial", pos=mass.com, mass=mass.mass, fullinertia=(xx, yy, zz, xy, xz, yz))]
