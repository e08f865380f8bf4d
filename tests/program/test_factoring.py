"""Common factors of sums are taken out where that saves a multiplication, and nothing else changes."""

from __future__ import annotations

from collections import Counter
from fractions import Fraction

import pytest
from hypothesis import given
from hypothesis import strategies as st
from programs import INPUTS, blocks_in_any_order, loops, operations, program_of, run, straight

from ncgen.program.ir import factoring
from ncgen.program.ir.factoring import factored
from ncgen.program.ir.finishing import finish
from ncgen.program.ir.graph import Graph

positions = st.lists(st.integers(-99, 99).map(lambda n: Fraction(n, 8)), min_size=INPUTS, max_size=INPUTS)

CASES = {
    "a x + a z": (lambda g, a, b, x, z: [g.add(g.mul(a, x), g.mul(a, z))], "1 mul 1 add"),
    "a x - z a": (lambda g, a, b, x, z: [g.sub(g.mul(a, x), g.mul(z, a))], "1 mul 1 sub"),
    "-a x - a z": (lambda g, a, b, x, z: [g.sub(g.neg(g.mul(a, x)), g.mul(a, z))], "1 mul 1 add 1 neg"),
    "a b x + (a x) z": (
        lambda g, a, b, x, z: [g.add(g.mul(g.mul(a, b), x), g.mul(g.mul(a, x), z))],
        "2 mul 1 add",
    ),
    "a b x + a z z": (
        lambda g, a, b, x, z: [g.add(g.mul(g.mul(a, b), x), g.mul(a, g.mul(z, z)))],
        "3 mul 1 add",
    ),
    "a a x + a z": (lambda g, a, b, x, z: [g.add(g.mul(g.mul(a, a), x), g.mul(a, z))], "2 mul 1 add"),
    "a x + b x - a z - b z": (
        lambda g, a, b, x, z: [g.sub(g.add(g.mul(a, x), g.mul(b, x)), g.add(g.mul(a, z), g.mul(b, z)))],
        "1 mul 1 add 1 sub",
    ),
    "a x + b + a z": (lambda g, a, b, x, z: [g.add(g.add(g.mul(a, x), b), g.mul(a, z))], "1 mul 2 add"),
    "a x + a is left: nothing is saved": (lambda g, a, b, x, z: [g.add(g.mul(a, x), a)], "1 mul 1 add"),
    "a x, which is stored, + a z": (
        lambda g, a, b, x, z: [g.mul(a, x), g.add(g.mul(a, x), g.mul(a, z))],
        "2 mul 1 add",
    ),
    "a x + a z, a x + a b: a x comes along": (
        lambda g, a, b, x, z: [g.add(g.mul(a, x), g.mul(a, z)), g.add(g.mul(a, x), g.mul(a, b))],
        "2 mul 2 add",
    ),
    "a x + a z, a x + b: a x stays for the second": (
        lambda g, a, b, x, z: [g.add(g.mul(a, x), g.mul(a, z)), g.add(g.mul(a, x), b)],
        "2 mul 2 add",
    ),
    "half of x + z": (lambda g, a, b, x, z: [g.add(g.mul(g.const(0.5), x), g.mul(g.const(0.5), z))], "1 mul 1 add"),
    "halves among others are exact, and stay": (
        lambda g, a, b, x, z: [g.add(g.sub(g.mul(g.const(0.5), x), b), g.mul(g.const(0.5), z))],
        "2 mul 1 sub 1 add",
    ),
}
"""{what: (what is stored, of a graph and four loads; the operations that are left)}."""


def block_of(build):
    graph = Graph()
    return straight(graph, *build(graph, *(graph.load("q", k) for k in range(INPUTS))))


def outputs(block, q, number=Fraction) -> list:
    return run(program_of(block, size=len(block.stores) * block.count), q, number)


@pytest.mark.parametrize("case", CASES)
def test_common_factors_are_taken_out(case):
    """Operations as counted by hand; results as before, exactly."""
    build, expected = CASES[case]
    block = block_of(build)
    made = factored(block)
    words = expected.split()
    assert Counter(operations(made)) == {code: int(n) for n, code in zip(words[::2], words[1::2], strict=True)}
    q = [Fraction(7, 3), Fraction(-5, 11), Fraction(13, 17), Fraction(19, 23)]
    assert outputs(made, q) == outputs(block, q)


def gains(g, a, b, x, z):
    """Two multiplications fewer, so that the block as a whole is taken."""
    return [g.add(g.add(g.mul(g.mul(x, x), a), g.mul(g.mul(x, x), b)), g.mul(g.mul(x, x), z))]


def test_shared_products_that_stay_are_read():
    """a x + a z, and a x + b: a multiplication of the first sum is fused with its addition, one of a (x + z) could not be."""
    block = block_of(lambda g, a, b, x, z: [g.add(g.mul(a, x), g.mul(a, z)), g.add(g.mul(a, x), b), *gains(g, a, b, x, z)])
    made = factored(block)
    assert len(operations(made)) < len(operations(block))
    assert made.ops[made.stores[0].node].code == "add"


def test_sums_of_shared_products_alone_stay():
    """a x + a z, a x - a z, (a x + b) + a z: two products serve three sums."""

    def build(g, a, b, x, z):
        first, second = g.mul(a, x), g.mul(a, z)
        return [g.add(first, second), g.sub(first, second), g.add(g.add(first, b), second), *gains(g, a, b, x, z)]

    made = factored(block_of(build))
    assert Counter(operations(made)) == Counter(add=3, sub=1, mul=2) + Counter(operations(factored(block_of(gains))))


def test_what_is_taken_out_waits_for_no_more_than_before():
    """((a x + b) + z) + a sin(z): the sine is still added last."""
    block = block_of(lambda g, a, b, x, z: [g.add(g.add(g.add(g.mul(a, x), b), z), g.mul(a, g.call("sin", z)))])
    made = factored(block)
    top = made.ops[made.stores[0].node]
    assert [made.ops[a].code for a in top.args].count("mul") == 1
    assert Counter(operations(made)) == {"mul": 1, "add": 3, "sin": 1}


@given(blocks_in_any_order(), positions)
def test_finished_blocks_give_the_same_with_no_more_operations(block, q):
    """Random blocks, in exact arithmetic."""
    made = finish(block)
    assert outputs(made, q) == outputs(block, q)
    assert len(operations(made)) <= len(operations(block))


@given(loops(), positions)
def test_finished_loops_give_the_same_with_no_more_operations(loop, q):
    """Slots are factors as loads are."""
    made = finish(loop)
    assert outputs(made, q) == outputs(loop, q)
    assert len(operations(made)) <= len(operations(loop))


def test_differences_of_positions_stay_exact():
    """0.5 q₀ − 0.5 q₁ + 0.5 (q₂ − q₃) at 1e6 m from the origin: the factor goes before the sum, whose order stays, so no digit is lost."""

    def build(g, a, b, x, z):
        half = g.const(0.5)
        return [g.add(g.sub(g.mul(half, a), g.mul(half, b)), g.mul(half, g.sub(x, z)))]

    block = block_of(build)
    made = factored(block)
    q = [1e6 + 0.3, 1e6 + 0.1, 1e6 + 1e-9, 1e6]
    assert len(operations(made)) == len(operations(block)) - 2
    exact = outputs(block, [Fraction(x) for x in q])
    assert outputs(made, q, float) == outputs(block, q, float) == [float(exact[0])]


def test_long_sums_are_taken_in_parts():
    """Σ a x_k of 5,000 terms, one after the other, takes one multiplication, and no depth of calls."""
    graph = Graph()
    a = graph.load("q", 0)
    node = graph.sum(graph.mul(a, graph.load("qd", k)) for k in range(5000))
    assert Counter(operations(factored(straight(graph, node)))) == {"mul": 1, "add": 4999}


@pytest.mark.parametrize("case", CASES)
def test_long_blocks_leave_shared_products(case, monkeypatch):
    """Whatever is taken out, results stay, and shared products that would serve sums and their factors are computed once."""
    monkeypatch.setattr(factoring, "MAX_FACTORED_OPERATIONS", 0)
    block = block_of(CASES[case][0])
    made = factored(block)
    q = [Fraction(7, 3), Fraction(-5, 11), Fraction(13, 17), Fraction(19, 23)]
    assert outputs(made, q) == outputs(block, q)
    assert len(operations(made)) <= len(operations(block))
