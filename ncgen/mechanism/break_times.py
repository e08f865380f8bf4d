"""The times at which a law of time alone changes its formula: knots of tables and splines, ends of smooth steps, zeros of the arguments
of sign and Abs, into which Heaviside, Min, Max and Piecewise are translated.

Every algorithm that advances time takes this list: no step passes a break, so that errors are those of smooth motions. A law of
coordinates is left to error control.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from ncgen.mechanism.driving import Function
from ncgen.mechanism.driving import Pieces as Signal
from ncgen.mechanism.kernels import Kernels
from ncgen.model.pieces import Pieces
from ncgen.program.ir.blocks import Program
from ncgen.program.ir.derivatives import tangent
from ncgen.program.ir.graph import PIECES, Graph, Input, Op
from ncgen.program.ir.inlined import inlined
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

NARROWEST = 16.0
"""Rounding errors of the run's largest time that an interval is wide at least where neither its range nor its slope tells anything."""

NEAREST = 16.0
"""Breaks are one that are no farther apart than this many times what one of them may be misplaced by: no step would fit between."""

ZERO = Pieces((0.0,), ((0.0, -1.0), (0.0, 1.0)))
"""What sign is, as pieces."""

TIME = Input("t", 0)


@dataclass(frozen=True, eq=False)
class Switch:
    """An operation that changes its formula where its argument, which depends on time and parameters alone, passes a knot.

    argument, slope: nodes of it and of its derivative by time; slope None where the argument is constant in time between other breaks
    pieces: the knots; jumps: True where the value jumps at one of them, or a value that this is the derivative of
    inner: numbers of the switches that the argument depends on
    """

    argument: int
    slope: int | None
    pieces: Pieces
    jumps: bool
    inner: tuple[int, ...]


@dataclass(frozen=True, eq=False)
class TimeLaws:
    """The laws of time alone of one mechanism: ops, and the switches among them in an order in which inner ones come first.

    parameters: numbers of those that ops read; constant: switches whose arguments depend on parameters alone, inputs among them
    """

    ops: tuple[Op, ...] = ()
    switches: tuple[Switch, ...] = ()
    parameters: tuple[int, ...] = ()
    constant: tuple[Switch, ...] = ()


NO_BREAKS = np.empty((0, 2))


def break_times(
    kernels: Kernels,
    p: np.ndarray,
    start: float,
    end: float,
    told: Sequence[Signal | Function | None] = (),
    rounding: float = DOUBLE,
) -> np.ndarray:
    """Find the breaks of a run, shape (B, 2) in s, ascending: where a step has to end, and where the next but one begins.

    p (n_p,): the parameters; told: what drives the inputs, whose tables have breaks at their knots
    rounding: the relative rounding of the numbers that the run computes with
    Both times of a row are the same where the value is continuous or C knows on which side of its knot a step lies. Else a step goes from
    one to the other, `UNCERTAINTY` before and after the jump. A row may begin at the start or end at the end.
    """
    laws = time_laws(kernels)
    tables = [signal.knots for signal in told if isinstance(signal, Signal)]
    if not laws.switches and not tables:
        return NO_BREAKS
    gap = UNCERTAINTY * rounding * max(abs(start), abs(end))
    driven = [len(p) - len(told) + i for i, signal in enumerate(told) if signal is not None]
    found = [np.column_stack([knots, knots]) for knots in tables]
    for switch, times in switch_times(laws, p, start, end, gap, driven):
        half = gap if switch.jumps else 0.0
        found.append(np.empty((0, 2)) if times is None else np.column_stack([times - half, times + half]))
    return merged(np.concatenate(found) if found else NO_BREAKS, start, end, gap)


def merged(rows: np.ndarray, start: float, end: float, gap: float) -> np.ndarray:
    """Rows in order and inside the run; those that are next to each other are one."""
    rows = rows[(rows[:, 1] > start) & (rows[:, 0] < end)]
    rows = np.clip(rows[np.argsort(rows[:, 0], kind="stable")], start, end)
    if not len(rows):
        return NO_BREAKS
    last = np.maximum.accumulate(rows[:, 1])
    begins = np.concatenate([[True], rows[1:, 0] > last[:-1] + NEAREST * gap])
    ends = np.append(np.flatnonzero(begins)[1:] - 1, len(rows) - 1)
    return np.column_stack([rows[begins, 0], last[ends]])


# -- which laws there are ------------------------------------------------------------------------------------------------------------------


def time_laws(kernels: Kernels, of_inputs: bool = False) -> TimeLaws:
    """The switches of time in forces and constraints, found once for a mechanism; of_inputs: with those that depend on inputs alone."""
    return kernels.remember("laws of time", of_inputs, lambda: _laws(kernels, len(kernels.inputs) if of_inputs else 0))


def _laws(kernels: Kernels, inputs: int) -> TimeLaws:
    """inputs: how many of the last parameters change with time, too."""
    graph, known = Graph(), {}
    sizes = {"t": 1, "p": len(kernels.p0), "q": kernels.n, "qd": kernels.n}
    for program in kernels.programs.programs.values():
        if _may_switch(program, {TIME, *(Input("p", len(kernels.p0) - 1 - k) for k in range(inputs))}):
            arrays = {name: [graph.load(name, k) for k in range(sizes.get(name, 0))] for name in program.inputs}
            inlined(graph, program, arrays)
    over_time: dict[int, int] = {}  # node -> the same among the laws' own
    own, switches, constant = Graph(), [], list[Switch]()
    for node, op in enumerate(graph.ops):
        if op.code == "const" or (op.code == "load" and op.input.array in ("t", "p")):
            over_time[node] = own.copied(op, ())
        elif op.args and all(a in over_time for a in op.args):
            over_time[node] = made = own.copied(op, [over_time[a] for a in op.args])
            if op.code in ("sign", "abs", PIECES) and made not in known and own.ops[made].args:
                known[made] = own.ops[made]
    t = own.load(*TIME)
    numbers = {node: k for k, node in enumerate(known)}
    for node, op in known.items():
        (argument,) = op.args
        below = own.below([argument])
        pieces = op.pieces if op.code == PIECES else ZERO
        if t not in below:
            constant.append(Switch(argument, None, pieces, _jumps(op), ()))
            continue
        slope = tangent(own, [argument], {t: own.const(1.0)}).get(argument)
        switches.append((node, Switch(argument, slope, pieces, _jumps(op), tuple(numbers[b] for b in below if b in numbers))))
    place = {numbers[node]: k for k, (node, _) in enumerate(switches)}
    found = tuple(
        Switch(s.argument, s.slope, s.pieces, s.jumps, tuple(place[i] for i in sorted(s.inner) if i in place)) for _, s in switches
    )
    loaded = tuple(op.input.position for op in own.ops if op.code == "load" and op.input.array == "p")
    return TimeLaws(tuple(own.ops), found, loaded, tuple(constant))


def _may_switch(program: Program, changing: Collection[Input]) -> bool:
    """True if a program reads what changes with time and has an operation that changes its formula."""
    if not any(op.code in ("sign", "abs", PIECES) for block in program.blocks for op in block.ops):
        return False
    loads = any(op.code == "load" and op.input in changing for block in program.blocks for op in block.ops)
    arrays = {each.array for each in changing}
    return loads or any(slot.array in arrays for block in program.blocks for slot in block.slots)


def _jumps(op: Op) -> bool:
    """True if the value of an operation jumps."""
    if op.code != PIECES:
        return op.code == "sign"
    pieces = op.pieces
    at = [*zip(pieces.knots, pieces.rows, pieces.rows[1:], strict=False)]
    if pieces.period:  # the row before the first knot is never taken; before it comes the last but one
        at = [(pieces.knots[-1], pieces.rows[-2], (pieces.rows[1][0] + pieces.period, *pieces.rows[1][1:])), *at[1:-1]]
    size = max(abs(_at(row, knot)) for knot, *rows in at for row in rows)
    return any(abs(_at(before, knot) - _at(after, knot)) > 1e-9 * size for knot, before, after in at)


def _at(row: Sequence[float], x: float) -> float:
    value = 0.0
    for coefficient in reversed(row[1:]):
        value = value * (x - row[0]) + coefficient
    return value


# -- when their arguments pass knots -------------------------------------------------------------------------------------------------------


def switch_times(
    laws: TimeLaws, p: np.ndarray, start: float, end: float, gap: float, driven: Collection[int]
) -> Iterator[tuple[Switch, np.ndarray | None]]:
    """Every switch with the times at which it switches, None where it depends on inputs that change, or switches too often."""
    given: dict[Input, float] = {Input("p", k): float(p[k]) for k in laws.parameters}
    lines = _straight_lines(laws.ops, given, driven)
    rounding = DOUBLE * max(abs(start), abs(end))
    found: list[np.ndarray] = []
    for switch in laws.switches:
        times: np.ndarray | None
        if lines[switch.argument] is None:
            times = None
        elif isinstance(line := lines[switch.argument], tuple):
            times = _on_a_line(*line, switch.pieces, start, end)
        else:
            inner = np.unique(np.concatenate([np.empty(0), *(found[k] for k in switch.inner)]))
            times = _on_a_curve(laws.ops, switch, given, _intervals(inner, start, end, gap), rounding)
        if times is not None:
            times = times[(times >= start) & (times <= end)]
        found.append(np.empty(0) if times is None else times)
        yield switch, times


def _straight_lines(ops: Sequence[Op], given: Mapping[Input, float], driven: Collection[int]) -> list[tuple[float, float] | bool | None]:
    """For every node a and b where it is a t + b, True where it is another function of time, None where an input drives it."""
    lines: list[tuple[float, float] | bool | None] = []
    for op in ops:
        arguments = [lines[a] for a in op.args]
        if op.code == "const":
            lines.append((0.0, op.value))
        elif op.code == "load":
            unknown = op.input.array == "p" and op.input.position in driven
            lines.append(None if unknown else (1.0, 0.0) if op.input == TIME else (0.0, given[op.input]))
        elif None in arguments:
            lines.append(None)
        else:
            lines.append(_line(op, arguments))
    return lines


def _line(op: Op, arguments: Sequence[tuple[float, float] | bool | None]) -> tuple[float, float] | bool:
    """Of one operation on straight lines; one whose numbers are not finite is none."""
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
    places = np.concatenate([[start], breaks[(breaks > start) & (breaks < end)], [end]])
    is_break = np.isin(places, breaks)
    low, high = places[:-1] + gap * is_break[:-1], places[1:] - gap * is_break[1:]
    return low[low < high], high[low < high]


def _on_a_curve(
    ops: Sequence[Op], switch: Switch, given: Mapping[Input, float], intervals: tuple[np.ndarray, np.ndarray], rounding: float
) -> np.ndarray | None:
    """When any function of time passes knots, None where that is too often: intervals are halved until none has a knot in its range, or
    the function rises or falls in it. Where even the narrowest tell neither, or there are too many, the values at their ends decide."""
    if switch.slope is None:
        return np.empty(0)
    low, high = intervals
    found: list[np.ndarray] = []
    bounds = partial(ranges, ops, (switch.argument, switch.slope))
    while len(low):
        bound = {key: (np.asarray(value), np.asarray(value)) for key, value in given.items()}
        (least, most), (falls, rises) = (np.broadcast_arrays(*each, low)[:2] for each in bounds({**bound, TIME: (low, high)}))
        slack = 1e-14 * np.maximum(np.abs(least), np.abs(most))
        inside = levels_below(switch.pieces, most + slack, "right") > levels_below(switch.pieces, least - slack, "left")
        inside = (least < most) & (inside | ~np.isfinite(slack))
        narrow = high - low <= NARROWEST * rounding
        decided = (falls > 0) | (rises < 0) | narrow | (np.count_nonzero(inside) > MOST_INTERVALS)
        times = _between(ops, switch, given, low[inside & decided], high[inside & decided], rounding)
        if times is None or sum(map(len, found)) + len(times) > MOST_BREAKS:
            return None
        found.append(times)
        low, high = low[inside & ~decided], high[inside & ~decided]
        middle = low + (high - low) / 2
        low, high = np.concatenate([low, middle]), np.concatenate([middle, high])
    return np.unique(np.concatenate([np.empty(0), *found]))


def _between(
    ops: Sequence[Op], switch: Switch, given: Mapping[Input, float], low: np.ndarray, high: np.ndarray, rounding: float
) -> np.ndarray | None:
    """When the argument passes the knots between its values at the ends of intervals, by bisection; None where that is too often."""
    at = partial(values, ops, switch.argument)
    first, last = (np.broadcast_to(at({**given, TIME: t}), t.shape) for t in (low, high))
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
        beyond = side * (at({**given, TIME: middle}) - knots) >= 0
        low, high = np.where(moves & ~beyond, middle, low), np.where(moves & beyond, middle, high)
    return high


def break_times_of_each(kernels: Kernels, p: np.ndarray, start: float, end: float) -> list[np.ndarray] | None:
    """The breaks of runs with parameters p (N, n_p), as of `break_times`; None where no law changes its formula. Equal parameters share one
    search."""
    laws = time_laws(kernels)
    if not laws.switches:
        return None
    known: dict[bytes, np.ndarray] = {}
    reads, found = list(laws.parameters), []
    for row in p:
        key = row[reads].tobytes()
        if key not in known:
            known[key] = break_times(kernels, row, start, end)
        found.append(known[key])
    return found


def smooth_parts(breaks: np.ndarray, start: float, end: float) -> Iterator[tuple[float, float]]:
    """The parts of a run (s) in which no law changes its formula, from the end of one break to the beginning of the next."""
    inside = breaks[(breaks[:, 1] > start) & (breaks[:, 0] < end)]
    places = [start, *inside.ravel().tolist(), end]
    yield from ((a, b) for a, b in zip(places[::2], places[1::2], strict=True) if a < b)


def beside(breaks: np.ndarray, times: np.ndarray) -> np.ndarray:
    """Times (s), those inside a break being where the step before it ends, or at the start of a run where the step after it begins."""
    times = np.array(times, dtype=float)
    for before, after in breaks[breaks[:, 0] < breaks[:, 1]]:
        times[(times > before) & (times <= after)] = before
    if len(breaks) and breaks[0, 0] <= times[0] < breaks[0, 1]:
        times[0] = breaks[0, 1]
    return times
