"""Friction of contacts that slide, as programs: its force is the coefficient times the load of the gap, which depends on the forces.

friction_forces(t, q, qd, p)  -> generalised forces (n) of all contacts that slide

The loads N of the k gaps are affine in the friction forces F: N = N0 − L F, L being the multipliers of the gaps for a force of 1 N along
each direction of sliding. With F = −μ N they follow from (1 − L μ) N = N0.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from ncgen.model.values import Scalar
from ncgen.program.assemble import input_lengths
from ncgen.program.ir.blocks import Program
from ncgen.program.ir.derivatives import gradient
from ncgen.program.ir.graph import Graph
from ncgen.program.ir.verify import verify
from ncgen.program.lines import Lines
from ncgen.program.motions.expression_nodes import expression_node
from ncgen.program.motions.full_motion import MotionSizes
from ncgen.program.motions.multipliers import STATE, AccelerationNodes
from ncgen.symbolic.numbering import Terms

MIN_SLIDING_VELOCITY = 1e-150
"""A sliding velocity (m/s) far below this has the direction in which it begins to slide."""


@dataclass(frozen=True, eq=False)
class Sliding:
    """A contact that slides. row: number of the constraint that holds its gap; friction: coefficient

    velocity: its sliding velocity (m/s), one expression in the plane, two in space; slip: as of `Contact`
    """

    name: str
    row: int
    friction: Scalar
    velocity: tuple[Scalar, ...]
    slip: tuple[str, ...]


class SlidingNodes:
    """Accelerations and multipliers with friction. lam (m): nodes; forces {coordinate: node}; margin: a node that is positive where the
    loads are determined"""

    def __init__(self, lines: Lines, sizes: MotionSizes, sliding: Sequence[Sliding]) -> None:
        graph, n = lines.graph, len(lines.equations.free)
        motion = AccelerationNodes(lines, sizes)
        self.lam, zero, one = list(motion.lam), graph.const(0.0), graph.const(1.0)
        along = [_direction(lines, each) for each in sliding]
        answers = [motion.saddle.refined(column) for column in along]
        mu = [expression_node(lines, f"contact {each.name}", each.friction) for each in sliding]
        matrix = [
            [graph.sub(one if i == j else zero, graph.mul(x.get(n + each.row, zero), mu[j])) for j, x in enumerate(answers)]
            for i, each in enumerate(sliding)
        ]
        loads, self.margin = _solved(graph, matrix, [graph.neg(motion.lam[each.row]) for each in sliding])
        friction = [graph.neg(graph.mul(m, load)) for m, load in zip(mu, loads, strict=True)]
        for r in range(len(self.lam)):
            parts = [graph.mul(x[n + r], f) for x, f in zip(answers, friction, strict=True) if n + r in x]
            self.lam[r] = graph.sum([self.lam[r], *parts])
        sums: dict[int, list[int]] = {}
        for column, f in zip(along, friction, strict=True):
            for c, node in column.items():
                sums.setdefault(c, []).append(graph.mul(node, f))
        self.forces = {c: graph.sum(nodes) for c, nodes in sums.items()}


def assemble_friction(equations: Terms, sizes: MotionSizes, sliding: Sequence[Sliding]) -> dict[str, Program]:
    """The program, by its name."""
    lines = Lines(equations)
    nodes = SlidingNodes(lines, sizes, sliding)
    zero = lines.graph.const(0.0)
    program = lines.program("friction_forces", STATE, [nodes.forces.get(c, zero) for c in range(len(equations.free))])
    verify(program, input_lengths(equations))
    return {"friction_forces": program}


def _direction(lines: Lines, sliding: Sliding) -> dict[int, int]:
    """{coordinate: generalised force} of 1 N along the direction in which a contact slides."""
    graph, n = lines.graph, len(lines.equations.free)
    where = f"contact {sliding.name}"
    velocities = [expression_node(lines, where, each) for each in sliding.velocity]
    names = [parameter.name for parameter in lines.equations.parameters]
    unit = [graph.load("p", names.index(name)) for name in sliding.slip]
    if len(unit) > 1:
        side = graph.call("sign", graph.sum([graph.mul(w, d) for w, d in zip(velocities, unit, strict=True)]))
        begun = [graph.mul(graph.const(MIN_SLIDING_VELOCITY), d) for d in unit]
        whole = [graph.add(graph.mul(side, w), d) for w, d in zip(velocities, begun, strict=True)]
        size = graph.call("sqrt", graph.sum([graph.mul(w, w) for w in whole]))
        unit = [graph.div(w, size) for w in whole]
    rates = [graph.load("qd", c) for c in range(n)]
    sums: dict[int, list[int]] = {}
    for velocity, d in zip(velocities, unit, strict=True):
        slopes = gradient(graph, velocity, rates)
        for c, rate in enumerate(rates):
            if rate in slopes:
                sums.setdefault(c, []).append(graph.mul(slopes[rate], d))
    return {c: graph.sum(nodes) for c, nodes in sums.items()}


def _solved(graph: Graph, matrix: list[list[int]], right: list[int]) -> tuple[list[int], int]:
    """The solution of a small system by elimination in the given order, and the product of the pivots."""
    matrix, right = [list(row) for row in matrix], list(right)
    size, product = len(right), graph.const(1.0)
    for k in range(size):
        product = graph.mul(product, matrix[k][k])
        for i in range(k + 1, size):
            factor = graph.div(matrix[i][k], matrix[k][k])
            matrix[i] = [graph.sub(a, graph.mul(factor, b)) for a, b in zip(matrix[i], matrix[k], strict=True)]
            right[i] = graph.sub(right[i], graph.mul(factor, right[k]))
    for k in reversed(range(size)):
        rest = [graph.neg(graph.mul(matrix[k][j], right[j])) for j in range(k + 1, size)]
        right[k] = graph.div(graph.sum([right[k], *rest]), matrix[k][k])
    return right, product
