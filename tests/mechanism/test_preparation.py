"""What a run reports as its own time holds no generator and no compiler."""

from __future__ import annotations

import time

import pytest

import ncgen
from ncgen.toolchain import cache
from ncgen.toolchain.preparation import preparation_seconds, preparing

LONG = 1000.0
"""Seconds by which the clock jumps within a preparation."""


@pytest.fixture
def jumping(monkeypatch):
    """A clock that somebody may put forward, as often as wanted."""
    real, added = time.perf_counter, [0.0]
    monkeypatch.setattr(time, "perf_counter", lambda: real() + added[0])

    def jump() -> None:
        added[0] += LONG

    return jump


def test_time_within_is_counted_once(jumping):
    before = preparation_seconds()
    with preparing():
        jumping()
        with preparing():
            jumping()
    jumping()
    assert preparation_seconds() - before == pytest.approx(2 * LONG, abs=LONG / 2)


def test_a_preparation_that_fails_is_counted(jumping):
    before = preparation_seconds()
    with pytest.raises(ZeroDivisionError), preparing():
        jumping()
        raise ZeroDivisionError
    assert preparation_seconds() - before == pytest.approx(LONG, abs=LONG / 2)


def test_a_run_reports_it_apart(jumping, monkeypatch, tmp_path):
    """The clock is put forward whenever a library is asked for; a second run of the same kernels asks for none."""
    monkeypatch.setenv("NCGEN_CACHE_DIR", str(tmp_path))
    m = ncgen.Model("prepared")  # no other test has loaded what is compiled for it
    A, B = m.point("A", (0, 0), fixed=True), m.point("B", (1, 0))
    m.distance(A, B)
    m.body("bob", [B], mass=1.0)
    kernels, build = ncgen.compile(m, "c"), cache.build

    def slowly(*arguments, **words):
        jumping()
        return build(*arguments, **words)

    monkeypatch.setattr(cache, "build", slowly)
    first, second = (ncgen.simulate(kernels, 0.1, engine="emitted", points=3).statistics for _ in range(2))
    assert first.preparation > LONG / 2 and second.preparation < LONG / 2
    assert first.seconds < LONG / 2 and second.seconds < LONG / 2
