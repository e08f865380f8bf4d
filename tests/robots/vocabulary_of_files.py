"""Files of URDF, SDF and MJCF that differ in one word: what is read must differ, or the word is listed, or the file is refused.

    python tests/robots/vocabulary_of_files.py 5000 [SEED]

draws so many words of the three formats' published schemas, a third each, places for them in a file and values, and prints those that
changed nothing. Of MJCF MuJoCo itself says whether a word changes the motion: accelerations of the compiled model at a moving state.
"""

from __future__ import annotations

import copy
import random
import re
import sys
import tempfile
import xml.etree.ElementTree as ET
from collections import Counter
from pathlib import Path

import numpy as np
from vocabulary_of_sdf import ignored as ignored_of_sdf
from vocabulary_of_sdf import printed

from ncgen.errors import ModelError
from ncgen.exchange.robots import mjcf, read_robot
from ncgen.exchange.robots.accounting import vocabulary

# -- URDF ------------------------------------------------------------------------------------------------------------------


def _urdf() -> str:
    links = "".join(
        f'<link name="{name}"><inertial><origin xyz="0.1 0.2 0" rpy="0.3 0 0"/><mass value="2"/><inertia ixx="0.1" iyy="0.2" izz="0.25"/>'
        '</inertial><visual><geometry><box size="1 2 3"/></geometry></visual>'
        '<collision><geometry><sphere radius="1"/></geometry></collision>'
        "</link>"
        for name in "abcdefg"
    )
    axis = '<axis xyz="0.6 0 0.8"/><dynamics damping="0.1"/><limit lower="-1" upper="2"/>'
    parts = [
        ("j1", "revolute", "ab", axis),
        ("j2", "prismatic", "bc", axis + '<mimic joint="j1"/>'),
        ("j3", "continuous", "cd", axis.partition("<limit")[0]),
    ]
    parts += [("j4", "fixed", "de", ""), ("j5", "planar", "ef", '<axis xyz="0 0 1"/>'), ("j6", "floating", "fg", "")]
    joints = "".join(
        f'<joint name="{name}" type="{kind}"><origin xyz="1 0 0.5" rpy="0.1 0.2 0.3"/><parent link="{ends[0]}"/><child link="{ends[1]}"/>'
        f"{inside}</joint>"
        for name, kind, ends, inside in parts
    )
    return f'<robot name="r">{links}{joints}</robot>'


URDF_ANCHORS = {"robot": ".", "link": ".//link", "joint": ".//joint", "pose": ".//origin"}
VECTORS = {"xyz": 3, "rpy": 3, "quat_xyzw": 4}
WORDS = {"link": ["a", "g", "none"], "joint": ["j1", "j3", "none"], "name": ["other"], "type": ["fixed", "continuous", "ball", "planar"]}
UNASKED = ("link/collision",)
"""An element without a text, which is counted already."""


def _value(attribute: str, rng: random.Random) -> str:
    if attribute in WORDS:
        return rng.choice(WORDS[attribute])
    count = VECTORS.get(attribute, 1)
    return " ".join(f"{rng.uniform(0.3, 2.0):.3f}" for _ in range(count))


def changed(tree: ET.Element, where: str, tags: list[str], attribute: str, place: int, text: str) -> ET.Element | None:
    """A copy of a file with a word set below the place of that number; None where the file has no such place."""
    found = copy.deepcopy(tree)
    places = found.findall(where)
    if not places:
        return None
    element = places[place % len(places)]
    for tag in tags:
        child = element.find(tag)
        element = child if child is not None else ET.SubElement(element, tag)
    if attribute:
        element.set(attribute, text)
    else:
        element.text = text
    return found


class Reading:
    """Reads files of one format in a folder of its own."""

    def __init__(self, folder: Path, suffix: str) -> None:
        self.path = folder / f"m{suffix}"

    def of(self, tree: ET.Element) -> object:
        """What a reader makes of a file: everything it has read and listed, or what it says against it."""
        self.path.write_text(ET.tostring(tree, encoding="unicode"), encoding="utf-8")
        try:
            return printed(read_robot(self.path))
        except ModelError as error:
            return str(error)


def ignored_of_urdf(count: int, seed: int, folder: Path) -> tuple[Counter[str], list[str]]:
    """Draw words of URDF: how many were modelled or listed, or refused, and those that changed nothing."""
    rng, reading, base = random.Random(seed), Reading(folder, ".urdf"), ET.fromstring(_urdf())
    before = reading.of(base)
    assert not isinstance(before, str), before
    paths = [path for path, word in vocabulary("urdf").items() if word.meaning != "looks" and path not in UNASKED]
    found, nothing = Counter[str](), []
    while sum(found.values()) < count:
        path = rng.choice(paths)
        anchor, attribute = path.partition("@")[0].split("/"), path.partition("@")[2]
        text = _value(attribute, rng) if attribute else rng.choice(["other", ""])
        place = rng.randrange(1000)
        tree = changed(base, URDF_ANCHORS[anchor[0]], anchor[1:], attribute, place, text)
        if tree is None or ET.tostring(tree) == ET.tostring(base):
            continue
        after = reading.of(tree)
        means_nothing = not attribute and not text and vocabulary("urdf")[path].meaning == "modelled"  # an element without a word
        found["refused" if isinstance(after, str) else "modelled or listed" if after != before or means_nothing else "nothing"] += 1
        if after == before and not means_nothing:
            nothing.append(f"{path} = {text} at place {place}")
    return found, nothing


# -- MJCF ------------------------------------------------------------------------------------------------------------------

MJCF = """<mujoco><option gravity="0 1 -9"/><worldbody>
<body name="a" pos="0 0 1"><joint name="ja" axis="0 1 0.2" damping="0.1"/><geom name="ga" type="box" size="0.1 0.2 0.3" pos="0.1 0 0"/>
<site name="sa" pos="0.3 0 0"/>
<body name="b" pos="0.8 0 0"><joint name="jb" type="slide" axis="1 0 0" stiffness="3"/><geom name="gb" type="sphere" size="0.1"/>
<site name="sb" pos="0 0.1 0"/>
<body name="c" pos="0.8 0 0.1"><joint name="jc" type="ball"/>
<inertial pos="0.1 0 0" mass="1" diaginertia="0.1 0.2 0.15"/></body></body></body>
<body name="d" pos="5 5 5"><freejoint name="jd"/><geom name="gd" type="capsule" size="0.1 0.3" euler="30 0 0"/></body>
</worldbody><tendon><fixed name="t"><joint joint="ja" coef="1"/><joint joint="jb" coef="2"/></fixed></tendon>
<equality><joint name="e" joint1="ja" joint2="jb" active="false"/></equality>
<actuator><motor name="m" joint="ja" gear="2"/><position name="p" joint="jb" kp="3"/></actuator>
<sensor><jointpos joint="ja"/></sensor><keyframe/><default/><contact/><custom/></mujoco>"""

NAMES = {
    "joint": ["ja", "jb"], "joint1": ["jb"], "joint2": ["ja"], "body": ["a", "d"], "body1": ["a", "c"], "body2": ["b", "d"], "site": ["sa"],
    "site1": ["sa"], "site2": ["sb"], "geom": ["ga"], "geom1": ["ga"], "geom2": ["gd"], "tendon": ["t"], "tendon1": ["t"],
    "type": ["ball", "slide", "sphere", "box"], "jointinparent": ["ja"], "objtype": ["site", "body"], "objname": ["sa"],
}  # fmt: skip
TIMES, ATTEMPTS = 2, 8
"""States at which accelerations are compared, and texts that are tried for a word."""


def words_of_mjcf() -> list[tuple[list[str], str]]:
    """(tags from the root on, attribute) of MuJoCo's schema, which is printed as a tree of elements with their attributes."""
    import mujoco

    found, stack = [], list[tuple[int, str]]()
    for line in mujoco.mj_printSchema(False, False).splitlines():
        match = re.match(r"(\s*)(\w+) \(([!?*R]+)\)\s*(.*)", line)
        if not match:
            attributes = line.split()
        else:
            depth = len(match[1])
            stack = [each for each in stack if each[0] < depth] + [(depth, match[2])]
            attributes = match[4].split()
        found += [([tag for _, tag in stack[1:]], name) for name in attributes if name.isidentifier()]
    return found


class Motion:
    """Accelerations of MuJoCo's own model of a file, contacts and all."""

    def __init__(self) -> None:
        import mujoco

        self.mujoco = mujoco
        mujoco.set_mju_user_warning(lambda text: None)

    def of(self, path: Path) -> list[np.ndarray] | None:
        """At some states with motors; None where MuJoCo does not read it."""
        try:
            model = self.mujoco.MjModel.from_xml_path(str(path))
        except (ValueError, RuntimeError, self.mujoco.FatalError):
            return None
        data, rng, found = self.mujoco.MjData(model), np.random.default_rng(0), []
        for _ in range(TIMES):
            self.mujoco.mj_resetData(model, data)
            step = rng.normal(size=100)[: model.nv] * 0.1
            self.mujoco.mj_integratePos(model, data.qpos, step, 1.0)
            data.qvel[:], data.ctrl[:] = rng.normal(size=100)[: model.nv], rng.normal(size=100)[: model.nu]
            self.mujoco.mj_forward(model, data)
            found.append(data.qacc.copy())
        return found


def ignored_of_mjcf(count: int, seed: int, folder: Path) -> tuple[Counter[str], list[str]]:
    """Draw words of MJCF: how many were modelled or listed, refused, or do not change the motion, and those that do and changed nothing."""
    rng, reading, base, motion = random.Random(seed), Reading(folder, ".xml"), ET.fromstring(MJCF), Motion()
    apart, mjcf.compiled = mjcf.compiled, lambda path, text=None: motion.mujoco.MjModel.from_xml_path(str(path))
    try:
        before, moves = reading.of(base), motion.of(reading.path)
        assert not isinstance(before, str) and moves is not None, before
        words, found, nothing = words_of_mjcf(), Counter[str](), []
        while sum(found.values()) < count:
            tags, attribute = rng.choice(words)
            place, new, text = rng.randrange(1000), None, ""
            where, inside = (".//" + tags[-1], []) if base.find(".//" + tags[-1]) is not None else (".", tags)
            for _ in range(ATTEMPTS):
                text = _text(attribute, rng)
                tree = changed(base, where, inside, attribute, place, text)
                assert tree is not None
                reading.path.write_text(ET.tostring(tree, encoding="unicode"), encoding="utf-8")
                if (new := motion.of(reading.path)) is not None:
                    break
            if new is None:
                found["not MuJoCo's"] += 1
                continue
            after = reading.of(tree)
            is_same = len(new) == len(moves) and all(a.shape == b.shape and np.array_equal(a, b) for a, b in zip(new, moves, strict=True))
            listed = "refused" if isinstance(after, str) else "modelled or listed" if after != before else ""
            word = listed or ("no motion" if is_same else "nothing")
            found[word] += 1
            if word == "nothing":
                nothing.append(f"{'/'.join(tags)}@{attribute} = {text} at place {place}")
        return found, nothing
    finally:
        mjcf.compiled = apart


def _text(attribute: str, rng: random.Random) -> str:
    if attribute in NAMES:
        return rng.choice(NAMES[attribute])
    kind = rng.randrange(5)
    if kind == 0:
        return rng.choice(["true", "false", "enable", "disable"])
    if kind == 1:
        return str(rng.randint(0, 3))
    return " ".join(f"{rng.uniform(0.05, 2.0):.3f}" for _ in range(rng.choice([1, 1, 2, 3, 4, 6])))


IGNORED = {"sdf": ignored_of_sdf, "urdf": ignored_of_urdf, "mjcf": ignored_of_mjcf}


if __name__ == "__main__":
    for name, ignored in IGNORED.items():
        with tempfile.TemporaryDirectory() as place:
            counts, left = ignored(int(sys.argv[1]) // len(IGNORED), int(sys.argv[2]) if len(sys.argv) > 2 else 1, Path(place))
        print(name, *sorted(left), dict(counts), sep="\n", flush=True)
