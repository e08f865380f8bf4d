"""What of a mechanism is a law of time alone: the operations among which breaks are looked for."""

from __future__ import annotations

from collections.abc import Collection, Container, Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from ncgen.mechanism.kernels import Kernels
from ncgen.model.pieces import Pieces
from ncgen.program.ir.blocks import Program
from ncgen.program.ir.derivatives import tangent
from ncgen.program.ir.functions import FUNCTIONS
from ncgen.program.ir.graph import PIECES, ArrayElement, Graph, Op
from ncgen.program.ir.inlined import inlined

TIME = ArrayElement("t", 0)

ZERO = Pieces((0.0,), ((0.0, -1.0), (0.0, 1.0)))
"""What sign is, as pieces."""

SWITCHING = frozenset({"sign", "abs", PIECES})
"""Codes of operations that change their formula."""

CODES_WITH_BREAKS = frozenset({"div", PIECES, *FUNCTIONS})
"""Codes of operations that a law with breaks has."""


SMOOTH_FUNCTIONS = frozenset({"sin", "cos", "exp", "sinh", "cosh", "sqrt", "log", "asin", "acos"})
"""Functions that have no pulse and no step where their argument rises evenly."""

HIGHEST_DEGREE = 8.0
"""The degree up to which a polynomial of time counts as slow."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Switch:
    """An operation that changes its formula where its argument, which depends on time and parameters alone, passes a knot.

    argument, derivative: nodes of it and of its derivative by time, None where the argument is constant in time between other breaks
    pieces: the knots; jumps: True where the value jumps at one of them; bends: where its slope does, or the value
    inner: numbers of the switches that the argument depends on
    """

    argument: int
    derivative: int | None
    pieces: Pieces
    jumps: bool
    bends: bool
    inner: tuple[int, ...]


@dataclass(frozen=True, eq=False)
class TimeLaws:
    """The laws of time alone of one mechanism.

    ops; switches among them, inner ones first; narrow: nodes that may change quickly although smooth; parameters: positions of those read
    """

    ops: tuple[Op, ...] = ()
    switches: tuple[Switch, ...] = ()
    narrow: tuple[int, ...] = ()
    parameters: tuple[int, ...] = ()

    @property
    def has_breaks(self) -> bool:
        """True if there may be breaks."""
        return bool(self.switches or self.narrow)

    def copied(self) -> tuple[Graph, list[int]]:
        """A graph of its own with these operations, and the node of each."""
        graph, nodes = Graph(), list[int]()
        for op in self.ops:
            nodes.append(graph.copied(op, [nodes[a] for a in op.args]))
        return graph, nodes


def time_laws(kernels: Kernels, of_inputs: bool = False) -> TimeLaws:
    """The switches of time in forces and constraints, found once for a mechanism; of_inputs: with those that depend on inputs alone."""

    def found() -> TimeLaws:
        inputs = len(kernels.inputs) if of_inputs else 0
        return _laws(kernels, {TIME, *(ArrayElement("p", len(kernels.p0) - 1 - k) for k in range(inputs))})

    return kernels.remember("laws of time", of_inputs, found)


def _laws(kernels: Kernels, changing: Collection[ArrayElement]) -> TimeLaws:
    """changing: the time, and inputs that change with it."""
    graph, known, outputs = Graph(), {}, []
    sizes = {"t": 1, "p": len(kernels.p0), "q": kernels.n, "qd": kernels.n}
    for program in kernels.programs.programs.values():
        if _reads(program, CODES_WITH_BREAKS, changing):
            arrays = {name: [graph.load(name, k) for k in range(sizes.get(name, 0))] for name in program.inputs}
            outputs += inlined(graph, program, arrays)
    over_time: dict[int, int] = {}  # node -> the same among the laws' own
    time_graph, switches = Graph(), []
    for node, op in enumerate(graph.ops):
        if op.code == "const" or (op.code == "load" and op.input.array in ("t", "p")):
            over_time[node] = time_graph.copied(op, ())
        elif op.args and all(a in over_time for a in op.args):
            over_time[node] = made = time_graph.copied(op, [over_time[a] for a in op.args])
            if op.code in SWITCHING and made not in known and time_graph.ops[made].args:
                known[made] = time_graph.ops[made]
    used = {*outputs, *(a for node, op in enumerate(graph.ops) if node not in over_time for a in op.args)}
    narrow = _narrow_nodes(time_graph, [over_time[node] for node in used if node in over_time])
    numbers = {node: k for k, node in enumerate(known)}
    for node, op in known.items():
        (argument,) = op.args
        below = time_graph.below([argument])
        if not any(time_graph.ops[b].leaf in changing for b in below):
            continue
        derivative = slope_in_time(time_graph, argument)
        pieces = op.pieces if op.code == PIECES else ZERO
        jumps, bends = _discontinuous(op)
        switches.append(
            (
                node,
                Switch(
                    argument=argument,
                    derivative=derivative,
                    pieces=pieces,
                    jumps=jumps,
                    bends=bends,
                    inner=tuple(numbers[b] for b in below if b in numbers),
                ),
            )
        )
    index = {numbers[node]: k for k, (node, _) in enumerate(switches)}
    mended = [replace(s, inner=tuple(index[i] for i in sorted(s.inner) if i in index)) for _, s in switches]
    return _without_others(time_graph, mended, narrow)


def slope_in_time(graph: Graph, node: int) -> int | None:
    """The node of a node's derivative by time; None where that is 0."""
    return tangent(graph, [node], {graph.load(*TIME): graph.const(1.0)}).get(node)


def _narrow_nodes(graph: Graph, roots: Iterable[int]) -> tuple[int, ...]:
    """What the roots, laws of time, need that may have a pulse although it is smooth: functions, quotients and products of what is no
    polynomial of time. Sums change as their terms do, and of what only its sign is asked for there are breaks."""
    signs = {node for node, op in enumerate(graph.ops) if op.code == "sign"}
    degrees = degrees_in_time(graph, graph.below(roots, signs))
    narrow: list[int] = []
    for node, degree in degrees.items():
        op, below = graph.ops[node], [degrees.get(a, 0.0) for a in graph.ops[node].args]
        if op.code == "mul":
            is_narrow = min(below) > HIGHEST_DEGREE
        elif op.code in ("add", "sub", "neg") or (op.code == "div" and not below[1]):
            is_narrow = False
        else:
            is_narrow = degree > 0.0 and not is_slow(op, below) and op.code not in SWITCHING
        if is_narrow:
            narrow.append(node)
    return tuple(narrow)


def is_slow(op: Op, below: Sequence[float]) -> bool:
    """True for a function that has no pulse and no step; below: the degrees in time of its arguments."""
    return not op.args or (op.code in SMOOTH_FUNCTIONS and below[0] <= 1.0)


def degrees_in_time(graph: Graph, nodes: Iterable[int]) -> dict[int, float]:
    """{node: its degree as a polynomial of time, infinite for what is not one of degree `HIGHEST_DEGREE` at most}, arguments first."""
    degrees: dict[int, float] = {}
    for node in sorted(nodes):
        op = graph.ops[node]
        below = [degrees.get(a, 0.0) for a in op.args]
        if not op.args:
            degree = float(op.leaf == TIME)
        elif op.code in ("add", "sub", "neg"):
            degree = max(below)
        elif op.code == "mul":
            degree = sum(below)
        elif op.code == "div" and not below[1]:
            degree = below[0]
        else:
            degree = np.inf if any(below) else 0.0
        degrees[node] = degree if degree <= HIGHEST_DEGREE else np.inf
    return degrees


def _without_others(graph: Graph, switches: Sequence[Switch], narrow: Sequence[int]) -> TimeLaws:
    """Laws with the operations that they need alone."""
    needed = sorted(graph.below([*narrow, *(n for s in switches for n in (s.argument, s.derivative) if n is not None)]))
    new = {old: k for k, old in enumerate(needed)}
    ops = tuple(graph.ops[old].renumbered(new) for old in needed)
    renumbered = (replace(s, argument=new[s.argument], derivative=None if s.derivative is None else new[s.derivative]) for s in switches)
    read = tuple(op.input.position for op in ops if op.code == "load" and op.input.array == "p")
    return TimeLaws(ops, tuple(renumbered), tuple(new[node] for node in narrow), read)


def may_switch(program: Program) -> bool:
    """True if a program reads the time and has an operation that changes its formula."""
    return _reads(program, SWITCHING, {TIME})


def _reads(program: Program, codes: Container[str], changing: Collection[ArrayElement]) -> bool:
    """True if a program reads some of what changes with time and has an operation of some codes."""
    if not any(op.code in codes for block in program.blocks for op in block.ops):
        return False
    loads = any(op.code == "load" and op.input in changing for block in program.blocks for op in block.ops)
    arrays = {each.array for each in changing}
    return loads or any(slot.array in arrays for block in program.blocks for slot in block.slots)


def _discontinuous(op: Op) -> tuple[bool, bool]:
    """Whether the value of an operation jumps, and whether its slope or the value does."""
    if op.code != PIECES:
        return op.code == "sign", True
    pieces = op.pieces
    at = [*zip(pieces.knots, pieces.rows, pieces.rows[1:], strict=False)]
    if pieces.period:  # the row before the first knot is never taken; before it comes the last but one
        at = [(pieces.knots[-1], pieces.rows[-2], (pieces.rows[1][0] + pieces.period, *pieces.rows[1][1:])), *at[1:-1]]
    size = max(abs(_at(row, knot)) for knot, *rows in at for row in rows)
    jumps = any(abs(_at(before, knot) - _at(after, knot)) > 1e-9 * size for knot, before, after in at)
    length = min((b - a for a, b in pairwise(pieces.knots)), default=1.0)
    derivatives = [abs(_at(_slope(before), knot) - _at(_slope(after), knot)) * length for knot, before, after in at]
    return jumps, jumps or any(derivative > 1e-9 * size for derivative in derivatives)


def _slope(row: Sequence[float]) -> tuple[float, ...]:
    """Origin and coefficients of a polynomial's derivative."""
    return row[0], *(k * coefficient for k, coefficient in enumerate(row[1:]) if k)


def _at(row: Sequence[float], x: float) -> float:
    value = 0.0
    for coefficient in reversed(row[1:]):
        value = value * (x - row[0]) + coefficient
    return value
