"""Robots from MJCF, the format of MuJoCo, which reads and compiles them itself (`pip install 'ncgen[robots]'`).

A body with several joints becomes a chain of bodies without mass. Connections, welds and couplings of joints (`<equality>`) close loops;
armatures are rotors. Coordinates begin at the reference values of the file.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TypedDict

import numpy as np

from ncgen.errors import ModelError
from ncgen.exchange.robots.closures import Closure, closures_of, with_closures
from ncgen.exchange.robots.looks import Shape, Unseen, colour_of, mesh, seen, shape, unseen
from ncgen.exchange.robots.markup import Markup
from ncgen.exchange.robots.mjcf_actuators import actuators
from ncgen.exchange.robots.mjcf_compiled import MESH, Compiled, Family, compiled, family, file_of
from ncgen.exchange.robots.mjcf_equalities import Apart, equalities
from ncgen.exchange.robots.mjcf_fields import (
    AT_JOINT,
    NO_DAMPERS,
    NO_FRICTION,
    NO_GRAVITY,
    NO_LIMITS,
    NO_SPRINGS,
    is_ball_in_world,
    left_out,
    off,
    without_constraints,
)
from ncgen.exchange.robots.mjcf_keyframes import keyframes
from ncgen.exchange.robots.mjcf_pictures import Readable
from ncgen.exchange.robots.mjcf_sensors import frames_of, sensors, sites_of
from ncgen.exchange.robots.placement import Placement
from ncgen.exchange.robots.robot import Joint, Link, Mass, Robot, hung
from ncgen.exchange.text import placed
from ncgen.model.arithmetic import unit
from ncgen.model.values import MAX_NUMBER

WORLD = "world"

KINDS = ("floating", "spherical", "prismatic", "revolute")
"""By MuJoCo's numbers of joint types."""

PLANE, SHAPES = 0, {2: "sphere", 3: "capsule", 4: "ellipsoid", 5: "cylinder", 6: "box"}
"""MuJoCo's numbers of geometries."""

LAST_SEEN = 2
"""Groups of geometries beyond this one are hidden in MuJoCo's viewer, unless they are asked for: collision shapes by custom."""

GREY = [0.5, 0.5, 0.5, 1.0]
"""The colour of what has none."""

NUMBERS = (
    "body_pos", "body_quat", "body_ipos", "body_iquat", "body_mass", "body_inertia", "jnt_pos", "jnt_axis", "jnt_range", "jnt_stiffness",
    "jnt_stiffnesspoly", "dof_armature", "dof_damping", "dof_dampingpoly", "dof_frictionloss", "eq_data", "body_gravcomp",
    "key_qpos", "key_qvel", "key_time", "key_ctrl", "jnt_actfrcrange",
)  # fmt: skip
"""Arrays of a compiled model that become numbers of ncgen's."""

DIRECTIONS = ("quat", "iquat", "axis")
"""Arrays that MuJoCo gives the length 1, but for those whose length it could not compute."""


def robot_of(root: Markup, path: Path) -> Robot:
    """The robot of a file. Raises ModelError with what MuJoCo says of it, NcgenError without MuJoCo."""
    whole, lost = family(root, path), ()
    try:
        model = compiled(path, whole)
    except ModelError as error:
        model, lost = _without_pictures(root, path, whole, error)
    _check_numbers(model, path.name)
    return _Reader(model, whole.roots, path, lost).robot()


def _without_pictures(root: Markup, path: Path, whole: Family, error: ModelError) -> tuple[Compiled, tuple[Unseen, ...]]:
    """The model without pictures that cannot be read, and these; raises the error where that does not help, or the dynamics need them."""
    readable = Readable(root, lambda name: file_of(name, root, path))
    if (text := readable.text()) is None:
        raise error
    try:
        return compiled(path, whole, text), tuple(Unseen(name[:80], is_file=True) for name in readable.missing)
    except ModelError:
        raise error from None


def _check_numbers(model: Compiled, where: str) -> None:
    """Raise ModelError where a number that is read is not finite, or larger than a model's numbers are: MuJoCo takes such ones."""
    objects = {
        "body": (model.nbody, "body", model.body),
        "jnt": (model.njnt, "joint", model.joint),
        "dof": (model.nv, "joint", lambda i: model.joint(int(model.dof_jntid[i]))),
        "eq": (model.neq, "equality", model.equality),
        "key": (model.nkey, "keyframe", model.key),
    }
    for name in NUMBERS:
        kind, _, quantity = name.partition("_")
        count, whose, of = objects[kind]
        values = np.array(getattr(model, name), dtype=float)
        values = values.reshape(count, values.size // max(1, count))
        large = ~(np.abs(values) <= MAX_NUMBER)
        wrong = np.flatnonzero(large.any(axis=1) | ((quantity in DIRECTIONS) & ~(np.abs(values).max(axis=1, initial=0.0) > 0.4)))
        if len(wrong):
            i = int(wrong[0])
            owner = f"{whose} {of(i).name or f'number {i}'}"
            number = f"the number {values[i][large[i]][0]:g} ({quantity})" if large[i].any() else f"no direction ({quantity})"
            raise ModelError(placed(where, None, f"{owner} has {number}; the largest number is {MAX_NUMBER:g}, check the unit"))
    more = {"gravity": model.opt.gravity, "a joint's reference": model.qpos0, "a spring's reference": model.qpos_spring}
    names = ("gear", "gainprm", "biasprm", "ctrlrange", "forcerange", "armature", "damping", "dampingpoly")
    more["an actuator's number"] = np.concatenate([np.ravel(getattr(model, f"actuator_{name}")) for name in names])
    for quantity, values in (more | {"a tendon's coefficient": model.wrap_prm}).items():
        if not np.all(np.abs(values) <= MAX_NUMBER):
            raise ModelError(placed(where, None, f"{quantity} is not finite, or larger than {MAX_NUMBER:g}; check the unit"))


class _Spring(TypedDict):
    """Springs and dampers by the names of `Joint`."""

    damping: float
    more_damping: tuple[float, ...]
    stiffness: float
    more_stiffness: tuple[float, ...]


def _closure(apart: Apart, robot: Robot) -> Closure:
    """A loop that is to be closed; robot: in the world where the model begins."""
    joint, frames = apart.joint, robot.frames(robot.base)
    parent, child = frames[joint.parent].inverse() @ joint.placement, frames[joint.child].inverse() @ apart.child
    return Closure(
        name=joint.name, kind=joint.kind, parent=joint.parent, child=joint.child, on_parent=parent, on_child=child, where=joint.where
    )


class _Reader:
    def __init__(self, model: Compiled, roots: Sequence[Markup], path: Path, lost: tuple[Unseen, ...] = ()) -> None:
        """lost: pictures of the file that the model does not have"""
        self.m, self.where, self.path, self.lost = model, path.name, path, lost
        meshes = (each.attributes for root in roots for each in root.walk() if each.tag == "mesh")
        self.shifted = {
            attributes.get("name") or Path(attributes.get("file", "")).stem
            for attributes in meshes
            if {"refpos", "refquat"} & attributes.keys()
        }
        self.looks = [self._look(g) for g in range(model.ngeom)]
        self.geoms: dict[int, list[int]] = {}
        for g, body in enumerate(model.geom_bodyid):
            self.geoms.setdefault(int(body), []).append(g)
        self.frames, self.sites = frames_of(model), sites_of(model)
        self.name = roots[0].attributes.get("model") or path.stem
        self.bodies = [WORLD, *(model.body(i).name or f"body{i}" for i in range(1, model.nbody))]
        self.placements: dict[str, Placement] = {WORLD: Placement()}
        self.links: dict[str, Link] = {WORLD: Link(name=WORLD, mass=None, shapes=self._shapes_of(0), sites=self.sites.get(0, {}))}
        self.joints: list[Joint] = []
        self.joint_names: list[str] = [model.joint(j).name or f"joint{j}" for j in range(model.njnt)]

    def robot(self) -> Robot:
        for i in range(1, self.m.nbody):
            self._body(i)
        closed = equalities(self.m, self.bodies, self.joint_names, self.placements, self.where)
        joints = tuple(replace(joint, mimic=closed.followers.get(joint.name)) for joint in self.joints)
        x, y, z = (0.0, 0.0, 0.0) if off(self.m, NO_GRAVITY) else map(float, self.m.opt.gravity)
        starts = keyframes(self.m, self.joint_names)
        omitted = (*(f"{words} ({count})" for words, count in left_out(self.m).items()), *unseen((*self.lost, *filter(None, self.looks))))
        motors = actuators(self.m, self.joint_names)
        robot = Robot(
            name=self.name,
            links=self.links,
            joints=joints,
            loops=closed.loops,
            gravity=(x, y, z),
            omitted=omitted,
            rows=closed.rows,
            starts=starts,
            sensors=sensors(self.m, self.joint_names),
            actuators=motors,
            words=("body", "site"),
        )
        hanging = hung(robot, self.placements)
        return (
            with_closures(hanging, [*closures_of(hanging), *(_closure(each, hanging) for each in closed.apart)])
            if closed.apart
            else hanging
        )

    def _body(self, i: int) -> None:
        m = self.m
        name, parent = self.bodies[i], self.bodies[m.body_parentid[i]]
        placement = self.placements[parent] @ Placement.of_quaternion(m.body_pos[i], m.body_quat[i])
        joints = range(m.body_jntadr[i], m.body_jntadr[i] + m.body_jntnum[i])
        for count, j in enumerate(joints, 1):
            last = count == len(joints)
            child = name if last else f"{name}.{self.joint_names[j]}"
            if not last:
                self.placements[child], self.links[child] = placement, Link(name=child, mass=None, where=self.where, origin=None)
            self.joints.append(self._joint(j, parent, child, placement))
            parent = child
        if not joints:
            self.joints.append(Joint(name=f"{name}.fixed", kind="fixed", parent=parent, child=name, placement=placement, where=self.where))
        self.placements[name], self.links[name] = (
            placement,
            Link(
                name=name,
                mass=self._mass(i),
                where=self.where,
                shapes=self._shapes_of(i),
                lifted=self._lifted(i),
                frames=self.frames.get(i, {}),
                sites=self.sites.get(i, {}),
            ),
        )

    def _shapes_of(self, i: int) -> tuple[Shape, ...]:
        """The shapes of a body."""
        return seen(shape for g in self.geoms.get(i, ()) if (shape := self.looks[g]))

    def _look(self, g: int) -> Shape | Unseen | None:
        """A shape in its body's frame; None for those that MuJoCo's viewer does not show either, and for planes, which are the ground."""
        m = self.m
        kind, rgba = int(m.geom_type[g]), [float(x) for x in m.geom_rgba[g]]
        if m.geom_group[g] > LAST_SEEN or rgba[3] == 0 or kind == PLANE:
            return None
        placement = Placement.of_quaternion(m.geom_pos[g], m.geom_quat[g])
        colour = None if rgba == GREY and m.geom_matid[g] < 0 else colour_of(m.mat_rgba[m.geom_matid[g]] if rgba == GREY else rgba)
        a, b, c = (float(x) for x in m.geom_size[g])
        if kind == MESH:
            return self._mesh(int(m.geom_dataid[g]), placement, colour)
        sizes = {"sphere": (a,), "capsule": (a, 2 * b), "ellipsoid": (a, b, c), "cylinder": (a, 2 * b), "box": (2 * a, 2 * b, 2 * c)}
        name = SHAPES.get(kind, "")
        return shape(name, sizes[name], placement, colour) if name else Unseen(f"type {kind}")

    def _mesh(self, number: int, placement: Placement, colour: str | None) -> Shape | Unseen:
        """Of a file, whose coordinates MuJoCo has moved to the mesh's principal axes."""
        m = self.m
        start = int(m.mesh_pathadr[number])
        name = m.paths[start : m.paths.index(b"\0", start)].decode(errors="replace") if start >= 0 else f"{m.mesh(number).name}, no file"
        if m.mesh(number).name in self.shifted:
            return Unseen("mesh with refpos or refquat")
        moved = Placement.of_quaternion(m.mesh_pos[number], m.mesh_quat[number])
        return mesh(name, [float(x) for x in m.mesh_scale[number]], placement @ moved.inverse(), colour, self.path)

    def _mass(self, i: int) -> Mass | None:
        m, j = self.m, int(self.m.body_jntadr[i])
        rotor = self._armature(j) if j >= 0 and is_ball_in_world(m, j) else 0.0
        moments = (*(np.asarray(m.body_inertia[i]) + rotor), 0.0, 0.0, 0.0)
        return Mass.of(float(m.body_mass[i]), moments, Placement.of_quaternion(m.body_ipos[i], m.body_iquat[i]))

    def _lifted(self, i: int) -> tuple[Mass, ...]:
        """What of a body's mass has its weight compensated; MuJoCo does that where it is so for one body by more than 0 (`ngravcomp`)."""
        m, mass = self.m, float(self.m.body_mass[i] * self.m.body_gravcomp[i])
        passive = bool(m.ngravcomp) and not (off(m, NO_SPRINGS) and off(m, NO_DAMPERS))
        return (Mass(mass, np.array(m.body_ipos[i], dtype=float), np.zeros((3, 3))),) if mass and passive else ()

    def _joint(self, j: int, parent: str, child: str, placement: Placement) -> Joint:
        """Placed in the world."""
        m = self.m
        kind, dof = KINDS[m.jnt_type[j]], m.jnt_dofadr[j]
        at = placement if kind == "floating" else placement @ Placement(position=np.array(m.jnt_pos[j]))
        joint = Joint(name=self.joint_names[j], kind=kind, parent=parent, child=child, placement=at, where=self.where, **self._spring(j))
        if kind in ("floating", "spherical"):
            return joint
        return replace(
            joint,
            axis=unit(m.jnt_axis[j]),
            armature=self._armature(j),
            rest=float(m.qpos_spring[m.jnt_qposadr[j]]),
            start=float(m.qpos0[m.jnt_qposadr[j]]),
            limits=(float(m.jnt_range[j][0]), float(m.jnt_range[j][1]))
            if m.jnt_limited[j] and not without_constraints(m, NO_LIMITS)
            else None,
            effort=(float(m.jnt_actfrcrange[j][0]), float(m.jnt_actfrcrange[j][1])) if m.jnt_actfrclimited[j] and m.nactuator else None,
            friction=0.0 if without_constraints(m, NO_FRICTION) else float(m.dof_frictionloss[dof]),
        )

    def _armature(self, j: int) -> float:
        """That of a joint, with those that actuators bring along."""
        return float(self.m.dof_armature[self.m.jnt_dofadr[j]]) + sum(armature for armature, _, _ in self._motors(j))

    def _spring(self, j: int) -> _Spring:
        """Spring and damper of a joint, those that actuators bring along among them."""
        m, dof = self.m, self.m.jnt_dofadr[j]
        spring: _Spring = {"damping": 0.0, "more_damping": (), "stiffness": 0.0, "more_stiffness": ()}
        if not off(m, NO_SPRINGS):
            spring["stiffness"], spring["more_stiffness"] = float(m.jnt_stiffness[j]), tuple(map(float, m.jnt_stiffnesspoly[j]))
        if not off(m, NO_DAMPERS):
            motors = self._motors(j)
            spring["damping"] = float(m.dof_damping[dof]) + sum(damping for _, damping, _ in motors)
            spring["more_damping"] = tuple(map(float, m.dof_dampingpoly[dof] + sum(more for _, _, more in motors)))
        return spring

    def _motors(self, j: int) -> list[tuple[float, float, np.ndarray]]:
        """Armature, damping and factors of more damping that actuators bring to a joint, by the square of their gears."""
        m, motors = self.m, []
        for k in range(m.nactuator) if m.jnt_actuatorid[j] != -1 else ():
            if m.actuator_trntype[k] in AT_JOINT and m.actuator_trnid[k][0] == j:
                square = float(m.actuator_gear[m.actuator_outadr[k]][0]) ** 2
                motors.append(
                    (float(m.actuator_armature[k]) * square, float(m.actuator_damping[k]) * square, m.actuator_dampingpoly[k] * square)
                )
        return motors
