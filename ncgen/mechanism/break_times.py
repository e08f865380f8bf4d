"""The times at which a law of time alone changes its formula: knots of tables and splines, ends of smooth steps, zeros of the arguments
of sign and Abs, into which Heaviside, Min, Max and Piecewise are translated; and those about its narrow changes (`narrow_laws`).

Every algorithm that advances time takes this list: no step passes a break, so that errors are those of smooth motions. A law of
coordinates is left to error control.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from functools import partial
from typing import TypeAlias

import numpy as np

from ncgen.mechanism.driving import Function, InputPieces
from ncgen.mechanism.kernels import Kernels
from ncgen.mechanism.narrow_laws import quick_changes, quick_changes_of
from ncgen.mechanism.time_laws import TIME, Switch, TimeLaws, time_laws
from ncgen.model.pieces import Pieces
from ncgen.program.ir.graph import ArrayElement, Op
from ncgen.program.ir.passes import compute
from ncgen.program.ir.ranges import level, levels_below, ranges, values

MOST_BREAKS = 100_000
"""Breaks of one law in a run, beyond which the law is left to error control."""

MOST_INTERVALS = 100_000
"""Intervals of time in which the zeros of one argument are looked for at once; beyond these only changes of its sign are seen."""

UNCERTAINTY = 4.0
"""Rounding errors of the run's largest time by which a break may be misplaced. Where a law jumps, one step goes from that long before
the break to that long after it, so that no other step sees both sides."""

DOUBLE = float(np.finfo(float).eps)
"""The relative rounding of double precision."""

MIN_INTERVAL_ROUNDINGS = 16.0
"""Rounding errors of the run's largest time that an interval is wide at least where neither its range nor its slope tells anything."""

MIN_GAP_ROUNDINGS = 16.0
"""Breaks are one that are no farther apart than this many times what one of them may be misplaced by: no step would fit between."""

MAX_CACHED_RUNS = 64
"""Runs whose breaks are kept for when they come again."""

NO_BREAKS = np.empty((0, 2))

Line: TypeAlias = tuple[float, float] | bool | None
"""What a node is over time: a and b of a t + b, True for another function, None where an input drives it."""


def break_times(
    kernels: Kernels,
    p: np.ndarray,
    start: float,
    end: float,
    signals: Sequence[InputPieces | Function | None] = (),
    rounding: float = DOUBLE,
) -> np.ndarray:
    """Find the breaks of a run, shape (B, 2) in s, ascending: where a step has to end, and where the next but one begins.

    p (n_p,): the parameters; signals: what drives the inputs, whose tables have breaks at their knots
    rounding: the relative rounding of the numbers that the run computes with
    Both times of a row are the same where the value is continuous or C knows on which side of its knot a step lies. Else a step goes from
    one to the other, `UNCERTAINTY` before and after the jump. A row may begin at the start or end at the end.
    """
    laws = time_laws(kernels)
    if not laws.has_breaks and not any(signals):
        return NO_BREAKS
    gap = UNCERTAINTY * max(rounding, DOUBLE) * max(abs(start), abs(end))  # the times are doubles
    breaks = []
    if laws.has_breaks:
        driven = tuple(len(p) - len(signals) + i for i, signal in enumerate(signals) if signal is not None)
        key = p[list(laws.parameters)].tobytes(), start, end, gap, driven
        breaks.append(kernels.remember("breaks in time", key, lambda: _of_laws(laws, p, start, end, gap, driven), MAX_CACHED_RUNS))
    for signal in signals:
        if signal is not None:
            times = signal.knots if isinstance(signal, InputPieces) else quick_changes_of(signal, start, end)
            breaks.append(np.column_stack([times, times]))
    return merged(np.concatenate(breaks), start, end, gap)


def breaks_of_laws(kernels: Kernels, laws: TimeLaws, end: float) -> np.ndarray:
    """The breaks of some of a mechanism's laws up to a time (s) with its own parameters, as of `break_times`."""
    gap = UNCERTAINTY * DOUBLE * abs(end)
    return merged(_of_laws(laws, np.asarray(kernels.p0), 0.0, end, gap, ()), 0.0, end, gap)


def _of_laws(laws: TimeLaws, p: np.ndarray, start: float, end: float, gap: float, driven: Collection[int]) -> np.ndarray:
    """The breaks of the model's own laws, (K, 2) in no order. driven: positions in p of what changes otherwise"""
    inputs: dict[ArrayElement, float] = {ArrayElement("p", k): float(p[k]) for k in laws.parameters}
    lines = _straight_lines(laws.ops, inputs, driven)
    breaks = [NO_BREAKS]
    for switch, times in _by_switch(laws, lines, inputs, start, end, gap):
        half = gap if switch.jumps else 0.0
        breaks.append(NO_BREAKS if times is None else np.column_stack([times - half, times + half]))
    known_breaks = np.concatenate(breaks).ravel()
    for node in laws.narrow:
        if lines[node] is True:
            times = quick_changes(*_cut(laws.ops, lines, node), inputs, start, end, known_breaks)
            breaks.append(np.column_stack([times, times]))
    return np.concatenate(breaks)


def _cut(ops: Sequence[Op], lines: Sequence[Line], node: int) -> tuple[list[Op], int]:
    """The operations that a node needs, those that are constant being numbers, and the node's number among them."""
    needed, waiting = set(), [node]
    while waiting:
        if (each := waiting.pop()) not in needed:
            needed.add(each)
            waiting.extend(() if _constant(lines[each]) is not None else ops[each].args)
    order = sorted(needed)
    new = {old: k for k, old in enumerate(order)}
    known = [_constant(lines[old]) for old in order]
    return [ops[o].renumbered(new) if c is None else Op("const", (), c) for o, c in zip(order, known, strict=True)], len(order) - 1


def _constant(line: Line) -> float | None:
    return line[1] if isinstance(line, tuple) and line[0] == 0.0 else None


def merged(rows: np.ndarray, start: float, end: float, gap: float) -> np.ndarray:
    """Rows in order and inside the run; those that are next to each other are one."""
    rows = rows[(rows[:, 1] > start) & (rows[:, 0] < end)]
    rows = np.clip(rows[np.argsort(rows[:, 0], kind="stable")], start, end)
    if not len(rows):
        return NO_BREAKS
    last = np.maximum.accumulate(rows[:, 1])
    begins = np.concatenate([[True], rows[1:, 0] > last[:-1] + MIN_GAP_ROUNDINGS * gap])
    ends = np.append(np.flatnonzero(begins)[1:] - 1, len(rows) - 1)
    return np.column_stack([rows[begins, 0], last[ends]])


# -- when their arguments pass knots -------------------------------------------------------------------------------------------------------


def switch_times(
    laws: TimeLaws, p: np.ndarray, start: float, end: float, gap: float, driven: Collection[int]
) -> Iterator[tuple[Switch, np.ndarray | None]]:
    """Every switch with the times at which it switches, None where it depends on inputs that change, or switches too often.

    gap (s): what is left out on both sides of other breaks; driven: positions in p of what changes otherwise
    """
    inputs: dict[ArrayElement, float] = {ArrayElement("p", k): float(p[k]) for k in laws.parameters}
    yield from _by_switch(laws, _straight_lines(laws.ops, inputs, driven), inputs, start, end, gap)


def _by_switch(
    laws: TimeLaws, lines: Sequence[Line], inputs: Mapping[ArrayElement, float], start: float, end: float, gap: float
) -> Iterator[tuple[Switch, np.ndarray | None]]:
    """As of `switch_times`; lines: what the nodes are over time."""
    rounding = DOUBLE * max(abs(start), abs(end))
    times_of: list[np.ndarray] = []
    for switch in laws.switches:
        times: np.ndarray | None
        if lines[switch.argument] is None:
            times = None
        elif isinstance(line := lines[switch.argument], tuple):
            times = _on_a_line(*line, switch.pieces, start, end)
        else:
            inner = np.unique(np.concatenate([np.empty(0), *(times_of[k] for k in switch.inner)]))
            times = _on_a_curve(laws.ops, switch, inputs, _intervals(inner, start, end, gap), rounding)
        if times is not None:
            times = times[(times >= start) & (times <= end)]
        times_of.append(np.empty(0) if times is None else times)
        yield switch, times


def _straight_lines(ops: Sequence[Op], inputs: Mapping[ArrayElement, float], driven: Collection[int]) -> list[Line]:
    """For every node a and b where it is a t + b, True where it is another function of time, None where an input drives it."""
    lines: list[Line] = []
    for op in ops:
        arguments = [lines[a] for a in op.args]
        if op.code == "const":
            lines.append((0.0, op.value))
        elif op.code == "load":
            unknown = op.input.array == "p" and op.input.position in driven
            lines.append(None if unknown else (1.0, 0.0) if op.input == TIME else (0.0, inputs[op.input]))
        elif None in arguments:
            lines.append(None)
        else:
            lines.append(_line(op, arguments))
    return lines


def _line(op: Op, arguments: Sequence[Line]) -> tuple[float, float] | bool:
    """Of one operation on straight lines; one whose numbers are not finite does not count."""
    pairs = [each for each in arguments if isinstance(each, tuple)]
    if len(pairs) < len(arguments):
        return True
    slopes, offsets = zip(*pairs, strict=True)
    try:
        if not any(slopes):
            line = 0.0, compute(op, offsets)
        elif op.code in ("add", "sub", "neg"):
            line = compute(op, slopes), compute(op, offsets)
        elif op.code == "mul" and not all(slopes):
            factor = offsets[0] if slopes[0] == 0.0 else offsets[1]
            other = pairs[1] if slopes[0] == 0.0 else pairs[0]
            line = factor * other[0], factor * other[1]
        elif op.code == "div" and slopes[1] == 0.0:
            line = slopes[0] / offsets[1], offsets[0] / offsets[1]
        else:
            return True
    except (ArithmeticError, ValueError):
        return True
    return line if np.all(np.isfinite(line)) else True


def _on_a_line(a: float, b: float, pieces: Pieces, start: float, end: float) -> np.ndarray | None:
    """When a t + b passes knots; None where that is too often."""
    if a == 0.0:
        return np.empty(0)
    low, high = sorted((a * start + b, a * end + b))
    margin = 1e-9 * (high - low)
    numbers = _numbers(pieces, np.array([low - margin]), np.array([high + margin]))
    return None if numbers is None else (level(pieces, numbers[1]) - b) / a


def _numbers(pieces: Pieces, low: np.ndarray, high: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
    """Of all knots in intervals: which interval, and the knot's number; None where there are more than `MOST_BREAKS`."""
    first, last = levels_below(pieces, low, "left"), levels_below(pieces, high, "right")
    counts = np.where(last > first, last - first, 0.0)
    if not counts.sum() <= MOST_BREAKS:
        return None
    where = np.repeat(np.arange(len(low)), counts.astype(int))
    ends = np.cumsum(counts)
    return where, first[where] + np.arange(len(where)) - (ends - counts)[where]


def _intervals(breaks: np.ndarray, start: float, end: float, gap: float) -> tuple[np.ndarray, np.ndarray]:
    """The parts of a run between breaks, without what lies about these."""
    ends = np.concatenate([[start], breaks[(breaks > start) & (breaks < end)], [end]])
    is_break = np.isin(ends, breaks)
    low, high = ends[:-1] + gap * is_break[:-1], ends[1:] - gap * is_break[1:]
    return low[low < high], high[low < high]


def _on_a_curve(
    ops: Sequence[Op], switch: Switch, inputs: Mapping[ArrayElement, float], intervals: tuple[np.ndarray, np.ndarray], rounding: float
) -> np.ndarray | None:
    """When any function of time passes knots, None where that is too often: intervals are halved until none has a knot in its range, or
    the function rises or falls in it. Where even the narrowest tell neither, or there are too many, the values at their ends decide."""
    if switch.derivative is None:
        return np.empty(0)
    low, high = intervals
    parts: list[np.ndarray] = []
    bounds = partial(ranges, ops, (switch.argument, switch.derivative))
    while len(low):
        bound = {key: (np.asarray(value), np.asarray(value)) for key, value in inputs.items()}
        (least, most), (falls, rises) = (np.broadcast_arrays(*each, low)[:2] for each in bounds({**bound, TIME: (low, high)}))
        slack = 1e-14 * np.maximum(np.abs(least), np.abs(most))
        inside = levels_below(switch.pieces, most + slack, "right") > levels_below(switch.pieces, least - slack, "left")
        inside = (least < most) & (inside | ~np.isfinite(slack))
        narrow = high - low <= MIN_INTERVAL_ROUNDINGS * rounding
        decided = (falls > 0) | (rises < 0) | narrow | (np.count_nonzero(inside) > MOST_INTERVALS)
        times = _between(ops, switch, inputs, low[inside & decided], high[inside & decided], rounding)
        if times is None or sum(map(len, parts)) + len(times) > MOST_BREAKS:
            return None
        parts.append(times)
        low, high = low[inside & ~decided], high[inside & ~decided]
        middle = low + (high - low) / 2
        low, high = np.concatenate([low, middle]), np.concatenate([middle, high])
    return np.unique(np.concatenate([np.empty(0), *parts]))


def _between(
    ops: Sequence[Op], switch: Switch, inputs: Mapping[ArrayElement, float], low: np.ndarray, high: np.ndarray, rounding: float
) -> np.ndarray | None:
    """When the argument passes the knots between its values at the ends of intervals, by bisection; None where that is too often."""
    at = partial(values, ops, switch.argument)
    first, last = (np.broadcast_to(at({**inputs, TIME: t}), t.shape) for t in (low, high))
    known = np.isfinite(first) & np.isfinite(last)
    low, high, first, last = low[known], high[known], first[known], last[known]
    passed = _numbers(switch.pieces, np.minimum(first, last), np.maximum(first, last))
    if passed is None:
        return None
    where, numbers = passed
    low, high, side = low[where], high[where], np.sign(last - first)[where]
    knots = level(switch.pieces, numbers)
    while len(low):
        middle = low + (high - low) / 2
        moves = (middle > low) & (middle < high) & (high - low > rounding / 4)
        if not np.any(moves):
            break
        beyond = side * (at({**inputs, TIME: middle}) - knots) >= 0
        low, high = np.where(moves & ~beyond, middle, low), np.where(moves & beyond, middle, high)
    return high


def break_times_of_each(kernels: Kernels, p: np.ndarray, start: float, end: float) -> list[np.ndarray] | None:
    """The breaks of runs with parameters p (N, n_p), as of `break_times`; None where no law changes its formula. Equal parameters share one
    search."""
    laws = time_laws(kernels)
    if not laws.has_breaks:
        return None
    known: dict[bytes, np.ndarray] = {}
    reads, breaks = list(laws.parameters), []
    for row in p:
        key = row[reads].tobytes()
        if key not in known:
            known[key] = break_times(kernels, row, start, end)
        breaks.append(known[key])
    return breaks


def outside_breaks(breaks: np.ndarray, times: np.ndarray) -> np.ndarray:
    """Times (s), those inside a break being where the step before it ends, or at the start of a run where the step after it begins."""
    times = np.array(times, dtype=float)
    for before, after in breaks[breaks[:, 0] < breaks[:, 1]]:
        times[(times > before) & (times <= after)] = before
    if len(breaks) and breaks[0, 0] <= times[0] < breaks[0, 1]:
        times[0] = breaks[0, 1]
    return times
