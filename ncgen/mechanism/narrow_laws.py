"""Where a smooth law of time alone changes much faster than before: a pulse that a step would pass without any stage inside.

Error control sees what the stages of a step see. So a run gets further breaks on the flanks of such changes, and steps end and begin there.
A law of the model is enclosed by interval arithmetic: no change is too narrow. A function of Python is asked at `SAMPLES` times.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from ncgen.mechanism.driving import Function
from ncgen.mechanism.time_laws import TIME
from ncgen.program.ir.graph import ArrayElement, Op
from ncgen.program.ir.ranges import ranges, values

FIRST_INTERVALS = 32
"""Intervals of a run in which a law is enclosed at first."""

MOST_PARTS = 8.0
"""Into how many parts an interval is cut at once."""

MOST_INTERVALS = 40_000
"""Intervals to which a law's enclosure is refined at most: 2.5e-5 of the run each where it changes everywhere."""

NARROWEST_PART = 1e-10
"""The fraction of a run below which no interval is halved."""

RESOLVED = 0.125
"""The fraction of a law's range that it may change by in an interval of its enclosure: half of `LEVEL`."""

LEVEL = 0.25
"""The fraction of a law's range by which it changes, up and down added, from one place to the next."""

SMALLEST_RANGE = 1e-6
"""A law's range over its size, below which it counts as constant. Where it is a sum, its terms are looked at by themselves."""

SMALLEST_CHANGE = 1e-40
"""A law's range in its own unit, below which it counts as constant: the tail of a Gaussian that is far away."""

RATIOS = ((4.0, 400), (16.0, 1000), (64.0, 100_000))
"""How many times faster than beside it a law has to change, and how many breaks that may give; with more of them the next one is taken.
From place to place a sine's speed changes 3 times, so that none is broken."""

N_BREAKS_PER_CHANGE = 8
"""Places on the fast side of a change at which steps end: both flanks of a pulse."""

DISTANCES = np.concatenate([2.0 ** np.arange(5), 16 * 4.0 ** np.arange(1, 16)])
"""Where there are breaks on the slow side, over the distance of the first two places: close ones, up to 8 standard deviations of a
Gaussian, and others for the tails of slower decays, which fixed steps would overrate."""

SAMPLES = 513
"""Times at which a function of Python is asked."""

FURTHER_SAMPLES = 400
"""Times at which it is asked, beyond these, where it changes by more than `RESOLVED` between two of them."""

HALVINGS = 6
"""How often the time between two samples is halved at most."""


def quick_changes(
    ops: Sequence[Op], node: int, inputs: Mapping[ArrayElement, float], start: float, end: float, breaks: np.ndarray
) -> np.ndarray:
    """Times (s), ascending, at which steps of a run have to end for the changes of a node's value.

    inputs: {parameter: value}; breaks (K,): times (s) between which the node is smooth
    """
    t = np.unique(np.concatenate([np.linspace(start, end, FIRST_INTERVALS + 1), breaks[(breaks > start) & (breaks < end)]]))
    narrowest = max(NARROWEST_PART * (end - start), 16 * np.finfo(float).eps * max(abs(start), abs(end)))
    x, widths = _at(ops, node, inputs, t), _widths(ops, node, inputs, t[:-1], t[1:])
    while True:
        allowed = RESOLVED * _size(x)
        open_ = np.where(np.diff(t) > narrowest, widths, 0.0)
        open_[open_ <= allowed] = 0.0
        if not np.any(open_):
            break
        worst = open_ >= 1e-3 * np.max(open_)  # what is far below them may be resolved as soon as these have shown how large the law is
        parts = np.where(worst, np.clip(open_ / max(allowed, np.max(open_) / MOST_PARTS), 2.0, MOST_PARTS), 1.0).astype(int)
        if parts.sum() > MOST_INTERVALS:
            break
        from_ = np.repeat(np.arange(len(parts)), parts)
        number = np.arange(len(from_)) - np.repeat(np.cumsum(parts) - parts, parts)
        low = t[from_] + np.diff(t)[from_] * (number / parts[from_])
        t, is_new, is_part = np.append(low, end), np.append(number > 0, False), parts[from_] > 1
        x, widths = np.append(x[:-1][from_], x[-1]), widths[from_]
        x[is_new] = _at(ops, node, inputs, t[is_new])
        widths[is_part] = _widths(ops, node, inputs, t[:-1][is_part], t[1:][is_part])
    return _flanks(t, x, narrowest)


def quick_changes_of(function: Function, start: float, end: float) -> np.ndarray:
    """The same for a function of Python. Where it raises, or gives no number, there is no break: the run reports it if it comes there."""
    t = np.linspace(start, end, SAMPLES)
    x = _values_at(function, t)
    left = FURTHER_SAMPLES
    for _ in range(HALVINGS):
        where = np.flatnonzero(np.abs(np.diff(x)) > RESOLVED * _size(x))
        if not 0 < len(where) <= left:
            break
        left -= len(where)
        middle = t[where] + (t[where + 1] - t[where]) / 2
        t, x = np.insert(t, where + 1, middle), np.insert(x, where + 1, _values_at(function, middle))
    return _flanks(t, x)


def _values_at(function: Function, times: np.ndarray) -> np.ndarray:
    values = np.full(len(times), np.nan)
    for k, t in enumerate(times.tolist()):
        try:
            values[k] = float(function(t))
        except Exception:  # the run calls it again where it needs it, and tells what it raises there
            continue
    return values


def _at(ops: Sequence[Op], node: int, inputs: Mapping[ArrayElement, float], t: np.ndarray) -> np.ndarray:
    return np.broadcast_to(values(ops, node, {**inputs, TIME: t}), t.shape)


def _widths(ops: Sequence[Op], node: int, inputs: Mapping[ArrayElement, float], low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Bounds of how much the value changes in intervals; a large number where nothing is known."""
    bound = {key: (np.asarray(value), np.asarray(value)) for key, value in inputs.items()}
    least, most = ranges(ops, [node], {**bound, TIME: (low, high)})[0]
    with np.errstate(all="ignore"):
        widths = np.broadcast_to(most - least, low.shape)
    return np.where(np.isfinite(widths), widths, 1e300)


def _size(x: np.ndarray) -> float:
    """How far values are apart; at least `SMALLEST_RANGE` of the largest."""
    x = x[np.isfinite(x)]
    return float(max(np.max(x) - np.min(x), SMALLEST_RANGE * np.max(np.abs(x)), SMALLEST_CHANGE)) if len(x) else SMALLEST_CHANGE


def _flanks(t: np.ndarray, x: np.ndarray, jump: float = 0.0) -> np.ndarray:
    """Where values x (K,) at times t (s) begin to change much faster than before, and where they cease to; jump: time (s) in which a
    change is the jump of a break, compared with which nothing is fast."""
    size = _size(x)
    steps = np.abs(np.diff(x))
    changes = np.concatenate([[0.0], np.cumsum(np.where(np.isfinite(steps) & (np.diff(t) > jump), steps, 0.0))])
    count = int(changes[-1] / (LEVEL * size) - 0.5)
    if count < 2:
        return np.empty(0)
    crossings = np.interp((np.arange(count) + 0.5) * LEVEL * size, changes, t)
    ends = np.concatenate([t[:1], crossings, t[-1:]])
    lengths = np.diff(ends)
    for ratio, most in RATIOS:
        rises = np.flatnonzero(lengths[:-2] > ratio * lengths[1:-1])
        falls = np.flatnonzero(lengths[2:] > ratio * lengths[1:-1]) + 2
        last = np.append(-1, rises)[np.searchsorted(rises, falls)]  # before each fall; the start of the run where there is none
        falls = falls[falls - last <= N_BREAKS_PER_CHANGE + 2]
        backward = _breaks_next_to(-ends[::-1], ratio, len(lengths) - 1 - falls)
        breaks = np.unique(np.concatenate([_breaks_next_to(ends, ratio, rises), -backward]))
        if len(breaks) <= most:
            return breaks
    return np.empty(0)


def _breaks_next_to(ends: np.ndarray, ratio: float, slow: np.ndarray) -> np.ndarray:
    """Breaks for changes from slow to fast.

    ends (K,): of parts in which a law changes by as much each, but for the first and the last; slow: the numbers of those that a fast one
    follows, which changes `ratio` times as fast
    """
    if not len(slow):
        return np.empty(0)
    lengths = np.diff(ends)
    fast = lengths[slow + 1]
    outside = ends[slow + 1, None] - fast[:, None] * DISTANCES
    breaks = [outside[outside > ends[slow, None]], ends[slow + 1]]
    for _ in range(N_BREAKS_PER_CHANGE):
        keep = slow + 2 < len(ends) - 1
        slow, fast = slow[keep] + 1, fast[keep]
        keep = lengths[slow] <= ratio * fast
        slow, fast = slow[keep], fast[keep]
        breaks.append(ends[slow + 1])
    return np.concatenate(breaks)
