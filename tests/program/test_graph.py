"""The graph simplifies without changing what is computed."""

from __future__ import annotations

import math
import sys
from fractions import Fraction

import pytest
from hypothesis import given
from hypothesis import strategies as st
from programs import DYADIC, INPUTS, value_of

from ncgen.program.ir.graph import Graph

EPS = sys.float_info.epsilon

# What is written, what it means, and the operations that may be left of it.
RULES = {
    "x + 0": (lambda g, x, y: g.add(x, g.const(0.0)), lambda x, y: x, []),
    "0 + x": (lambda g, x, y: g.add(g.const(0.0), x), lambda x, y: x, []),
    "x - 0": (lambda g, x, y: g.sub(x, g.const(0.0)), lambda x, y: x, []),
    "0 - x": (lambda g, x, y: g.sub(g.const(0.0), x), lambda x, y: -x, ["neg"]),
    "x - x": (lambda g, x, y: g.sub(x, x), lambda x, y: 0, []),
    "x * 0": (lambda g, x, y: g.mul(x, g.const(0.0)), lambda x, y: 0, []),
    "x * 1": (lambda g, x, y: g.mul(x, g.const(1.0)), lambda x, y: x, []),
    "1 * x": (lambda g, x, y: g.mul(g.const(1.0), x), lambda x, y: x, []),
    "x * -1": (lambda g, x, y: g.mul(x, g.const(-1.0)), lambda x, y: -x, ["neg"]),
    "x / 1": (lambda g, x, y: g.div(x, g.const(1.0)), lambda x, y: x, []),
    "0 / x": (lambda g, x, y: g.div(g.const(0.0), x), lambda x, y: 0, []),
    "-(-x)": (lambda g, x, y: g.neg(g.neg(x)), lambda x, y: x, []),
    "-(x - y)": (lambda g, x, y: g.neg(g.sub(x, y)), lambda x, y: y - x, ["sub", "neg"]),
    "(x - y)(y - x)": (lambda g, x, y: g.mul(g.sub(x, y), g.sub(y, x)), lambda x, y: (x - y) * (y - x), ["sub", "mul", "neg"]),
    "x + (-y)": (lambda g, x, y: g.add(x, g.neg(y)), lambda x, y: x - y, ["sub"]),
    "-x + y": (lambda g, x, y: g.add(g.neg(x), y), lambda x, y: y - x, ["sub"]),
    "x - (-y)": (lambda g, x, y: g.sub(x, g.neg(y)), lambda x, y: x + y, ["add"]),
    "-x - y": (lambda g, x, y: g.sub(g.neg(x), y), lambda x, y: -x - y, ["add", "neg"]),
    "x + -2": (lambda g, x, y: g.add(x, g.const(-2.0)), lambda x, y: x - 2, ["sub"]),
    "-2 + x": (lambda g, x, y: g.add(g.const(-2.0), x), lambda x, y: x - 2, ["sub"]),
    "x - -2": (lambda g, x, y: g.sub(x, g.const(-2.0)), lambda x, y: x + 2, ["add"]),
    "-x * y": (lambda g, x, y: g.mul(g.neg(x), y), lambda x, y: -x * y, ["mul", "neg"]),
    "x * -y": (lambda g, x, y: g.mul(x, g.neg(y)), lambda x, y: -x * y, ["mul", "neg"]),
    "-x * -y": (lambda g, x, y: g.mul(g.neg(x), g.neg(y)), lambda x, y: x * y, ["mul"]),
    "x * -2 + y": (lambda g, x, y: g.add(g.mul(x, g.const(-2.0)), y), lambda x, y: y - 2 * x, ["mul", "sub"]),
    "2 * (3 * x)": (lambda g, x, y: g.mul(g.const(2.0), g.mul(x, g.const(3.0))), lambda x, y: 6 * x, ["mul"]),
    "x / 4": (lambda g, x, y: g.div(x, g.const(4.0)), lambda x, y: x / 4, ["mul"]),
    "-x / y": (lambda g, x, y: g.div(g.neg(x), y), lambda x, y: -x / y, ["div", "neg"]),
    "x / -y": (lambda g, x, y: g.div(x, g.neg(y)), lambda x, y: -x / y, ["div", "neg"]),
    "-x / -y": (lambda g, x, y: g.div(g.neg(x), g.neg(y)), lambda x, y: x / y, ["div"]),
    "2 + 3": (lambda g, x, y: g.add(g.const(2.0), g.const(3.0)), lambda x, y: 5, []),
    "2 - 3": (lambda g, x, y: g.sub(g.const(2.0), g.const(3.0)), lambda x, y: -1, []),
    "2 * 3": (lambda g, x, y: g.mul(g.const(2.0), g.const(3.0)), lambda x, y: 6, []),
    "3 / 2": (lambda g, x, y: g.div(g.const(3.0), g.const(2.0)), lambda x, y: Fraction(3, 2), []),
    "-(2)": (lambda g, x, y: g.neg(g.const(2.0)), lambda x, y: -2, []),
    "x**0": (lambda g, x, y: g.power(x, 0), lambda x, y: 1, []),
    "x**1": (lambda g, x, y: g.power(x, 1), lambda x, y: x, []),
    "x**2": (lambda g, x, y: g.power(x, 2), lambda x, y: x**2, ["mul"]),
    "x**7": (lambda g, x, y: g.power(x, 7), lambda x, y: x**7, ["mul"] * 4),
    "x**8": (lambda g, x, y: g.power(x, 8), lambda x, y: x**8, ["mul"] * 3),
    "x**-2": (lambda g, x, y: g.power(x, -2), lambda x, y: 1 / x**2, ["mul", "div"]),
    "sum": (lambda g, x, y: g.sum([x, y, g.const(0.0), x]), lambda x, y: 2 * x + y, ["add", "add"]),
    "sum of nothing": (lambda g, x, y: g.sum([]), lambda x, y: 0, []),
}
nonzero = st.integers(-1000, 1000).filter(bool).map(lambda n: Fraction(n, 64))


@pytest.mark.parametrize("rule", RULES)
@given(x=nonzero, y=nonzero)
def test_rule(rule, x, y):
    """Each rule leaves the operations it promises, and on fractions exactly the same value."""
    build, meaning, left = RULES[rule]
    value, codes = value_of(lambda g, a, b, *_: build(g, a, b), (x, y, Fraction(0), Fraction(0)), Fraction)
    assert value == meaning(x, y)
    assert codes == left


@pytest.mark.parametrize("rule", RULES)
def test_rule_on_floats(rule):
    """On floats a rule changes the last bits at most."""
    build, meaning, _ = RULES[rule]
    for x, y in ((0.1, 0.7), (-3.3, 1e-9), (1e10, -0.3)):
        assert value_of(lambda g, a, b, *_: build(g, a, b), (x, y, 0.0, 0.0))[0] == pytest.approx(meaning(x, y), rel=4 * EPS)


# Constants at the ends of the range: what is written, and x.
EXTREMES = {
    "x / 1e-310": (lambda g, x: g.div(x, g.const(1e-310)), lambda x: x / 1e-310, 1e-305),
    "x / 1.7e308": (lambda g, x: g.div(x, g.const(1.7e308)), lambda x: x / 1.7e308, 1.1e308),
    "1e200 * (1e200 * x)": (lambda g, x: g.mul(g.const(1e200), g.mul(g.const(1e200), x)), lambda x: 1e200 * (1e200 * x), 1e-300),
    "1e-200 * (1e-200 * x)": (lambda g, x: g.mul(g.const(1e-200), g.mul(g.const(1e-200), x)), lambda x: 1e-200 * (1e-200 * x), 1e300),
}


@pytest.mark.parametrize("case", EXTREMES)
def test_rules_know_the_range_of_numbers(case):
    """Where 1/c or c·d is infinite, zero or subnormal, the operations stay as they are."""
    build, meaning, x = EXTREMES[case]
    assert value_of(lambda g, a, *_: build(g, a), (x, 0.0, 0.0, 0.0))[0] == pytest.approx(meaning(x), rel=4 * EPS)


@pytest.mark.parametrize("code", ["add", "mul"])
def test_commutative_operations_are_one(code):
    """x + y and y + x are the same operation."""
    graph = Graph()
    x, y = graph.load("q", 0), graph.load("q", 1)
    assert getattr(graph, code)(x, y) == getattr(graph, code)(y, x)


def test_equal_expressions_exist_once():
    """Building an expression twice adds nothing; another constant, even by one bit, adds an operation."""
    graph = Graph()
    build = lambda c: graph.call("sin", graph.mul(graph.const(c), graph.load("q", 0)))  # noqa: E731
    first, count = build(0.1), len(graph.ops)
    assert build(0.1) == first and len(graph.ops) == count
    assert build(math.nextafter(0.1, 1.0)) != first


def test_functions_of_numbers_are_numbers():
    """Elementary functions of constants are computed at once."""
    graph = Graph()
    assert graph.value(graph.call("sqrt", graph.const(2.0))) == math.sqrt(2.0)
    assert graph.value(graph.call("atan2", graph.const(1.0), graph.const(-2.0))) == math.atan2(1.0, -2.0)
    assert graph.value(graph.call("sin", graph.load("q", 0))) is None


def test_there_is_one_zero():
    """-0.0 and 0.0 are the same constant, and no constant is written as -0.0."""
    graph = Graph()
    assert graph.const(-0.0) == graph.const(0.0)
    assert math.copysign(1.0, graph.ops[0].leaf) == 1.0


# -- random expressions -------------------------------------------------------------------------

leaves = st.one_of(
    st.integers(0, INPUTS - 1).map(lambda i: ("q", i)),
    st.sampled_from(DYADIC).map(lambda c: ("const", c)),
)


def grow(children):
    pair = st.tuples(st.sampled_from(["add", "sub", "mul"]), children, children)
    quotient = st.tuples(st.just("shrink"), children, st.sampled_from([2.0, -4.0, 0.5]))
    power = st.tuples(st.just("power"), children, st.integers(0, 3))
    return st.one_of(pair, st.tuples(st.just("neg"), children), quotient, power)


trees = st.recursive(leaves, grow, max_leaves=20)
numbers = st.lists(st.integers(-512, 512).map(lambda n: Fraction(n, 128)), min_size=INPUTS, max_size=INPUTS)


def build_tree(graph: Graph, tree) -> int:
    """A tree as operations of a graph."""
    match tree:
        case ("q", i):
            return graph.load("q", i)
        case ("const", c):
            return graph.const(c)
        case ("power", inner, n):
            return graph.power(build_tree(graph, inner), n)
        case ("shrink", inner, c):
            return graph.div(build_tree(graph, inner), graph.const(c))
        case (code, *inner):
            return getattr(graph, code)(*(build_tree(graph, i) for i in inner))


def size_of(tree) -> int:
    """Operations in a tree as it is written; a negative constant is a number and a sign."""
    match tree:
        case ("q", _):
            return 0
        case ("const", c):
            return c < 0
        case ("power", inner, n):
            return size_of(inner) + (0, 0, 1, 2)[n]
        case ("shrink", inner, c):
            return size_of(inner) + 1 + (c < 0)
        case (_, *inner):
            return 1 + sum(map(size_of, inner))


def meaning(tree, q, number, minus=lambda a, b: a - b, negative=lambda a: -a):
    """The direct value of a tree; with `minus` = + and `negative` = identity, its size with all signs made equal."""
    again = lambda t: meaning(t, q, number, minus, negative)  # noqa: E731
    match tree:
        case ("q", i):
            return q[i]
        case ("const", c):
            return number(c)
        case ("add", a, b):
            return again(a) + again(b)
        case ("sub", a, b):
            return minus(again(a), again(b))
        case ("mul", a, b):
            return again(a) * again(b)
        case ("neg", a):
            return negative(again(a))
        case ("shrink", a, c):
            return again(a) / number(c)
        case ("power", a, n):
            return again(a) ** n


@given(tree=trees, q=numbers)
def test_random_expression_is_exact_on_fractions(tree, q):
    """A random expression means in the graph what it means directly, and takes no more operations than it has."""
    value, codes = value_of(lambda g, *_: build_tree(g, tree), q, Fraction)
    assert value == meaning(tree, q, Fraction)
    assert len(codes) <= size_of(tree)


@given(tree=trees, q=numbers)
def test_random_expression_is_close_on_floats(tree, q):
    """On floats the error stays below one rounding per operation, measured against the sum of magnitudes."""
    value, _ = value_of(lambda g, *_: build_tree(g, tree), [float(x) for x in q])
    exact = meaning(tree, q, Fraction)
    magnitude = meaning(tree, list(map(abs, q)), lambda c: abs(Fraction(c)), lambda a, b: a + b, lambda a: a)
    assert abs(Fraction(value) - exact) <= (1 + 2 * size_of(tree)) * Fraction(EPS) * magnitude
