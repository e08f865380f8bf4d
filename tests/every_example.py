"""Every example for a test with parameters: those whose programs are long are among the longer proofs."""

from __future__ import annotations

from collections.abc import Iterable

import pytest

from ncgen.exchange.examples import example_names

LONG = ("quadruped", "tree")


def long_ones_slow(names: Iterable[str]) -> list:
    """The names as parameters, long ones marked as slow."""
    return [pytest.param(name, marks=pytest.mark.slow) if name in LONG else name for name in names]


EVERY = long_ones_slow(example_names())
