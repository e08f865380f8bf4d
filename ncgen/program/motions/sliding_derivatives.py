"""Derivatives of the friction of what slides, and of a motion with it, as programs.

friction_tangent(t, q, qd, p, seed)  -> how friction_forces (n) change with seed = [dq; dq̇; dp]
friction_adjoint(t, q, qd, p, bar)   -> how the sum of bar times them changes with [q; q̇; p]

The solution x = [q̈; λ] of A x = b + Σ c_k s_k x_k, in which the friction of each k follows its multiplier x_k, changes by
(A − Σ c_k s_k eₖᵀ) dx = db − dA x + Σ dc_k s_k x_k: the factors of A and the small matrix of loads serve again. Signs are held.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from ncgen.errors import ModelError
from ncgen.program.algebra.elimination import solve_in_order
from ncgen.program.assemble import input_lengths
from ncgen.program.differentiation.differentiated import BAR, SEED, adjoint_of, tangent_of
from ncgen.program.ir.blocks import Program
from ncgen.program.ir.derivatives import adjoints, tangent
from ncgen.program.ir.graph import Graph
from ncgen.program.ir.inlined import inlined
from ncgen.program.ir.verify import verify
from ncgen.program.lines import Lines, line
from ncgen.program.motions.full_motion import MotionSizes
from ncgen.program.motions.multipliers import STATE
from ncgen.program.motions.sliding import Sliding, SlidingNodes
from ncgen.symbolic.numbering import Terms

Sums = dict[int, list[int]]
"""{place: nodes to be added up}."""


class SlidingDerivatives:
    """Of friction in a graph."""

    def __init__(self, lines: Lines, nodes: SlidingNodes) -> None:
        self._graph, self._nodes, motion = lines.graph, nodes, nodes.motion
        self._right, self._A, self._n = motion.right, motion.saddle.A, motion.n
        self._signed = [lines.graph.mul(s, lines.graph.neg(load)) for s, load in zip(nodes.signs, nodes.loads, strict=True)]
        self._x = dict(motion.x)
        for answer, force in zip(nodes.answers, nodes.friction, strict=True):
            for i, node in answer.items():
                product = lines.graph.mul(node, force)
                self._x[i] = lines.graph.add(self._x[i], product) if i in self._x else product

    def along(self, changes: Mapping[int, int]) -> tuple[dict[int, int], dict[int, int]]:
        """How x {place: node} and the forces {coordinate: node} change where inputs of the graph do. changes: {input: its change}"""
        graph, nodes, by_force = self._graph, self._nodes, Sums()
        parts = [*self._right.values(), *self._A.values(), *(node for column in nodes.columns for node in column.values())]
        moved = tangent(graph, parts, dict(changes))
        for column, size in zip(nodes.columns, self._signed, strict=True):
            for c, node in column.items():
                if node in moved:
                    by_force.setdefault(c, []).append(graph.mul(moved[node], size))
        right = Sums({i: list(each) for i, each in by_force.items()})
        for i, node in self._right.items():
            if node in moved:
                right.setdefault(i, []).append(moved[node])
        for (i, j), node in sorted(self._A.items()):
            if node in moved and j in self._x:
                right.setdefault(i, []).append(graph.neg(graph.mul(moved[node], self._x[j])))
        first, zero = nodes.motion.saddle.refined(_added(graph, right)), graph.const(0.0)
        multipliers, _ = solve_in_order(graph, nodes.matrix, [first.get(row, zero) for row in nodes.rows])
        x = Sums({i: [node] for i, node in first.items()})
        for answer, column, m, s, change in zip(nodes.answers, nodes.columns, nodes.mu, nodes.signs, multipliers, strict=True):
            size = graph.mul(s, change)
            for i, node in answer.items():
                x.setdefault(i, []).append(graph.mul(node, graph.mul(m, size)))
            for c, node in column.items():
                by_force.setdefault(c, []).append(graph.mul(node, size))
        return _added(graph, x), _added(graph, by_force)

    def back(self, weights: Sequence[int], variables: Sequence[int]) -> list[int]:
        """How the sum of weights (n) times the forces changes with variables of the graph."""
        graph, nodes = self._graph, self._nodes
        weighted = [graph.sum([graph.mul(weights[c], node) for c, node in column.items()]) for column in nodes.columns]
        transposed = [list(row) for row in zip(*nodes.matrix, strict=True)]
        shares, _ = solve_in_order(graph, transposed, [graph.mul(s, each) for s, each in zip(nodes.signs, weighted, strict=True)])
        right = Sums()
        for row, coefficient in zip(nodes.rows, shares, strict=True):
            right.setdefault(row, []).append(coefficient)
        v, sums = nodes.motion.saddle.refined(_added(graph, right)), Sums()
        for i, node in self._right.items():
            if i in v:
                sums.setdefault(node, []).append(v[i])
        for (i, j), node in sorted(self._A.items()):
            if i in v and j in self._x:
                sums.setdefault(node, []).append(graph.neg(graph.mul(v[i], self._x[j])))
        for column, size in zip(nodes.columns, self._signed, strict=True):
            for c, node in column.items():
                weight = graph.add(weights[c], v[c]) if c in v else weights[c]
                sums.setdefault(node, []).append(graph.mul(weight, size))
        derivatives = adjoints(graph, _added(graph, sums), variables)
        return [derivatives.get(variable, graph.const(0.0)) for variable in variables]


def assemble_friction_derivatives(equations: Terms, sizes: MotionSizes, sliding: Sequence[Sliding]) -> dict[str, Program]:
    """Both programs, by their names; arguments as of `assemble_friction`. Raises ModelError for a load that is the root of squares."""
    if sliding[0].across is not None:
        raise ModelError(
            f"{sliding[0].words}: friction with across has no derivatives yet; take an explicit method, and differences of runs"
        )
    programs, n, count = {}, len(equations.free), len(equations.parameters)
    for name, more, size in (("friction_tangent", SEED, 2 * n + count), ("friction_adjoint", BAR, n)):
        lines = Lines(equations)
        graph = lines.graph
        inputs = [graph.load(array, k) for array, length in (("q", n), ("qd", n), ("p", count)) for k in range(length)]
        derivatives = SlidingDerivatives(lines, SlidingNodes(lines, sizes, sliding))
        loads = [graph.load(more, k) for k in range(size)]
        if more == SEED:
            _, forces = derivatives.along(dict(zip(inputs, loads, strict=True)))
            outputs = [forces.get(c, graph.const(0.0)) for c in range(n)]
        else:
            outputs = derivatives.back(loads, inputs)
        programs[name] = lines.program(name, (*STATE, more), outputs)
        verify(programs[name], input_lengths(equations) | {more: size})
    return programs


def with_friction(derivative: Program, friction: Mapping[str, Program], equations: Terms, kind: str, prepared: int) -> Program:
    """The derivative (kind "tangent" or "adjoint") of a motion's forced `derivative` where its forces are friction.

    friction: `friction_forces` and its derivatives; prepared: how many numbers follow the parameters in p
    """
    graph, n, count = Graph(), len(equations.free), len(equations.parameters)
    lengths = {"t": 1, "q": n, "qd": n, "p": count + prepared, SEED: 2 * n + count + prepared, BAR: 2 * n}
    reads = {array: [graph.load(array, k) for k in range(length)] for array, length in lengths.items()}
    forces = {"forces": inlined(graph, friction["friction_forces"], reads)}
    if kind == "tangent":
        program, seed = tangent_of(derivative, equations, 2 * n, prepared), reads[SEED]
        changes = inlined(graph, friction["friction_tangent"], reads | {SEED: seed[: 2 * n + count]})
        outputs, more = inlined(graph, program, reads | forces | {SEED: [*seed[: 2 * n], *changes, *seed[2 * n :]]}), SEED
    else:
        program, more = adjoint_of(derivative, equations, 2 * n, prepared), BAR
        whole = inlined(graph, program, reads | forces)
        outputs = [*whole[: 2 * n], *whole[3 * n :]]
        parts = inlined(graph, friction["friction_adjoint"], reads | {BAR: whole[2 * n : 3 * n]})
        outputs[: len(parts)] = [graph.add(a, b) for a, b in zip(outputs, parts, strict=False)]
    made = line(graph, program.name, (*STATE, more), outputs, equations)
    verify(made, {array: lengths[array] for array in (*STATE, more)})
    return made


def _added(graph: Graph, sums: Sums) -> dict[int, int]:
    return {position: graph.sum(nodes) for position, nodes in sums.items()}
