"""Kernels called many times from C, one after the other, so that the clock measures them and not the way into C."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ncgen.emit.naming import prefix_of
from ncgen.emit.runtime_files import runtime_files
from ncgen.mechanism.arguments import numbers, pointer
from ncgen.report.clock import Run
from ncgen.toolchain.abi import NUMBERS, abi, marked
from ncgen.toolchain.compilers import FLAGS
from ncgen.toolchain.loader import load

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from ncgen.emit.sources import Sources

SCALAR = (*FLAGS, "-fno-tree-vectorize", "-fno-tree-slp-vectorize")
"""The arithmetic rate is that of single numbers, as in straight-line code."""

OPERATIONS = 24
"""Multiplications and additions in one turn of the loop of `ncgen_arithmetic`."""


@cache
def _timing() -> str:
    """The text of timing.c."""
    return Path(__file__).with_name("timing.c").read_text(encoding="utf-8")


@cache
def _repeater() -> tuple[Any, Any]:  # cffi's stubs know neither arrays of NumPy nor what a library declares
    return load({"timing.c": _timing()} | runtime_files("ncgen.h"), marked(_timing(), "functions"), abi(), SCALAR)


@dataclass
class KernelCall:
    """A kernel's function in C and how many numbers it writes; owner: the library, which must live as long."""

    function: object
    size: int
    owner: object
    out: np.ndarray = field(init=False)

    def __post_init__(self) -> None:
        self.out = np.empty(self.size)


def runner(t: float, q: ArrayLike, v: ArrayLike, p: ArrayLike, positions: Sequence[KernelCall], velocity: KernelCall | None = None) -> Run:
    """A function run(times) that calls up to two kernels of the position and one of the velocity; it fills their `out`."""
    ffi, library = _repeater()
    inputs = [np.ascontiguousarray(numbers(a, name)) for name, a in (("q", q), ("v", v), ("p", p))]
    first, second, *_ = [*positions, None, None]
    arguments = []
    for call in (first, second, velocity):
        arguments += [ffi.NULL, ffi.NULL] if call is None else [call.function, pointer(ffi, call.out, count=call.size)]
    pointers = [pointer(ffi, a) for a in inputs]

    def run(times: int, keep: object = (inputs, positions, velocity)) -> None:  # the pointers live as long as the buffers do
        library.ncgen_repeat(times, t, *pointers, *arguments)

    return run


def each(t: float, q: np.ndarray, v: np.ndarray, p: np.ndarray, function: object, moves: bool, out: np.ndarray) -> Run:
    """A function run(times) that calls a kernel, one of the velocity if it `moves`, for every row of q and v, and fills rows of out."""
    ffi, library = _repeater()
    arrays = [np.ascontiguousarray(numbers(a, "rows")) for a in (q, v, p)]
    q_rows, v_rows, parameters = (pointer(ffi, a, count=count) for a, count in zip(arrays, (q.size, q.size, p.size), strict=True))
    results = pointer(ffi, out, count=len(q) * out.shape[1])
    either = (ffi.NULL, function) if moves else (function, ffi.NULL)

    def run(times: int) -> None:
        for _ in range(times):
            library.ncgen_each(len(q), t, q.shape[1], q_rows, v_rows, parameters, *either, out.shape[1], results)

    return run


def typed_runner(
    sources: Sources, real: str, t: float, q: ArrayLike, v: ArrayLike, p: ArrayLike, names: Sequence[str]
) -> tuple[dict[str, Run], dict[str, np.ndarray]]:
    """({kernel: run(times)}, {kernel: its output}) of a model's source compiled for another number type, and for all at once.

    sources: as `ncgen.generate` gives them; t, q, v, p: in double
    """
    number = NUMBERS[real]
    getter = f"{prefix_of(sources.programs.equations.model.name)}_model"
    declarations = marked(_timing(), "functions") + f"const ncgen_model *{getter}(void);"
    ffi, library = load(sources.c | {"timing.c": _timing()}, declarations, abi(real), (*FLAGS, *number.flags))
    model = getattr(library, getter)()
    arrays = [np.array(x, dtype=number.dtype) for x in (q, v, p)]
    programs = sources.programs.programs
    out = {name: np.empty(programs[name].size, dtype=number.dtype) for name in names}

    def run(name: str) -> Run:
        empty = [ffi.NULL] * 4
        call = [getattr(model, name), pointer(ffi, out[name], "ncgen_real[]")]
        calls = [*empty, *call] if "qd" in programs[name].inputs else [*call, *empty]
        state = [pointer(ffi, x, "ncgen_real[]") for x in arrays]

        def turns(times: int, keep: object = (arrays, library)) -> None:
            library.ncgen_repeat(times, t, *state, *calls)

        return turns

    return {name: run(name) for name in names}, out


def arithmetic() -> Run:
    """A function run(times): plain multiplications and additions, OPERATIONS of them each time."""
    _, library = _repeater()
    return lambda times: library.ncgen_arithmetic(times, 0.5, 0.25)
