"""The times of a run: those that are asked for, and those at which its energy is looked at."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

import numpy as np

from ncgen.errors import ModelError, shown
from ncgen.mechanism.arguments import constant
from ncgen.solver.argument_checks import several
from ncgen.solver.runs.settings import CACHED, count, echo

MIN_TIME_SPACING = 100 * np.finfo(float).eps
"""Instants nearer to each other than this, relative to the time, cannot be distinguished."""

MAX_INTEGER = 10**300
"""Whole numbers beyond this are no doubles."""

MOST_NUMBERS = 2**31
"""Numbers in a trajectory's positions, velocities and accelerations: 16 GiB."""

MOST_CACHED_POINTS = 10_000
"""Times of a grid that is kept for later runs, and of runs that are."""

N_SAMPLES = 8
"""Instants inside a run at which the energy is looked at, besides its ends."""

GOLDEN = (np.sqrt(5.0) - 1.0) / 2.0

SAMPLE_FRACTIONS = np.sort(np.arange(1, N_SAMPLES + 1) * GOLDEN % 1.0)
"""Of a run, where its energy is looked at: multiples of the golden section are as far from every even grid as can be, so a motion that
rests at all instants of the grid does not rest at these. A run in C without other rows there is looked at where the step around ends."""


@dataclass(frozen=True, eq=False)
class RunTimes:
    """Times (K,) of a run in s, and a mask of those that were not asked for: where its energy is looked at.

    Nobody writes to them; of equal grids they are the same.
    """

    times: np.ndarray
    is_extra: np.ndarray

    @cached_property
    def wanted(self) -> np.ndarray:
        """Numbers of the rows that were asked for."""
        return np.flatnonzero(~self.is_extra)

    @cached_property
    def duration(self) -> float:
        """From the first to the last (s)."""
        return float(self.times[-1] - self.times[0])

    @cached_property
    def looked_at(self) -> list[int]:
        """Numbers of the rows at which the energy is looked at: those for it alone, else some that were asked for; and the ends."""
        last = len(self.times) - 1
        inside = np.flatnonzero(self.is_extra) if self.is_extra.any() else np.rint(SAMPLE_FRACTIONS * last).astype(int)
        return sorted({0, *inside.tolist(), last})


class Grid:
    """The times (points,) that are asked for, in s."""

    def __init__(self, times: np.ndarray) -> None:
        self.times = constant(times)

    @cached_property
    def duration(self) -> float:
        """From the first instant to the last (s)."""
        return float(self.times[-1] - self.times[0])

    @property
    def is_small(self) -> bool:
        """Whether it may be kept for later runs."""
        return len(self.times) <= MOST_CACHED_POINTS

    @cached_property
    def plain(self) -> RunTimes:
        """The times themselves."""
        return RunTimes(self.times, constant(np.zeros(len(self.times), dtype=bool)))

    @cached_property
    def monitored(self) -> RunTimes:
        """The times, and between them those at which the energy is looked at."""
        times, extra = self.times, self.times[0] + SAMPLE_FRACTIONS * self.duration
        extra = extra[times[np.searchsorted(times, extra)] != extra]
        both = np.concatenate([times, extra])
        order = np.argsort(both, kind="stable")
        return RunTimes(constant(both[order]), constant(order >= len(times)))


def grid_of(start: float, length: float, points: Any, n: int) -> Grid:
    """Even instants, or those that are given. Raises ModelError where there are too many, or they cannot be distinguished."""
    if type(points) is int and points <= MOST_CACHED_POINTS:
        return _even(start, length, points, n)
    if type(points) is np.ndarray and points.dtype == float and points.ndim == 1 and len(points) <= MOST_CACHED_POINTS:
        return _listed(start, length, tuple(points.tolist()), n)
    return _grid(start, length, points, n)


def _grid(start: float, length: float, points: Any, n: int) -> Grid:
    """Even instants, or those that are given. Raises ModelError where there are too many, or they cannot be distinguished."""
    is_single = not isinstance(points, Iterable) or isinstance(points, str) or (isinstance(points, np.ndarray) and points.ndim == 0)
    times = None if is_single else several(points, "points")
    size = count(points, "points", 2, "a trajectory has at least 2") if times is None else len(times)
    if size * (3 * n + 1) > MOST_NUMBERS:
        room = min(size * (3 * n + 1), MAX_INTEGER) * 8 / 2**30
        raise ModelError(f"points: {shown(size)} instants of {n} coordinates take {room:.3g} GiB; ask for fewer")
    end = start + length
    if not np.isfinite(end):
        raise ModelError(f"duration: {length:.6g} s from t0 = {start:.6g} s on is beyond all numbers; take a shorter one")
    shortest = MIN_TIME_SPACING * max(abs(start), abs(end))
    if times is not None:
        return Grid(_instants(times, start, end, shortest))
    if length / (size - 1) < shortest:
        raise ModelError(
            f"t0: {start:.6g} s with {size} points in {length:.6g} s: instants cannot be distinguished in double precision; "
            "begin nearer to 0, or ask for fewer points"
        )
    return Grid(np.linspace(start, end, size))


_even = lru_cache(maxsize=CACHED)(_grid)


@lru_cache(maxsize=CACHED)
def _listed(start: float, length: float, times: tuple[float, ...], n: int) -> Grid:
    """Those that are given."""
    return _grid(start, length, np.array(times), n)


def _instants(times: np.ndarray, start: float, end: float, shortest: float) -> np.ndarray:
    """Given instants. Raises ModelError unless they ascend from the start of a run to its end."""
    if len(times) < 2 or abs(times[0] - start) > shortest or abs(times[-1] - end) > shortest:
        raise ModelError(f"points: {echo(times.tolist())} given; instants begin at t0 = {start:.6g} s and end at {end:.6g} s")
    for k in np.flatnonzero(~(np.diff(times) >= shortest))[:1]:
        raise ModelError(f"points: {times[k + 1]:.6g} s follows {times[k]:.6g} s; let the instants ascend")
    return times
