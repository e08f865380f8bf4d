"""Long straight lines in several blocks compute what they compute in one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from ncgen.compiler import compile, generate
from ncgen.exchange.examples import load
from ncgen.program.ir import cut as cutting
from ncgen.program.ir.blocks import Loop, Phases, Program, Slot, Store, Straight, TableStore
from ncgen.program.ir.cut import CUT_ARRAY, cut, cut_into_phases
from ncgen.program.ir.evaluate import evaluate
from ncgen.program.ir.finishing import finish
from ncgen.program.ir.graph import Graph, Op
from ncgen.program.ir.verify import verify


def program(seed: int) -> Program:
    """200 random sums and products of five inputs and of each other; every tenth is an output, and so are an input and a constant."""
    rng, graph = np.random.default_rng(seed), Graph()
    nodes = [graph.load("q", k) for k in range(5)]
    for _ in range(200):
        a, b = rng.choice(nodes[-40:], 2)
        nodes.append(graph.add(int(a), graph.mul(graph.const(0.37), int(b))))
    outputs = [*nodes[5::10], nodes[0], graph.const(2.5), nodes[-1]]
    stores = tuple(Store(array="out", index=k, node=node) for k, node in enumerate(outputs))
    return Program(name="out", inputs=("q",), output="out", size=len(outputs), blocks=(finish(Straight(tuple(graph.ops), stores)),))


@pytest.mark.parametrize("longest", [7, 40, 110])
@pytest.mark.parametrize("seed", range(3))
def test_same_numbers_in_short_blocks(monkeypatch, longest, seed):
    monkeypatch.setattr(cutting, "MAX_OPERATIONS", longest)
    whole = program(seed)
    parts = cut(whole)
    verify(parts, {"q": 5})
    q = [0.3, -1.2, 0.7, 2.0, -0.4]
    assert evaluate(parts, {"q": q}) == evaluate(whole, {"q": q})
    assert len(parts.blocks) == -(-len(whole.blocks[0].ops) // longest)
    assert all(sum(bool(op.args) for op in block.ops) <= longest for block in parts.blocks)
    assert parts.temporaries[CUT_ARRAY] < len(whole.blocks[0].ops) / 2
    assert {store.index for block in parts.blocks for store in block.stores if store.array == CUT_ARRAY} == set(
        range(parts.temporaries[CUT_ARRAY])
    )


def test_what_lies_in_the_output_is_kept_nowhere_else(monkeypatch):
    """A chain whose every link is an output: later blocks read where the last one was written."""
    monkeypatch.setattr(cutting, "MAX_OPERATIONS", 10)
    graph = Graph()
    nodes = [graph.load("q", 0)]
    for k in range(40):
        nodes.append((graph.mul if k % 2 else graph.add)(nodes[-1], graph.load("q", 1 + k % 3)))
    stores = tuple(Store(array="out", index=k, node=node) for k, node in enumerate(nodes[1:]))
    parts = cut(Program(name="out", inputs=("q",), output="out", size=40, blocks=(finish(Straight(tuple(graph.ops), stores)),)))
    verify(parts, {"q": 4})
    assert len(parts.blocks) > 1
    assert not any(store.array == CUT_ARRAY for block in parts.blocks for store in block.stores)
    q, links = [0.5, 0.25, 1.5, -2.0], [0.5]
    for k in range(40):
        links.append(links[-1] * q[1 + k % 3] if k % 2 else links[-1] + q[1 + k % 3])
    assert evaluate(parts, {"q": q}) == links[1:]


def phased() -> Program:
    """A draft whose phases have operations in common, and outputs that are constants, inputs, and results of other phases."""
    graph = Graph()
    q, x = ([graph.load(array, k) for k in range(5)] for array in ("q", "rates"))
    common = [graph.mul(a, b) for a, b in zip(q, q[1:], strict=False)]
    measured = [q[0], common[1], graph.add(common[2], q[4])]
    corrected = [graph.sub(node, graph.mul(graph.mul(common[0], common[3]), q[2])) for node in measured]
    first = [x[0], graph.mul(x[1], common[0]), graph.const(0.0), common[1]]
    others = [graph.mul(first[1], x[2]), common[1], graph.const(0.0), corrected[1], graph.add(common[2], x[1])]
    stores = tuple(Store(array="out", index=k, node=node) for k, node in enumerate([*measured, *corrected, *first, *others]))
    block = finish(Straight(tuple(graph.ops), stores))
    return Program(name="out", inputs=("q", "rates"), output="out", size=len(stores), blocks=(block,), phases=Phases(3, (0, 1, 2, 3)))


@pytest.mark.parametrize("longest", [1, 3, 400])
def test_three_programs_consist_of_phases(monkeypatch, longest):
    """All, the leading outputs alone, which write nothing else, and without corrections; each reads what the one before has left."""
    monkeypatch.setattr(cutting, "MAX_OPERATIONS", longest)
    draft = phased()
    parts = cut_into_phases(draft)
    q = [0.3, -1.2, 0.7, 2.0, -0.4]
    drafted = evaluate(draft, {"q": q, "rates": [0.0] * 5})
    measured, corrected = drafted[:3], drafted[3:6]
    assert measured != corrected
    for program, rates in ((parts, corrected), (parts.beginning, corrected), (parts.uncorrected, measured)):
        verify(program, {"q": 5})
        expected = evaluate(draft, {"q": q, "rates": [*rates, 0.0, 0.0]})[6:]
        assert evaluate(program, {"q": q}) == expected[: program.size]
    assert (parts.size, parts.beginning.size, parts.inputs) == (9, 4, ("q",))
    reordered = parts.reordered([8, *range(8)])
    assert evaluate(reordered, {"q": q}) == [*evaluate(parts, {"q": q})[1:], evaluate(parts, {"q": q})[0]]
    assert cut(parts) is parts


def test_what_is_short_stays_whole():
    assert cut(program(0)).blocks == program(0).blocks


def test_kernels_with_loops_are_cut_in_their_straight_lines(monkeypatch):
    """What stands in loops stays where it was, between the parts of the straight lines."""
    monkeypatch.setattr(cutting, "MAX_OPERATIONS", 40)
    whole = program(0)
    loop = Loop(count=3, ops=(Op("slot", (), 0),), slots=(Slot("q", (0, 1, 2)),), stores=(TableStore("out", (0, 1, 2), 0, True),))
    both = replace(whole, blocks=(*whole.blocks, loop))
    parts = cut(both)
    verify(parts, {"q": 5})
    q = [0.3, -1.2, 0.7, 2.0, -0.4]
    assert evaluate(parts, {"q": q}) == evaluate(both, {"q": q})
    assert parts.blocks[-1] == loop and len(parts.blocks) > 2
    assert cut(parts) is parts


def test_long_kernels_are_several_functions_in_c(monkeypatch):
    """They compute the same, and their loops stand in the function that calls the parts."""
    model = load("quadruped")
    whole = compile(generate(model), "c")
    monkeypatch.setattr(cutting, "MAX_OPERATIONS", 60)
    sources = generate(model)
    assert "quadruped_gamma_2(" in sources.c["quadruped.c"] and "for (int i = 0;" in sources.c["quadruped.c"]
    parts = compile(sources, "c")
    rng = np.random.default_rng(0)
    q, qd = rng.uniform(-1, 1, (2, whole.n))
    for name in ("phi", "phi_q", "gamma"):
        assert np.allclose(parts.values(name, 0.0, q, qd, parts.p0), whole.values(name, 0.0, q, qd, whole.p0), rtol=1e-13, atol=1e-13)
