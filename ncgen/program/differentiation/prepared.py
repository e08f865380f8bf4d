"""What depends on parameters alone, taken out of programs: it is computed once when parameters change.

    prepared(p)       -> numbers
    f(t, q, …, p)     reads [p, numbers] in the place of p

Inputs stand in p, too, and change all the time: what depends on them stays where it is.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from ncgen.program.differentiation.differentiated import reads, written_out
from ncgen.program.differentiation.identities import simplified
from ncgen.program.ir.blocks import Program, written
from ncgen.program.ir.factoring import factored
from ncgen.program.ir.graph import Graph, Op
from ncgen.program.ir.multiples import is_known, spread
from ncgen.program.ir.passes import dead_code, unroll
from ncgen.program.lines import line
from ncgen.symbolic.numbering import Terms


def take_out(drafts: Sequence[Program], equations: Terms) -> tuple[Program | None, list[Program]]:
    """`prepared`, None where there is nothing to prepare, and the straight lines that rely on it."""
    graph = Graph()
    outputs = [written_out(graph, draft, reads(draft, equations))[1] for draft in drafts]
    inputs = {p.name for p in equations.model.inputs.values()}
    defaults = [p.default for p in equations.parameters if p.name not in inputs]  # inputs are the last numbers of p
    frontier: list[int] = []
    if _frontier(graph, len(defaults), outputs):
        graph, outputs = _rearranged(graph, outputs, defaults)
        frontier = _frontier(graph, len(defaults), outputs)
    made = []
    index = {node: len(equations.parameters) + k for k, node in enumerate(frontier)}
    for draft, nodes in zip(drafts, outputs, strict=True):
        rest, new = _without(graph, nodes, index)
        made.append(line(rest, draft.name, draft.inputs, [new[node] for node in nodes], equations, draft.phases))
    return line(graph, "prepared", ("p",), frontier, equations) if frontier else None, made


def _rearranged(graph: Graph, outputs: Sequence[Sequence[int]], defaults: Sequence[float]) -> tuple[Graph, list[list[int]]]:
    """Known factors in sums of known multiples, others together, and common ones outside, as long as that leaves fewer operations."""
    if changes := spread(graph.ops, [node for nodes in outputs for node in nodes], len(defaults)):
        graph, new = changes
        outputs = [[new[node] for node in nodes] for nodes in outputs]
    least = len(graph.ops)  # of operations that are not known
    while True:
        graph, outputs = simplified(graph, outputs, defaults)
        block = factored(dead_code(written(graph, "", [node for nodes in outputs for node in nodes])), len(defaults))
        count = _known(block.ops, len(defaults)).count(False)
        if count >= least:
            return graph, outputs
        least, graph = count, Graph()
        new = unroll(graph, block, 0)
        stores = iter(block.stores)
        outputs = [[new[next(stores).node] for _ in nodes] for nodes in outputs]


def _known(ops: Sequence[Op], parameters: int) -> list[bool]:
    known: list[bool] = []
    for op in ops:
        known.append(is_known(op, [known[a] for a in op.args], parameters))
    return known


def _frontier(graph: Graph, parameters: int, outputs: Sequence[Sequence[int]]) -> list[int]:
    """What depends on parameters alone and is computed, and read by what does not, or by nobody but a store."""
    known = _known(graph.ops, parameters)
    stored = [node for nodes in outputs for node in nodes]
    frontier: set[int] = {node for node in stored if known[node]}
    for node in graph.below(stored):
        if not known[node]:
            frontier.update(a for a in graph.ops[node].args if known[a])
    return sorted(node for node in frontier if graph.ops[node].args)


def _without(graph: Graph, outputs: Sequence[int], index: Mapping[int, int]) -> tuple[Graph, dict[int, int]]:
    """A graph that loads what is prepared from its place in p, and its nodes for those of the other one."""
    rest, new = Graph(), dict[int, int]()
    for node in sorted(graph.below(outputs, index)):
        op = graph.ops[node]
        if node in index:
            new[node] = rest.load("p", index[node])
        elif op.code == "load":
            new[node] = rest.load(*op.input)
        else:
            new[node] = rest.const(op.value) if op.code == "const" else rest.apply(op, tuple(new[a] for a in op.args))
    return rest, new
