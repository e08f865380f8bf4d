"""Files of SDF that differ in one word: what a reader makes of both must differ, or the word is listed, or the file is refused.

    python tests/robots/vocabulary_of_sdf.py 5000 [SEED]

draws so many words of the published descriptions, places for them in a file and values, and prints those that changed nothing.
"""

import copy
import random
import sys
import tempfile
import xml.etree.ElementTree as ET
from collections import Counter
from dataclasses import fields, is_dataclass
from pathlib import Path

import numpy as np

from ncgen.errors import ModelError
from ncgen.exchange.robots import read_robot
from ncgen.exchange.robots.accounting import vocabulary

SCHEMA = Path(__file__).parent / "schemas" / "sdf.txt"

INERTIAL = "<inertial><pose>0.1 0.2 0 0.3 0 0</pose><mass>2</mass><inertia><ixx>.1</ixx><iyy>.2</iyy><izz>.25</izz></inertia></inertial>"
AXIS = "<xyz>0.6 0 0.8</xyz><dynamics><damping>0.1</damping></dynamics>"


def _joint(name: str, kind: str, parent: str, child: str, inside: str = "") -> str:
    pose = "<pose>0.1 0.2 0.3 0.4 0.5 0.6</pose>"
    return f'<joint name="{name}" type="{kind}">{pose}<parent>{parent}</parent><child>{child}</child>{inside}</joint>'


def _link(name: str, more: str = INERTIAL) -> str:
    """Each in a place of its own: what is relative to one of them is not what is relative to another."""
    box = "<geometry><box><size>1 2 3</size></box></geometry>"
    shapes = f'<collision name="c">{box}</collision><visual name="v">{box}</visual>'
    return f'<link name="{name}"><pose>1 2 {ord(name[0]) / 32} 0.1 0.2 0.3</pose>{more}{shapes}</link>'


SOLID = '<inertial auto="true"/>'
TOOL = "".join(
    [
        '<sdf version="1.8"><model name="tool"><pose>1 0 0 0 0 1</pose>',
        *map(_link, "tu"),
        '<frame name="tip"><pose>1 1 1 1 1 1</pose></frame>',
        _joint("grip", "prismatic", "t", "u", f"<axis>{AXIS}</axis>"),
        "</model></sdf>",
    ]
)

INSIDE = "".join(
    [
        *map(_link, "abcdef"),
        _link("g").replace("<pose>", '<pose relative_to="q">', 1),
        _link("h").replace("<pose>", '<pose relative_to="n::o">', 1),
        _link("solid", SOLID),
        '<frame name="q" attached_to="b"><pose>0.1 0 0 0 0 0.5</pose></frame>',
        '<model name="n"><pose>1 1 1 0 0 1</pose>' + _link("a") + _link("z") + '<frame name="o"><pose>0 1 0 1 0 0</pose></frame></model>',
        "<include><uri>tool.sdf</uri></include>",
        _joint("j1", "revolute", "a", "b", f"<axis>{AXIS}</axis>"),
        _joint("j2", "prismatic", "q", "c", f'<axis>{AXIS}<mimic joint="j1"><multiplier>2</multiplier></mimic></axis>'),
        _joint("j3", "universal", "c", "d", "<axis><xyz>1 0 0</xyz></axis><axis2><xyz>0 0.6 0.8</xyz></axis2>"),
        _joint("j4", "ball", "d", "e"),
        _joint("j5", "screw", "e", "f", f"<axis>{AXIS}</axis><screw_thread_pitch>0.1</screw_thread_pitch>"),
        _joint("j6", "fixed", "f", "g"),
        _joint("j7", "continuous", "g", "n", f"<axis>{AXIS}</axis>"),
    ]
)
FILE = "".join(
    [
        '<sdf version="1.12"><world name="w"><physics/><gravity>0 1 -9</gravity>',
        f'<model name="m"><pose>0 0 1 0 0 0.5</pose>{INSIDE}</model>',
        '<include><uri>tool.sdf</uri><pose relative_to="p">0 0 1 1 0 0</pose></include>',
        '<frame name="p"><pose>1 0 0 0 0 0.2</pose></frame></world></sdf>',
    ]
)

NAMES = {
    "uri": ["tool.sdf", "none.sdf"], "name": ["other"], "placement_frame": ["tip", "o", "q"], "canonical_link": ["z", "u", "c"],
    "attached_to": ["a", "c", "none"], "relative_to": ["a", "q", "none", "p"], "frame": ["a", "none"], "expressed_in": ["a", "q", "none"],
    "parent": ["a", "g", "n", "q", "none"], "child": ["a", "g", "n", "q", "none"], "joint": ["j5", "none"], "axis": ["axis2"],
    "rotation_format": ["quat_xyzw"], "type": ["ball", "fixed", "prismatic", "wheel"], "version": ["1.4"], "gearbox_reference_body": ["a"],
}  # fmt: skip
"""Texts for words that are names."""

UNASKED = ("link/collision", "model@canonical_link")
"""An element without a text, and a name that is nothing to a file which does not mention its model."""

ANCHORS = {
    "root": ".", "world": "world", "physics": "world/physics", "model": ".//model", "link": ".//link", "joint": ".//joint",
    "mimic": ".//mimic", "frame": ".//frame", "pose": ".//pose", "inertial": ".//inertial",
}  # fmt: skip
"""Where in the file elements stand that the table has a vocabulary for."""


def kinds() -> dict[str, str]:
    """{path: type} of the published descriptions."""
    lines = (line.split("|") for line in SCHEMA.read_text(encoding="utf-8").splitlines())
    return {path.strip(): kind.strip() for path, _, kind, _ in lines}


def values(path: str, kind: str, rng: random.Random) -> str:
    """A text for a word that is not its default."""
    name = path.rpartition("@")[2] if "@" in path else path.rpartition("/")[2]
    if name in NAMES:
        return rng.choice(NAMES[name])
    number = lambda: f"{rng.uniform(0.05, 2.0):.3f}"  # noqa: E731
    match kind:
        case "bool":
            defaults = vocabulary("sdf")[path].defaults
            return "false" if defaults and vocabulary("sdf")[path].is_default("true") else "true"
        case "double":
            return number()
        case "int" | "unsigned int":
            return str(rng.randint(2, 9))
        case "vector3":
            return " ".join(number() for _ in range(3))
        case "pose" | "= pose":
            return " ".join(number() for _ in range(6))
        case _:
            return "other"


def changed(tree: ET.Element, path: str, place: int, text: str) -> ET.Element | None:
    """A copy of the file with a word set at the place of that number; None where the file has no such place, or this value there."""
    anchor, mark, inside = path.partition("/") if "/" in path else path.partition("@")
    found = copy.deepcopy(tree)
    anchors = found.findall(ANCHORS[anchor])
    if not anchors:
        return None
    element = anchors[place % len(anchors)]
    tags, _, attribute = inside.partition("@") if mark == "/" else ("", "", inside)
    for tag in filter(None, tags.split("/")):
        child = element.find(tag)
        element = child if child is not None else ET.SubElement(element, tag)
    before = element.get(attribute) if attribute else element.text
    if attribute:
        element.set(attribute, text)
    else:
        element.text = text
    return None if before and _value(before) == _value(text) else found


def _value(text: str) -> list[float] | str:
    """The numbers of a text; of another one the text itself."""
    try:
        return [float(word) for word in text.split()]
    except ValueError:
        return text


def printed(thing: object) -> object:
    """A robot as something that can be compared."""
    if isinstance(thing, np.ndarray):
        return tuple(np.round(thing.ravel(), 12).tolist())
    if is_dataclass(thing):
        return tuple((each.name, printed(getattr(thing, each.name))) for each in fields(thing) if each.name != "where")
    if isinstance(thing, dict):
        return tuple((key, printed(value)) for key, value in thing.items())
    return tuple(map(printed, thing)) if isinstance(thing, (list, tuple)) else thing


class Reading:
    """Reads files in a folder of its own."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        (folder / "tool.sdf").write_text(TOOL, encoding="utf-8")

    def of(self, tree: ET.Element) -> object:
        """What a reader makes of a file: everything it has read and listed, or what it says against it."""
        (self.folder / "m.sdf").write_text(ET.tostring(tree, encoding="unicode"), encoding="utf-8")
        try:
            return printed(read_robot(self.folder / "m.sdf"))
        except ModelError as error:
            return str(error)


def ignored(count: int, seed: int, folder: Path) -> tuple[Counter[str], list[str]]:
    """Draw words and see what becomes of them: how many were modelled or listed, or refused, and those that changed nothing."""
    rng, reading, base = random.Random(seed), Reading(folder), ET.fromstring(FILE)
    table, types = vocabulary("sdf"), kinds()
    before = reading.of(base)
    assert not isinstance(before, str), before
    paths = [path for path, word in table.items() if word.meaning != "looks" and types[path] != "group" and path not in UNASKED]
    found: Counter[str] = Counter()
    nothing = []
    while sum(found.values()) < count:
        path = rng.choice(paths)
        place, text = rng.randrange(1000), values(path, types[path], rng)
        tree = changed(base, path, place, text)
        if tree is None:
            continue
        after = reading.of(tree)
        found["refused" if isinstance(after, str) else "modelled or listed" if after != before else "nothing"] += 1
        if after == before:
            nothing.append(f"{path} = {text} at place {place}")
    return found, nothing


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as folder:
        counts, left = ignored(int(sys.argv[1]), int(sys.argv[2]) if len(sys.argv) > 2 else 1, Path(folder))
    print(*sorted(left), counts, sep="\n")
