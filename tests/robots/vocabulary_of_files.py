"""Files of URDF, SDF and MJCF that differ in one word: what is read must differ, or the word is listed, or the file is refused.

    python tests/robots/vocabulary_of_files.py 5000 [SEED]

draws so many words of the three formats' published schemas, a third each, places for them in a file and values, and prints those that
changed nothing. Files of MJCF have up to four words and are compared with MuJoCo (`vocabulary_of_mjcf.py`).
"""

from __future__ import annotations

import copy
import random
import sys
import tempfile
import xml.etree.ElementTree as ET
from collections import Counter
from pathlib import Path

from vocabulary_of_mjcf import ignored_of_mjcf
from vocabulary_of_sdf import ignored as ignored_of_sdf
from vocabulary_of_sdf import printed

from ncgen.errors import ModelError
from ncgen.exchange.robots import read_robot
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


IGNORED = {"sdf": ignored_of_sdf, "urdf": ignored_of_urdf, "mjcf": ignored_of_mjcf}


if __name__ == "__main__":
    for name, ignored in IGNORED.items():
        with tempfile.TemporaryDirectory() as place:
            counts, left = ignored(int(sys.argv[1]) // len(IGNORED), int(sys.argv[2]) if len(sys.argv) > 2 else 1, Path(place))
        print(name, *sorted(left), dict(counts), sep="\n", flush=True)
