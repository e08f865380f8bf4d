"""Pulses that are short beside the run: a few in the ordinary suite, 20,000 in the slow one (NCGEN_ABUSE_PULSES, NCGEN_ABUSE_SEED)."""

from __future__ import annotations

import os

import pytest
from pulses import DOORS, LAWS, SIGNALS, Pulse, error, hunt

COUNT = int(os.environ.get("NCGEN_ABUSE_PULSES", 20_000))


def test_a_pulse_that_is_missed_is_told():
    """A mechanism that stays at rest, and one that goes on as before."""
    for mechanism in ("slider", "oscillator", "pendulum"):
        assert error(Pulse(mechanism, "Gaussian", 5.0, 1e-3, 1.0, 0.0), 0.0, 0.0) > 0.9


@pytest.mark.slow
def test_no_random_pulse_is_missed(record_property):
    counts, findings = hunt(COUNT, int(os.environ.get("NCGEN_ABUSE_SEED", 1)))
    record_property("counts", ", ".join(f"{number} {what}" for what, number in counts.items()))
    assert not findings, f"{len(findings)} of {COUNT}:\n" + "\n".join(findings[:40])
    assert sum(counts[name] for name in DOORS) == COUNT
    assert all(counts[f"{law} (model)"] for law in LAWS) and all(counts[f"{law} (input)"] for law in SIGNALS)
