"""A program written into a graph, with nodes of that graph for its inputs: functions of functions, to be simplified and differentiated."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from ncgen.program.ir.angles import SHARED
from ncgen.program.ir.blocks import Block, Program, Slot
from ncgen.program.ir.graph import Graph, Op


def inlined(graph: Graph, program: Program, inputs: Mapping[str, Sequence[int]]) -> list[int]:
    """Nodes of a program's output; inputs: {"t": [node], "q": nodes, …}."""
    zero = graph.const(0.0)
    arrays = {name: list(inputs[name]) for name in program.inputs}
    arrays |= {name: [zero] * size for name, size in [*program.temporaries.items(), (program.output, program.size)]}
    if program.angles:
        arrays |= {name: [graph.call(code, arrays["q"][i]) for i in program.angles] for code, name in SHARED.items()}
    for block in program.blocks:
        for run in range(block.count):
            nodes: list[int] = []
            for op in block.ops:
                nodes.append(_node(graph, op, block, run, arrays, nodes))
            for store in block.stores:
                array, index = arrays[store.array], store.table[run]
                array[index] = graph.add(array[index], nodes[store.node]) if store.accumulate else nodes[store.node]
    return arrays[program.output]


def _node(graph: Graph, op: Op, block: Block, run: int, arrays: Mapping[str, Sequence[int]], nodes: Sequence[int]) -> int:
    if op.code == "const":
        return graph.const(op.value)
    if op.code == "load":
        return arrays[op.input.array][op.input.position]
    if op.code == "slot":
        slot = block.slots[op.slot]
        return arrays[slot.array][slot.table[run]] if isinstance(slot, Slot) else graph.const(slot.table[run])
    return graph.apply(op, tuple(nodes[a] for a in op.args))
