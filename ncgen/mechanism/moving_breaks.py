"""How breaks of laws in time move with parameters: where an argument g(t, p) passes a knot at the time τ, dτ/dp = −g_p/g_t.

A motion that is differentiated ends its steps where a run ends its own. At a break that a parameter moves, derivatives by this parameter
differ before and after, so a step goes from one side to the other there, even where the law itself is continuous.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from ncgen.mechanism.break_times import DOUBLE, NO_BREAKS, UNCERTAINTY, break_times, merged, switch_times
from ncgen.mechanism.driving import Function, told_at
from ncgen.mechanism.driving import Pieces as Signal
from ncgen.mechanism.kernels import Kernels
from ncgen.mechanism.narrow_laws import TIME
from ncgen.mechanism.time_laws import Switch, TimeLaws, time_laws
from ncgen.program.ir.derivatives import tangent
from ncgen.program.ir.graph import Graph, Input, Op
from ncgen.program.ir.ranges import levels_below, values

SAME = 1e-9
"""Relative difference up to which two rates of breaks are one."""


@dataclass(frozen=True, eq=False)
class MovingBreaks:
    """The breaks of a motion that is differentiated by n_p parameters.

    rows (B, 2): s, as of `break_times`
    rates (B, n_p): how the jump in a row moves with parameters, s per unit of them, 0 where nothing jumps; NaN where that is not known:
        laws switch there together and do not move together, the argument only touches its knot, or the run begins or ends there
    moving: numbers of the rows that may move; movers: numbers of all parameters that move any
    unknown: numbers of parameters which move jumps at times that are not known
    """

    rows: np.ndarray
    rates: np.ndarray
    moving: np.ndarray
    movers: tuple[int, ...] = ()
    unknown: tuple[int, ...] = ()

    @property
    def moved(self) -> np.ndarray:
        """Numbers of the rows in which a jump may move."""
        return np.flatnonzero(np.any(self.rates != 0.0, axis=1))


@dataclass(frozen=True, eq=False)
class _Slopes:
    """Derivatives of a switch's argument: nodes by parameters, and by time, among the operations of `_Laws`."""

    by_parameters: Mapping[int, int]
    by_time: int | None


@dataclass(frozen=True, eq=False)
class _Laws:
    ops: tuple[Op, ...]
    slopes: tuple[_Slopes, ...]


@dataclass(frozen=True, eq=False)
class Jump:
    """A jump of accelerations at a time that parameters move.

    change (n,): what they were before, less what they are after
    rates (n_p,): how the time moves, s per unit of a parameter, NaN where that is not known
    """

    change: np.ndarray
    rates: np.ndarray

    def along(self, dp: np.ndarray) -> np.ndarray:
        """By how much more velocities change after it, (n, D), with p, (n_p, D)."""
        lost = np.isnan(self.rates) & np.any(dp != 0.0, axis=1)
        return np.outer(self.change, np.where(lost, np.nan, np.nan_to_num(self.rates)) @ dp)

    def felt(self, weights: np.ndarray) -> np.ndarray:
        """How a number with these derivatives (n,) by velocities after it changes with p, (n_p,)."""
        return self.rates * (self.change @ weights)


Jumping: TypeAlias = Callable[[np.ndarray, np.ndarray, np.ndarray], Mapping[int, Jump]]
"""From all instants at which steps end (K,), s, and q and q̇ there (K, n) to the jumps, by the number of the instant just before."""


def no_jumps(times: np.ndarray, q: np.ndarray, qd: np.ndarray) -> Mapping[int, Jump]:
    """The jumps of a motion whose breaks no parameter moves."""
    return {}


def moving_breaks(kernels: Kernels, p: np.ndarray, times: np.ndarray, told: Sequence[Signal | Function | None] = ()) -> MovingBreaks:
    """Find the breaks of a motion over the times (K,) of a grid (s), and how they move with parameters p (n_p,).

    told: what drives the inputs, as of `break_times`
    """
    laws, start, end = time_laws(kernels, any(told)), float(times[0]), float(times[-1])
    tables = [signal for signal in told if isinstance(signal, Signal)]
    if not laws.has_breaks and not any(told):
        return MovingBreaks(NO_BREAKS, np.empty((0, len(p))), np.empty(0, dtype=int))
    derived = kernels.remember("laws of time by parameters", any(told), lambda: _derived(laws))
    given = {Input("p", k): float(p[k]) for k in laws.parameters}
    first = len(p) - len(told)
    driven = {first + i: signal for i, signal in enumerate(told) if signal is not None}
    gap = UNCERTAINTY * DOUBLE * max(abs(start), abs(end))
    found, moving, movers, unknown = [break_times(kernels, p, start, end, told)], [np.empty(0)], set[int](), set[int]()
    jumps = [(np.empty(0), np.empty((0, len(p))))]
    for signal in tables:
        at = signal.knots[_jumps(signal)]
        jumps.append((at, np.zeros((len(at), len(p)))))
    for switch, slopes, (_, at) in zip(
        laws.switches, derived.slopes[: len(laws.switches)], switch_times(laws, p, start, end, gap, driven), strict=True
    ):
        if at is None:
            unknown |= _lost(laws, switch, slopes, given, driven, times)
            continue
        if slopes.by_parameters and len(at):
            moving.append(at)
            movers |= set(slopes.by_parameters)
            found.append(np.column_stack([at - gap, at + gap]))
        if switch.jumps:
            jumps.append((at, _rates(derived, slopes, given, at, len(p))))
    for switch, slopes in zip(laws.constant if driven else (), derived.slopes[len(laws.switches) :], strict=False):
        unknown |= _lost(laws, switch, slopes, given, driven, times)
    rows = merged(np.concatenate(found), start, end, gap)
    at, rates = (np.concatenate(parts) for parts in zip(*jumps, strict=True))
    places = np.unique(_place(rows, np.concatenate(moving))) if len(rows) else np.empty(0, dtype=int)
    return MovingBreaks(rows, _by_row(rows, at, rates, start, end), places, tuple(sorted(movers)), tuple(sorted(unknown)))


def _derived(laws: TimeLaws) -> _Laws:
    """The arguments of all switches by time and by parameters."""
    graph = Graph()
    place: list[int] = []
    for op in laws.ops:
        place.append(graph.copied(op, [place[a] for a in op.args]))
    loads = {op.input.position: place[k] for k, op in enumerate(laws.ops) if op.code == "load" and op.input.array == "p"}
    one, found = graph.const(1.0), list[_Slopes]()
    for switch in (*laws.switches, *laws.constant):
        argument = place[switch.argument]
        below = graph.below([argument])
        nodes = {k: tangent(graph, [argument], {load: one}).get(argument) for k, load in loads.items() if load in below}
        by_time = None if switch.slope is None else place[switch.slope]
        found.append(_Slopes({k: node for k, node in nodes.items() if node is not None}, by_time))
    return _Laws(tuple(graph.ops), tuple(found))


def _rates(laws: _Laws, slopes: _Slopes, given: Mapping[Input, float], at: np.ndarray, count: int) -> np.ndarray:
    """dτ/dp at times when an argument passes knots, (times, count)."""
    rates = np.zeros((len(at), count))
    if slopes.by_time is None or not len(at):
        return rates
    here = {**given, TIME: at}
    by_time = np.broadcast_to(values(laws.ops, slopes.by_time, here), at.shape)
    for k, node in slopes.by_parameters.items():
        by_p = np.broadcast_to(values(laws.ops, node, here), at.shape)
        with np.errstate(all="ignore"):
            rate = -by_p / by_time
        rates[:, k] = np.where(np.isfinite(rate), rate, np.nan)
    return rates


def _by_row(rows: np.ndarray, at: np.ndarray, rates: np.ndarray, start: float, end: float) -> np.ndarray:
    """The rate of what jumps in every row, NaN where jumps in it do not move together."""
    least, most = np.full((len(rows), rates.shape[1]), np.inf), np.full((len(rows), rates.shape[1]), -np.inf)
    inside = (at >= start) & (at <= end)
    if not len(rows) or not np.any(inside):
        return np.zeros(least.shape)
    place = _place(rows, at[inside])
    np.minimum.at(least, place, rates[inside])
    np.maximum.at(most, place, rates[inside])
    with np.errstate(invalid="ignore"):
        same = most - least <= SAME * np.maximum(np.abs(least), np.abs(most))
    found = np.where(same, most, np.where(np.isinf(least), 0.0, np.nan))
    ends = (rows[:, 0] <= start) | (rows[:, 1] >= end)
    found[ends] = np.where(found[ends] == 0.0, 0.0, np.nan)
    return found


def _place(rows: np.ndarray, at: np.ndarray) -> np.ndarray:
    """The numbers of the rows in which times lie."""
    return np.maximum(np.searchsorted(rows[:, 0], at, side="right") - 1, 0)


def _jumps(signal: Signal) -> np.ndarray:
    """At which of its knots a table jumps, (K,)."""
    before = signal.at(signal.knots[1:], signal.knots[:-1])
    size = np.max(np.abs(signal.coefficients[:, 0]), initial=0.0)
    return np.append(False, np.abs(before - signal.coefficients[1:, 0]) > SAME * size)


def _lost(
    laws: TimeLaws,
    switch: Switch,
    slopes: _Slopes,
    given: Mapping[Input, float],
    driven: Mapping[int, Signal | Function],
    times: np.ndarray,
) -> set[int]:
    """Parameters which move jumps of a switch whose times are not known: none where it does not switch between times of the grid."""
    if not switch.jumps:
        return set()
    known = {Input("p", k): told_at(signal, times, times) for k, signal in driven.items()}
    argument = np.broadcast_to(values(laws.ops, switch.argument, {**given, **known, TIME: times}), times.shape)
    sides = levels_below(switch.pieces, argument, "right")
    return set() if np.all(sides == sides[0]) else set(slopes.by_parameters)
