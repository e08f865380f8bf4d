"""Files of URDF, SDF and MJCF made from words of the published schemas: none of them is ignored.

    python tests/robots/vocabulary_of_files.py 5000 [SEED]

makes so many files, a third of each format, and prints those in which a word was ignored, and what became of how many.
A file of URDF has up to four words; accelerations are Pinocchio's (`vocabulary_of_urdf.py`). One of MJCF has up to four words that
MuJoCo takes; accelerations are MuJoCo's without what is listed as left out (`vocabulary_of_mjcf.py`). One of SDF has one word, by
which what is read must differ (`vocabulary_of_sdf.py`).
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

from vocabulary_of_mjcf import ignored_of_mjcf
from vocabulary_of_sdf import ignored as ignored_of_sdf
from vocabulary_of_urdf import ignored_of_urdf

IGNORED = {"sdf": ignored_of_sdf, "urdf": ignored_of_urdf, "mjcf": ignored_of_mjcf}


if __name__ == "__main__":
    for name, ignored in IGNORED.items():
        with tempfile.TemporaryDirectory() as place:
            counts, left = ignored(int(sys.argv[1]) // len(IGNORED), int(sys.argv[2]) if len(sys.argv) > 2 else 1, Path(place))
        print(name, *sorted(left), dict(counts), sep="\n", flush=True)
