"""Random models by the thousand: processes that examine one seed after the other, and what is made of those that hang or die.

A worker reads seeds from its input and writes one JSON line each. Every call of ncgen has its own limit of processor time, so that a
busy machine makes no hang; where it is used up the process says where it was and ends, and another takes its place. Whatever else
a worker prints is a finding, too: no library may speak past ncgen.
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import tempfile
import threading
from collections import Counter
from collections.abc import Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path

import platformdirs

LIMIT = 10.0
"""Seconds of processor time that a call may take."""

SILENCE = 600.0
"""Seconds without a word, by the clock, after which a worker is taken to wait for something that never comes."""

WARM = -1
"""The seed of no model: a worker compiles what all models share, before anything is timed."""


@dataclass
class Tally:
    """What a hunt found: counts, and (seed, judge, text) of every finding; kind: the module that repeats it."""

    counts: Counter = field(default_factory=Counter)
    findings: list[tuple[int, str, str]] = field(default_factory=list)
    kind: str = "random_models"

    def lines(self) -> list[str]:
        """The counts, and every finding with the line that repeats it."""
        told = ", ".join(f"{count} {what}" for what, count in sorted(self.counts.items(), key=lambda item: -item[1]))
        return [told, *(f"{judge}: {text}\n    python tests/abuse/{self.kind}.py {seed}" for seed, judge, text in self.findings)]


def hunt(seeds: Iterable[int], workers: int | None = None, kind: str = "random_models") -> Tally:
    """Examine seeds in as many processes as there are processors. kind: the module whose models these are"""
    tally, waiting, lock = Tally(kind=kind), iter(seeds), threading.Lock()

    def following() -> Iterator[int]:
        while True:
            with lock:
                seed = next(waiting, None)
            if seed is None:
                return
            yield seed

    def serve() -> None:
        with Worker(kind) as worker:
            for seed in following():
                answer = worker.examine(seed)
                with lock:
                    tally.counts.update(answer["counts"])
                    tally.findings += [(seed, judge, text) for judge, text in answer["findings"]]

    count = workers or len(os.sched_getaffinity(0) if hasattr(os, "sched_getaffinity") else range(os.cpu_count()))
    with ThreadPoolExecutor(count) as pool:
        for done in [pool.submit(serve) for _ in range(count)]:
            done.result()
    return tally


class Worker:
    """A process that examines seeds of a kind, and is replaced when it dies."""

    def __init__(self, kind: str):
        self.kind = kind

    def __enter__(self):
        self._start()
        return self

    def __exit__(self, *_):
        self._end()

    def _start(self) -> None:
        self.errors = tempfile.TemporaryFile("w+", encoding="utf-8")
        command = [sys.executable, "-X", "utf8", str(Path(__file__).resolve()), self.kind]
        self.process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=self.errors, text=True, encoding="utf-8"
        )
        self._ask(WARM)

    def _end(self) -> None:
        self.process.stdin.close()
        self.process.stdout.close()
        self.process.wait()
        self.errors.close()

    def examine(self, seed: int) -> dict:
        """{"counts", "findings"} of a seed."""
        answer = self._ask(seed)
        if answer is not None:
            return answer
        code = self.process.wait()
        self.errors.seek(0)
        said = " ".join(line.strip() for line in self.errors.read().splitlines() if "ncgen" in line or "Current" in line)
        how = "hangs" if code in (-signal.SIGPROF, -signal.SIGKILL) else f"dies with code {code}"
        self._end()
        self._start()
        if code == -signal.SIGTERM:
            return self.examine(seed)  # somebody else ended it, which says nothing of the seed
        return {"counts": {}, "findings": [("process", f"{how}: {said[:600]}")]}

    def _ask(self, seed: int) -> dict | None:
        """The worker's answer; None if it died."""
        clock = threading.Timer(SILENCE, self.process.kill)
        clock.start()
        printed = []
        try:
            self.process.stdin.write(f"{seed}\n")
            self.process.stdin.flush()
            for line in self.process.stdout:
                if line.startswith("{"):
                    answer = json.loads(line)
                    answer["findings"] += [("process", f"something prints: {text}") for text in printed]
                    return answer
                printed.append(line.strip())
        except BrokenPipeError:
            pass  # it died before it could read
        finally:
            clock.cancel()
        return None


def _work(kind: str) -> None:
    """What a worker does: seeds from the input, JSON lines to the output."""
    import faulthandler
    import importlib

    from judges import warm

    examine = importlib.import_module(kind).examine

    # The dump comes even out of C; then the signal does what it does by itself, which is to end the process.
    faulthandler.register(signal.SIGPROF, chain=True)
    faulthandler.enable()

    def watch(_: str) -> None:
        signal.setitimer(signal.ITIMER_PROF, LIMIT)

    for line in sys.stdin:
        seed = int(line)
        signal.setitimer(signal.ITIMER_PROF, 0)
        if seed == WARM:
            warm()
            answer = {"counts": {}, "findings": []}
        else:
            report = examine(seed, watch)
            answer = {"counts": report.counts, "findings": report.findings}
        print(json.dumps(answer), flush=True)


# -- seeds -------------------------------------------------------------------------------------------

COUNTER = "abuse-seed"


def next_seeds(count: int) -> range:
    """Seeds that were not tried before: from NCGEN_ABUSE_SEED, or where the last run ended, kept in the user's cache folder."""
    chosen = os.environ.get("NCGEN_ABUSE_SEED")
    if chosen:
        return range(int(chosen), int(chosen) + count)
    path = Path(platformdirs.user_cache_dir("ncgen")) / COUNTER
    first = int(path.read_text(encoding="utf-8")) if path.is_file() else 1
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(str(first + count), encoding="utf-8")
    return range(first, first + count)


if __name__ == "__main__":
    _work(sys.argv[1])
