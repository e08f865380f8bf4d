"""Exact derivatives of operations, as operations of the same graph: forward and reverse sweeps.

A sweep visits every operation below its outputs once. The forward sweep carries one direction through all
outputs; the reverse sweep finds the gradient of one output by everything it depends on.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence

from ncgen.program.ir.functions import FUNCTIONS
from ncgen.program.ir.graph import Graph


def gradient(graph: Graph, output: int, variables: Collection[int]) -> dict[int, int]:
    """{variable: node of ∂output/∂variable} by one reverse sweep; structural zeros stay out."""
    return adjoints(graph, {output: graph.const(1.0)}, variables)


def adjoints(graph: Graph, weights: Mapping[int, int], variables: Collection[int]) -> dict[int, int]:
    """{variable: node of ∂(Σ weight · output)/∂variable} by one reverse sweep at constant weights; structural zeros stay out.

    weights: {output: node of its weight}
    """
    active = _active(graph, weights, variables)
    sensitivities = dict(weights)
    for node in reversed(active):
        if node not in sensitivities or not graph.ops[node].args:
            continue
        for argument, derivative in zip(graph.ops[node].args, slopes(graph, node), strict=True):
            if argument in active:
                product = graph.mul(sensitivities[node], derivative())
                sensitivities[argument] = graph.add(sensitivities[argument], product) if argument in sensitivities else product
    return {v: sensitivities[v] for v in variables if v in sensitivities and graph.value(sensitivities[v]) != 0.0}


def tangent(graph: Graph, outputs: Collection[int], direction: dict[int, int]) -> dict[int, int]:
    """{output: node of its derivative along a direction} by one forward sweep; structural zeros stay out.

    direction: {variable: node of its rate}
    """
    rates = dict(direction)
    for node in _active(graph, outputs, direction):
        if node in rates:
            continue
        parts = [
            graph.mul(derivative(), rates[argument])
            for argument, derivative in zip(graph.ops[node].args, slopes(graph, node), strict=True)
            if argument in rates
        ]
        rates[node] = graph.sum(parts)
    return {output: rates[output] for output in outputs if output in rates and graph.value(rates[output]) != 0.0}


def changes_along(graph: Graph, outputs: Sequence[int], direction: dict[int, int]) -> list[int]:
    """Derivatives along a direction, as `tangent` finds them, one an output: 0 of what does not change."""
    changes = tangent(graph, outputs, direction)
    return [changes.get(output, graph.const(0.0)) for output in outputs]


def slopes(graph: Graph, node: int) -> list[Callable[[], int]]:
    """For every argument of an operation a function that makes the node of ∂operation/∂argument."""
    op = graph.ops[node]
    one = graph.const(1.0)
    match op.code, op.args:
        case "add", _:
            return [lambda: one, lambda: one]
        case "sub", _:
            return [lambda: one, lambda: graph.neg(one)]
        case "neg", _:
            return [lambda: graph.neg(one)]
        case "mul", (a, b):
            return [lambda: b, lambda: a]
        case "div", (_, b):
            return [lambda: graph.div(one, b), lambda: graph.neg(graph.div(node, b))]
        case "pieces", (a,):
            return [lambda: graph.lookup(op.pieces.derivative(), a)]
    return [lambda rule=rule: rule(graph, node, *op.args) for rule in FUNCTIONS[op.code].derivatives]


def _active(graph: Graph, outputs: Iterable[int], variables: Collection[int]) -> dict[int, None]:
    """Operations below the outputs that depend on a variable, arguments first (an ordered set)."""
    active: dict[int, None] = {}
    for node in sorted(graph.below(outputs)):
        if node in variables or any(a in active for a in graph.ops[node].args):
            active[node] = None
    return active
