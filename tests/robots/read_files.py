"""How many robots' files of some folders are read, and why others are not:

    git clone --depth 1 https://github.com/osrf/gazebo_models
    python tests/robots/read_files.py gazebo_models [--joints] [--balanced]

A line a file: joints, bodies, what is left out that would change its motion, seconds of the processor; or why it is refused. The last lines
count. --joints: only files that have joints. --balanced: also those with inertias that no body has. What is no XML, or XML of another kind,
is counted apart.
"""

import sys
import time
import warnings
from collections import Counter
from pathlib import Path

import ncgen
from ncgen.errors import NcgenError
from ncgen.exchange.robots import FORMATS
from ncgen.exchange.robots.accounting import amount, changes_motion
from ncgen.exchange.robots.markup import read_markup

SUFFIXES = (".sdf", ".urdf", ".xml")


def judged(path: Path, only_joints: bool, inertias: str) -> tuple[str, str]:
    """What became of a file, in one word and in a line."""
    try:
        root = read_markup(path)
    except NcgenError as error:
        return "no XML", str(error)
    if root.tag not in FORMATS:
        return "another kind", f"<{root.tag}>"
    joints = sum(each.tag in ("joint", "freejoint") for each in root.walk())
    if only_joints and not joints:
        return "without joints", ""
    begun = time.process_time()
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            model = ncgen.load(path, inertias=inertias)
    except NcgenError as error:
        return "refused", str(error)
    left = sum(amount(said) for said in model.left_out if changes_motion(said))
    return "read", f"{joints} joints, {len(model.bodies)} bodies, {left} left out, {time.process_time() - begun:.2f} s"


def main(folders: list[str], only_joints: bool, inertias: str) -> None:
    files = sorted(path for folder in folders for path in Path(folder).rglob("*") if path.suffix in SUFFIXES and path.is_file())
    counts: Counter[str] = Counter()
    for path in files:
        word, line = judged(path, only_joints, inertias)
        counts[word] += 1
        if word in ("read", "refused"):
            print(f"{path}: {word}: {line}", flush=True)
    tried = counts["read"] + counts["refused"]
    print(*(f"{word} {count}" for word, count in counts.items()), sep=", ")
    if tried:
        print(f"{counts['read']} of {tried} read, {100 * counts['read'] / tried:.1f} %")


if __name__ == "__main__":
    places = [each for each in sys.argv[1:] if not each.startswith("--")]
    main(places, "--joints" in sys.argv, "balanced" if "--balanced" in sys.argv else "refused")
