"""The initial position as a program of the parameters, for models whose positions have some.

start(p)      q of the position that the user described with these parameters (n)
start_p(p)    its derivatives (n × parameters), row by row

described(t, p)    the same of any components, fixed ones too
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

from ncgen.model.elements import Component
from ncgen.model.values import Value, as_sympy, is_number
from ncgen.program.ir.blocks import Program, written
from ncgen.program.ir.derivatives import gradient
from ncgen.program.ir.finishing import finish
from ncgen.program.ir.graph import Graph
from ncgen.program.ir.lower import lower_value
from ncgen.symbolic.numbering import Numbering


def assemble_start(numbering: Numbering) -> tuple[Program, Program]:
    """The two programs."""
    graph = Graph()
    parameters, nodes = _nodes(graph, numbering, numbering.free)
    slopes = [gradient(graph, node, parameters.values()) for node in nodes]
    zero = graph.const(0.0)
    entries = [row.get(p, zero) for row in slopes for p in parameters.values()]
    slopes = _program("start_p", graph, entries)
    (block,) = slopes.blocks  # what is not written is 0, as most derivatives are
    kept = tuple(store for store in block.stores if block.ops[store.node].leaf != 0.0)
    return _program("start", graph, nodes), replace(slopes, blocks=(finish(replace(block, stores=kept)),))


def assemble_described(numbering: Numbering, components: Iterable[Component]) -> Program:
    """The program of these components; like every kernel it is given the time."""
    graph = Graph()
    return _program("described", graph, _nodes(graph, numbering, components)[1], ("t", "p"))


def _nodes(graph: Graph, numbering: Numbering, components: Iterable[Component]) -> tuple[dict[str, int], list[int]]:
    """Nodes of the parameters by name, and of the components' values in the initial position."""
    parameters = {p.name: graph.load("p", i) for i, p in enumerate(numbering.parameters)}
    return parameters, [_node(graph, c.value, parameters) for c in components]


def _node(graph: Graph, value: Value, parameters: dict[str, int]) -> int:
    return graph.const(float(value)) if is_number(value) else lower_value(graph, as_sympy(value), parameters)


def _program(name: str, graph: Graph, nodes: Sequence[int], inputs: tuple[str, ...] = ("p",)) -> Program:
    return Program(name, inputs, name, len(nodes), (finish(written(graph, name, nodes)),))
