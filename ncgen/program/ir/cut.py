"""Long straight lines cut into blocks of bounded size, which languages may print as functions of their own.

Compilers take more than twice as long for a function of twice the length: they look for registers for all values at once. What one
block computes and a later one reads is read from the output where it is written there, and goes through the array `kept` otherwise,
whose places are used again when nobody reads them any more.
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from dataclasses import replace
from typing import TypeGuard

from ncgen.program.ir.blocks import Block, Loop, Program, Store, Straight
from ncgen.program.ir.graph import ArrayElement, Op

MAX_OPERATIONS = 400
"""Operations of a block: a humanoid's motion is compiled in three quarters of the time that 800 take, and has no more instructions."""

CUT_ARRAY = "kept"


def cut(program: Program) -> Program:
    """The program with its straight lines cut where they are more than twice as long as MAX_OPERATIONS, and behind its leading outputs;
    loops, and what was cut, stay."""
    if CUT_ARRAY in program.temporaries or not (program.leading or any(map(_is_long, program.blocks))):
        return program
    blocks: list[Block] = []
    most = 1  # C has no empty arrays
    for block in program.blocks:
        if isinstance(block, Loop) or not (program.leading or _is_long(block)):
            blocks.append(block)
            continue
        plan = _Cuts(block, program.output, program.leading.size if program.leading else 0)
        blocks += [_block(plan, number) for number in range(plan.count)]
        most = max(most, plan.size)
    return replace(program, blocks=tuple(blocks), temporaries={**program.temporaries, CUT_ARRAY: most})


def _is_long(block: Block) -> TypeGuard[Straight]:
    return isinstance(block, Straight) and len(block.ops) > 2 * MAX_OPERATIONS


class _Cuts:
    """Where a straight line is cut: blocks are about equally long, and operations stay in their order.

    block_of: the number of the block that computes every operation; count: how many there are
    store_block: the block of every store, which is that of its operation unless others are to be had without it
    elements, size: {operation: where it lies} of what later blocks read, and how many places `kept` has
    """

    def __init__(self, block: Straight, output: str, leading: int) -> None:
        self.block = block
        leads = [store.array == output and store.index < leading for store in block.stores]
        nodes = [store.node for store, is_leading in zip(block.stores, leads, strict=True) if is_leading]
        before = 1 + max(nodes, default=-1)
        self.block_of = [*_parts(before, 0), *_parts(len(block.ops) - before, -(-before // MAX_OPERATIONS))]
        first = [0 if is_leading else -(-before // MAX_OPERATIONS) for is_leading in leads]
        self.store_block = [max(self.block_of[store.node], least) for store, least in zip(block.stores, first, strict=True)]
        self.count = 1 + max(self.block_of[-1], *self.store_block)
        self.elements, self.size = self._places()

    def _places(self) -> tuple[dict[int, ArrayElement], int]:
        """What lies in the output where it is written is read there."""
        block, block_of = self.block, self.block_of
        written: dict[int, ArrayElement] = {}
        last: dict[int, int] = {}

        def reads(node: int, number: int) -> None:
            if block.ops[node].args and block_of[node] < number:
                last[node] = max(last.get(node, 0), number)

        for store, number in zip(block.stores, self.store_block, strict=True):
            if not store.accumulate and number == block_of[store.node]:
                written[store.node] = ArrayElement(store.array, store.index)
            reads(store.node, number)
        for node, op in enumerate(block.ops):
            for a in op.args:
                reads(a, block_of[node])
        elements = {node: written[node] for node in last if node in written}
        free: list[int] = []
        ending: list[list[int]] = [[] for _ in range(self.count)]
        size = begun = 0
        for node in sorted(last.keys() - elements.keys()):
            for ended in range(begun, block_of[node]):  # their places may be written from the next block on
                free += ending[ended]
            begun = max(begun, block_of[node])
            if not free:
                free.append(size)
                size += 1
            elements[node] = ArrayElement(CUT_ARRAY, free[-1])
            ending[last[node]].append(free.pop())
        return elements, size


def _parts(length: int, begun: int) -> list[int]:
    """The numbers of blocks, from `begun` on, that compute so many operations."""
    count = -(-length // MAX_OPERATIONS)
    return [begun + k * count // length for k in range(length)]


def _block(plan: _Cuts, number: int) -> Straight:
    """One of the blocks: its own operations, with loads of what they read from others; leaves are read anew in every block."""
    block, block_of, elements = plan.block, plan.block_of, plan.elements
    ops: list[Op] = []
    new: dict[int, int] = {}
    names: dict[int, str] = {}

    def take(node: int) -> int:
        """An operation of the long line in this block."""
        if node not in new:
            op = block.ops[node]
            is_read = bool(op.args) and block_of[node] < number
            op = Op("load", (), elements[node]) if is_read else op.renumbered(new)
            new[node] = len(ops)
            if node in block.names:
                names[len(ops)] = block.names[node]
            ops.append(op)
        return new[node]

    wanted: dict[int, list[Store]] = {}
    for store, home in zip(block.stores, plan.store_block, strict=True):
        if home == number:
            wanted.setdefault(store.node, []).append(store)
    late = [node for node in wanted if block_of[node] < number]
    written = [replace(store, node=take(node)) for node in late for store in wanted[node]]
    for node in range(bisect_left(block_of, number), bisect_right(block_of, number)):
        if not block.ops[node].args and node not in wanted:
            continue  # a leaf is taken where it is read
        for a in block.ops[node].args:
            take(a)
        take(node)
        written += (
            [Store(array=CUT_ARRAY, index=elements[node].position, node=new[node])]
            if node in elements and elements[node].array == CUT_ARRAY
            else []
        )
        written += [replace(store, node=new[node]) for store in wanted.get(node, ())]
    return replace(block, ops=tuple(ops), stores=tuple(written), names=names)
