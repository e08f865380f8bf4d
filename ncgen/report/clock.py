"""Times of things that do the same work: measured in turns, so that all of them see the same disturbances."""

from __future__ import annotations

import time
from collections.abc import Callable, Hashable, Mapping
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

Run = Callable[[int], None]
"""run(times): a function that does something so many times."""

Name = TypeVar("Name", bound=Hashable)

MIN_SAMPLE_SECONDS = 1e-3
"""Seconds that one sample should last at least: far above the clock's resolution, and above the tens of microseconds that a
processor may take to change its own clock where wide vectors begin."""

ROUNDS = 41

NOISE_MARK = 0.3
"""Distance of the quartiles, relative to the median, from which a time is marked."""


@dataclass(frozen=True)
class Spread:
    """Seconds per call: the median of all samples, the quartiles around it, and the least."""

    median: float
    low: float
    high: float
    least: float

    def seconds(self, calls: int = 1) -> dict[str, float]:
        """Of a record: median and quartiles of one of so many things that a call does."""
        return {"seconds": self.median / calls, "low": self.low / calls, "high": self.high / calls}


def is_noisy(low: float, median: float, high: float) -> bool:
    """Whether the quartiles of a time (s) are far apart."""
    return high - low > NOISE_MARK * median


def measure(runs: Mapping[Name, Run], rounds: int = ROUNDS, *, sample_seconds: float | None = None) -> dict[Name, Spread]:
    """{name: seconds per call} of functions run(times), one sample of each in every round.

    sample_seconds: how long a sample lasts at least, MIN_SAMPLE_SECONDS by default
    """
    times = {name: _enough(run, sample_seconds or MIN_SAMPLE_SECONDS) for name, run in runs.items()}
    samples: dict[Name, list[float]] = {name: [] for name in runs}
    for _ in range(rounds):
        for name, run in runs.items():
            samples[name].append(elapsed(run, times[name]) / times[name])
    return {
        name: Spread(*(float(np.quantile(values, fraction)) for fraction in (0.5, 0.25, 0.75, 0.0))) for name, values in samples.items()
    }


def repeated(call: Callable[[], object]) -> Run:
    """A function run(times) of a Python function without arguments."""

    def run(times: int) -> None:
        for _ in range(times):
            call()

    return run


def elapsed(run: Run, times: int) -> float:
    start = time.perf_counter()
    run(times)
    return time.perf_counter() - start


def _enough(run: Run, sample_seconds: float) -> int:
    """How many calls fill a sample; the first call only warms up."""
    run(1)
    times = 1
    while (seconds := elapsed(run, times)) < sample_seconds:
        times = max(2 * times, int(times * sample_seconds / max(seconds, 1e-9)))
    return times
