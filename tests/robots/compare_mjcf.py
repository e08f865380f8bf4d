"""MJCF of whole folders beside MuJoCo: positions, velocities and accelerations, equalities among them. Run by hand:

    python tests/robots/compare_mjcf.py FOLDER …

A line a file that has joints: its rates and equalities, the largest error of accelerations of points and directions of bodies over 1 +
the largest, at 3 random states, seconds of the processor, and what is left out. Springs, dampers, compensated weights and motors act,
equalities are rigid; contacts, limits, friction, fluids, tendons that act and actuators that are left out are off. The last line counts.
"""

from __future__ import annotations

import re
import sys
import time
import warnings
from collections import Counter
from pathlib import Path

import numpy as np
from one_by_one import judged_apart

from ncgen.errors import NcgenError

STATES, SIZE = 3, 0.2
"""States of each file, and how far joints and velocities are from where they begin (rad, m, and per second)."""

ROOT = re.compile(r"<mujoco[\s>]")
"""What a file of the format has."""

LARGEST = 8000
"""Coordinates of the largest model that is compared."""


def line(path: Path) -> tuple[str, str]:
    """What became of a file, in one word and in a line."""
    import mujoco
    from by_mujoco import Beside

    mujoco.set_mju_user_warning(lambda text: None)
    warnings.simplefilter("ignore")
    begun = time.process_time()
    try:
        both = Beside(path, motors=True, largest=LARGEST)
    except NcgenError as error:
        return "refused", str(error)
    if both.kernels is None:
        return "read", f"{len(both.model.components)} coordinates, too many to compare; left out: {', '.join(both.model.left_out)}"
    if not both.theirs.nv:
        return "without joints", ""
    both.only_what_is_modelled()
    rng = np.random.default_rng(0)
    error = both.closed_error(rng, STATES, SIZE) if both.theirs.neq else both.error(rng, STATES, SIZE)
    return "compared", (
        f"{both.theirs.nv} rates, {both.theirs.neq} equalities, error {error:.0e}, {time.process_time() - begun:.1f} s; "
        f"left out: {', '.join(both.model.left_out) or 'nothing'}"
    )


def main(folders: list[str]) -> None:
    paths = sorted(path for folder in folders for path in Path(folder).rglob("*.xml") if ROOT.search(path.read_text(errors="replace")))
    counts: Counter[str] = Counter()
    for path, word, said in judged_apart(line, paths):
        counts[word] += 1
        if word != "without joints":
            print(f"{path.parent.name}/{path.name}: {word}: {said}", flush=True)
    print(*(f"{word} {count}" for word, count in counts.items()), sep=", ")


if __name__ == "__main__":
    main(sys.argv[1:])
