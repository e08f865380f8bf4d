"""What becomes of the robots' files of some folders: read, compared with another program, refused with the reason, and seconds.

    git clone --depth 1 https://github.com/osrf/gazebo_models
    python tests/robots/read_files.py gazebo_models [--joints] [--balanced | --as-given] [--compare N] [--seconds S]

A line a file: joints, bodies, what is left out that would change its motion, seconds of the processor; or why it is refused. The last lines
count. --joints: only files that have joints. --balanced, --as-given: also those with inertias that no body has. --compare N: of up to N
joints the mass matrix, gravity and so on of URDF next to Pinocchio (`compare_files.py`), accelerations of MJCF next to MuJoCo
(`compare_mjcf.py`), as the largest error over 1 + the largest entry; SDF has no independent reader here. What is no XML, or XML of another
kind, is counted apart. --seconds S: for one file, 300 by default.
"""

import argparse
import re
import time
import warnings
from collections import Counter
from functools import partial
from pathlib import Path

from one_by_one import LONGEST, judged_apart

import ncgen
from ncgen.errors import NcgenError
from ncgen.exchange.robots import FORMATS
from ncgen.exchange.robots.accounting import changes_motion, parted
from ncgen.exchange.robots.markup import Markup, read_markup

SUFFIXES = (".sdf", ".urdf", ".xml")

ERROR = re.compile(r"[0-9]e[+-][0-9]+")
"""A number as the comparisons write errors."""


def judged(path: Path, only_joints: bool, inertias: str, largest: int) -> tuple[str, str]:
    """What became of a file, in one word and in a line. largest: joints of a robot that is compared"""
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
    left = sum(parted(said)[1] for said in model.left_out if changes_motion(said))
    line = f"{joints} joints, {len(model.bodies)} bodies, {left} left out, {time.process_time() - begun:.2f} s"
    if joints > largest or not (joints or largest and root.tag == "mujoco"):  # MJCF may have joints of other files
        return "read", line
    word, beside = compared(path, root)
    return word, f"{line}; {beside}"


def compared(path: Path, root: Markup) -> tuple[str, str]:
    """The largest error next to another program, and its seconds; or why there is none."""
    begun = time.process_time()
    if root.tag == "robot":
        from compare_files import line

        said, program = line(path).partition("; ")[2], "Pinocchio"
    elif root.tag == "mujoco":
        from compare_mjcf import line as accelerations

        word, said = accelerations(path)
        said, program = said.partition("; left out")[0] or word, "MuJoCo"
    else:
        return "read", "no independent reader"
    errors = [float(each) for each in ERROR.findall(said)]
    if not errors:
        return "read", f"not compared: {said or 'other joints than Pinocchio has'}"
    return "compared", f"{program} {max(errors):.0e}, {time.process_time() - begun:.1f} s"


def main(folders: list[str], only_joints: bool, inertias: str, largest: int, longest: float) -> None:
    files = sorted(path for folder in folders for path in Path(folder).rglob("*") if path.suffix in SUFFIXES and path.is_file())
    counts: Counter[str] = Counter()
    worst: Counter[str] = Counter()
    judge = partial(judged, only_joints=only_joints, inertias=inertias, largest=largest)
    for path, word, line in judged_apart(judge, files, longest):
        counts[word] += 1
        if word in ("read", "compared", "refused", "failed"):
            print(f"{path}: {word}: {line}", flush=True)
        if found := re.search(r"; (\w+) (\de[+-]\d+),", line):
            worst[f"{found[1]} within {10.0 ** max(-12, int(found[2].partition('e')[2]) + 1):.0e}"] += 1
    read = counts["read"] + counts["compared"]
    print(*(f"{word} {count}" for word, count in counts.items()), sep=", ")
    print(*(f"{word}: {count}" for word, count in sorted(worst.items())), sep=", ")
    if tried := read + counts["refused"]:
        print(f"{read} of {tried} read, {100 * read / tried:.1f} %")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folders", nargs="+")
    parser.add_argument("--joints", action="store_true")
    parser.add_argument("--balanced", dest="inertias", action="store_const", const="balanced", default="refused")
    parser.add_argument("--as-given", dest="inertias", action="store_const", const="as given")
    parser.add_argument("--compare", type=int, default=0, metavar="N")
    parser.add_argument("--seconds", type=float, default=LONGEST, metavar="S")
    asked = parser.parse_args()
    main(asked.folders, asked.joints, asked.inertias, asked.compare, asked.seconds)
