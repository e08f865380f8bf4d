"""Files next to a robot's that say its loops."""

from __future__ import annotations

import re
from pathlib import Path

from ncgen.exchange.text import text_of
from ncgen.files import is_file

SUFFIX = ".loops.toml"
"""How a table of loops ends in place of the robot's suffix (`ncgen.exchange.robots.loops`)."""

YAML = (".yaml", ".yml")
"""How files of Gepetto's parallel robots end (`ncgen.exchange.robots.parallel_robots`)."""


def loop_file_of(path: Path) -> Path | None:
    """The file that says the loops of a robot's file, if there is one."""
    loop_file = path.with_suffix(SUFFIX)
    if is_file(loop_file):
        return loop_file
    return next((each for end in YAML if is_file(each := path.with_suffix(end)) and _says_loops(text_of(each))), None)


def _says_loops(text: str) -> bool:
    """Whether a YAML file says loops in the words that are read here."""
    return re.search(r"^closed_loop\s*:", text, re.MULTILINE) is not None
