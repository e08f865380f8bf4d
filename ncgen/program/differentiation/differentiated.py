"""A program's derivatives as programs: along a direction, and transposed.

    f(t, q, …)                  -> out
    f_tangent(t, q, …, seed)    -> how the first outputs change with seed: changes of q, … one after the other
    f_adjoint(t, q, …, bar)     -> how the sum of bar times the first outputs changes with q, … one after the other

Time is held. Both contain as much of f as slopes need, and compute once what they have in common.
"""

from __future__ import annotations

from collections.abc import Mapping

from ncgen.program.ir.blocks import Program
from ncgen.program.ir.derivatives import adjoints, changes_along
from ncgen.program.ir.graph import Graph
from ncgen.program.ir.inlined import inlined
from ncgen.program.ir.verify import verify
from ncgen.program.lines import line
from ncgen.symbolic.numbering import Terms

SEED, BAR = "seed", "bar"


def tangent_of(program: Program, equations: Terms, outputs: int, prepared: int = 0) -> Program:
    """f_tangent of the first outputs. prepared: how many numbers follow the parameters in p"""
    graph, lengths = Graph(), reads(program, equations, prepared)
    moved, nodes = written_out(graph, program, lengths)
    changes = changes_along(graph, nodes[:outputs], {node: graph.load(SEED, k) for k, node in enumerate(moved)})
    made = line(graph, f"{program.name}_tangent", (*program.inputs, SEED), changes, equations)
    verify(made, {**lengths, SEED: len(moved)})
    return made


def adjoint_of(program: Program, equations: Terms, outputs: int, prepared: int = 0) -> Program:
    """f_adjoint of the first outputs. prepared: how many numbers follow the parameters in p"""
    graph, lengths = Graph(), reads(program, equations, prepared)
    moved, nodes = written_out(graph, program, lengths)
    weights: dict[int, int] = {}
    for k, node in enumerate(nodes[:outputs]):
        bar = graph.load(BAR, k)
        weights[node] = graph.add(weights[node], bar) if node in weights else bar
    gradients = adjoints(graph, weights, moved)
    derivatives = [gradients.get(node, graph.const(0.0)) for node in moved]
    made = line(graph, f"{program.name}_adjoint", (*program.inputs, BAR), derivatives, equations)
    verify(made, {**lengths, BAR: outputs})
    return made


def reads(program: Program, equations: Terms, prepared: int = 0) -> dict[str, int]:
    """{array: length} of what a program reads."""
    n = len(equations.free)
    lengths = {"t": 1, "q": n, "qd": n, "qdd": n, "forces": n, "rates": n, "p": len(equations.parameters) + prepared}
    return {array: lengths[array] for array in program.inputs}


def written_out(graph: Graph, program: Program, lengths: Mapping[str, int]) -> tuple[list[int], list[int]]:
    """A program in a graph of its own: loads of all that it reads but time, and the nodes of its outputs."""
    inputs = {array: [graph.load(array, k) for k in range(length)] for array, length in lengths.items()}
    return [node for array, nodes in inputs.items() if array != "t" for node in nodes], inlined(graph, program, inputs)
