"""Long straight lines cut into blocks of bounded size, which languages may print as functions of their own.

Compilers take more than twice as long for a function of twice the length: they look for registers for all values at once. What one
block computes and a later one reads is read from the output where it is written there, and goes through the array `kept` otherwise,
whose places are used again when nobody reads them any more.
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from dataclasses import replace
from typing import TypeGuard

from ncgen.program.ir.blocks import Block, Program, Store, Straight
from ncgen.program.ir.graph import ArrayElement, Op

MAX_OPERATIONS = 400
"""Operations of a block: a humanoid's motion is compiled in three quarters of the time that 800 take, and has no more instructions."""

CUT_ARRAY = "kept"


def cut(program: Program) -> Program:
    """The program with its straight lines cut where they are more than twice as long as MAX_OPERATIONS; loops, and what was cut, stay."""
    if CUT_ARRAY in program.temporaries or not any(map(_is_long, program.blocks)):
        return program
    blocks: list[Block] = []
    most = 1  # C has no empty arrays
    for block in program.blocks:
        if not _is_long(block):
            blocks.append(block)
            continue
        block_of = _parts(block)
        written = {store.node: ArrayElement(store.array, store.index) for store in block.stores if not store.accumulate}
        elements, size = _places(block, block_of, written)
        blocks += [_block(block, block_of, elements, number) for number in range(block_of[-1] + 1)]
        most = max(most, size)
    return replace(program, blocks=tuple(blocks), temporaries={**program.temporaries, CUT_ARRAY: most})


def _is_long(block: Block) -> TypeGuard[Straight]:
    return isinstance(block, Straight) and len(block.ops) > 2 * MAX_OPERATIONS


def _parts(block: Straight) -> list[int]:
    """The number of the block that computes every operation: they stay in their order, and blocks are about equally long."""
    count = -(-len(block.ops) // MAX_OPERATIONS)
    return [k * count // len(block.ops) for k in range(len(block.ops))]


def _places(block: Straight, block_of: list[int], written: dict[int, ArrayElement]) -> tuple[dict[int, ArrayElement], int]:
    """{operation: where it lies} of what later blocks read, and how many places `kept` has; written: what lies in the output."""
    last: dict[int, int] = {}
    for node, op in enumerate(block.ops):
        for a in op.args:
            if block.ops[a].args and block_of[a] < block_of[node]:
                last[a] = max(last.get(a, 0), block_of[node])
    elements = {node: written[node] for node in last if node in written}
    free: list[int] = []
    ending: list[list[int]] = [[] for _ in range(block_of[-1] + 1)]
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


def _block(block: Straight, block_of: list[int], elements: dict[int, ArrayElement], number: int) -> Straight:
    """One of the blocks: its own operations, with loads of what they read from others; leaves are read anew in every block."""
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
    for store in block.stores:
        wanted.setdefault(store.node, []).append(store)
    written: list[Store] = []
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
