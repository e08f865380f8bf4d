"""Files of URDF, SDF and MJCF made from words of the published schemas: none of them is ignored.

    python tests/robots/vocabulary_of_files.py 5000 [SEED]

makes so many files, a third of each format, and prints those in which a word was ignored, and what became of how many.
A file of URDF has up to four words; accelerations are Pinocchio's (`vocabulary_of_urdf.py`). One of MJCF has up to four words that
MuJoCo takes; accelerations are MuJoCo's without what is listed as left out (`vocabulary_of_mjcf.py`). Half of those of SDF have one word,
by which what is read must differ (`vocabulary_of_sdf.py`), half up to four, and accelerations are those of Drake (`pip install drake`,
`vocabulary_by_drake.py`); without it all are of the first kind.
"""

from __future__ import annotations

import sys
import tempfile
from importlib.util import find_spec
from pathlib import Path

from vocabulary_by_drake import ignored_by_drake
from vocabulary_of_mjcf import ignored_of_mjcf
from vocabulary_of_sdf import ignored as ignored_of_sdf
from vocabulary_of_urdf import ignored_of_urdf

HAS_DRAKE = find_spec("pydrake") is not None

PARTS = [("sdf", ignored_of_sdf, 6 if HAS_DRAKE else 3), *([("sdf with Drake", ignored_by_drake, 6)] if HAS_DRAKE else []),
         ("urdf", ignored_of_urdf, 3), ("mjcf", ignored_of_mjcf, 3)]  # fmt: skip
"""Kinds of files, and what part of all they are."""


if __name__ == "__main__":
    for name, ignored, part in PARTS:
        with tempfile.TemporaryDirectory() as place:
            counts, left = ignored(int(sys.argv[1]) // part, int(sys.argv[2]) if len(sys.argv) > 2 else 1, Path(place))
        print(name, *sorted(left), dict(counts), sep="\n", flush=True)
