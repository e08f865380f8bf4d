"""Adds up what contributes to the same entry of a kernel's output: numbers at generation, the rest in straight-line code and loops."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import replace

from ncgen.program.ir import passes
from ncgen.program.ir.blocks import Block, Column, Loop, Store, Straight, TableStore
from ncgen.program.ir.graph import Graph
from ncgen.program.labels import labelled_errors, load_name
from ncgen.symbolic.numbering import Terms


def take_constants(block: Loop, base: list[float]) -> Loop:
    """Move stores of plain numbers into the base table."""
    kept: list[TableStore] = []
    for store in block.stores:
        op = block.ops[store.node]
        if op.code == "const":
            column = (op.value,) * block.count
        elif op.code == "slot" and block.slots[op.slot].array == "const":
            column = block.slots[op.slot].table
        else:
            kept.append(store)
            continue
        for position, value in zip(store.table, column, strict=True):
            base[position] += value
            if not math.isfinite(base[position]):
                raise OverflowError("what is added up becomes infinite")
    return replace(block, stores=tuple(kept))


def combine(array: str, base: list[float], loops: Sequence[Loop], lines: Sequence[Loop], equations: Terms) -> list[Block]:
    """Base table first, then straight-line code, then loops; plain stores where nothing is added up."""
    hits: dict[int, int] = defaultdict(int)
    for block in loops:
        for store in block.stores:
            for position in store.table:
                hits[position] += 1
    straight = _straight(array, lines, base, hits, equations)
    written = {s.index for s in straight.stores} if straight else set()
    alone = all(base[i] == 0.0 for i in hits) and all(n == 1 for n in hits.values()) and not written & set(hits)
    blocks: list[Block] = []
    if straight and alone:
        straight = _with_constants(straight, array, {i: x for i, x in enumerate(base) if i not in written and i not in hits})
    elif not (alone and len(hits) == len(base)):
        blocks.append(_base_block(array, base))
    if straight:
        blocks.append(straight)
    for block in loops:
        blocks.append(replace(block, stores=tuple(replace(s, accumulate=not alone) for s in block.stores)))
    return blocks


def _with_constants(block: Straight, array: str, values: dict[int, float]) -> Straight:
    """The block with stores of plain numbers among its own, by position."""
    graph = Graph.of(block.ops)
    stores = [*block.stores, *(Store(array=array, index=i, node=graph.const(value)) for i, value in values.items())]
    return replace(block, ops=tuple(graph.ops), stores=tuple(sorted(stores, key=lambda s: s.index)))


def _base_block(array: str, base: list[float]) -> Loop:
    graph = Graph()
    count = len(base)
    if len(set(base)) <= 1:
        node, slots = graph.const(base[0] if base else 0.0), ()
    else:
        node, slots = graph.slot(0), (Column(tuple(base)),)
    return Loop(
        count=count,
        ops=tuple(graph.ops),
        slots=slots,
        stores=(TableStore(array, tuple(range(count)), node),),
        names={},
        title="constant part",
    )


def _straight(array: str, lines: Sequence[Loop], base: list[float], hits: Mapping[int, int], equations: Terms) -> Straight | None:
    """Small groups: their loops unrolled into one graph, contributions to one place added."""
    graph = Graph()
    sums: dict[int, list[int]] = defaultdict(list)
    comments: dict[int, list[str]] = defaultdict(list)
    names: dict[int, str] = {}
    for loop in lines:
        for run in range(loop.count):
            with labelled_errors(loop.comments[run]):
                nodes = passes.unroll(graph, loop, run)
            for store in loop.stores:
                sums[store.table[run]].append(nodes[store.node])
                comments[store.table[run]].append(loop.comments[run])
    if not sums:
        return None
    for node, op in enumerate(graph.ops):
        if op.code == "load":
            names[node] = load_name(*op.input, equations)
    stores: list[Store] = []
    for position in sorted(sums):
        value = sums[position] if position in hits else [graph.const(base[position]), *sums[position]]
        comment = "; ".join(dict.fromkeys(comments[position]))
        stores.append(Store(array=array, index=position, node=graph.sum(value), accumulate=position in hits, comment=comment))
    return Straight(tuple(graph.ops), tuple(stores), names)
