"""No model file, however it was damaged, ends in a traceback, hangs, or is taken for what it does not say."""

from __future__ import annotations

import os
import random
from collections import Counter, defaultdict
from pathlib import Path

import pytest
from mutated_files import argument, examples, mutated, next_number, outcome, read_all, remember

from ncgen.exchange.words import kind_of, signature_of, words

FEW, MANY = 150, 100_000


@pytest.fixture(scope="module")
def texts():
    return examples()


def test_every_kind_of_argument_is_damaged():
    kinds = {kind_of(parameter) for word in words() for parameter in signature_of(word).parameters.values()}
    for kind in kinds:
        assert all(argument(random.Random(seed), kind, defaultdict(list)) for seed in range(20)), kind


def test_damaged_files(texts, tmp_path):
    """Some files, the same every time: refused in a line each, or accepted, written and read again.

    The damage is neither so small that nothing is refused nor so large that nothing is read.
    """
    results = {number: outcome(mutated(number, texts), tmp_path) for number in range(FEW)}
    assert {number: result for number, result in results.items() if result not in ("refused", "accepted")} == {}
    counts = Counter(results.values())
    assert counts["refused"] > FEW / 3 and counts["accepted"] > FEW / 30


@pytest.mark.slow
def test_many_damaged_files():
    """Other files in every run; NCGEN_ABUSE_FILES says how many."""
    first, count = next_number(), int(os.environ.get("NCGEN_ABUSE_FILES", MANY))
    tally = read_all(first, count, processes=os.cpu_count() or 2)
    remember(first + count)
    print(f"\nfrom {first}: {tally}")
    report = "\n".join(f"file {number}: {result}" for number, result in list(tally.wrong.items())[:20])
    assert not tally.wrong, f"{len(tally.wrong)} files; `python {Path(__file__).with_name('mutated_files.py')} NUMBER` shows one\n{report}"
