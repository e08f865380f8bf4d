"""When laws of time change their formula, or a smooth one has a pulse, as a program: what exported motions, whose parameters and end are
not known here, ask for the time of the next break.

switches(t, p) writes four numbers for every switch whose argument is a straight line between the breaks of others: b, n, its slope a and
the size x of what the argument is a sum of. Where a is not 0, its formula changed last at b / a and changes next at n / a, known to the
rounding of x / a. For every other switch it writes the number of the piece that it is in at t, which changes where the formula does.

A pulse of a known form, such as exp(-((t - at) / width)^2), has a switch whose argument is the distance from its middle in its own widths.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ncgen.mechanism.break_times import MOST_BREAKS, break_times
from ncgen.mechanism.kernels import Kernels
from ncgen.mechanism.time_laws import TIME, TimeLaws, time_laws
from ncgen.model.pieces import Pieces
from ncgen.program.ir.blocks import Program
from ncgen.program.ir.derivatives import gradient, tangent
from ncgen.program.ir.graph import PIECES, Graph, Op
from ncgen.program.lines import line
from ncgen.symbolic.numbering import Terms

INTERVALS = 10_000
"""Times in the described motion at which arguments are looked at that are no straight lines."""

SHORTEST = 1e-6
"""Fraction of the described motion that two such times are at least apart."""

DISTANCES = (1.0, 2.0, 3.0, 4.0, 6.0, *(8.0 * 4.0**k for k in range(14)))
"""From the middle of a pulse, in its widths (of a Gaussian its standard deviation): close where steps of fixed length need them, then
farther and farther apart, so that a step comes near the pulse. The last one is so far away that rounding hides a narrower pulse."""

FLANKS = (*(-d for d in reversed(DISTANCES)), 0.0, *DISTANCES)

FLANK = Pieces(FLANKS, tuple((FLANKS[0], float(k)) for k in range(len(FLANKS) + 1)))
"""The parts of a pulse's flanks."""


@dataclass(frozen=True, eq=False)
class Switching:
    """program: the one above; lines, curves: switches whose arguments are straight, and others; interval: s between looks at the latter"""

    program: Program
    lines: int
    curves: int
    interval: float

    @property
    def described(self) -> dict[str, object]:
        """What templates are told."""
        return {"lines": self.lines, "curves": self.curves, "size": self.program.size, "interval": repr(self.interval)}


def assemble_switches(kernels: Kernels, equations: Terms, duration: float) -> Switching | None:
    """The switches of a mechanism whose described motion takes `duration` (s); None where no law of time changes its formula."""
    laws = time_laws(kernels)
    if not laws.has_breaks:
        return None
    graph, nodes = _copied(laws)
    straight: list[int] = []
    curved: list[int] = []
    for switch in laws.switches:
        argument = nodes[switch.argument]
        slope = _rate(graph, argument)
        if slope is None:
            continue  # it is constant between breaks of others
        if _rate(graph, slope) is None:
            straight += _line(graph, argument, slope, switch.pieces, duration)
        else:
            curved.append(graph.lookup(_numbered(switch.pieces), argument))
    for argument in dict.fromkeys(_pulses(graph, [nodes[narrow] for narrow in laws.narrow])):
        if (slope := _rate(graph, argument)) is not None:
            straight += _line(graph, argument, slope, FLANK, duration)
    if not straight and not curved:
        return None
    program = line(graph, "switches", ("t", "p"), [*straight, *curved], equations)
    return Switching(program, len(straight) // 4, len(curved), _interval(kernels, duration) if curved else 0.0)


def _copied(laws: TimeLaws) -> tuple[Graph, list[int]]:
    graph = Graph()
    nodes: list[int] = []
    for op in laws.ops:
        nodes.append(graph.copied(op, [nodes[a] for a in op.args]))
    return graph, nodes


def _rate(graph: Graph, node: int) -> int | None:
    """The derivative of a node by time; None where it is constant between breaks."""
    return tangent(graph, [node], {graph.load(*TIME): graph.const(1.0)}).get(node)


def _pulses(graph: Graph, narrow: list[int]) -> Iterator[int]:
    """Of what has a pulse, or a step, in laws that may be narrow: the distance from its middle in its widths, a straight line of time."""
    for node in sorted(graph.below(narrow)):
        op = graph.ops[node]
        if op.code in ("tanh", "atan", "cosh"):
            if (slope := _rate(graph, op.args[0])) is not None and _rate(graph, slope) is None:
                yield op.args[0]
        elif op.code == "exp":
            yield from _on_a_parabola(graph, op.args[0], of_height=False)
        elif op.code in ("div", "pow"):
            yield from _on_a_parabola(graph, op.args[op.code == "div"], of_height=True)


def _on_a_parabola(graph: Graph, node: int, of_height: bool) -> Iterator[int]:
    """g' / √|g''| of a node g of second degree in time, or g' / √|g'' g_0|, g_0 being its extreme, to which it changes in relation."""
    if (slope := _rate(graph, node)) is None or (bend := _rate(graph, slope)) is None or _rate(graph, bend) is not None:
        return
    scale = bend
    if of_height:
        middle = graph.neg(graph.div(graph.replaced(slope, {TIME: graph.const(0.0)}), bend))
        scale = graph.mul(bend, graph.replaced(node, {TIME: middle}))
    yield graph.div(slope, graph.call("sqrt", graph.call("abs", scale)))


def _line(graph: Graph, argument: int, slope: int, pieces: Pieces, duration: float) -> tuple[int, int, int, int]:
    """Nodes b, n, a and x of a switch with a straight argument."""
    t = graph.load(*TIME)
    if pieces.period:
        passed, ahead = _neighbours(graph, slope, argument, _distances(pieces, 0), _distances(pieces, 1))
        offset, used = graph.neg(graph.mul(slope, t)), _slow_enough(graph, slope, pieces, duration)
    else:
        passed, ahead = _neighbours(graph, slope, argument, _levels(pieces, 0), _levels(pieces, 1))
        offset, used = graph.replaced(argument, {TIME: graph.const(0.0)}), slope
        if t in graph.below([slope]):
            offset = graph.sub(argument, graph.mul(slope, t))
    return graph.sub(passed, offset), graph.sub(ahead, offset), used, _size(graph, argument)


def _size(graph: Graph, argument: int) -> int:
    """The sum of |∂argument/∂v · v| over the sums, lookups and parameters v in it: times the rounding unit, how wrong it may be."""
    parts = [v for v in sorted(graph.below([argument])) if graph.ops[v].code in ("add", "sub", PIECES) or _is_parameter(graph.ops[v])]
    return graph.sum(graph.call("abs", graph.mul(slope, v)) for v, slope in gradient(graph, argument, parts).items())


def _is_parameter(op: Op) -> bool:
    return op.code == "load" and op.input != TIME


def _neighbours(graph: Graph, slope: int, argument: int, below: Pieces, above: Pieces) -> tuple[int, int]:
    """What is looked up for the knots on both sides of an argument, that which it comes from first."""
    low, high = graph.lookup(below, argument), graph.lookup(above, argument)
    if low == high:
        return low, high
    side, half = graph.call("sign", slope), graph.const(0.5)
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


def _slow_enough(graph: Graph, slope: int, pieces: Pieces, duration: float) -> int:
    """The slope, or 0 where the law switches more often than `MOST_BREAKS` in the described motion: it is left to error control."""
    fastest = graph.const(MOST_BREAKS * pieces.period / (len(pieces.knots) - 1) / duration)
    slower = graph.call("sign", graph.sub(fastest, graph.call("abs", slope)))
    return graph.mul(slope, graph.mul(graph.const(0.5), graph.add(graph.const(1.0), slower)))


def _numbered(pieces: Pieces) -> Pieces:
    """The number of the piece."""
    return Pieces(pieces.knots, tuple((pieces.knots[0], float(k)) for k in range(len(pieces.rows))), pieces.period)


def _interval(kernels: Kernels, duration: float) -> float:
    """How far apart in time (s) the curves are looked at: so that breaks of the described motion are seen one by one."""
    found = break_times(kernels, np.asarray(kernels.p0), 0.0, duration).mean(axis=1)
    gaps = np.diff(found, prepend=0.0, append=duration)
    return max(SHORTEST * duration, min(duration / INTERVALS, float(gaps[gaps > 0].min()) / 2))
