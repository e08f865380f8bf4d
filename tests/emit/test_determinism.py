"""The same model gives the same bytes, wherever and whenever it is generated."""

from __future__ import annotations

import hashlib
import json
import math
import os
import re
import subprocess
import sys
from pathlib import Path

import numpy
import pytest
import sympy

import ncgen
from ncgen import Model
from ncgen.exchange.examples import example_names
from ncgen.files import put
from ncgen.model.digest import digest
from ncgen.resources import folder

GENERATE = """
import sys, ncgen
ncgen.generate(ncgen.load("robot")).write(sys.argv[1])
"""
SURROUNDINGS = {
    "PYTHONHASHSEED": "4242",
    "LC_ALL": "tr_TR.UTF-8",
    "LANG": "tr_TR",
    "TZ": "America/St_Johns",
    "PYTHONUTF8": "0",
    "PYTHONOPTIMIZE": "1",
}


DIGESTS = """
import json, ncgen
from ncgen.exchange.examples import example_names
from ncgen.model.digest import digest
print(json.dumps({name: digest(ncgen.load(name)) for name in example_names()}))
"""


def test_no_example_depends_on_the_processor():
    """BLAS adds in another order on other processors: what an example computes for its model must not go through it."""
    found = {name: digest(ncgen.load(name)) for name in example_names()}
    assert None not in found.values()
    environment = {**os.environ, "OPENBLAS_CORETYPE": "Prescott"}  # without vectors of four and fused operations
    run = subprocess.run([sys.executable, "-c", DIGESTS], env=environment, capture_output=True, text=True)
    assert run.returncode == 0, run.stderr
    assert json.loads(run.stdout) == found


def digests(path: Path) -> dict[str, str]:
    return {file.name: hashlib.sha256(file.read_bytes()).hexdigest() for file in sorted(path.iterdir())}


def test_surroundings_do_not_matter(robot_sources, tmp_path):
    """A process with another hash seed, folder, home, language and time zone writes what this one writes, whose seed is random."""
    home = tmp_path / "another home"
    home.mkdir()
    environment = {**os.environ, **SURROUNDINGS, "HOME": str(home), "XDG_CACHE_HOME": str(home / "cache")}
    command = [sys.executable, "-c", GENERATE, str(tmp_path / "out")]
    run = subprocess.run(command, cwd=home, env=environment, capture_output=True, text=True)
    assert run.returncode == 0, run.stderr
    expected = {name: hashlib.sha256(text.encode()).hexdigest() for name, text in sorted(robot_sources("auto").files.items())}
    assert digests(tmp_path / "out") == expected


DATE, VERSION, PLACE, HOUR = r"\b(19|20)\d\d-\d\d?-\d\d?\b", r"\b\d+\.\d+\.\d+\b", r"/(home|tmp|usr|root)/", r"\b\d\d:\d\d:\d\d\b"


def traces(text: str) -> list[str]:
    """What a text tells of when, where and by which versions it was written."""
    here = [sympy.__version__, numpy.__version__, ncgen.__version__, str(folder("templates").parent), str(Path.home())]
    found = [trace for trace in here if len(trace) > 1 and trace in text]
    return found + [match[0] for pattern in (DATE, VERSION, PLACE, HOUR) for match in re.finditer(pattern, text)]


@pytest.mark.parametrize("emission", ["unrolled", "tabled", "auto"])
def test_no_trace_of_time_and_place(robot_sources, emission):
    """No date, path or version is in any file."""
    assert {name: traces(text) for name, text in robot_sources(emission).files.items() if traces(text)} == {}


@pytest.mark.parametrize("text", ["2026-01-31", "by ncgen 0.1.0", "at 12:34:56", "in /home/me/models", str(folder("templates"))])
def test_traces_would_be_seen(text):
    """The check above finds each of them."""
    assert traces(f"/* robot.c: generated {text} */")


def test_generating_twice_is_generating_once(robot_tables, robot_sources):
    """Nothing is left over from one generation to the next in the same process."""
    assert ncgen.generate(robot_tables.build()).files == robot_sources("auto").files


def pendulum(length: float) -> Model:
    model = Model("pendulum")
    model.distance(model.point("A", (0, 0), fixed=True), model.point("B", (1, 0)), length)
    return model


def test_the_fingerprint_is_the_source():
    """Equal sources have equal fingerprints; one bit in one length gives another."""
    lengths = (1.0, 1.0, math.nextafter(1.0, 2.0))
    found = [re.search(r'\.fingerprint = "([0-9a-f]{16})"', ncgen.generate(pendulum(x)).c["pendulum.c"])[1] for x in lengths]
    assert found[0] == found[1] != found[2]


def test_everyone_may_read_what_is_written(tmp_path):
    """One file under its own name, in place of what stood there."""
    path = tmp_path / "a.c"
    for data in (b"1", b"2"):
        assert put(path, data, ".a.") == path
    assert path.read_bytes() == b"2" and path.stat().st_mode & 0o777 == 0o644 and list(tmp_path.iterdir()) == [path]


def test_nothing_is_left_of_what_cannot_be_written(tmp_path):
    (tmp_path / "a.c").mkdir()
    with pytest.raises(OSError):
        put(tmp_path / "a.c", b"1", ".a.")
    assert [path.name for path in tmp_path.iterdir()] == ["a.c"]
