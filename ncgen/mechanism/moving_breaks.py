"""How breaks of laws in time move with parameters: where an argument g(t, p) passes a knot at the time τ, dτ/dp = −g_p/g_t.

A motion that is differentiated ends its steps where a run ends its own. At a break that a parameter moves, derivatives by this parameter
differ before and after, so a step goes from one side to the other there, even where the law itself is continuous.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TypeAlias

import numpy as np

from ncgen.mechanism.break_times import DOUBLE, UNCERTAINTY, break_times, merged, switch_times
from ncgen.mechanism.driving import Function, InputPieces
from ncgen.mechanism.kernels import Kernels
from ncgen.mechanism.time_laws import TIME, TimeLaws, time_laws
from ncgen.program.ir.derivatives import tangent
from ncgen.program.ir.graph import ArrayElement, Op
from ncgen.program.ir.ranges import values

RATE_TOLERANCE = 1e-9
"""Relative difference up to which two rates of breaks are one."""


@dataclass(frozen=True, eq=False)
class MovingBreaks:
    """The breaks of a motion that is differentiated by n_p parameters.

    rows (B, 2): s, as of `break_times`
    rates (B, n_p): how the jump in a row moves with parameters, s per unit of them, 0 where nothing jumps; NaN where that is not known:
        laws switch there together and do not move together, the argument only touches its knot, or the run begins or ends there
    unknown: positions of parameters which move jumps at times that are not known
    bending: positions of parameters which move corners or jumps, the times of these known or not
    """

    rows: np.ndarray
    rates: np.ndarray
    unknown: frozenset[int] = frozenset()
    bending: frozenset[int] = frozenset()

    @property
    def moved(self) -> list[int]:
        """Numbers of the rows in which a jump may move."""
        return np.flatnonzero(np.any(self.rates != 0.0, axis=1)).tolist()


@dataclass(frozen=True, eq=False)
class Jump:
    """A jump of accelerations at a time that parameters move.

    change (n,): what they were before, less what they are after
    rates (n_p,): how the time moves, s per unit of a parameter, NaN where that is not known
    """

    change: np.ndarray
    rates: np.ndarray

    def along(self, dp: np.ndarray) -> np.ndarray:
        """By how much more velocities change after it, (n, D), with p, (n_p, D), of which those that move it otherwise rest."""
        return np.outer(self.change, np.nan_to_num(self.rates) @ dp)

    def felt(self, weights: np.ndarray) -> np.ndarray:
        """How a number with these derivatives (n,) by velocities after it changes with p, (n_p,)."""
        return self.rates * (self.change @ weights)


Jumping: TypeAlias = Callable[[np.ndarray, np.ndarray, np.ndarray], Mapping[int, Jump]]
"""From all instants at which steps end (K,), s, and q and q̇ there (K, n) to the jumps, by the number of the instant just before."""


@dataclass(frozen=True, eq=False)
class _Slopes:
    """Operations, and of every switch of some laws the node of its argument's derivative by time, and nodes of those by parameters."""

    ops: tuple[Op, ...] = ()
    by_time: list[int | None] = field(default_factory=list)
    by_parameters: list[dict[int, int]] = field(default_factory=list)


def moving_breaks(
    kernels: Kernels, p: np.ndarray, times: np.ndarray, signals: Sequence[InputPieces | Function | None] = ()
) -> MovingBreaks:
    """Find the breaks of a motion over the times (K,) of a grid (s), and how they move with parameters p (n_p,).

    told: what drives the inputs, as of `break_times`
    """
    start, end, count = float(times[0]), float(times[-1]), len(p)
    laws, rows = time_laws(kernels, any(signals)), break_times(kernels, p, start, end, signals)
    if not laws.switches:
        return MovingBreaks(rows, np.zeros((len(rows), count)))
    derivatives = kernels.remember("laws of time by parameters", any(signals), lambda: _slopes(laws))
    inputs = {ArrayElement("p", k): float(p[k]) for k in laws.parameters}
    driven = [count - len(signals) + i for i, signal in enumerate(signals) if signal is not None]
    gap = UNCERTAINTY * DOUBLE * max(abs(start), abs(end))
    breaks, unknown, bending = [rows], set[int](), set[int]()
    held = np.concatenate([np.empty(0), *(signal.knots[_jumps(signal)] for signal in signals if isinstance(signal, InputPieces))])
    jumps = [(held, np.zeros((len(held), count)))]
    for k, (switch, at) in enumerate(switch_times(laws, p, start, end, gap, driven)):
        movers = derivatives.by_parameters[k]
        if at is None:
            unknown |= movers.keys() if switch.jumps else set()
        elif movers and len(at):
            breaks.append(np.column_stack([at - gap, at + gap]))
        if switch.bends and (at is None or len(at)):
            bending |= movers.keys()
        if switch.jumps and at is not None and len(at):
            jumps.append((at, _rates(derivatives, k, inputs, at, count)))
    rows = merged(np.concatenate(breaks), start, end, gap)
    at, rates = (np.concatenate(parts) for parts in zip(*jumps, strict=True))
    return MovingBreaks(rows, _by_row(rows, at, rates, start, end), frozenset(unknown), frozenset(bending))


def _slopes(laws: TimeLaws) -> _Slopes:
    """Of the arguments of all switches."""
    graph, copies = laws.copied()
    loads = {op.input.position: copies[k] for k, op in enumerate(laws.ops) if op.code == "load" and op.input.array == "p"}
    one, derivatives = graph.const(1.0), list[dict[int, int]]()
    for switch in laws.switches:
        argument = copies[switch.argument]
        below = graph.below([argument])
        nodes = {k: tangent(graph, [argument], {load: one}).get(argument) for k, load in loads.items() if load in below}
        derivatives.append({k: node for k, node in nodes.items() if node is not None})
    by_time = [None if switch.derivative is None else copies[switch.derivative] for switch in laws.switches]
    return _Slopes(tuple(graph.ops), by_time, derivatives)


def _rates(derivatives: _Slopes, switch: int, inputs: Mapping[ArrayElement, float], at: np.ndarray, count: int) -> np.ndarray:
    """dτ/dp at times when the argument of a switch passes knots, (times, count)."""
    rates, by_time, inputs_there = np.zeros((len(at), count)), derivatives.by_time[switch], {**inputs, TIME: at}
    for k, node in derivatives.by_parameters[switch].items():
        with np.errstate(all="ignore"):
            passing = 0.0 if by_time is None else values(derivatives.ops, by_time, inputs_there)
            rate = np.divide(-values(derivatives.ops, node, inputs_there), passing)
        rates[:, k] = np.where(np.isfinite(rate), rate, np.nan)
    return rates


def _by_row(rows: np.ndarray, at: np.ndarray, rates: np.ndarray, start: float, end: float) -> np.ndarray:
    """The rate of what jumps in every row, NaN where jumps in it do not move together."""
    least, most = np.full((len(rows), rates.shape[1]), np.inf), np.full((len(rows), rates.shape[1]), -np.inf)
    inside = (at >= start) & (at <= end)
    if not len(rows) or not np.any(inside):
        return np.zeros(least.shape)
    row = np.maximum(np.searchsorted(rows[:, 0], at[inside], side="right") - 1, 0)
    np.minimum.at(least, row, rates[inside])
    np.maximum.at(most, row, rates[inside])
    least, most = (np.where(np.isinf(each), 0.0, each) for each in (least, most))
    moved = np.where(most - least <= RATE_TOLERANCE * np.maximum(np.abs(least), np.abs(most)), most, np.nan)
    ends = (rows[:, 0] <= start) | (rows[:, 1] >= end)
    moved[ends] = np.where(moved[ends] == 0.0, 0.0, np.nan)
    return moved


def _jumps(signal: InputPieces) -> np.ndarray:
    """At which of its knots a table jumps, (K,)."""
    before = signal.at(signal.knots[1:], signal.knots[:-1])
    size = np.max(np.abs(signal.coefficients[:, 0]), initial=0.0)
    return np.append(False, np.abs(before - signal.coefficients[1:, 0]) > RATE_TOLERANCE * size)
