"""Files of URDF made by setting words of its published schema, one to four in a file, and their motion next to Pinocchio's.

Accelerations of all bodies agree, and what is read differs from what it was, or is listed in `model.left_out`; else a word was ignored.
"""

from __future__ import annotations

import copy
import random
import warnings
import xml.etree.ElementTree as ET
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from by_mujoco import lagrange
from vocabulary_of_sdf import printed

import ncgen
from ncgen.errors import NcgenError
from ncgen.exchange.robots import read_robot
from ncgen.exchange.robots.accounting import parted, vocabulary
from ncgen.exchange.robots.robot import Robot, together
from ncgen.model.elements import Point, Spatial
from ncgen.model.names import word

WITHIN, STATES, MOST_WORDS = 1e-9, 2, 4
"""Largest error of an acceleration over 1 + the largest one; states of each file; words of a file."""

LINK = """<link name="{name}"><inertial><origin xyz="0.1 0.2 0" rpy="0.3 0 0"/><mass value="2"/><inertia ixx="0.1" ixy="0" ixz="0"
iyy="0.2" iyz="0" izz="0.25"/>
</inertial><visual><geometry><box size="1 2 3"/></geometry></visual>
<collision><geometry><sphere radius="1"/></geometry></collision></link>"""

JOINT = """<joint name="{name}" type="{kind}"><origin xyz="1 0 0.5" rpy="0.1 0.2 0.3"/><parent link="{parent}"/><child link="{child}"/>
{inside}</joint>"""

AXIS = '<axis xyz="0.6 0 0.8"/><dynamics damping="0.1"/>'

TREES = (
    [
        ("revolute", AXIS + '<limit lower="-1" upper="2" effort="3" velocity="4"/>'),
        ("prismatic", AXIS + '<limit lower="-1" upper="2" effort="3" velocity="4"/><mimic joint="j1"/>'),
    ],
    [("continuous", AXIS), ("fixed", ""), ("prismatic", AXIS + '<limit lower="-1" upper="2" effort="3" velocity="4"/>')],
    [("planar", '<axis xyz="0 0 1"/>'), ("continuous", AXIS)],
    [("floating", ""), ("continuous", AXIS)],
)
"""Joints of files, one on the other, with what stands in them."""


def base_of(joints: list[tuple[str, str]]) -> ET.Element:
    """A file of links a, b, … and joints j1, j2, …"""
    names = "abcdefg"[: len(joints) + 1]
    parts = [LINK.format(name=name) for name in names]
    for k, (kind, inside) in enumerate(joints):
        parts.append(JOINT.format(name=f"j{k + 1}", kind=kind, parent=names[k], child=names[k + 1], inside=inside))
    return ET.fromstring(f'<robot name="r">{"".join(parts)}</robot>')


ANCHORS = {"robot": ".", "link": ".//link", "joint": ".//joint", "pose": ".//origin"}
VECTORS = {"xyz": 3, "rpy": 3, "quat_xyzw": 4}
WORDS = {
    "link": ["a", "b", "c", "none"],
    "joint": ["j1", "j2", "none"],
    "name": ["other"],
    "type": ["fixed", "continuous", "ball", "planar", "revolute"],
}
SIZES = {"ixx": (1.0, 1.5), "iyy": (1.0, 1.5), "izz": (1.0, 1.5), "ixy": (-0.2, 0.2), "ixz": (-0.2, 0.2), "iyz": (-0.2, 0.2)}
"""Moments of inertia that a body may have if all of them are drawn."""

COMPANIONS = {
    "limit": {"effort": "1", "velocity": "2"}, "dynamics": {"friction": "0"},
    "safety_controller": {"k_velocity": "1"}, "mimic": {"joint": "j1"}, "mass": {"value": "1"}, "axis": {"xyz": "1 0 0"},
    "inertia": {name: "0" if name[1] != name[2] else "1" for name in SIZES},
}  # fmt: skip
"""What an element has to have."""

RARE = ("link", "joint", "name", "type")
"""Words whose texts are mostly refused."""

UNASKED = ("link/collision",)
"""An element without a text, which is counted already."""


def text_of(attribute: str, rng: random.Random) -> str:
    """A text for an attribute."""
    if attribute in WORDS:
        return rng.choice(WORDS[attribute])
    low, high = SIZES.get(attribute, (-1.5, 1.5) if attribute in VECTORS else (0.3, 2.0))
    return " ".join(f"{rng.uniform(low, high):.3f}" for _ in range(VECTORS.get(attribute, 1)))


def _can_follow(tree: ET.Element, joint: ET.Element) -> bool:
    """Whether a joint may follow j1."""
    scalar = ("revolute", "continuous", "prismatic")
    return joint.get("name") != "j1" and all(j.get("type") in scalar for j in (joint, tree.find("joint")))


class Beside:
    """A file in ncgen and in Pinocchio, without limits and dry friction."""

    def __init__(self, path: Path, tree: ET.Element) -> None:
        import pinocchio as pin

        self.pin, self.tree = pin, tree
        self.model = ncgen.load(path)
        self.theirs = pin.buildModelFromXML(ET.tostring(with_planes_across_z(tree), encoding="unicode"))
        self.data, self.values = self.theirs.createData(), dict[str, float]()
        self.followed = {
            joint.get("name"): (mimic.get("joint"), float(mimic.get("multiplier", "1")), float(mimic.get("offset", "0")))
            for joint in tree.findall("joint")
            if (mimic := joint.find("mimic")) is not None
        }

    def place(self) -> None:
        """{element: (number of Pinocchio's frame, its place there)}, where the model begins."""
        self.kernels = ncgen.compile(self.model, "numpy")
        self._set(self._position({}), np.zeros(self.theirs.nv), np.zeros(self.theirs.nv))
        numbers = {word(frame.name, "link"): i for i, frame in enumerate(self.theirs.frames) if frame.type == self.pin.FrameType.BODY}
        self.at: dict[Spatial, tuple[int, np.ndarray]] = {}
        for name, body in self.model.bodies.items():
            for element in body.elements:
                if not element.fixed and name in numbers:
                    frame = self.data.oMf[numbers[name]]
                    away = element.initial - frame.translation if isinstance(element, Point) else element.initial
                    self.at[element] = numbers[name], frame.rotation.T @ away

    def _own(self, name: str) -> tuple[str, float, float]:
        """The joint that one follows in the end, factor and offset: itself, if it follows none."""
        if name not in self.followed:
            return name, 1.0, 0.0
        other, factor, offset = self.followed[name]
        leader, inner, zero = self._own(other)
        return leader, factor * inner, factor * zero + offset

    def _position(self, values: dict[str, float]) -> np.ndarray:
        """Pinocchio's position of joint values by name, 0 for others."""
        q = self.pin.neutral(self.theirs)
        for j in range(1, self.theirs.njoints):
            kind = self.theirs.joints[j]
            if kind.nv == 1:
                leader, factor, offset = self._own(self.theirs.names[j])
                value = self.values[self.theirs.names[j]] = factor * values.get(leader, 0.0) + offset
                q[kind.idx_q : kind.idx_q + kind.nq] = [value] if kind.nq == 1 else [np.cos(value), np.sin(value)]
        return q

    def _set(self, q: np.ndarray, v: np.ndarray, a: np.ndarray) -> None:
        self.pin.forwardKinematics(self.theirs, self.data, q, v, a)
        self.pin.updateFramePlacements(self.theirs, self.data)

    def _following(self) -> np.ndarray:
        """Joint velocities by those of joints that follow none."""
        m = self.theirs
        own = np.eye(m.nv)
        for j in range(1, m.njoints):
            leader, factor, _ = self._own(m.names[j])
            if leader != m.names[j]:
                own[m.joints[j].idx_v] = factor * np.eye(m.nv)[m.joints[m.getJointId(leader)].idx_v]
        return own[:, [i for i in range(m.nv) if np.any(own[:, i])]]

    def _damping(self) -> np.ndarray:
        """Of all joint velocities, as the file says it."""
        found = np.zeros(self.theirs.nv)
        for joint in self.tree.findall("joint"):
            dynamics, name = joint.find("dynamics"), joint.get("name")
            if dynamics is not None and joint.get("type") in ("revolute", "continuous", "prismatic") and self.theirs.existJointName(name):
                found[self.theirs.joints[self.theirs.getJointId(name)].idx_v] = float(dynamics.get("damping", "0"))
        return found

    def motion(self) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """Velocities and accelerations of Pinocchio's joints at some states, which are set."""
        m, rng, follow = self.theirs, np.random.default_rng(2), self._following()
        for _ in range(STATES):
            rates = rng.normal(size=100)
            values = {m.names[j]: rng.uniform(-1, 1) for j in range(1, m.njoints)}
            q, v = self._position(values), follow @ rates[: follow.shape[1]]
            wide = np.concatenate([[joint.nv > 1] * joint.nv for joint in list(m.joints)[1:]] or [[]]).astype(bool)
            q = self.pin.integrate(m, q, np.where(wide, rng.uniform(-1, 1, m.nv), 0.0))
            mass = self.pin.crba(m, self.data, q)
            mass = np.triu(mass) + np.triu(mass, 1).T
            right = -self._damping() * v - self.pin.nonLinearEffects(m, self.data, q, v)
            a = follow @ np.linalg.solve(follow.T @ mass @ follow, follow.T @ right)
            self._set(q, v, a)
            yield v, a

    def error(self) -> float:
        """The largest error of an acceleration over 1 + the largest."""
        worst, k = 0.0, self.kernels
        for v, a in self.motion():
            found, known = self._natural(v, a)
            closed = np.max(np.abs(k.phi(found[0], 0.0, k.p0)), initial=0.0)
            if not closed < 1e-9:
                return float("inf")
            mine = lagrange(k, found[0], found[1], 0.0, np.array(k.p0))
            worst = max(worst, float(np.max(np.abs(mine - found[2])[known], initial=0.0) / (1 + np.max(np.abs(found[2]), initial=0.0))))
        return worst

    def _natural(self, v: np.ndarray, a: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Natural coordinates with their derivatives, (3, n), and which of them are known."""
        k, m, pin = self.kernels, self.theirs, self.pin
        found, known = np.zeros((3, k.n)), np.zeros(k.n, dtype=bool)

        def put(name: str, values: Any) -> None:
            found[:, k.index[name]], known[k.index[name]] = values, True

        for element, (i, place) in self.at.items():
            frame = self.data.oMf[i]
            rate = pin.getFrameVelocity(m, self.data, i, pin.LOCAL_WORLD_ALIGNED)
            more = pin.getFrameClassicalAcceleration(m, self.data, i, pin.LOCAL_WORLD_ALIGNED)
            arm, w = frame.rotation @ place, rate.angular
            values = [arm, np.cross(w, arm), np.cross(more.angular, arm) + np.cross(w, np.cross(w, arm))]
            if isinstance(element, Point):
                values = [x + y for x, y in zip(values, (frame.translation, rate.linear, more.linear), strict=True)]
            for axis, component in enumerate(element.components):
                if not component.fixed:
                    put(component.name, [value[axis] for value in values])
        for j in range(1, m.njoints):
            joint, name = m.joints[j], word(m.names[j], "joint")
            if joint.nv == 1 and name in k.index:
                put(name, [self.values[m.names[j]], v[joint.idx_v], a[joint.idx_v]])
        return found, known


def what_is_read(robot: Robot) -> tuple[object, object]:
    """A robot as things that can be compared: what moves it, and what is left out."""
    return printed(tuple(getattr(together(robot), each) for each in ("links", "joints", "rows", "loops", "base"))), robot.omitted


class Draws:
    """Files with words of the schema."""

    def __init__(self, seed: int) -> None:
        self.rng = random.Random(seed)
        table = vocabulary("urdf")
        self.words = [path for path, each in table.items() if each.meaning != "looks" and path not in UNASKED]
        self.modelled = [path for path in self.words if table[path].meaning == "modelled"]
        self.bases = [base_of(joints) for joints in TREES]

    def file(self) -> tuple[int, ET.Element, list[str]]:
        """The number of the file that it is made from, a file, and its words."""
        rng = self.rng
        which = rng.randrange(len(self.bases))
        tree, said = copy.deepcopy(self.bases[which]), list[str]()
        for _ in range(rng.randint(1, MOST_WORDS)):
            said += self._set(tree, rng.choice(self.modelled if rng.random() < 0.6 else self.words))
        return (which, tree, said) if said else self.file()

    def _set(self, tree: ET.Element, path: str) -> list[str]:
        """Set a word somewhere; what was set. Moments of inertia are set all together."""
        tags, _, attribute = path.partition("@")
        anchor, *inside = tags.split("/")
        if not (places := tree.findall(ANCHORS[anchor])):
            return []
        element = places[place := self.rng.randrange(len(places))]
        if attribute in RARE and self.rng.random() < 0.7 or (inside[:1] == ["mimic"] and not _can_follow(tree, element)):
            return []
        for tag in inside:
            child = element.find(tag)
            element = child if child is not None else ET.SubElement(element, tag, COMPANIONS.get(tag, {}))
        if not attribute:
            element.text = self.rng.choice(["other", None])
            return [f"{path} at {place}"] if element.text or vocabulary("urdf")[path].meaning != "modelled" else []
        for each in SIZES if attribute in SIZES else (attribute,):
            element.set(each, text_of(each, self.rng))
        return [f"{path}={element.get(attribute)} at {place}"]


def with_planes_across_z(tree: ET.Element) -> ET.Element:
    """The same file where the planes of planar joints are across z, as Pinocchio has them whatever their axes are."""
    import pinocchio as pin

    found = copy.deepcopy(tree)
    for joint in [each for each in found.findall("joint") if each.get("type") == "planar"]:
        axis, origin, child = joint.find("axis"), joint.find("origin"), joint.find("child")
        normal = np.array([float(x) for x in (axis.get("xyz", "1 0 0") if axis is not None else "1 0 0").split()])
        turn = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), normal).toRotationMatrix()
        origin = origin if origin is not None else ET.SubElement(joint, "origin")
        rpy = pin.rpy.rpyToMatrix(np.array([float(x) for x in origin.get("rpy", "0 0 0").split()])) @ turn
        between = f"{joint.get('name')}.plane"
        origin.set("rpy", " ".join(map(repr, pin.rpy.matrixToRpy(rpy).tolist())))
        back = " ".join(map(repr, pin.rpy.matrixToRpy(turn.T).tolist()))
        found.append(ET.fromstring(f'<link name="{between}"/>'))
        ends = f'<origin rpy="{back}"/><parent link="{between}"/><child link="{child.get("link")}"/>'
        found.append(ET.fromstring(f'<joint name="{between}" type="fixed">{ends}</joint>'))
        child.set("link", between)
    return found


def judged(path: Path, tree: ET.Element, base: tuple[object, object]) -> tuple[str, str]:
    """What became of a file, and why. base: what is read of the one that it was made from"""
    for joint in tree.findall("joint"):
        if joint.get("type") in ("revolute", "prismatic") and joint.find("limit") is None:  # Pinocchio asks for them
            ET.SubElement(joint, "limit", COMPANIONS["limit"])
    path.write_text(ET.tostring(tree, encoding="unicode"), encoding="utf-8")
    try:
        moving, omitted = what_is_read(read_robot(path))
        ncgen.load(path)
    except NcgenError as refusal:
        return "refused", str(refusal)
    listed = {parted(each)[0] for each in omitted} - {parted(each)[0] for each in base[1]}
    try:
        both = Beside(path, tree)
    except (ValueError, RuntimeError) as error:
        return ("not Pinocchio's, read differently" if (moving, omitted) != base else "ignored"), f"Pinocchio: {error}"
    both.place()
    error = both.error() if both.theirs.nv else 0.0
    if not error < WITHIN:
        return "ignored", f"error {error:.0e}, left out: {', '.join(omitted)}"
    if listed:
        return "listed, and the rest checked", ""
    return ("without effect on the motion, checked" if moving == base[0] else "modelled and checked"), ""


def drawn(count: int, seed: int, folder: Path, counts: Counter[str]) -> Iterator[tuple[str, str, str]]:
    """Draw files: what became of each, why, and its words. counts: of words, which are added to"""
    draws, path, bases = Draws(seed), folder / "m.urdf", dict[int, tuple[object, object]]()
    for which, tree in enumerate(draws.bases):
        path.write_text(ET.tostring(tree, encoding="unicode"), encoding="utf-8")
        bases[which] = what_is_read(read_robot(path))
    for _ in range(count):
        which, tree, said = draws.file()
        counts["words"] += len(said)
        yield *judged(path, tree, bases[which]), f"{'; '.join(said)} of file {which}"


def ignored_of_urdf(count: int, seed: int, folder: Path) -> tuple[Counter[str], list[str]]:
    """Draw files of URDF: how many became what, and those in which a word was ignored."""
    counts, nothing = Counter[str](), []
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for what, why, said in drawn(count, seed, folder, counts):
            counts[what] += 1
            counts["files"] += 1
            if what == "ignored":
                nothing.append(f"{said}: {why}")
    return counts, nothing
