"""No damaged file of a robot, a study, a motion or a mesh ends in a traceback, hangs, or takes this process along."""

from __future__ import annotations

import os
import signal
from collections import Counter
from pathlib import Path

import pytest
from mutated_data import outcome

FEW, MANY, SECONDS = 200, 20_000, 60


def read(numbers: range, folder: Path) -> tuple[Counter, dict[int, str]]:
    """How many had which outcome, and what was wrong; what takes longer than SECONDS is wrong."""

    def late(*_: object) -> None:
        raise AssertionError(f"no end after {SECONDS} s")

    before = signal.signal(signal.SIGALRM, late)
    counts, wrong = Counter(), {}
    try:
        for number in numbers:
            signal.alarm(SECONDS)
            result = outcome(number, folder)
            counts[result if result in ("refused", "accepted") else "wrong"] += 1
            if result not in ("refused", "accepted"):
                wrong[number] = result
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)
    return counts, wrong


def test_damaged_data(tmp_path):
    """Some files, the same every time; the damage is neither so small that nothing is refused nor so large that nothing is read."""
    pytest.importorskip("mujoco")
    counts, wrong = read(range(FEW), tmp_path)
    assert wrong == {}
    assert counts["refused"] > FEW / 3 and counts["accepted"] > FEW / 20


@pytest.mark.slow
def test_much_damaged_data(tmp_path):
    """NCGEN_ABUSE_FILES says how many."""
    pytest.importorskip("mujoco")
    count = int(os.environ.get("NCGEN_ABUSE_FILES", MANY))
    counts, wrong = read(range(FEW, FEW + count), tmp_path)
    print(f"\n{dict(counts)}")
    report = "\n".join(f"file {number}: {result}" for number, result in list(wrong.items())[:20])
    assert not wrong, f"{len(wrong)} files; `python {Path(__file__).with_name('mutated_data.py')} NUMBER` shows one\n{report}"
