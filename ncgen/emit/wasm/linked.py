"""A mechanism's kernels as one module, which is linked to the runtime."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple

from ncgen.emit.wasm.binary import F64, I32, LINK, Import, Signature, linked
from ncgen.emit.wasm.code import SINCOS, called, function
from ncgen.emit.wasm.memory import Memory
from ncgen.program.ir.angles import SHARED
from ncgen.program.ir.blocks import Program
from ncgen.program.ir.functions import FUNCTIONS
from ncgen.program.ir.graph import PIECES

RUNTIME = {SINCOS: Signature((F64, I32, I32), ()), PIECES: Signature((F64, I32, I32, I32, I32, F64), (F64,))}
"""Functions of ncgen_linked.h that kernels call."""


class Linked(NamedTuple):
    """A module that is linked to the runtime.

    binary: its bytes; size, rooms: bytes of memory for its tables and, behind them, its arrays; integers, numbers: where its two tables of
    a description are
    """

    binary: bytes
    size: int
    rooms: int
    integers: int
    numbers: int


def linked_module(
    programs: Iterable[Program], prefix: str, integers: Sequence[int], numbers: Sequence[float], custom: dict[str, bytes]
) -> Linked:
    """The module with a function `prefix_name(t, q, qd, p, out)` for every program, of the arguments that it has, which returns NCGEN_OK.

    Arguments but t are addresses of doubles in the memory that the module shares with the runtime; custom: sections that engines pass over
    """
    programs = list(programs)
    memory = Memory(_rooms(programs))
    names = set().union(*map(called, programs))
    imports = [Import("Math", name, Signature((F64,) * FUNCTIONS[name].arity, (F64,))) for name in sorted(names - RUNTIME.keys())]
    imports += [Import(LINK, f"ncgen_linked_{name}", RUNTIME[name]) for name in sorted(names & RUNTIME.keys())]
    numbers_of = {name: k for k, name in enumerate([*sorted(names - RUNTIME.keys()), *sorted(names & RUNTIME.keys())])}
    functions = [function(program, prefix, memory, numbers_of) for program in programs]
    addresses = memory.integers(integers), memory.numbers(tuple(numbers))
    return Linked(linked(imports, functions, memory.data, custom), len(memory.data), memory.size, *addresses)


def _rooms(programs: list[Program]) -> dict[str, int]:
    """{array: its largest size} of what kernels write besides their results; they run one after the other."""
    rooms: dict[str, int] = {}
    for program in programs:
        angles = dict.fromkeys(SHARED.values(), len(program.angles)) if program.angles else {}
        for name, size in {**program.temporaries, **angles}.items():
            rooms[name] = max(size, rooms.get(name, 0))
    return rooms
