"""Which tests run which line, and what each costs: the ordinary tests run once, with this plugin of pytest.

    python tests/mutation/measured.py [arguments of pytest: a few test files, whose lines are added, or -n 1, but not -n 0, where pytest-cov
                                       tells no tests apart]

Lines of Python go to `.coverage`. What else is told of a test goes to `.tests`, a line of JSON each:

    {"test": id, "passed": true, "seconds": of the processor, "lines": {"ncgen_run.c": [12, 15, …]}}

Lines of the C library are the first of each block that ran. They are known by what libraries call that are compiled with
-fsanitize-coverage=trace-pc, which gcc and clang can: `blocks.c`, which is preloaded.
"""

from __future__ import annotations

import ctypes
import json
import os
import subprocess
import sys
import tempfile
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

import pytest

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
FILE = ROOT / ".tests"

SLOTS = 1 << 18
"""As in blocks.c."""

try:
    _blocks_taken = ctypes.CDLL(None).blocks_taken
except AttributeError:
    _blocks_taken = None
_places = (ctypes.c_size_t * SLOTS)()
_lines: dict[tuple[str, int], list[tuple[str, int]]] = {}
_outcomes: dict[str, bool] = {}


def _spent() -> float:
    """Seconds of the processor, with those of processes that have ended."""
    return sum(os.times()[:4])


def _taken() -> list[int]:
    return _places[: _blocks_taken(_places)] if _blocks_taken else []


def _located(places: list[int]) -> dict[str, list[int]]:
    """{file of the runtime: lines} of places in memory."""
    libraries = []
    for line in Path("/proc/self/maps").read_text().splitlines():
        span, _, offset, _, _, *path = line.split(maxsplit=5)
        if path and path[0].endswith(".so"):
            begin, end = (int(number, 16) for number in span.split("-"))
            libraries.append((begin, end, int(offset, 16), path[0]))
    asked = defaultdict(list)
    known = []
    for place in places:
        for begin, end, offset, path in libraries:
            if begin <= place < end:
                known.append((path, place - begin + offset))
                if known[-1] not in _lines:
                    asked[path].append(place - begin + offset)
                break
    for path, addresses in asked.items():
        _ask(path, addresses)
    found = defaultdict(set)
    for key in known:
        for file, line in _lines.get(key, ()):
            found[file].add(line)
    return {file: sorted(found[file]) for file in sorted(found)}


def _ask(path: str, addresses: list[int]) -> None:
    """What addr2line says of addresses in a library: the line, and those of the calls that were inlined there."""
    text = "\n".join(f"{address - 1:#x}" for address in addresses)
    told = subprocess.run(["addr2line", "-a", "-i", "-e", path], input=text, capture_output=True, text=True).stdout
    frames: list[tuple[str, int]] = []
    waiting = iter(addresses)
    for line in told.splitlines():
        if line.startswith("0x"):
            frames = _lines.setdefault((path, next(waiting)), [])
            continue
        file, _, number = line.partition(" ")[0].rpartition(":")
        name = Path(file).name
        if name.startswith("ncgen") and number.isdigit():
            frames.append((name, int(number)))


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item, call: object) -> Iterator[None]:
    report = yield
    _outcomes[item.nodeid] = _outcomes.get(item.nodeid, True) and report.passed
    return report


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Iterator[None]:
    _taken()
    before = _spent()
    result = yield
    spent, lines = round(_spent() - before, 3), _located(_taken())
    record = {"test": item.nodeid, "passed": _outcomes.get(item.nodeid, False), "seconds": spent, "lines": lines}
    with FILE.open("a") as file:
        file.write(json.dumps(record) + "\n")
    return result


def main(arguments: list[str]) -> int:
    """Run tests as they are measured."""
    with tempfile.TemporaryDirectory() as folder:
        blocks = Path(folder) / "blocks.so"
        subprocess.run(["cc", "-O2", "-shared", "-fPIC", "-o", blocks, HERE / "blocks.c"], check=True)
        surroundings = os.environ | {
            "LD_PRELOAD": str(blocks),
            "NCGEN_CFLAGS": "-O1 -g1 -fsanitize-coverage=trace-pc",
            "PYTHONPATH": str(HERE),
            "OPENBLAS_NUM_THREADS": "1",
        }
        measuring = ["-p", "measured", "--cov=ncgen", "--cov-context=test", "--cov-append", "--cov-report=", "--cov-fail-under=0"]
        return subprocess.run([sys.executable, "-m", "pytest", *measuring, *arguments], cwd=ROOT, env=surroundings).returncode


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
