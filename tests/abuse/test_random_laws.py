"""Random models with tables, inputs and drivers with kinks: a few in the ordinary suite, 2,000 in the slow one, others each time."""

from __future__ import annotations

import os
from collections import Counter

import pytest
from hunt import hunt, next_seeds
from random_laws import examine

ALWAYS = (2000, 2011, 2015, 2028, 2029)
"""Quick ones that all public functions take."""

FUNCTIONS = (
    "moved", "simulate rows", "study", "step", "start of many", "gradient by rk4", "gradient by dop853", "sensitivities", "exported C",
)  # fmt: skip

MANY = int(os.environ.get("NCGEN_ABUSE_LAWS", 2000))


def test_a_few_models_with_laws():
    """No findings, with signals, tables and drivers, and by all functions."""
    reports = [examine(seed) for seed in ALWAYS]
    assert [(r.seed, *finding) for r in reports for finding in r.findings] == []
    counts = sum((r.counts for r in reports), Counter())
    assert all(counts[what] for what in (*FUNCTIONS, "signals", "tables and splines", "drivers"))


@pytest.mark.slow
def test_thousands_of_random_laws(record_property):
    """All of them in C; seeds go on from run to run (NCGEN_ABUSE_SEED: from there; NCGEN_ABUSE_LAWS: so many)."""
    seeds = next_seeds(MANY)
    tally = hunt(seeds, kind="random_laws")
    counts, *findings = tally.lines()
    record_property("counts", f"seeds {seeds.start} to {seeds.stop - 1}: {counts}")
    assert not findings, "\n".join(findings)
    assert tally.counts["models"] == MANY
    assert tally.counts["moved"] > MANY / 4
