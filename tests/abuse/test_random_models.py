"""Random models: a few in the ordinary suite, always the same; thousands in the slow one, others each time."""

from __future__ import annotations

import os

import pytest
from hunt import hunt, next_seeds
from judges import examine
from random_expressions import SAFE

from ncgen.program.functions import FUNCTIONS

ALWAYS = [seed for seed in range(60_001, 60_045) if seed % 10]
"""In NumPy."""

MANY = int(os.environ.get("NCGEN_ABUSE_COUNT", 5000))


def test_expressions_call_every_function():
    assert set(SAFE) == set(FUNCTIONS)


def test_a_few_random_models():
    """No findings, and most of the models are there to be judged."""
    reports = [examine(seed) for seed in ALWAYS]
    assert [(r.seed, *finding) for r in reports for finding in r.findings] == []
    assert sum(r.counts["models"] for r in reports) == len(ALWAYS)
    assert sum(r.counts["moved"] for r in reports) > len(ALWAYS) / 3


@pytest.mark.slow
def test_thousands_of_random_models(record_property):
    """Every tenth in C; seeds go on from run to run (NCGEN_ABUSE_SEED: from there; NCGEN_ABUSE_COUNT: so many)."""
    seeds = next_seeds(MANY)
    tally = hunt(seeds)
    counts, *findings = tally.lines()
    record_property("counts", f"seeds {seeds.start} to {seeds.stop - 1}: {counts}")
    assert not findings, "\n".join(findings)
    assert tally.counts["models"] == MANY
    assert tally.counts["moved"] > MANY / 3
