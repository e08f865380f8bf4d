"""Running a program directly, on any kind of number: floats, complex numbers, fractions, mpmath.

Slow and simple. It serves where compiling is not worth it, and as one more witness in tests.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from ncgen.program.ir.angles import SHARED
from ncgen.program.ir.blocks import Block, Program
from ncgen.program.ir.functions import FUNCTIONS
from ncgen.program.ir.graph import Op
from ncgen.program.ir.passes import ON_NUMBERS, compute


def evaluate(
    program: Program,
    inputs: Mapping[str, Any],
    functions: Mapping[str, Callable[..., Any]] | None = None,
    number: Callable[[float], Any] = float,
) -> list[Any]:
    """The output of a program, as numbers of the kind that `inputs` and `number` are of.

    inputs: {"t": number, "q": sequence, …}
    functions: {name: callable} where the numbers need other elementary functions than `math`'s; of "pieces" it is one of (polynomials, x)
    number: turns a constant into the kind of number wanted, such as `mpmath.mpf`
    """
    table = {**ON_NUMBERS, **(functions or {})}
    arrays = {name: [inputs[name]] if name == "t" else inputs[name] for name in program.inputs}
    arrays |= {name: [number(0.0)] * size for name, size in program.temporaries.items()}
    arrays[program.output] = [number(0.0)] * program.size
    if program.angles:
        arrays |= {name: [table[code](arrays["q"][i]) for i in program.angles] for code, name in SHARED.items()}
    for block in program.blocks:
        for run in range(block.count):
            values: list[Any] = []
            for op in block.ops:
                arguments = [values[a] for a in op.args]
                values.append(compute(op, arguments, table) if arguments else _leaf(op, block, run, arrays, number))
            for store in block.stores:
                index, array = store.table[run], arrays[store.array]
                array[index] = array[index] + values[store.node] if store.accumulate else values[store.node]
    return arrays[program.output]


def evaluate_rows(program: Program, p: np.ndarray) -> np.ndarray:
    """The output of a program of parameters alone at p (…, n_p), real or complex, shape (…, size)."""
    functions = {name: getattr(np, function.numpy) for name, function in FUNCTIONS.items()}
    columns = evaluate(program, {"p": np.moveaxis(p, -1, 0)}, functions)
    if p.ndim == 1:
        return np.array(columns, dtype=p.dtype)
    return np.stack(np.broadcast_arrays(*columns, p[..., 0])[:-1], axis=-1)


def _leaf(op: Op, block: Block, run: int, arrays: Mapping[str, Any], number: Callable[[float], Any]) -> Any:
    """The value of an operation without arguments."""
    if op.code == "const":
        return number(op.value)
    if op.code == "load":
        array, position = op.input
        return arrays[array][position]
    slot = block.slots[op.slot]
    return number(slot.table[run]) if slot.array == "const" else arrays[slot.array][slot.table[run]]
