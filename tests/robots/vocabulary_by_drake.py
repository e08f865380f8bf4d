"""Files of SDF with one to four words of the published descriptions, and their motion next to Drake's, which reads them by libsdformat.

    pip install drake

Where Drake reads a file, accelerations of all bodies agree; where it does not, what is read differs from what it was; else a word was
ignored.
"""

from __future__ import annotations

import random
import warnings
import xml.etree.ElementTree as ET
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from by_mujoco import lagrange
from vocabulary_of_sdf import AXIS, INERTIAL, changed, kinds, printed, values

import ncgen
from ncgen.errors import NcgenError
from ncgen.exchange.robots import read_robot
from ncgen.exchange.robots.accounting import parted, vocabulary
from ncgen.exchange.robots.robot import Robot
from ncgen.model.bodies import check_inertia
from ncgen.model.elements import Point, Spatial
from ncgen.model.names import word

WITHIN, STATES, MOST_WORDS = 1e-9, 2, 4
"""Largest error of an acceleration over 1 + the largest one; states of each file; words of a file."""

POSES = ("0.3 0.1 0.2 0.1 0.2 0.3", "0.1 0.2 0.3 0.4 0.5 0.6")


def _link(name: str, pose: str = f"<pose>{POSES[0]}</pose>") -> str:
    return f'<link name="{name}">{pose}{INERTIAL}</link>'


def _joint(name: str, kind: str, parent: str, child: str, inside: str = f"<axis>{AXIS}</axis>") -> str:
    return f'<joint name="{name}" type="{kind}"><pose>{POSES[1]}</pose><parent>{parent}</parent><child>{child}</child>{inside}</joint>'


FRAME = '<frame name="q" attached_to="b"><pose>0.1 0 0 0 0 0.5</pose></frame>'
NESTED = f'<model name="n"><pose>1 1 1 0 0 1</pose>{_link("a")}{_link("z")}{_joint("j", "revolute", "a", "z")}</model>'
AXES = "<axis><xyz>1 0 0</xyz></axis><axis2><xyz>0 0.6 0.8</xyz></axis2>"
INSIDE = (
    [*map(_link, "abc"), FRAME, _joint("j1", "revolute", "a", "b"), _joint("j2", "prismatic", "q", "c")],
    [*map(_link, "ab"), FRAME, _joint("j1", "universal", "world", "a", AXES), _joint("j2", "ball", "a", "b", "")],
    [*map(_link, "abc"), FRAME, _joint("j1", "continuous", "world", "a"), _joint("j2", "fixed", "a", "b", ""),
     _joint("j3", "screw", "b", "c", f"<axis>{AXIS}</axis><screw_thread_pitch>0.1</screw_thread_pitch>")],
    [*map(_link, "ab"), FRAME, NESTED, _joint("j1", "revolute", "world", "a"), _joint("j2", "prismatic", "a", "b"),
     _joint("j3", "fixed", "b", "n::a", "")],
)  # fmt: skip
"""A free tree, universal joint and ball, screw, and a model in a model."""

BASES = [f'<sdf version="1.10"><model name="m"><pose>0 0 1 0 0 0.5</pose>{"".join(inside)}</model></sdf>' for inside in INSIDE]

NOT_DRAKES = (
    "root@version",
    "gravity",
    "velocity_decay",
    "static",
    "friction",
    "mimic",
    "auto",
    "density",
    "fluid",
    "physics",
    "gearbox",
    "kinematic",
    "self",
)
"""Parts of words that Drake passes over, or reads in a way of its own: nested models in versions that have none."""


class Beside:
    """A file in ncgen and in Drake."""

    def __init__(self, path: Path) -> None:
        from pydrake.multibody.parsing import Parser
        from pydrake.multibody.plant import MultibodyPlant

        self.model = ncgen.load(path)
        self.plant: Any = MultibodyPlant(0.0)
        Parser(self.plant).AddModels(str(path))
        self.plant.Finalize()
        self.context = self.plant.CreateDefaultContext()
        p = self.plant
        if any(said.startswith("damping of joints with several") for said in self.model.left_out):
            for joint in map(p.get_joint, p.GetJointIndices()):
                if joint.num_velocities() > 1:
                    joint.SetDampingVector(self.context, np.zeros(joint.num_velocities()))
        self.bodies: dict[str, Any] = {}
        for instance in range(1, p.num_model_instances()):
            for i in p.GetBodyIndices(_instance(instance)):
                body = p.get_body(i)
                self.bodies[self._name(body)] = body

    def _name(self, thing: Any) -> str:
        """As ncgen calls a body or a joint: without the outermost model."""
        scope = self.plant.GetModelInstanceName(thing.model_instance()).split("::")[1:]
        return "::".join([*scope, thing.name()])

    def place(self) -> None:
        """{element: (Drake's body, its place there)}, where the model begins."""
        self.kernels = ncgen.compile(self.model, "numpy")
        self.at: dict[Spatial, tuple[Any, np.ndarray]] = {}
        named = {word(name, "link"): body for name, body in self.bodies.items()}
        for name, body in self.model.bodies.items():
            for element in body.elements:
                if not element.fixed and name in named:
                    pose = self.plant.EvalBodyPoseInWorld(self.context, named[name])
                    away = element.initial - pose.translation() if isinstance(element, Point) else element.initial
                    self.at[element] = named[name], pose.rotation().matrix().T @ away

    def states(self) -> Iterator[None]:
        """Random states, which are set."""
        p, rng, begin = self.plant, np.random.default_rng(3), self.plant.GetPositions(self.context).copy()
        for _ in range(STATES):
            q = begin + rng.uniform(-0.5, 0.5, len(begin))
            for body in self.bodies.values():
                if body.is_floating_base_body():
                    at = slice(body.floating_positions_start(), body.floating_positions_start() + 4)
                    q[at] /= np.linalg.norm(q[at])
            p.SetPositions(self.context, q)
            p.SetVelocities(self.context, rng.normal(size=p.num_velocities()))
            yield

    def error(self) -> float:
        """The largest error of an acceleration over 1 + the largest."""
        worst, k = 0.0, self.kernels
        for _ in self.states():
            found, known = self._natural()
            closed = np.max(np.abs(k.phi(found[0], 0.0, k.p0)), initial=0.0)
            if not closed < 1e-9:
                return float("inf")
            mine = lagrange(k, found[0], found[1], 0.0, np.array(k.p0))
            worst = max(worst, float(np.max(np.abs(mine - found[2])[known], initial=0.0) / (1 + np.max(np.abs(found[2]), initial=0.0))))
        return worst

    def _natural(self) -> tuple[np.ndarray, np.ndarray]:
        """Natural coordinates with their derivatives, (3, n), and which of them are known."""
        k, p, context = self.kernels, self.plant, self.context
        found, known = np.zeros((3, k.n)), np.zeros(k.n, dtype=bool)
        for element, (body, place) in self.at.items():
            pose, rate = p.EvalBodyPoseInWorld(context, body), p.EvalBodySpatialVelocityInWorld(context, body)
            more = p.EvalBodySpatialAccelerationInWorld(context, body)
            arm, w = pose.rotation().matrix() @ place, rate.rotational()
            rows = [arm, np.cross(w, arm), np.cross(more.rotational(), arm) + np.cross(w, np.cross(w, arm))]
            if isinstance(element, Point):
                rows = [x + y for x, y in zip(rows, (pose.translation(), rate.translational(), more.translational()), strict=True)]
            for axis, component in enumerate(element.components):
                if not component.fixed:
                    found[:, k.index[component.name]], known[k.index[component.name]] = [row[axis] for row in rows], True
        q, v = p.GetPositions(context), p.GetVelocities(context)
        a = p.get_generalized_acceleration_output_port().Eval(context)
        for i in p.GetJointIndices():
            joint = p.get_joint(i)
            name = word(self._name(joint), "joint")
            if joint.num_velocities() == 1 and name in k.index:
                at, rate = joint.position_start(), joint.velocity_start()
                own = np.array([q[at], v[rate], a[rate]])
                found[:, k.index[name]], known[k.index[name]] = own, True
                if f"{name}_slide" in k.index:  # of a screw
                    found[:, k.index[f"{name}_slide"]] = own * joint.screw_pitch() / (2 * np.pi)
        return found, known


def _instance(number: int) -> Any:
    from pydrake.multibody.tree import ModelInstanceIndex

    return ModelInstanceIndex(number)


def _impossible(robot: Robot) -> str | None:
    """What is wrong with the inertia of a link by itself: Drake takes another one for it."""
    try:
        for link in robot.links.values():
            if link.mass:
                check_inertia(link.name, link.mass.mass, link.mass.com, link.mass.tensor)
    except NcgenError as error:
        return str(error)
    return None


def judged(path: Path, tree: ET.Element, base: object, said: list[str]) -> tuple[str, str]:
    """What became of a file, and why. base: what is read of the one that it was made from; said: its words"""
    path.write_text(ET.tostring(tree, encoding="unicode"), encoding="utf-8")
    try:
        robot = read_robot(path)
        ncgen.load(path)
    except NcgenError as refusal:
        return "refused", str(refusal)
    is_other = printed(robot) != base
    passed = next((each for each in said if any(part in each for part in NOT_DRAKES)), None) or _impossible(robot)
    if any(joint.kind == "screw" and joint.stiffness for joint in robot.joints):
        passed = "springs of screws"
    try:
        both = Beside(path) if passed is None else None
    except RuntimeError as error:
        both, passed = None, str(error)
    if both is None:
        return ("not Drake's, read differently" if is_other else "ignored"), f"Drake: {passed}"
    both.place()
    error = both.error() if both.plant.num_velocities() else 0.0
    if not error < WITHIN:
        return "ignored", f"error {error:.0e}, left out: {', '.join(robot.omitted)}"
    if {parted(each)[0] for each in robot.omitted}:
        return "listed, and the rest checked", ""
    return ("modelled and checked" if is_other else "without effect on the motion, checked"), ""


def drawn(count: int, seed: int, folder: Path, counts: Counter[str]) -> Iterator[tuple[str, str, str]]:
    """Draw files: what became of each, why, and its words. counts: of words, which are added to"""
    rng, path, types, table = random.Random(seed), folder / "m.sdf", kinds(), vocabulary("sdf")
    trees, bases = [ET.fromstring(base) for base in BASES], []
    for base in BASES:
        path.write_text(base, encoding="utf-8")
        bases.append(printed(read_robot(path)))
    paths = [each for each, word in table.items() if word.meaning == "modelled" and types[each] != "group" and not each.startswith("world")]
    while count:
        which, said = rng.randrange(len(BASES)), list[str]()
        tree = trees[which]
        for _ in range(rng.randint(1, MOST_WORDS)):
            each, place = rng.choice(paths), rng.randrange(1000)
            text = values(each, types[each], rng)
            try:
                new = changed(tree, each, place, text)
            except KeyError:
                continue
            if new is not None and ET.tostring(new) != ET.tostring(tree):
                tree = new
                said.append(f"{each}={text} at {place}")
        if said:
            count -= 1
            counts["words"] += len(said)
            yield *judged(path, tree, bases[which], said), f"{'; '.join(said)} of file {which}"


def ignored_by_drake(count: int, seed: int, folder: Path) -> tuple[Counter[str], list[str]]:
    """Draw files of SDF: how many became what, and those in which a word was ignored."""
    counts, nothing = Counter[str](), []
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for what, why, said in drawn(count, seed, folder, counts):
            counts[what] += 1
            counts["files"] += 1
            if what == "ignored":
                nothing.append(f"{said}: {why}")
    return counts, nothing
