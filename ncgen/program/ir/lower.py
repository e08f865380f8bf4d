"""From sympy expressions to operations: one pass over the expression, no simplification by sympy.

Sums are taken in the order of their sort keys, with what is subtracted last; products multiply their
data first, so that constants meet constants.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from functools import cache
from typing import TYPE_CHECKING, TypeAlias, cast

from ncgen.errors import ModelError, shown
from ncgen.model.expressions import symbols_in
from ncgen.model.lookups import pieces_in
from ncgen.model.names import TIME
from ncgen.program.ir.catalogued import Operations, catalogued
from ncgen.program.ir.functions import FUNCTIONS
from ncgen.program.ir.graph import Graph, Op
from ncgen.symbolic.templates import Template, TemplateOutput, rate_name

if TYPE_CHECKING:
    import sympy

SIMPLE = 2**53
"""Integers below this are doubles."""

Nodes: TypeAlias = "dict[sympy.Expr, int]"
"""{expression: its node}, of symbols to begin with."""

BY_SYMPY_NAME = {function.sympy: name for name, function in FUNCTIONS.items()}


class LoweredTemplate:
    """A template as operations over slots: replayed into a graph wherever the template is used.

    slots: {symbol name: slot number} for scalars, their rates, data and time
    known: its operations and {output: node}, where they need not be derived
    """

    def __init__(self, template: Template, known: Operations | None = None) -> None:
        names = [*template.scalars, *map(rate_name, template.scalars), *template.data, TIME]
        self.slots = {name: i for i, name in enumerate(names)}
        if known is not None:
            self.ops, self.outputs = known
            return
        import sympy

        graph = Graph()
        nodes: Nodes = {sympy.Symbol(name, real=True): graph.slot(i) for name, i in self.slots.items()}
        data = {sympy.Symbol(name, real=True) for name in template.data}
        self.outputs = {key: _lower(graph, e, nodes, data) for key, e in template.outputs.items()}
        self.ops = tuple(graph.ops)

    def replay(self, graph: Graph, bind: Callable[[str], int], wanted: Iterable[TemplateOutput]) -> dict[TemplateOutput, int]:
        """The nodes of the wanted outputs in `graph`; bind(name) gives the node of a symbol."""
        names = list(self.slots)
        made: dict[int, int] = {}

        def build(node: int) -> int:
            for operand in self._needed(node, made):
                op = self.ops[operand]
                if op.code == "slot":
                    made[operand] = bind(names[op.slot])
                elif op.code == "const":
                    made[operand] = graph.const(op.value)
                else:
                    made[operand] = graph.apply(op, tuple(made[a] for a in op.args))
            return made[node]

        return {key: build(self.outputs[key]) for key in wanted}

    def _needed(self, root: int, made: dict[int, int]) -> list[int]:
        """Operations below a root that are not made yet, arguments first; operations are numbered in that order."""
        needed: set[int] = set()
        stack = [root]
        while stack:
            node = stack.pop()
            if node not in made and node not in needed:
                needed.add(node)
                stack.extend(self.ops[node].args)
        return sorted(needed)


@cache
def lowered(template: Template) -> LoweredTemplate:
    """Templates are lowered once per process; those of the catalogue are read, which sympy would derive for two seconds."""
    return LoweredTemplate(template, catalogued().get(template.key) if template.is_catalogued else None)


def lower_value(graph: Graph, expression: sympy.Expr, parameters: dict[str, int]) -> int:
    """An expression of parameters, such as 1/(2 L), as operations."""
    nodes: Nodes = {s: parameters[s.name] for s in symbols_in(expression)}
    return _lower(graph, expression, nodes, set())


def _lower(graph: Graph, expression: sympy.Expr, nodes: Nodes, data: set[sympy.Symbol]) -> int:
    if expression not in nodes:
        nodes[expression] = _lower_new(graph, expression, nodes, data)
    return nodes[expression]


def _lower_new(graph: Graph, expression: sympy.Expr, nodes: Nodes, data: set[sympy.Symbol]) -> int:
    if expression.is_Number or expression.is_NumberSymbol:
        return graph.const(_finite(expression))
    if expression.is_Add:
        return _lower_sum(graph, expression, nodes, data)
    if expression.is_Mul:
        return _lower_product(graph, expression, nodes, data)
    if expression.is_Pow:
        return _lower_power(graph, expression, nodes, data)
    if (pieces := pieces_in(expression)) is not None:
        return graph.lookup(pieces, _lower(graph, _arguments(expression)[0], nodes, data))
    name = BY_SYMPY_NAME.get(type(expression).__name__)
    if name is None:
        raise ModelError(f"{shown(expression)}: this cannot be generated; known functions are {', '.join(FUNCTIONS)}")
    return graph.call(name, *(_lower(graph, a, nodes, data) for a in _arguments(expression)))


def _arguments(expression: sympy.Expr) -> tuple[sympy.Expr, ...]:
    return cast("tuple[sympy.Expr, ...]", expression.args)  # sympy says Basic of them


def _finite(number: sympy.Expr) -> float:
    """A number of sympy as a double; ModelError for what is not one (infinity, nan, or beyond the range)."""
    try:
        value = float(number)
    except (OverflowError, TypeError):
        value = math.inf
    if not math.isfinite(value):
        raise ModelError(f"{shown(number)}: this is not a finite number; correct the expression")
    return value


def _lower_sum(graph: Graph, expression: sympy.Expr, nodes: Nodes, data: set[sympy.Symbol]) -> int:
    import sympy
    from sympy.core.sorting import default_sort_key

    content, rest = expression.primitive()
    if isinstance(content, sympy.Rational) and content.p < SIMPLE and content.q < SIMPLE and rest.is_Add:
        expression = rest
    else:
        content = sympy.Integer(1)  # a content that is not exact in doubles would only add its rounding
    positive: list[sympy.Expr] = []
    negative: list[sympy.Expr] = []
    for term in sorted(_arguments(expression), key=default_sort_key):
        (negative if term.could_extract_minus_sign() else positive).append(term)
    total = graph.sum(_lower(graph, term, nodes, data) for term in positive)
    for term in negative:
        total = graph.sub(total, _lower(graph, -term, nodes, data))
    return graph.mul(graph.const(float(content)), total)


def _lower_product(graph: Graph, expression: sympy.Expr, nodes: Nodes, data: set[sympy.Symbol]) -> int:
    from sympy.core.sorting import default_sort_key

    above, below = graph.const(1.0), graph.const(1.0)
    for factor in sorted(_arguments(expression), key=lambda f: (not f.free_symbols <= data, default_sort_key(f))):
        base, exponent = factor.as_base_exp()
        if exponent.is_Number and exponent < 0 and base.free_symbols <= data:
            # Data are constants of the generated code: their reciprocal is taken at generation.
            above = graph.mul(above, _lower(graph, factor, nodes, data))
        elif exponent.is_Number and exponent < 0:
            below = graph.mul(below, _lower(graph, base**-exponent, nodes, data))
        else:
            above = graph.mul(above, _lower(graph, factor, nodes, data))
    return graph.div(above, below)


def _lower_power(graph: Graph, expression: sympy.Expr, nodes: Nodes, data: set[sympy.Symbol]) -> int:
    import sympy

    base, exponent = expression.as_base_exp()
    node = _lower(graph, base, nodes, data)
    if exponent.is_Integer:
        return graph.power(node, int(exponent))
    if exponent == sympy.S.Half:
        return graph.call("sqrt", node)
    if exponent == -sympy.S.Half:
        return graph.div(graph.const(1.0), graph.call("sqrt", node))
    if base == sympy.E:
        return graph.call("exp", _lower(graph, exponent, nodes, data))
    return graph.call("pow", node, _lower(graph, exponent, nodes, data))


__all__ = ["LoweredTemplate", "Op", "lower_value", "lowered"]
