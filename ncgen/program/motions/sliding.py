"""Friction of contacts and joints that slide, as programs: its force is the coefficient times a load, which depends on the forces.

friction_forces(t, q, qd, p)  -> generalised forces (n) of all contacts and joints that slide

The loads N of the k gaps are affine in the friction forces F: N = N0 − L F, L being the multipliers of the gaps for a force of 1 N along
each direction of sliding. With F = −μ N they follow from (1 − L μ) N = N0.

The constraint that presses a joint may push and pull: F = −μ |N| = −μ s N, s being the sign of N. From all s = 1 on, the first s that does
not agree with its load is changed, 2ᵏ − 1 times at most: the method of least indices (K. G. Murty, Linear Complementarity, 1988), which
finds the one solution that there is if and only if the determinants of all 2ᵏ combinations of signs are positive.

Two constraints that press a joint at a right angle make N = √(λ² + λ'²). With λ = λ0 − a N, a being the coefficient times the multiplier
for a force of 1 N, this is (1 − |a|²) N² + 2 λ0·a N − |λ0|² = 0, which has exactly one N ≥ 0 for any λ0 if and only if |a| < 1.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

from ncgen.model.values import Scalar
from ncgen.program.algebra.elimination import solve_in_order
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

BEGINNING = 1e-11
"""A sliding velocity in space far below this share of the length of `slip` counts as having that direction: friction turns the velocity the
faster the smaller it is, and integrators could not follow from rest on."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Sliding:
    """A contact or joint that slides. row: number of the constraint whose load presses; friction: coefficient

    velocity: its sliding velocity (m/s), one expression in the plane, two in space; slip: as of `Contact`
    is_joint: whether the load may push and pull; across: number of another constraint, with which the load is √(λ² + λ'²)
    may_rest: whether its slip may be zero, where there is no friction of it, and numbers may be of single precision, as in exports
    """

    name: str
    row: int
    friction: Scalar
    velocity: tuple[Scalar, ...]
    slip: tuple[str, ...]
    is_joint: bool = False
    across: int | None = None
    may_rest: bool = False

    @property
    def words(self) -> str:
        """What messages call it."""
        return f"{'friction' if self.is_joint else 'contact'} {self.name}"


class SlidingNodes:
    """Accelerations and multipliers with friction. lam (m): nodes; forces {coordinate: node}; margin: a node that is positive where the
    loads are determined

    motion: without friction; columns: of each what slides {coordinate: node} of its force for a multiplier of 1, but for the sign; signs,
    loads: nodes; friction: of the force along each
    """

    def __init__(self, lines: Lines, sizes: MotionSizes, sliding: Sequence[Sliding]) -> None:
        graph, n = lines.graph, len(lines.equations.free)
        self.motion = motion = AccelerationNodes(lines, sizes)
        self.lam, zero, one = list(motion.lam), graph.const(0.0), graph.const(1.0)
        along = [_direction(lines, each) for each in sliding]
        answers = [motion.saddle.refined(column) for column in along]
        mu = [expression_node(lines, each.words, each.friction) for each in sliding]
        if sliding[0].across is not None:
            rows = [sliding[0].row, sliding[0].across]
            per_load = [graph.mul(mu[0], answers[0].get(n + row, zero)) for row in rows]
            load, self.margin = _root_load(graph, [motion.lam[row] for row in rows], per_load)
            self._apply(graph, n, along, answers, [graph.neg(graph.mul(mu[0], load))])
            return
        shares = [[graph.mul(x.get(n + each.row, zero), m) for x, m in zip(answers, mu, strict=True)] for each in sliding]
        joints = [k for k, each in enumerate(sliding) if each.is_joint]

        def matrix(signs: Sequence[int]) -> list[list[int]]:
            return [
                [graph.sub(one if i == j else zero, graph.mul(factor, s)) for j, (factor, s) in enumerate(zip(row, signs, strict=True))]
                for i, row in enumerate(shares)
            ]

        def solved(signs: Sequence[int]) -> tuple[list[int], int]:
            return solve_in_order(graph, matrix(signs), [graph.neg(motion.lam[each.row]) for each in sliding])

        signs = [one] * len(sliding)
        for _ in range(2 ** len(joints) - 1):
            signs = _corrected(graph, signs, solved(signs)[0], joints)
        loads, _ = solved(signs)
        sides = [[one, graph.const(-1.0)] if each.is_joint else [one] for each in sliding]
        self.margin = _least(graph, [solved(combination)[1] for combination in product(*sides)])
        friction = [graph.neg(graph.mul(m, graph.mul(s, load))) for m, s, load in zip(mu, signs, loads, strict=True)]
        self._apply(graph, n, along, answers, friction)
        self.rows, self.answers, self.signs, self.loads, self.friction = [n + s.row for s in sliding], answers, signs, loads, friction
        self.columns = [{c: graph.mul(node, m) for c, node in column.items()} for column, m in zip(along, mu, strict=True)]
        self.mu, self.matrix = mu, matrix(signs)

    def _apply(
        self, graph: Graph, n: int, along: Sequence[dict[int, int]], answers: Sequence[dict[int, int]], friction: Sequence[int]
    ) -> None:
        """Add friction forces to the multipliers, and note the generalised forces."""
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
    velocities = [expression_node(lines, sliding.words, each) for each in sliding.velocity]
    names = [parameter.name for parameter in lines.equations.parameters]
    unit = [graph.load("p", names.index(name)) for name in sliding.slip]
    if len(unit) > 1:
        side = graph.call("sign", graph.sum([graph.mul(w, d) for w, d in zip(velocities, unit, strict=True)]))
        begun = [graph.mul(graph.const(BEGINNING), d) for d in unit]
        whole = [graph.add(graph.mul(side, w), d) for w, d in zip(velocities, begun, strict=True)]
        squares = [graph.mul(w, w) for w in whole]
        if sliding.may_rest:  # 0 / 1, not 0 / 0
            slips = graph.call("sign", graph.sum([graph.call("abs", d) for d in unit]))
            squares.append(graph.sub(graph.const(1.0), slips))
        size = graph.call("sqrt", graph.sum(squares))
        unit = [graph.div(w, size) for w in whole]
    rates = [graph.load("qd", c) for c in range(n)]
    sums: dict[int, list[int]] = {}
    for velocity, d in zip(velocities, unit, strict=True):
        derivatives = gradient(graph, velocity, rates)
        for c, rate in enumerate(rates):
            if rate in derivatives:
                sums.setdefault(c, []).append(graph.mul(derivatives[rate], d))
    return {c: graph.sum(nodes) for c, nodes in sums.items()}


def _corrected(graph: Graph, signs: Sequence[int], loads: Sequence[int], joints: Sequence[int]) -> list[int]:
    """The signs of loads (1 or −1), the first one of a joint that does not agree with its load being changed."""
    one, two, half = graph.const(1.0), graph.const(2.0), graph.const(0.5)
    corrected, before = list(signs), one  # before: 1 as long as all agree, then 0
    for k in joints:
        side = graph.call("sign", graph.mul(signs[k], loads[k]))
        side = graph.call("sign", graph.add(graph.mul(two, side), one))  # a load of 0 agrees
        corrected[k] = graph.mul(signs[k], graph.add(one, graph.mul(before, graph.sub(side, one))))
        before = graph.mul(before, graph.mul(half, graph.add(one, side)))
    return corrected


def _root_load(graph: Graph, plain: Sequence[int], per_load: Sequence[int]) -> tuple[int, int]:
    """N = √Σ(λ0 − a N)², and 1 − |a|². plain: λ0; per_load: a"""
    B = graph.sum([graph.mul(x, a) for x, a in zip(plain, per_load, strict=True)])
    C = graph.sum([graph.mul(x, x) for x in plain])
    A = graph.sub(graph.const(1.0), graph.sum([graph.mul(a, a) for a in per_load]))
    square = graph.add(graph.mul(B, B), graph.mul(A, C))
    root = graph.call("sqrt", graph.call("abs", square))  # below 0 only where the load is not determined
    return graph.div(graph.sub(root, B), A), A


def _least(graph: Graph, nodes: Sequence[int]) -> int:
    """The least of some nodes."""
    least = nodes[0]
    for node in nodes[1:]:
        difference = graph.call("abs", graph.sub(least, node))
        least = graph.mul(graph.const(0.5), graph.sub(graph.add(least, node), difference))
    return least
