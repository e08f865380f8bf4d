"""Passes change how a block computes, never what."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

from hypothesis import given
from hypothesis import strategies as st
from programs import INPUTS, blocks_in_any_order, loops, program_of, run

from ncgen.program.ir import passes
from ncgen.program.ir.blocks import Column, Loop, Slot, Store, Straight, TableStore
from ncgen.program.ir.graph import Graph, Op

positions = st.lists(st.integers(-99, 99).map(lambda n: Fraction(n, 8)), min_size=INPUTS, max_size=INPUTS)


def outputs(block, q) -> list:
    """What a block stores, by a program that verify() accepts."""
    return run(program_of(block, size=len(block.stores) * block.count), q, Fraction)


def below(block, node: int) -> set[int]:
    """An operation and all it needs."""
    return {node}.union(*(below(block, a) for a in block.ops[node].args))


@given(blocks_in_any_order(), positions)
def test_dead_code_keeps_results_and_nothing_else(block, q):
    """Only what reaches a store stays, and the stores' values do not change."""
    alive = passes.dead_code(block)
    assert outputs(alive, q) == outputs(block, q)
    assert set().union(*(below(alive, s.node) for s in alive.stores)) == set(range(len(alive.ops)))


@given(blocks_in_any_order(), positions)
def test_schedule_keeps_results_in_the_order_of_stores(block, q):
    """Operations stand in the order in which the stores first need them."""
    ordered = passes.schedule(block)
    assert outputs(ordered, q) == outputs(block, q)
    first = [next(k for k, s in enumerate(ordered.stores) if node in below(ordered, s.node)) for node in range(len(ordered.ops))]
    assert first == sorted(first)


@given(loops(), positions)
def test_dead_code_and_schedule_keep_loops(loop, q):
    """Slots that nobody reads go with their operations; tables and results stay."""
    for shorter in (passes.dead_code(loop), passes.schedule(loop)):
        assert outputs(shorter, q) == outputs(loop, q)
        assert {op.leaf for op in shorter.ops if op.code == "slot"} == set(range(len(shorter.slots)))


def is_constant(loop: Loop, op: Op) -> bool:
    return op.code == "const" or (op.code == "slot" and loop.slots[op.leaf].array == "const")


@given(loops(), positions)
def test_fold_tables_computes_constants_now(loop, q):
    """No operation on constants alone is left, the results are the same."""
    folded = passes.fold_tables(loop)
    assert outputs(folded, q) == outputs(loop, q)
    inner = [op for op in folded.ops if op.args]
    assert not any(all(is_constant(folded, folded.ops[a]) for a in op.args) for op in inner)
    assert len(inner) <= len([op for op in loop.ops if op.args])


def test_fold_tables_keeps_readable_names():
    """A slot that survives keeps its name; a computed table has none."""
    graph = Graph()
    a, b, x = (graph.slot(k) for k in range(3))
    node = graph.mul(graph.add(a, b), x)
    slots = (Column((1.0, 2.0)), Column((0.5, 0.25)), Slot("q", (0, 1)))
    loop = Loop(count=2, ops=tuple(graph.ops), slots=slots, stores=(TableStore("out", (0, 1), node),), names={a: "a", b: "b", x: "x"})
    folded = passes.fold_tables(loop)
    assert set(folded.slots) == {Slot("q", (0, 1)), Column((1.5, 2.25))}
    assert [folded.names[n] for n, op in enumerate(folded.ops) if op.code == "slot" and n in folded.names] == ["x"]


@given(loops(), positions)
def test_unroll_writes_a_loop_out(loop, q):
    """All runs in one graph store what the loop stores, without a slot or table left."""
    graph = Graph()
    stores = []
    for k in range(loop.count):
        nodes = passes.unroll(graph, loop, k)
        stores += [Store(array="out", index=s.table[k], node=nodes[s.node]) for s in loop.stores]
    written_out = Straight(tuple(graph.ops), tuple(stores))
    assert outputs(written_out, q) == outputs(loop, q)
    assert "slot" not in {op.code for op in written_out.ops}


@given(blocks_in_any_order())
def test_uses_counts_every_reader(block):
    """The number of uses is the number of arguments and stores that mention an operation."""
    count = passes.uses(block)
    assert sum(count.values()) == sum(len(op.args) for op in block.ops) + len(block.stores)
    doubled = replace(block, stores=block.stores * 2)
    assert passes.uses(doubled)[block.stores[0].node] > count[block.stores[0].node]


def test_deep_code_is_no_problem():
    """Passes walk chains that are deeper than Python's stack."""
    graph = Graph()
    node = graph.load("q", 0)
    for k in range(5000):
        node = graph.add(node, graph.load("q", 1 + k % 3)) if k % 2 else graph.mul(node, graph.load("q", 1))
    block = Straight(tuple(graph.ops), (Store(array="out", index=0, node=node),))
    assert passes.schedule(passes.dead_code(block)).stores[0].node == len(block.ops) - 1
