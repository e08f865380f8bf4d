"""Random models: a few in the ordinary suite, always the same; thousands in the slow one, others each time."""

from __future__ import annotations

import os

import pytest
from hunt import hunt, next_seeds
from judges import examine
from random_expressions import SAFE

from ncgen.program.ir.functions import FUNCTIONS

ALWAYS = (
    60002, 60003, 60004, 60013, 60014, 60018, 60019, 60022, 60025, 60026, 60031, 60032, 60035, 60037, 60039, 60043, 60044, 60046,
    60048, 60049, 60051, 60052, 60055, 60057, 60059, 60061, 60064, 60065, 60068, 60069, 60085, 60092, 60094, 60096, 60107, 60113,
)  # fmt: skip
"""Quick ones of every kind, in NumPy."""

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
