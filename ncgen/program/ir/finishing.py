"""A block as it is emitted: what no store needs left out, factors where they cost least, the rest in the order in which stores need it."""

from __future__ import annotations

from dataclasses import replace
from typing import TypeVar

from ncgen.program.ir.blocks import Block
from ncgen.program.ir.factoring import factored
from ncgen.program.ir.graph import Op
from ncgen.program.ir.multiples import spread
from ncgen.program.ir.passes import dead_code, operations, schedule, uses

B = TypeVar("B", bound=Block)


def finish(block: B) -> B:
    """The block as it is emitted."""
    return schedule(_plain_differences(factored(_spread(dead_code(block)))))


def _spread(block: B) -> B:
    """The block with its numbers within sums of multiples, if that leaves fewer operations."""
    changes = spread(block.ops, [store.node for store in block.stores])
    if changes is None:
        return block
    graph, new = changes
    stores = tuple([s.of(new[s.node]) for s in block.stores])
    names = {new[k]: name for k, name in block.names.items()}
    made = dead_code(replace(block, ops=tuple(graph.ops), stores=stores, names=names))
    return made if operations(made) < operations(block) else block


def _plain_differences(block: B) -> B:
    """−(a − b) becomes b − a where a − b serves nothing else."""
    count, ops = uses(block), list(block.ops)
    turned = [k for k, op in enumerate(ops) if op.code == "neg" and ops[op.args[0]].code == "sub" and count[op.args[0]] == 1]
    for node in turned:
        ops[node] = Op("sub", ops[ops[node].args[0]].args[::-1])
    return dead_code(replace(block, ops=tuple(ops))) if turned else block
