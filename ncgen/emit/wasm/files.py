"""A mechanism's kernels as one module."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, NamedTuple

from ncgen.emit.naming import prefix_of
from ncgen.emit.wasm import binary
from ncgen.emit.wasm.binary import F64, Import, Signature, WasmFunction
from ncgen.emit.wasm.code import SINCOS, called, function
from ncgen.emit.wasm.lookup import lookup
from ncgen.emit.wasm.memory import Memory
from ncgen.emit.wasm.sincos import sincos
from ncgen.program.ir.angles import SHARED
from ncgen.program.ir.blocks import Program
from ncgen.program.ir.functions import FUNCTIONS
from ncgen.program.ir.graph import PIECES

if TYPE_CHECKING:
    from ncgen.program.programs import Programs

IS_READ = False


def model_files(programs: Programs) -> dict[str, bytes]:
    """{file name: bytes} of the module."""
    prefix = prefix_of(programs.equations.model.name)
    return {f"{prefix}.wasm": module(programs.programs.values(), prefix)}


def module(programs: Iterable[Program], prefix: str) -> bytes:
    """The bytes of a module with a function `prefix_name(t, q, qd, p, out)` for every program, of the arguments that it has.

    Arguments but t are addresses of doubles in the module's memory; from `ncgen_heap` on it is the caller's.
    """
    programs = list(programs)
    memory = Memory(_rooms(programs))
    imports, functions = _functions(programs, prefix, memory)
    return binary.module(imports, functions, memory.start, memory.data, memory.heap)


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
    """The same functions, which return a status, for a memory that they share with others; custom: sections that engines pass over."""
    programs = list(programs)
    memory = Memory(_rooms(programs), linked=True)
    imports, functions = _functions(programs, prefix, memory)
    places = memory.integers(integers), memory.numbers(tuple(numbers))
    return Linked(binary.linked(imports, functions, memory.data, custom), len(memory.data), memory.start, *places)


def _functions(programs: list[Program], prefix: str, memory: Memory) -> tuple[list[Import], list[WasmFunction]]:
    """What a module imports, and its functions."""
    names = set().union(*map(called, programs))
    imported = sorted(names - {SINCOS, PIECES} | (set(SHARED) if SINCOS in names else set()))
    imports = [Import("Math", name, Signature((F64,) * FUNCTIONS[name].arity, (F64,))) for name in imported]
    helpers = sorted(names & {SINCOS, PIECES})
    numbers = {name: k for k, name in enumerate([*imported, *helpers])}
    functions = [lookup() if name == PIECES else sincos(numbers["sin"], numbers["cos"]) for name in helpers]
    functions += [function(program, prefix, memory, numbers) for program in programs]
    return imports, functions


def _rooms(programs: list[Program]) -> dict[str, int]:
    """{array: its largest size} of what kernels write besides their results; they run one after the other."""
    rooms: dict[str, int] = {}
    for program in programs:
        angles = dict.fromkeys(SHARED.values(), len(program.angles)) if program.angles else {}
        for name, size in {**program.temporaries, **angles}.items():
            rooms[name] = max(size, rooms.get(name, 0))
    return rooms
