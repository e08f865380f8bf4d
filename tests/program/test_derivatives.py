"""Derivatives of operations against mpmath's numerical ones at 60 digits, forward against reverse."""

from __future__ import annotations

import mpmath
import pytest

from ncgen.program.ir.blocks import Program, Store, Straight
from ncgen.program.ir.derivatives import gradient, tangent
from ncgen.program.ir.evaluate import evaluate
from ncgen.program.ir.functions import FUNCTIONS
from ncgen.program.ir.graph import Graph

MP = {name: getattr(mpmath, name, None) for name in FUNCTIONS} | {"abs": abs, "pow": mpmath.power}
POINT = [mpmath.mpf(x) for x in ("0.3217", "0.7431", "0.1129")]


def value(graph: Graph, node: int, q) -> mpmath.mpf:
    block = Straight(tuple(graph.ops[: node + 1]), (Store(array="out", index=0, node=node),))
    return evaluate(Program(name="f", inputs=("q",), output="out", size=1, blocks=(block,)), {"q": q}, MP, mpmath.mpf)[0]


def numerical(graph: Graph, node: int, k: int) -> mpmath.mpf:
    """The central difference with a step of 1e-20: its own error is about 1e-40."""
    step = mpmath.mpf("1e-20")
    ahead, behind = ([x + s * (i == k) for i, x in enumerate(POINT)] for s in (step, -step))
    return (value(graph, node, ahead) - value(graph, node, behind)) / (2 * step)


def expressions():
    """Every function once, and the arithmetic in all its forms."""
    for name, function in FUNCTIONS.items():
        yield name, lambda g, a, b, c, name=name, n=function.arity: g.call(name, *(g.mul(a, b), b)[:n])
    yield "add", lambda g, a, b, c: g.add(g.mul(a, b), c)
    yield "sub", lambda g, a, b, c: g.sub(g.mul(a, a), g.mul(b, c))
    yield "neg", lambda g, a, b, c: g.neg(g.mul(a, g.mul(b, b)))
    yield "div", lambda g, a, b, c: g.div(g.mul(a, b), g.add(b, c))
    yield "shared", lambda g, a, b, c: g.mul(g.call("sin", g.mul(a, b)), g.add(g.call("exp", g.mul(a, b)), g.div(c, a)))


@pytest.mark.parametrize(("name", "make"), [pytest.param(n, m, id=n) for n, m in expressions()])
def test_against_differences(name, make):
    """Both sweeps agree with the slope of the function itself to 1e-15."""
    graph = Graph()
    loads = [graph.load("q", k) for k in range(3)]
    node = make(graph, *loads)
    slopes = gradient(graph, node, loads)
    with mpmath.workdps(60):
        for k, load in enumerate(loads):
            wanted = numerical(graph, node, k)
            along = tangent(graph, [node], {load: graph.const(1.0)}).get(node)
            for found in (slopes.get(load), along):
                got = value(graph, found, POINT) if found is not None else mpmath.mpf(0)
                assert abs(got - wanted) <= 1e-15 * (1 + abs(wanted)), (name, k)


def test_what_does_not_depend_is_left_out():
    """No node stands for a derivative that is structurally zero."""
    graph = Graph()
    a, b = graph.load("q", 0), graph.load("q", 1)
    assert gradient(graph, graph.mul(a, a), [a, b]).keys() == {a}
    assert tangent(graph, [graph.call("sin", b)], {a: graph.const(1.0)}) == {}
    assert gradient(graph, graph.const(3.0), [a]) == {}


def test_a_direction_of_several_variables():
    """The forward sweep along (2, 3) is twice one slope and three times the other."""
    graph = Graph()
    a, b = graph.load("q", 0), graph.load("q", 1)
    product = graph.mul(a, b)
    along = tangent(graph, [product, a], {a: graph.const(2.0), b: graph.const(3.0)})
    assert value(graph, along[product], [5.0, 7.0]) == 2 * 7 + 3 * 5
    assert value(graph, along[a], [5.0, 7.0]) == 2.0
