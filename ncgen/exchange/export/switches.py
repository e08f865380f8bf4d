"""When laws of time change their formula, as a program: what exported motions, whose parameters and end are not known here, ask for the
time of the next break.

switches(t, p) writes four numbers for every switch whose argument is a straight line between the breaks of others: b, n, its slope a and
the size x of what the argument is a sum of. Where a is not 0, its formula changed last at b / a and changes next at n / a, known to the
rounding of x / a. For every other switch it writes the number of the piece that it is in at t, which changes where the formula does.

A smooth law that is narrow (`narrow_switches`) is as many pieces; one of which nothing is known for all parameters is pieces of its
values, where it is narrow in the described motion.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ncgen.exchange.export.narrow_switches import narrow_arguments
from ncgen.mechanism.break_times import MOST_BREAKS, breaks_of_laws
from ncgen.mechanism.driver_jumps import may_jump
from ncgen.mechanism.kernels import Kernels
from ncgen.mechanism.time_laws import TIME, TimeLaws, slope_in_time, time_laws
from ncgen.model.pieces import Pieces
from ncgen.program.ir.blocks import Program
from ncgen.program.ir.derivatives import gradient
from ncgen.program.ir.graph import PIECES, ArrayElement, Graph, Op
from ncgen.program.ir.ranges import values
from ncgen.program.lines import line
from ncgen.symbolic.numbering import Terms

INTERVALS = 10_000
"""Times in the described motion at which arguments are looked at that are no straight lines."""

MIN_TIME_FRACTION = 1e-6
"""Fraction of the described motion that two such times are at least apart."""

RANGE_FRACTIONS = (1e-8, 1e-5, 1e-3, 0.02, 0.125, 0.375, 0.625, 0.875, 0.98, 0.999, 1 - 1e-5, 1 - 1e-8)
"""Fractions of a narrow law's range in the described motion at which steps end: dense where it begins and ceases to change."""

MOST_CHANGES = 1000
"""Steps that may end in the described motion for such a law; one that needs more is left to error control."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Switching:
    """program: the one above; lines, curves: switches whose arguments are straight, and others; interval: s between looks at the latter;
    jumps: whether the velocity of a driver may jump at a break"""

    program: Program
    lines: int
    curves: int
    interval: float
    jumps: bool

    @property
    def described(self) -> dict[str, object]:
        """Values for the templates."""
        counts = {"lines": self.lines, "curves": self.curves, "size": self.program.size}
        return {**counts, "interval": repr(self.interval), "jumps": self.jumps}


def assemble_switches(kernels: Kernels, equations: Terms, duration: float) -> Switching | None:
    """The switches of a mechanism whose described motion takes `duration` (s); None where no law of time has breaks."""
    laws = time_laws(kernels)
    if not laws.has_breaks:
        return None
    graph, nodes = laws.copied()
    straight: list[int] = []
    curved: list[int] = []
    for switch in laws.switches:
        argument = nodes[switch.argument]
        derivative = slope_in_time(graph, argument)
        if derivative is None:
            continue  # it is constant between breaks of others
        if slope_in_time(graph, derivative) is None:
            straight += _line(graph, argument, derivative, switch.pieces, duration)
        else:
            curved.append(graph.lookup(_numbered(switch.pieces), argument))
    defaults = {ArrayElement("p", k): float(kernels.p0[k]) for k in laws.parameters}
    arguments, left = narrow_arguments(graph, [nodes[node] for node in laws.narrow], defaults)
    for u, pieces in arguments:
        derivative = slope_in_time(graph, u)
        assert derivative is not None, "a narrow law's argument does not depend on time"
        straight += _line(graph, u, derivative, pieces, duration)
    watched = _narrow_here(kernels, laws, [node for node in laws.narrow if nodes[node] in left], duration)
    curved += [graph.lookup(pieces, nodes[node]) for node, pieces in watched.items()]
    if not straight and not curved:
        return None
    program = line(graph, "switches", ("t", "p"), [*straight, *curved], equations)
    interval = _interval(kernels, replace(laws, narrow=tuple(watched)), duration) if curved else 0.0
    return Switching(program=program, lines=len(straight) // 4, curves=len(curved), interval=interval, jumps=may_jump(kernels))


def _narrow_here(kernels: Kernels, laws: TimeLaws, nodes: Sequence[int], duration: float) -> dict[int, Pieces]:
    """{law that has narrow changes in the described motion: the number of the piece that its value is in}."""
    inputs = {ArrayElement("p", k): float(kernels.p0[k]) for k in laws.parameters}
    narrow = {}
    for node in nodes:
        breaks = breaks_of_laws(kernels, replace(laws, switches=(), narrow=(node,)), duration)
        if len(breaks):
            t = np.sort(np.concatenate([np.linspace(0.0, duration, INTERVALS + 1), breaks[:, 0]]))
            x = values(laws.ops, node, {**inputs, TIME: t})
            low, high = np.min(x[np.isfinite(x)]), np.max(x[np.isfinite(x)])
            knots = np.unique([float(f"{low + (high - low) * level:.12g}") for level in RANGE_FRACTIONS]).tolist()
            if np.count_nonzero(np.diff(np.searchsorted(knots, x))) <= MOST_CHANGES:
                narrow[node] = Pieces(tuple(knots), tuple((0.0, float(k)) for k in range(len(knots) + 1)))
    return narrow


def _line(graph: Graph, argument: int, derivative: int, pieces: Pieces, duration: float) -> tuple[int, int, int, int]:
    """Nodes b, n, a and x of a switch with a straight argument."""
    t = graph.load(*TIME)
    if pieces.period:
        passed, ahead = _neighbours(graph, derivative, argument, _distances(pieces, 0), _distances(pieces, 1))
        offset, used = graph.neg(graph.mul(derivative, t)), _slow_enough(graph, derivative, pieces, duration)
    else:
        passed, ahead = _neighbours(graph, derivative, argument, _levels(pieces, 0), _levels(pieces, 1))
        offset, used = graph.replaced(argument, {TIME: graph.const(0.0)}), derivative
        if t in graph.below([derivative]):
            offset = graph.sub(argument, graph.mul(derivative, t))
    return graph.sub(passed, offset), graph.sub(ahead, offset), used, _size(graph, argument)


def _size(graph: Graph, argument: int) -> int:
    """The sum of |∂argument/∂v · v| over the sums, lookups and parameters v in it: times the rounding unit, how wrong it may be."""
    parts = [v for v in sorted(graph.below([argument])) if graph.ops[v].code in ("add", "sub", PIECES) or _is_parameter(graph.ops[v])]
    return graph.sum(graph.call("abs", graph.mul(derivative, v)) for v, derivative in gradient(graph, argument, parts).items())


def _is_parameter(op: Op) -> bool:
    return op.code == "load" and op.input != TIME


def _neighbours(graph: Graph, derivative: int, argument: int, below: Pieces, above: Pieces) -> tuple[int, int]:
    """What is looked up for the knots on both sides of an argument, that which it comes from first."""
    low, high = graph.lookup(below, argument), graph.lookup(above, argument)
    if low == high:
        return low, high
    side, half = graph.call("sign", derivative), graph.const(0.5)
    rising, falling = (graph.mul(half, each(graph.const(1.0), side)) for each in (graph.add, graph.sub))

    def chosen(up: int, down: int) -> int:
        return graph.add(graph.mul(rising, up), graph.mul(falling, down))

    return chosen(low, high), chosen(high, low)


def _levels(pieces: Pieces, above: int) -> Pieces:
    """The knot above an argument (1) or at or below it (0); the last one on this side where there is none."""
    return Pieces(pieces.knots, tuple((pieces.knots[0], each) for each in _beside_pieces(pieces, above)))


def _distances(pieces: Pieces, above: int) -> Pieces:
    """How far that knot is away, where they repeat themselves."""
    return Pieces(pieces.knots, tuple((each, 0.0, -1.0) for each in _beside_pieces(pieces, above)), pieces.period)


def _beside_pieces(pieces: Pieces, above: int) -> list[float]:
    """Of every piece the knot where it ends (above 1) or begins (0)."""
    return [pieces.knots[min(max(k - 1 + above, 0), len(pieces.knots) - 1)] for k in range(len(pieces.rows))]


def _slow_enough(graph: Graph, derivative: int, pieces: Pieces, duration: float) -> int:
    """The slope, or 0 where the law switches more often than `MOST_BREAKS` in the described motion: it is left to error control."""
    fastest = graph.const(MOST_BREAKS * pieces.period / (len(pieces.knots) - 1) / duration)
    slower = graph.call("sign", graph.sub(fastest, graph.call("abs", derivative)))
    return graph.mul(derivative, graph.mul(graph.const(0.5), graph.add(graph.const(1.0), slower)))


def _numbered(pieces: Pieces) -> Pieces:
    """The number of the piece."""
    return Pieces(pieces.knots, tuple((pieces.knots[0], float(k)) for k in range(len(pieces.rows))), pieces.period)


def _interval(kernels: Kernels, laws: TimeLaws, duration: float) -> float:
    """How far apart in time (s) the curves are looked at: so that breaks of the described motion are seen one by one."""
    breaks = breaks_of_laws(kernels, laws, duration).mean(axis=1)
    gaps = np.diff(breaks, prepend=0.0, append=duration)
    return max(MIN_TIME_FRACTION * duration, min(duration / INTERVALS, float(gaps[gaps > 0].min()) / 2))
