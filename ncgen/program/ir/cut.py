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
RATES = "rates"
"""The temporary that phases of a program hand over."""


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
        plan = _Plan(block, _parts(len(block.ops), 0))
        blocks += [_block(plan, number) for number in range(plan.count)]
        most = max(most, plan.size)
    return replace(program, blocks=tuple(blocks), temporaries={**program.temporaries, CUT_ARRAY: most})


def cut_into_phases(program: Program) -> Program:
    """A program of one straight line with its phases in blocks of their own. Its first outputs are the rates that the first phase finds,
    then those that the second one puts in their place."""
    phases, (block,) = program.phases, program.blocks
    assert phases is not None and isinstance(block, Straight), "a straight line with phases"
    stores, phase_of_store = [], []
    for store in block.stores:
        phase, index = divmod(store.index, phases.rates) if store.index < 2 * phases.rates else (2, store.index - 2 * phases.rates)
        phase_of_store.append(phase if phase < 2 or index in phases.leading else 3)
        stores.append(replace(store, array=RATES if phase < 2 else store.array, index=index))
    phase_of = _phases(block, phase_of_store)
    order = sorted(range(len(block.ops)), key=phase_of.__getitem__)
    new = {node: k for k, node in enumerate(order)}
    block = replace(
        block,
        ops=tuple([block.ops[node].renumbered(new) for node in order]),
        stores=tuple([store.of(new[store.node]) for store in stores]),
        names={new[node]: name for node, name in block.names.items()},
    )
    block_of: list[int] = []
    begins = []
    for phase in range(4):
        begins.append(block_of[-1] + 1 if block_of else 0)
        block_of += _parts(phase_of.count(phase), begins[-1])
    plan = _Plan(block, block_of, [begins[phase] for phase in phase_of_store])
    return replace(
        program,
        size=program.size - 2 * phases.rates,
        blocks=tuple([_block(plan, number) for number in range(plan.count)]),
        temporaries={**program.temporaries, RATES: max(phases.rates, 1), CUT_ARRAY: max(plan.size, 1)},
        inputs=tuple(name for name in program.inputs if name != RATES),
        phases=phases._replace(ends=(begins[1], begins[2], begins[3])),
    )


def _phases(block: Straight, phase_of_store: list[int]) -> list[int]:
    """The phase of every operation: the first has what both the second and later ones need, and what its own outputs do."""
    needed = [bytearray(len(block.ops)) for _ in range(4)]
    for store, phase in zip(block.stores, phase_of_store, strict=True):
        needed[phase][store.node] = 1
    for node in range(len(block.ops) - 1, -1, -1):
        for each in needed:
            if each[node]:
                for a in block.ops[node].args:
                    each[a] = 1
    first, second, third, _ = needed
    last = needed[3]
    return [
        0 if first[k] or (second[k] and (third[k] or last[k])) else 1 if second[k] else 2 if third[k] else 3 for k in range(len(block.ops))
    ]


def _is_long(block: Block) -> TypeGuard[Straight]:
    return isinstance(block, Straight) and len(block.ops) > 2 * MAX_OPERATIONS


class _Plan:
    """Where a straight line is cut: blocks are about equally long, and operations stay in their order.

    block_of: the number of the block that computes every operation; count: how many there are
    store_block: the block of every store: that of its operation, or the least that is given
    elements, size: {operation: where it lies} of what later blocks read, and how many places `kept` has
    """

    def __init__(self, block: Straight, block_of: list[int], least: list[int] | None = None) -> None:
        self.block, self.block_of = block, block_of
        least = least or [0] * len(block.stores)
        self.store_block = [max(block_of[store.node], each) for store, each in zip(block.stores, least, strict=True)]
        self.count = 1 + max(block_of[-1], *self.store_block)
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
            if not store.accumulate and number == block_of[store.node] and store.array != RATES:
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


def _block(plan: _Plan, number: int) -> Straight:
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
