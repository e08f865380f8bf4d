"""Known factors go into sums of known multiples."""

from __future__ import annotations

from collections import Counter
from fractions import Fraction

import pytest
from programs import INPUTS, operations, program_of, run, straight

from ncgen.program.ir.finishing import finish
from ncgen.program.ir.graph import Graph
from ncgen.program.ir.multiples import spread


def times(g, number, node):
    return g.mul(g.const(number), node)


CASES = {
    "3 (5 a - 7 b)": (lambda g, a, b, x, z: [times(g, 3.0, g.sub(times(g, 5.0, a), times(g, 7.0, b)))], "2 mul 1 sub"),
    "3 (5 a - 7 b + x)": (
        lambda g, a, b, x, z: [times(g, 3.0, g.add(g.sub(times(g, 5.0, a), times(g, 7.0, b)), x))],
        "3 mul 1 sub 1 add",
    ),
    "3 (2 a - 4 b): exact as it is": (
        lambda g, a, b, x, z: [times(g, 3.0, g.sub(times(g, 2.0, a), times(g, 4.0, b)))],
        "3 mul 1 sub",
    ),
    "3 (5 a - 7 b), and 5 a": (
        lambda g, a, b, x, z: [times(g, 3.0, g.sub(times(g, 5.0, a), times(g, 7.0, b))), times(g, 5.0, a)],
        "3 mul 1 sub",
    ),
    "3 (5 a - 7 b), which is stored, and 3 (5 x - 7 z)": (
        lambda g, a, b, x, z: [
            g.sub(times(g, 5.0, a), times(g, 7.0, b)),
            times(g, 3.0, g.sub(times(g, 5.0, a), times(g, 7.0, b))),
            times(g, 3.0, g.sub(times(g, 5.0, x), times(g, 7.0, z))),
        ],
        "5 mul 2 sub",
    ),
    "3 (5 a - 7 b), of which 5 a and 7 b are stored, and 3 (5 x - 7 z)": (
        lambda g, a, b, x, z: [
            times(g, 5.0, a),
            times(g, 7.0, b),
            times(g, 3.0, g.sub(times(g, 5.0, a), times(g, 7.0, b))),
            times(g, 3.0, g.sub(times(g, 5.0, x), times(g, 7.0, z))),
        ],
        "5 mul 2 sub",
    ),
    "x (5 a - 7 b)": (lambda g, a, b, x, z: [g.mul(x, g.sub(times(g, 5.0, a), times(g, 7.0, b)))], "3 mul 1 sub"),
}


@pytest.mark.parametrize("case", CASES)
def test_numbers_go_into_sums(case):
    """Operations as counted by hand; results as before, exactly."""
    build, expected = CASES[case]
    graph = Graph()
    block = straight(graph, *build(graph, *(graph.load("q", k) for k in range(INPUTS))))
    made = finish(block)
    words = expected.split()
    assert Counter(operations(made)) == {code: int(n) for n, code in zip(words[::2], words[1::2], strict=True)}
    q = [Fraction(7, 3), Fraction(-5, 11), Fraction(13, 17), Fraction(19, 23)]
    size = len(block.stores)
    assert run(program_of(made, size=size), q, Fraction) == run(program_of(block, size=size), q, Fraction)


def test_parameters_go_into_sums():
    """p₀ (p₁ q₀ + p₂ q₁) becomes (p₀ p₁) q₀ + (p₀ p₂) q₁: both products of parameters are computed before."""
    graph = Graph()
    p, q = [graph.load("p", k) for k in range(3)], [graph.load("q", k) for k in range(2)]
    node = graph.mul(p[0], graph.add(graph.mul(p[1], q[0]), graph.mul(p[2], q[1])))
    made, new = spread(graph.ops, [node], parameters=3)
    known = [made.mul(made.load("p", 0), made.load("p", k)) for k in (1, 2)]
    assert new[node] == made.add(*(made.mul(known[k], made.load("q", k)) for k in range(2)))


def test_inputs_are_not_known():
    """The last numbers of p change all the time."""
    graph = Graph()
    p, q = [graph.load("p", k) for k in range(3)], [graph.load("q", k) for k in range(2)]
    node = graph.mul(p[2], graph.add(graph.mul(p[0], q[0]), graph.mul(p[1], q[1])))
    assert spread(graph.ops, [node], parameters=2) is None
    assert spread(graph.ops, [node], parameters=3) is not None
