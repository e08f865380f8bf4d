"""Small functions from block to block; none changes what is computed beyond the last bits."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any, TypeVar

from ncgen.model.pieces import Pieces
from ncgen.program.ir.blocks import Block, Column, Loop, Slot
from ncgen.program.ir.functions import FUNCTIONS
from ncgen.program.ir.graph import PIECES, Graph, Op

B = TypeVar("B", bound=Block)

_ARITHMETIC: dict[str, Callable[..., Any]] = {
    "add": lambda a, b: a + b,
    "sub": lambda a, b: a - b,
    "mul": lambda a, b: a * b,
    "div": lambda a, b: a / b,
    "neg": lambda a: -a,
}
ON_NUMBERS = _ARITHMETIC | {name: function.python for name, function in FUNCTIONS.items()} | {PIECES: Pieces.at}
"""{code: function} of all operations on Python's numbers."""


def compute(op: Op, arguments: Iterable[Any], functions: Mapping[str, Callable[..., Any]] = ON_NUMBERS) -> Any:
    """The value of an inner operation on the values of its arguments, which may be numbers of any kind."""
    function = functions[op.code]
    return function(op.pieces, *arguments) if op.code == PIECES else function(*arguments)


def fold_tables(loop: Loop) -> Loop:
    """Operations of a loop that depend on constants alone are computed now and become constants."""
    if all(slot.array != "const" for slot in loop.slots):
        return dead_code(loop)  # a graph has computed what depends on numbers
    graph = Graph()
    columns: dict[int, tuple[float, ...]] = {}  # new node -> its value in every run
    slots: list[Slot | Column] = []
    names: dict[int, str] = {}
    made: list[int] = []

    def table(column: tuple[float, ...], name: str | None) -> int:
        if not all(map(math.isfinite, column)):
            raise OverflowError(f"a constant becomes {next(x for x in column if not math.isfinite(x))}")
        if len(set(column)) == 1:
            node = graph.const(column[0])
        else:
            slot = Column(column)
            if slot not in slots:
                slots.append(slot)
            node = graph.slot(slots.index(slot))
        columns[node] = column
        if name:
            names.setdefault(node, name)
        return node

    for number, op in enumerate(loop.ops):
        name = loop.names.get(number)
        if op.code == "const":
            made.append(table((op.value,) * loop.count, None))
        elif op.code == "slot" and loop.slots[op.slot].array == "const":
            made.append(table(loop.slots[op.slot].table, name))
        elif op.code == "slot":
            slots.append(loop.slots[op.slot])
            node = graph.slot(len(slots) - 1)
            made.append(node)
            if name is not None:
                names[node] = name
        elif op.code == "load":
            made.append(graph.load(*op.input))
        else:
            arguments = tuple(made[a] for a in op.args)
            if all(a in columns for a in arguments):
                made.append(table(tuple(compute(op, run) for run in zip(*(columns[a] for a in arguments), strict=True)), None))
            else:
                made.append(graph.apply(op, arguments))
    stores = tuple([s.of(made[s.node]) for s in loop.stores])
    return dead_code(replace(loop, ops=tuple(graph.ops), slots=tuple(slots), stores=stores, names=names))


def dead_code(block: B) -> B:
    """Only operations and slots that reach a store."""
    return _keep(block, _reachable(block))


def schedule(block: B) -> B:
    """Operations in the order in which the stores need them, so that values live briefly and read well.

    Of an operation's arguments the one that takes longest to reach comes first: the others wait for it no longer than they
    must. That leaves a third less alive at a time in the robot's accelerations, whose lanes then stay in the nearest cache.
    """
    depth = [0] * len(block.ops)
    for node, op in enumerate(block.ops):
        depth[node] = 1 + max([depth[a] for a in op.args], default=0)
    order: list[int] = []
    visited = bytearray(len(block.ops))
    for store in block.stores:
        _append_below(order, block.ops, store.node, visited, depth)
    return _keep(block, order)


def unroll(graph: Graph, block: Block, run: int) -> list[int]:
    """One run of a block as operations of a graph; returns the node of every operation."""
    nodes: list[int] = []
    for op in block.ops:
        if op.code == "const":
            nodes.append(graph.const(op.value))
        elif op.code == "load":
            nodes.append(graph.load(*op.input))
        elif op.code == "slot":
            slot = block.slots[op.slot]
            nodes.append(graph.const(slot.table[run]) if slot.array == "const" else graph.load(slot.array, slot.table[run]))
        else:
            nodes.append(graph.apply(op, tuple(nodes[a] for a in op.args)))
    return nodes


def operations(block: Block) -> int:
    """How many operations it has but leaves, a loop's counted once."""
    return sum(bool(op.args) for op in block.ops)


def uses(block: Block) -> dict[int, int]:
    """How often every operation is read, by operations and stores."""
    count = dict.fromkeys(range(len(block.ops)), 0)
    for op in block.ops:
        for a in op.args:
            count[a] += 1
    for store in block.stores:
        count[store.node] += 1
    return count


def _reachable(block: Block) -> list[int]:
    """Operations that reach a store, in their order: arguments come before what reads them, so one pass backwards finds them."""
    alive = bytearray(len(block.ops))
    for store in block.stores:
        alive[store.node] = 1
    for node in range(len(block.ops) - 1, -1, -1):
        if alive[node]:
            for a in block.ops[node].args:
                alive[a] = 1
    return [node for node, lives in enumerate(alive) if lives]


def _append_below(order: list[int], ops: Sequence[Op], root: int, visited: bytearray, depth: Sequence[int]) -> None:
    """Append new operations below a root to an order, arguments first, the deepest of them before the others; iterative, since graphs can
    be deep."""
    waiting = [root]
    while waiting:
        node = waiting.pop()
        if node < 0:  # its arguments are there
            order.append(~node)
        elif not visited[node]:
            visited[node] = 1
            waiting.append(~node)
            arguments = ops[node].args[::-1]
            waiting += sorted(arguments, key=depth.__getitem__) if len(arguments) > 1 else arguments


def _is_whole(block: Block, order: list[int]) -> bool:
    """Whether all operations stay where they are, and with them all slots."""
    return order == list(range(len(order))) and len({op.slot for op in block.ops if op.code == "slot"}) == len(block.slots)


def _keep(block: B, order: list[int]) -> B:
    """The block with these operations only, in this order (arguments first)."""
    if len(order) == len(block.ops) and _is_whole(block, order):
        return block
    new = {node: k for k, node in enumerate(order)}
    ops = [block.ops[node] for node in order]
    names = {new[node]: name for node, name in block.names.items() if node in new}
    if isinstance(block, Loop):
        used = sorted({op.slot for op in ops if op.code == "slot"})
        numbers = {slot: k for k, slot in enumerate(used)}
        ops = [op._replace(leaf=numbers[op.slot]) if op.code == "slot" else op for op in ops]
        block = replace(block, slots=tuple(block.slots[s] for s in used))
    renumbered = tuple([op.renumbered(new) for op in ops])
    stores = tuple([s.of(new[s.node]) for s in block.stores])
    return replace(block, ops=renumbered, stores=stores, names=names)
