"""Sines and cosines of angles, computed once for the whole program and all at the same time.

An angle coordinate enters a program through its sine and cosine. Taken out of the blocks they become two
arrays that a loop without branches fills, which processors do several angles at a time; for the robot
they were half the time of Φ.
"""

from __future__ import annotations

from dataclasses import replace

from ncgen.program.ir import passes
from ncgen.program.ir.blocks import Block, Loop, Program, Slot
from ncgen.program.ir.graph import ArrayElement, Op

SHARED = {"sin": "sine", "cos": "cosine"}
"""Functions of a coordinate, and the arrays that hold their values."""


def share_angles(program: Program) -> Program:
    """The program with sin and cos of coordinates read from the arrays `sine` and `cosine` of `program.ir.angles`."""
    angles = sorted({i for block in program.blocks for op in block.ops for i in _positions(op, block)})
    if not angles:
        return program
    index = {q: k for k, q in enumerate(angles)}
    blocks = tuple(passes.dead_code(_rewrite(block, index)) for block in program.blocks)
    return replace(program, blocks=blocks, angles=tuple(angles))


def _positions(op: Op, block: Block) -> tuple[int, ...]:
    """Positions in q whose sine or cosine an operation takes, run by run."""
    if op.code not in SHARED:
        return ()
    inner = block.ops[op.args[0]]
    if inner.code == "load":
        array, position = inner.input
        return (position,) if array == "q" else ()
    if inner.code == "slot":
        slot = block.slots[inner.slot]
        return slot.table if slot.array == "q" else ()
    return ()


def _rewrite(block: Block, index: dict[int, int]) -> Block:
    ops, names = list(block.ops), dict(block.names)
    slots = list(block.slots)
    for number, op in enumerate(block.ops):
        positions = _positions(op, block)
        if not positions:
            continue
        table = tuple(index[i] for i in positions)
        if isinstance(block, Loop):
            slots.append(Slot(SHARED[op.code], table))
            ops[number] = Op("slot", (), len(slots) - 1)
        else:
            ops[number] = Op("load", (), ArrayElement(SHARED[op.code], table[0]))
        names[number] = f"{op.code}_{block.names.get(op.args[0], f'angle{table[0]}')}"
    if isinstance(block, Loop):
        return replace(block, ops=tuple(ops), names=names, slots=tuple(slots))
    return replace(block, ops=tuple(ops), names=names)
