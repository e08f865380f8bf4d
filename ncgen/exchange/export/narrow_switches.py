"""Where narrow smooth laws of time begin and cease to change quickly, for exported motions, whose parameters are not known here.

A Gaussian, 1/cosh or tanh is a function of one argument u, which is linear in time, and parameters stand in u alone, or in factors. It
changes quickly at numbers u that are found once, at export; the times follow from them and the parameters, as those of a table's knots do.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Container, Iterable, Mapping
from typing import NamedTuple

import numpy as np

from ncgen.mechanism.narrow_laws import quick_changes
from ncgen.mechanism.time_laws import TIME, degrees_in_time, is_slow, slope_in_time
from ncgen.model.pieces import Pieces
from ncgen.program.ir.graph import ArrayElement, Graph
from ncgen.program.ir.ranges import values

MAX_ARGUMENT = 1e4
"""The number u up to which quick changes are looked for: the tails of a pulse are followed to a thousand times its width."""

PERIODIC = frozenset({"sin", "cos", "tan"})
"""Functions that have the period 2π."""

FACTORS = (1.0, 0.6, 1.7)
"""What parameters are multiplied by to see which numbers do not depend on them."""

ROUNDING_TOLERANCE = 1e-9
"""The difference of two numbers of the size 1 that is rounding."""


class Argument(NamedTuple):
    """u: a node that is linear in time. A polynomial g of time is vertex + sign u², or u itself where the sign is 0; where it has a scale
    of parameters, which is a factor of the law, g over that."""

    u: int
    sign: float = 0.0
    vertex: float = 0.0


def narrow_arguments(
    graph: Graph, nodes: Iterable[int], defaults: Mapping[ArrayElement, float]
) -> tuple[list[tuple[int, Pieces]], list[int]]:
    """Find where laws of time change quickly.

    nodes: those that may, arguments first; defaults: {parameter: value}, of which the signs matter
    Returns pairs of an argument u, which is linear in time, and the numbers at which steps have to end, as knots; and the nodes of which
    nothing is known for all parameters.
    """
    knots: dict[tuple[int, float], set[float]] = defaultdict(set)
    known: set[int] = set()
    left: list[int] = []
    for node in nodes:
        op = graph.ops[node]
        is_share = op.code == "div" and TIME not in _inputs(graph, op.args[0])
        law = graph.div(graph.const(1.0), op.args[1]) if is_share else node
        degrees = degrees_in_time(graph, graph.below([node, law]))
        base = _base(graph, law, degrees)
        argument = None if base is None else _argument(graph, law, base, defaults)
        if base is not None and argument is not None:
            period = 2 * np.pi if not argument.sign and _is_periodic(graph, law, base) else 0.0
            knots[argument.u, period].update(_knots(graph, law, base, argument, period))
        elif not _changes_with(graph, node, degrees, known):
            left.append(node)
            continue
        known.add(node)
    return [(u, _pieces(sorted(changes), period)) for (u, period), changes in knots.items() if changes], left


def _inputs(graph: Graph, node: int) -> set[ArrayElement]:
    return {graph.ops[n].input for n in graph.below([node]) if graph.ops[n].code == "load"}


def _base(graph: Graph, node: int, degrees: Mapping[int, float]) -> int | None:
    """The polynomial of time, of degree 2 at most, of which alone the node is a function; None where it reads anything else."""
    laws, waiting = set(), [node]
    while waiting:
        each = waiting.pop()
        if degrees[each] > 2:
            waiting += graph.ops[each].args
        elif degrees[each] > 0:
            laws.add(each)
        elif graph.ops[each].code != "const":
            return None
    return laws.pop() if len(laws) == 1 else None


def _argument(graph: Graph, law: int, base: int, defaults: Mapping[ArrayElement, float]) -> Argument | None:
    """The argument of a polynomial g, which a law is a function of; None where its vertex is a parameter and no factor of the law."""
    derivative = slope_in_time(graph, base)
    assert derivative is not None, "a narrow law's argument does not depend on time"
    curvature = slope_in_time(graph, derivative)
    if curvature is None:
        return Argument(base)
    top = graph.neg(graph.div(graph.replaced(derivative, {TIME: graph.const(0.0)}), curvature))
    peak = graph.replaced(base, {TIME: top})
    bends, vertices = (np.array([_number(graph, node, defaults, factor) for factor in FACTORS]) for node in (curvature, peak))
    if np.ptp(vertices) <= ROUNDING_TOLERANCE * (1.0 + abs(vertices[0])):
        scale, signs, vertex = graph.const(1.0), np.sign(bends), float(vertices[0])
    elif graph.ops[law].code == "exp" and base in graph.ops[law].args:
        scale, signs, vertex = graph.const(1.0), np.sign(bends), 0.0  # exp(vertex) is a factor
    elif _is_power(graph, law, base):
        scale, signs, vertex = peak, np.sign(bends * vertices), 1.0
    else:
        return None
    if not np.all(np.abs(signs) == 1.0) or np.ptp(signs):
        return None
    size = graph.call("abs", graph.mul(curvature, scale))
    return Argument(graph.div(derivative, graph.call("sqrt", graph.mul(graph.const(2.0), size))), float(signs[0]), vertex)


def _number(graph: Graph, node: int, defaults: Mapping[ArrayElement, float], factor: float) -> float:
    """The value of a node without time, at other parameters."""
    return float(values(graph.ops, node, {each: (value or 1.0) * factor for each, value in defaults.items()} | {TIME: 0.0}))


def _is_power(graph: Graph, node: int, base: int) -> bool:
    """Whether a factor of the base is one of the node."""
    between = graph.below([node], {base}) - {base}
    return all(graph.ops[n].code in ("mul", "div", "neg", "sqrt", "const") for n in between)


def _is_periodic(graph: Graph, node: int, base: int) -> bool:
    """Whether functions of period 2π alone read the base."""
    return all(graph.ops[n].code in PERIODIC for n in graph.below([node], {base}) if base in graph.ops[n].args)


def _changes_with(graph: Graph, node: int, degrees: Mapping[int, float], known: Container[int]) -> bool:
    """Whether a node is made of known ones, with what is slow in addition to them, by sums, products and quotients alone."""
    waiting, is_met = list(graph.ops[node].args), False
    while waiting:
        each = waiting.pop()
        op = graph.ops[each]
        if each in known:
            is_met = True
        elif np.isinf(degrees[each]) and not is_slow(op, [degrees[a] for a in op.args]):
            if op.code not in ("add", "sub", "neg", "mul", "div"):
                return False
            waiting += op.args
    return is_met and graph.ops[node].code in ("mul", "div")


def _knots(graph: Graph, law: int, base: int, argument: Argument, period: float) -> list[float]:
    """The numbers u, rounded to six digits so that they are the same on every machine."""
    law_graph = Graph()
    u = law_graph.load(*TIME)
    square = law_graph.mul(law_graph.const(argument.sign), law_graph.mul(u, u))
    new = {base: law_graph.add(law_graph.const(argument.vertex), square) if argument.sign else u}
    for node in sorted(graph.below([law], {base}) - {base}):
        new[node] = law_graph.copied(graph.ops[node], [new[a] for a in graph.ops[node].args])
    start, end = (0.0, 4 * period) if period else (-MAX_ARGUMENT, MAX_ARGUMENT)
    changes = quick_changes(law_graph.ops, new[law], {}, start, end, np.empty(0))
    if period:
        changes = changes[(changes >= 2 * period) & (changes < 3 * period)] - 2 * period
    return [float(f"{each:.6g}") for each in changes]


def _pieces(knots: list[float], period: float) -> Pieces:
    """As knots; those that are next to each other are one."""
    knots = [b for a, b in zip([-np.inf, *knots], knots, strict=False) if b - a > ROUNDING_TOLERANCE * max(1.0, abs(b))]
    if period:
        knots.append(knots[0] + period)
    return Pieces(tuple(knots), tuple((0.0, float(k)) for k in range(len(knots) + 1)), period)
