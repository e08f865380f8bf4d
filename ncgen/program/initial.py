"""The initial position as a program of the parameters, for models whose positions have some.

start(p)      q of the position that the user described with these parameters (n)
start_p(p)    its derivatives (n × parameters), row by row

described(t, p)    the same of any components, fixed ones too
values(p)          any values that depend on parameters alone
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

from ncgen.model import Model
from ncgen.model.elements import Component
from ncgen.model.values import Parameter, Value, as_sympy, is_number
from ncgen.program.ir.blocks import Program, written
from ncgen.program.ir.derivatives import gradient
from ncgen.program.ir.finishing import finish
from ncgen.program.ir.graph import Graph
from ncgen.symbolic.numbering import Numbering


def assemble_start(numbering: Numbering) -> tuple[Program, Program]:
    """The two programs."""
    graph = Graph()
    parameters, nodes = _nodes(graph, numbering.model, [c.value for c in numbering.free])
    derivatives = [gradient(graph, node, parameters.values()) for node in nodes]
    zero = graph.const(0.0)
    entries = [row.get(p, zero) for row in derivatives for p in parameters.values()]
    derivatives = _program("start_p", graph, entries)
    (block,) = derivatives.blocks  # what is not written is 0, as most derivatives are
    kept = tuple(store for store in block.stores if block.ops[store.node].leaf != 0.0)
    return _program("start", graph, nodes), replace(derivatives, blocks=(finish(replace(block, stores=kept)),))


def assemble_described(numbering: Numbering, components: Iterable[Component]) -> Program:
    """The program of these components; like every kernel it is given the time."""
    graph = Graph()
    return _program("described", graph, _nodes(graph, numbering.model, [c.value for c in components])[1], ("t", "p"))


def assemble_values(model: Model, values: Iterable[Value]) -> Program:
    """The program of these values of a model."""
    graph = Graph()
    return _program("values", graph, _nodes(graph, model, values)[1])


def _nodes(graph: Graph, model: Model, values: Iterable[Value]) -> tuple[dict[str, int], list[int]]:
    """Nodes of the parameters by name, and of the values."""
    parameters = {name: graph.load("p", i) for i, name in enumerate(model.numbers)}
    return parameters, [_node(graph, value, parameters) for value in values]


def _node(graph: Graph, value: Value, parameters: dict[str, int]) -> int:
    if isinstance(value, Parameter):
        return parameters[value.name]
    if is_number(value):
        return graph.const(float(value))
    from ncgen.program.ir.lower import lower_value  # it loads sympy, which expressions have loaded

    return lower_value(graph, as_sympy(value), parameters)


def _program(name: str, graph: Graph, nodes: Sequence[int], inputs: tuple[str, ...] = ("p",)) -> Program:
    return Program(name=name, inputs=inputs, output=name, size=len(nodes), blocks=(finish(written(graph, name, nodes)),))
