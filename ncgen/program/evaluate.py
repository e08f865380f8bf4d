"""Running a program directly, on any kind of number: floats, complex numbers, fractions, mpmath.

Slow and simple. It serves where compiling is not worth it, and as one more witness in tests.
"""

from __future__ import annotations

from ncgen.program.angles import SHARED
from ncgen.program.blocks import Loop, Program
from ncgen.program.functions import FUNCTIONS
from ncgen.program.passes import ARITHMETIC_ON_NUMBERS, compute


def evaluate(program: Program, inputs: dict[str, object], functions: dict | None = None, number=float) -> list:
    """The output of a program.

    inputs: {"t": number, "q": sequence, …}
    functions: {name: callable} where the numbers need other elementary functions than `math`'s
    number: turns a constant into the kind of number wanted, such as `mpmath.mpf`
    """
    table = ARITHMETIC_ON_NUMBERS | {name: f.python for name, f in FUNCTIONS.items()} | (functions or {})
    arrays = {name: [inputs[name]] if name == "t" else inputs[name] for name in program.inputs}
    arrays |= {name: [number(0.0)] * size for name, size in program.temporaries.items()}
    arrays[program.output] = [number(0.0)] * program.size
    if program.angles:
        arrays |= {name: [table[code](arrays["q"][i]) for i in program.angles] for code, name in SHARED.items()}
    for block in program.blocks:
        for run in range(block.count):
            values = []
            for op in block.ops:
                values.append(_value(op, block, run, arrays, values, table, number))
            for store in block.stores:
                index = store.table[run] if isinstance(block, Loop) else store.index
                array = arrays[store.array]
                array[index] = array[index] + values[store.node] if store.accumulate else values[store.node]
    return arrays[program.output]


def _value(op, block, run, arrays, values, table, number):
    if op.code == "const":
        return number(op.leaf)
    if op.code == "load":
        array, index = op.leaf
        return arrays[array][index]
    if op.code == "slot":
        slot = block.slots[op.leaf]
        return number(slot.table[run]) if slot.array == "const" else arrays[slot.array][slot.table[run]]
    return compute(op, [values[a] for a in op.args], table)
