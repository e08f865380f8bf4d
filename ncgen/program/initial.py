"""The initial position as a program of the parameters, for models whose positions have some.

start(p)      q of the position that the user described with these parameters (n)
start_p(p)    its derivatives (n × parameters), row by row
"""

from __future__ import annotations

from ncgen.model.values import Value, as_sympy, is_number
from ncgen.program import passes
from ncgen.program.blocks import Program, Store, Straight
from ncgen.program.derivatives import gradient
from ncgen.program.graph import Graph
from ncgen.program.lower import lower_value
from ncgen.symbolic.numbering import Numbering


def assemble_start(numbering: Numbering) -> tuple[Program, Program]:
    """The two programs."""
    graph = Graph()
    parameters = {p.name: graph.load("p", i) for i, p in enumerate(numbering.parameters)}
    nodes = [_node(graph, c.value, parameters) for c in numbering.free]
    slopes = [gradient(graph, node, parameters.values()) for node in nodes]
    zero = graph.const(0.0)
    entries = [row.get(p, zero) for row in slopes for p in parameters.values()]
    return _program("start", graph, nodes), _program("start_p", graph, entries)


def _node(graph: Graph, value: Value, parameters: dict[str, int]) -> int:
    return graph.const(float(value)) if is_number(value) else lower_value(graph, as_sympy(value), parameters)


def _program(name: str, graph: Graph, nodes: list[int]) -> Program:
    """What is not written is 0: most derivatives are."""
    stores = tuple(Store(name, k, node) for k, node in enumerate(nodes) if graph.value(node) != 0.0)
    return Program(name, ("p",), name, len(nodes), (passes.finish(Straight(tuple(graph.ops), stores)),))
