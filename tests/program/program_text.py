"""A program as text, for reading and for comparing."""

from __future__ import annotations

from ncgen.program.ir.blocks import Loop, Program, Store
from ncgen.program.ir.graph import PIECES, Op


def dump(program: Program) -> str:
    """One line an operation: `%3 = mul %1 %2`, with loops, tables and stores spelled out."""
    lines = [f"program {program.name}({', '.join(program.inputs)}) -> {program.output}[{program.size}]"]
    lines += [f"  temporary {name}[{size}]" for name, size in program.temporaries.items()]
    lines += [f"  sine, cosine = q[{', '.join(map(str, program.angles))}]"] if program.angles else []
    for block in program.blocks:
        loop = isinstance(block, Loop)
        lines.append(f"  loop {block.count}  # {block.title}" if loop else f"  straight  # {block.title}".rstrip(" #"))
        for number, slot in enumerate(block.slots):
            lines.append(f"    slot {number} = {slot.array}[{', '.join(map(repr, slot.table))}]")
        for number, op in enumerate(block.ops):
            name = f"  # {block.names[number]}" if number in block.names else ""
            lines.append(f"    %{number} = {_operation(op)}{name}")
        for store in block.stores:
            indices = ", ".join(map(str, store.table))
            sign = "+=" if store.accumulate else "="
            comment = f"  # {store.comment}" if isinstance(store, Store) and store.comment else ""
            lines.append(f"    {store.array}[{indices}] {sign} %{store.node}{comment}")
    return "\n".join(lines) + "\n"


def _operation(op: Op) -> str:
    if op.code == "const":
        return f"const {op.value!r}"
    if op.code == "load":
        array, position = op.input
        return f"load {array}[{position}]"
    if op.code == "slot":
        return f"slot {op.slot}"
    if op.code == PIECES:
        return f"pieces {op.pieces.degree} {len(op.pieces.knots)} %{op.args[0]}"
    return f"{op.code} " + " ".join(f"%{a}" for a in op.args)
