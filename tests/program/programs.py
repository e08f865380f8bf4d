"""Small programs for the tests: made by hand or drawn at random, and evaluated on the spot."""

from __future__ import annotations

from hypothesis import strategies as st

from ncgen.program.ir import passes
from ncgen.program.ir.blocks import Column, Loop, Program, Slot, Store, Straight, TableStore
from ncgen.program.ir.evaluate import evaluate
from ncgen.program.ir.graph import Graph
from ncgen.program.ir.verify import verify

INPUTS = 4
"""Length of q in the programs made here."""

DYADIC = (0.0, 1.0, -1.0, 2.0, -2.0, 0.5, -0.25, 3.0, 0.375)
"""Constants whose sums, products and reciprocals of powers of two are exact."""


def program_of(*blocks, size: int = 1) -> Program:
    """A program from q (and t) to `out`, checked."""
    program = Program(name="test", inputs=("t", "q"), output="out", size=size, blocks=blocks)
    verify(program, {"t": 1, "q": INPUTS})
    return program


def straight(graph: Graph, *nodes: int) -> Straight:
    """A block that stores these nodes one after the other, without dead operations."""
    return passes.dead_code(Straight(tuple(graph.ops), tuple(Store(array="out", index=k, node=node) for k, node in enumerate(nodes))))


def run(program: Program, q, number=float) -> list:
    return evaluate(program, {"t": number(0), "q": q}, number=number)


def operations(block) -> list[str]:
    """Codes of the inner operations of a block."""
    return [op.code for op in block.ops if op.args]


def value_of(build, q, number=float):
    """What `build(graph, *loads)` computes at q, and the operations it takes."""
    graph = Graph()
    block = straight(graph, build(graph, *(graph.load("q", i) for i in range(INPUTS))))
    return run(program_of(block), q, number)[0], operations(block)


@st.composite
def blocks_in_any_order(draw) -> Straight:
    """Straight-line code with dead and repeated operations, whose stores ask for them in any order."""
    graph = Graph()
    nodes = [graph.load("q", i) for i in range(INPUTS)] + [graph.const(c) for c in DYADIC]
    for _ in range(draw(st.integers(1, 25))):
        a, b = draw(st.sampled_from(nodes)), draw(st.sampled_from(nodes))
        nodes.append(getattr(graph, draw(st.sampled_from(["add", "sub", "mul"])))(a, b))
    stored = draw(st.lists(st.sampled_from(nodes), min_size=1, max_size=4))
    return Straight(tuple(graph.ops), tuple(Store(array="out", index=k, node=node) for k, node in enumerate(stored)))


@st.composite
def loops(draw) -> Loop:
    """A loop over tables of numbers and of places in q, writing every output once."""
    count = draw(st.integers(1, 5))
    graph = Graph()
    slots = []
    for _ in range(draw(st.integers(1, 3))):
        slots.append(Column(tuple(draw(st.lists(st.sampled_from(DYADIC), min_size=count, max_size=count)))))
        slots.append(Slot("q", tuple(draw(st.lists(st.integers(0, INPUTS - 1), min_size=count, max_size=count)))))
    nodes = [graph.slot(k) for k in range(len(slots))] + [graph.const(2.0), graph.load("q", 0)]
    for _ in range(draw(st.integers(1, 15))):
        a, b = draw(st.sampled_from(nodes)), draw(st.sampled_from(nodes))
        nodes.append(getattr(graph, draw(st.sampled_from(["add", "sub", "mul"])))(a, b))
    places = draw(st.permutations(range(2 * count)))
    stores = tuple(TableStore("out", tuple(places[k * count : (k + 1) * count]), draw(st.sampled_from(nodes))) for k in range(2))
    names = {k: f"s{k}" for k in range(len(slots))}
    return Loop(count=count, ops=tuple(graph.ops), slots=tuple(slots), stores=stores, names=names)
