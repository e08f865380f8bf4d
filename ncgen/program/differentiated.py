"""A program's derivatives as programs: along a direction, and transposed.

    f(t, q, …)                  -> out
    f_tangent(t, q, …, seed)    -> how the first outputs change with seed: changes of q, … one after the other
    f_adjoint(t, q, …, bar)     -> how the sum of bar times the first outputs changes with q, … one after the other

Time is held. Both contain as much of f as slopes need, and compute once what they have in common.
"""

from __future__ import annotations

from collections.abc import Mapping

from ncgen.program.angles import SHARED
from ncgen.program.blocks import Block, Program, Straight
from ncgen.program.cut import KEPT
from ncgen.program.derivatives import adjoints, tangent
from ncgen.program.graph import Graph
from ncgen.program.lines import line
from ncgen.program.verify import verify
from ncgen.symbolic.numbering import Terms

SEED, BAR = "seed", "bar"


def tangent_of(program: Program, equations: Terms, outputs: int, prepared: int = 0) -> Program:
    """f_tangent of the first outputs of a straight line. prepared: how many numbers follow the parameters in p"""
    graph, sizes = Graph(), _sizes(program, equations, prepared)
    nodes, moved = written_out(program, graph), _loads(graph, sizes)
    found = tangent(graph, nodes[:outputs], {node: graph.load(SEED, k) for k, node in enumerate(moved)})
    changes = [found.get(node, graph.const(0.0)) for node in nodes[:outputs]]
    made = line(graph, f"{program.name}_tangent", (*program.inputs, SEED), changes, equations)
    verify(made, {"t": 1, **sizes, SEED: len(moved)})
    return made


def adjoint_of(program: Program, equations: Terms, outputs: int, prepared: int = 0) -> Program:
    """f_adjoint of the first outputs of a straight line. prepared: how many numbers follow the parameters in p"""
    graph, sizes = Graph(), _sizes(program, equations, prepared)
    nodes, moved = written_out(program, graph), _loads(graph, sizes)
    weights: dict[int, int] = {}
    for k, node in enumerate(nodes[:outputs]):
        bar = graph.load(BAR, k)
        weights[node] = graph.add(weights[node], bar) if node in weights else bar
    found = adjoints(graph, weights, moved)
    slopes = [found.get(node, graph.const(0.0)) for node in moved]
    made = line(graph, f"{program.name}_adjoint", (*program.inputs, BAR), slopes, equations)
    verify(made, {"t": 1, **sizes, BAR: outputs})
    return made


def written_out(program: Program, graph: Graph) -> list[int]:
    """A straight line, cut or not, in a graph where it reads its inputs alone: the nodes of its outputs."""
    known = {(array, k): graph.call(name, graph.load("q", q)) for name, array in SHARED.items() for k, q in enumerate(program.angles)}
    outputs = [graph.const(0.0)] * program.size
    for block in program.blocks:
        assert isinstance(block, Straight), f"{program.name} is no straight line"
        nodes = _nodes(graph, block, known)
        for store in block.stores:
            if store.array == KEPT:
                known[KEPT, store.index] = nodes[store.node]
            else:
                outputs[store.index] = nodes[store.node]
    return outputs


def _nodes(graph: Graph, block: Block, known: Mapping[tuple[str, int], int]) -> list[int]:
    """The operations of a straight block in another graph; known: nodes of what it reads from arrays in between."""
    nodes: list[int] = []
    for op in block.ops:
        if op.code == "load":
            nodes.append(known[op.input] if op.input in known else graph.load(*op.input))
        else:
            nodes.append(graph.const(op.value) if op.code == "const" else graph.apply(op, tuple(nodes[a] for a in op.args)))
    return nodes


def _sizes(program: Program, equations: Terms, prepared: int) -> dict[str, int]:
    """Lengths of all arrays that a program reads."""
    n = len(equations.free)
    lengths = {"q": n, "qd": n, "qdd": n, "p": len(equations.parameters) + prepared}
    return {array: lengths[array] for array in program.inputs if array != "t"}


def _loads(graph: Graph, sizes: Mapping[str, int]) -> list[int]:
    return [graph.load(array, k) for array, size in sizes.items() for k in range(size)]
