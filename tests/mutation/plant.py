"""Faults planted one at a time, and whether the tests notice.

    python tests/mutation/measured.py                   # once: which test runs which line, in .coverage and .tests
    python tests/mutation/plant.py COUNT [SEED] [--room program emit solver runtime] [--part PART] [--seconds 40] [--cache FOLDER]
                                   [--log FILE [--again [--tests FILE …]]] [--workers 1]

A fault is one small change of a source (`faults.py` says of what kind). It is made in a copy of the repository, where those tests that run
its line, the quick ones first, run until one fails or the seconds of the processor are over; a test that does not end notices, too. What
is not noticed by then counts as a survivor, so the rate that is printed is a lower bound. Printed is a line a fault as it is decided, with
what noticed it, and at the end how many of each room were caught. Some faults change nothing that anybody could see: those that somebody
has looked at and judged so stand in `unseen.toml` with the reason, and the rate over the others is printed beside that over all.

A seed gives the same faults as long as the sources are the same. --part takes those in files whose path contains it. --log keeps what has
been found in a file, and what stands there is not planted again: an interrupted run goes on, and the rate that it prints is that of all;
with --again what survived is planted once more, and with --tests only these run, as where a test has been written. --workers says how many
are planted at a time, and --cache keeps what tests have compiled for later runs.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import tomllib
from collections import Counter
from collections.abc import Iterable, Iterator
from itertools import count, islice
from multiprocessing import get_context
from pathlib import Path

from faults import ROOT, Fault, faults, is_source
from reached import PREBUILT, Reached
from trial import failing, warm_up

ROOMS = ("program", "emit", "solver", "runtime")

UNSEEN = Path(__file__).with_name("unseen.toml")

JUDGED = {(entry["file"], entry["change"]): entry["why"] for entry in tomllib.loads(UNSEEN.read_text(encoding="utf-8"))["fault"]}
"""Why a fault changes nothing that anybody could see."""


class Log:
    """What has been found, a line of JSON a fault: {"fault": text, "by": the test that noticed it, or nothing}."""

    def __init__(self, path: Path) -> None:
        self.path = path
        path.touch()

    def found(self) -> dict[str, str]:
        """What noticed each fault, or nothing."""
        records = map(json.loads, self.path.read_text(encoding="utf-8").splitlines())
        return {record["fault"]: record["by"] for record in records}

    def add(self, fault: Fault, by: str) -> None:
        """Remember what noticed a fault."""
        with self.path.open("a", encoding="utf-8") as file:
            file.write(json.dumps({"fault": str(fault), "by": by}, ensure_ascii=False) + "\n")


class Planted:
    """A copy of the repository, with one fault at a time."""

    def __init__(self, folder: Path) -> None:
        folder.mkdir()
        self.copy = folder / "copy"
        self.turns = count(1)
        shutil.copytree(ROOT, self.copy, ignore=shutil.ignore_patterns(".git", "__pycache__", ".coverage*", ".tests", "*-output"))

    def noticed_by(self, fault: Fault, tests: list[str], seconds: float) -> str:
        """The test that fails with the fault before `seconds` of the processor's time are over; or nothing."""
        path = self.copy / fault.file
        sound, status = path.read_bytes(), path.stat()
        path.write_text(fault.planted(sound.decode()), encoding="utf-8")
        # Python takes compiled modules for those of their source by its time and size: each fault has a time of its own.
        os.utime(path, (status.st_atime, status.st_mtime + next(self.turns)))
        binaries = {file: file.read_bytes() for file in path.parent.glob("*.wasm")} if path.parent.name == PREBUILT else {}
        try:
            if binaries and not self._makes_binaries():
                return "the compiler of WebAssembly"
            return failing(self.copy, tests, seconds, is_in_c=path.suffix == ".c")
        finally:
            path.write_bytes(sound)
            os.utime(path, (status.st_atime, status.st_mtime))
            for file, content in binaries.items():
                file.write_bytes(content)

    def _makes_binaries(self) -> bool:
        """Whether the files of WebAssembly can be made anew."""
        command = [sys.executable, "-m", "ncgen.toolchain.generic_wasm"]
        return subprocess.run(command, cwd=self.copy, capture_output=True).returncode == 0


def _once(faults: Iterable[Fault]) -> Iterator[Fault]:
    """Each the first time that it comes."""
    seen = set()
    for fault in faults:
        if fault not in seen:
            seen.add(fault)
            yield fault


def drawn(rooms: list[str], number: int, seed: int, part: str = "") -> list[Fault]:
    """So many faults in files whose path contains `part`, as many of each room on average."""
    chance = random.Random(seed)
    everything = {room: [fault for fault in faults(room) if part in fault.file] for room in rooms}
    offered = (chance.choice(everything[room]) for room in iter(lambda: chance.choice(rooms), None))
    return list(islice(_once(filter(is_source, offered)), number))


def plant(chosen: list[Fault], folder: Path, seconds: float, log: Log, tests: list[str] | None) -> None:
    """Plant faults in a copy in a new folder, and remember and print what becomes of each; tests: None for those of its line."""
    planted, reached = Planted(folder), None if tests else Reached()
    os.environ["PYTHONPATH"] = str(planted.copy)
    for fault in chosen:
        by = planted.noticed_by(fault, reached.tests(fault) if reached else tests or [], seconds)
        log.add(fault, by)
        print(judged(fault, by)[1], flush=True)


def judged(fault: Fault, by: str) -> tuple[str, str]:
    """What has become of a fault, in a word and in a line; by: the test that noticed it, or nothing."""
    if by:
        return "caught", f"caught   {fault}  by {by}"
    if why := JUDGED.get((fault.file, fault.change)):
        return "unseen", f"unseen   {fault}  {why}"
    return "survived", f"SURVIVED {fault}"


def told(name: str, tally: Counter[str]) -> str:
    """How many were caught, of all and of those that could be seen."""
    caught, whole, unseen = tally["caught"], tally.total(), tally["unseen"]
    shares = [100 * caught / max(count, 1) for count in (whole, whole - unseen)]
    return f"{name}: {caught} of {whole} caught, {shares[0]:.0f} %; {unseen} cannot be seen, of the others {shares[1]:.0f} %"


def main() -> None:
    asked = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    asked.add_argument("count", type=int)
    asked.add_argument("seed", type=int, nargs="?", default=0)
    asked.add_argument("--room", nargs="+", choices=ROOMS, default=list(ROOMS))
    asked.add_argument("--seconds", type=float, default=40.0)
    asked.add_argument("--part", default="")
    asked.add_argument("--log", type=Path)
    asked.add_argument("--again", action="store_true")
    asked.add_argument("--tests", nargs="+")
    asked.add_argument("--workers", type=int, default=1)
    asked.add_argument("--cache", type=Path)
    given = asked.parse_args()
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))  # the tests that run end, too
    chosen = drawn(given.room, given.count, given.seed, given.part)
    with tempfile.TemporaryDirectory() as folder:
        log = Log(given.log or Path(folder) / "log")
        known = log.found()
        missing = [
            fault
            for fault in chosen
            if (given.again and judged(fault, known[str(fault)])[0] == "survived" if str(fault) in known else not given.tests)
        ]
        # One cache for all faults: what lies there is found by all that made it, so it belongs to sources without the fault or with it.
        os.environ |= {"NCGEN_TEST_CACHE": str((given.cache or Path(folder) / "cache").resolve()), "OPENBLAS_NUM_THREADS": "1"}
        warm_up()
        shares = [
            (missing[k :: given.workers], Path(folder) / str(k), given.seconds, log, given.tests)
            for k in range(min(given.workers, len(missing)))
        ]
        processes = [get_context("fork").Process(target=plant, args=share, daemon=True) for share in shares]
        for process in processes:
            process.start()
        for process in processes:
            process.join()
        found = log.found()
    tally = {room: Counter[str]() for room in given.room}
    for fault in (fault for fault in chosen if str(fault) in found):
        tally[fault.room][judged(fault, found[str(fault)])[0]] += 1
    for room in given.room:
        print(told(room, tally[room]))
    print(told("in all", sum(tally.values(), Counter())))


if __name__ == "__main__":
    sys.exit(main())
