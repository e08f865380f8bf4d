"""What parameters make of themselves at all their values, and what only looks like it."""

from __future__ import annotations

import pytest

from ncgen.program.differentiation.identities import simplified
from ncgen.program.ir.graph import Graph

DEFAULTS = [0.3, 1.7, 2.5]

SAME = {
    "a (1/a) = 1": (lambda g, a, b, c: g.mul(a, g.div(g.const(1.0), a)), lambda g, a, b, c: g.const(1.0)),
    "(a + b) - b - a = 0": (lambda g, a, b, c: g.sub(g.sub(g.add(a, b), b), a), lambda g, a, b, c: g.const(0.0)),
    "0.3 a - 0.1 a = 0.2 a": (
        lambda g, a, b, c: g.sub(g.mul(g.const(0.3), a), g.mul(g.const(0.1), a)),
        lambda g, a, b, c: g.mul(g.const(0.2), a),
    ),
    "(a + b)(a - b) = a a - b b": (
        lambda g, a, b, c: g.mul(g.add(a, b), g.sub(a, b)),
        lambda g, a, b, c: g.sub(g.mul(a, a), g.mul(b, b)),
    ),
    "a/b - c = -(c b - a)/b": (
        lambda g, a, b, c: g.sub(g.div(a, b), c),
        lambda g, a, b, c: g.neg(g.div(g.sub(g.mul(c, b), a), b)),
    ),
    "sqrt(a a + b b)^2 = a a + b b": (
        lambda g, a, b, c: g.power(g.call("sqrt", g.add(g.mul(a, a), g.mul(b, b))), 2),
        lambda g, a, b, c: g.add(g.mul(a, a), g.mul(b, b)),
    ),
    "|a| |a| = a a": (lambda g, a, b, c: g.power(g.call("abs", a), 2), lambda g, a, b, c: g.mul(a, a)),
}

OTHERS = {
    "sqrt(a a), a: other signs of a": (lambda g, a, b, c: g.call("sqrt", g.mul(a, a)), lambda g, a, b, c: a),
    "|a|, a": (lambda g, a, b, c: g.call("abs", a), lambda g, a, b, c: a),
    "sqrt((a - b)^2), b - a: b may be the smaller": (
        lambda g, a, b, c: g.call("sqrt", g.power(g.sub(a, b), 2)),
        lambda g, a, b, c: g.sub(b, a),
    ),
    "a + 1e-12 b, a: rounding is smaller": (lambda g, a, b, c: g.add(a, g.mul(g.const(1e-12), b)), lambda g, a, b, c: a),
    "sin(a), a: of functions nothing is believed": (lambda g, a, b, c: g.call("sin", a), lambda g, a, b, c: a),
    "a, 0.3: at the default alone": (lambda g, a, b, c: a, lambda g, a, b, c: g.const(0.3)),
}


def outputs_of(*formulas):
    """Nodes of formulas of three parameters, simplified together, and the graph."""
    graph = Graph()
    parameters = [graph.load("p", k) for k in range(len(DEFAULTS))]
    new, (nodes,) = simplified(graph, [[formula(graph, *parameters) for formula in formulas]], DEFAULTS)
    return new, nodes


@pytest.mark.parametrize(("left", "right"), SAME.values(), ids=SAME)
def test_what_is_equal_by_algebra_is_one_result(left, right):
    _, (first, second) = outputs_of(left, right)
    assert first == second


@pytest.mark.parametrize(("left", "right"), OTHERS.values(), ids=OTHERS)
def test_what_only_looks_equal_stays_two(left, right):
    graph, (first, second) = outputs_of(left, right)
    assert first != second and graph.value(first) is None


def test_known_factors_come_together():
    """a (b (c q)) is one multiplication of q, as with numbers; an input that follows the parameters is not known."""
    graph = Graph()
    a, b, c, drive = (graph.load("p", k) for k in range(4))
    q = graph.load("q", 0)
    together = graph.mul(a, graph.mul(b, graph.mul(c, q)))
    apart = graph.mul(a, graph.mul(drive, q))
    new, ((first, second),) = simplified(graph, [[together, apart]], DEFAULTS)
    of_q = new.load("q", 0)
    assert {new.ops[node].code for node in new.below([first])} == {"mul", "load"}
    assert of_q in new.ops[first].args
    assert of_q not in new.ops[second].args


def below_zero(graph, a, b, c):
    """√(−1 − a a)"""
    return graph.call("sqrt", graph.sub(graph.const(-1.0), graph.mul(a, a)))


def test_a_result_that_exists_nowhere_is_no_reason():
    _, (first, second) = outputs_of(below_zero, lambda g, a, b, c: g.mul(a, below_zero(g, a, b, c)))
    assert first != second
