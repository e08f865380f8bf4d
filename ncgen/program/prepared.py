"""What depends on parameters alone, taken out of programs: it is computed once when parameters change.

    prepared(p)       -> numbers
    f(t, q, …, p)     reads [p, numbers] in the place of p

Inputs stand in p, too, and change all the time: what depends on them stays where it is.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from ncgen.program.blocks import Program
from ncgen.program.differentiated import reads, written_out
from ncgen.program.graph import Graph
from ncgen.program.lines import line
from ncgen.symbolic.numbering import Terms


def take_out(programs: Sequence[Program], equations: Terms) -> tuple[Program | None, list[Program]]:
    """`prepared`, None where there is nothing to prepare, and the straight lines that rely on it."""
    graph = Graph()
    outputs = [written_out(graph, program, reads(program, equations))[1] for program in programs]
    known = _known(graph, len(equations.parameters) - len(equations.model.inputs))
    frontier = _frontier(graph, known, [node for nodes in outputs for node in nodes])
    if not frontier:
        return None, list(programs)
    made = []
    place = {node: len(equations.parameters) + k for k, node in enumerate(frontier)}
    for program, nodes in zip(programs, outputs, strict=True):
        rest, new = _without(graph, nodes, place)
        made.append(line(rest, program.name, program.inputs, [new[node] for node in nodes], equations))
    return line(graph, "prepared", ("p",), frontier, equations), made


def _known(graph: Graph, parameters: int) -> list[bool]:
    """Of every operation: does it depend on nothing but parameters?"""
    known: list[bool] = []
    for op in graph.ops:
        is_leaf = op.code == "const" or (op.code == "load" and op.input.array == "p" and op.input.position < parameters)
        known.append(is_leaf or (bool(op.args) and all(known[a] for a in op.args)))
    return known


def _frontier(graph: Graph, known: Sequence[bool], outputs: Sequence[int]) -> list[int]:
    """What is known and computed, and read by what is not known, or by nobody but a store."""
    found: set[int] = {node for node in outputs if known[node]}
    for node in graph.below(outputs):
        if not known[node]:
            found.update(a for a in graph.ops[node].args if known[a])
    return sorted(node for node in found if graph.ops[node].args)


def _without(graph: Graph, outputs: Sequence[int], place: Mapping[int, int]) -> tuple[Graph, dict[int, int]]:
    """A graph that loads what is prepared from its place in p, and its nodes for those of the other one."""
    rest, new = Graph(), dict[int, int]()
    for node in sorted(graph.below(outputs, place)):
        op = graph.ops[node]
        if node in place:
            new[node] = rest.load("p", place[node])
        elif op.code == "load":
            new[node] = rest.load(*op.input)
        else:
            new[node] = rest.const(op.value) if op.code == "const" else rest.apply(op, tuple(new[a] for a in op.args))
    return rest, new
