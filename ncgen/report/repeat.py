"""Kernels called many times from C, one after the other, so that the clock measures them and not the way into C."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ncgen.emit.runtime_files import runtime_files
from ncgen.mechanism.arguments import numbers, pointer
from ncgen.report.clock import Run
from ncgen.toolchain.abi import abi, marked
from ncgen.toolchain.compilers import FLAGS
from ncgen.toolchain.loader import load

if TYPE_CHECKING:
    from numpy.typing import ArrayLike


@cache
def timing() -> str:
    """The text of timing.c."""
    return Path(__file__).with_name("timing.c").read_text(encoding="utf-8")


@cache
def _repeater() -> tuple[Any, Any]:  # cffi's stubs know neither arrays of NumPy nor what a library declares
    return load({"timing.c": timing()} | runtime_files("ncgen.h"), marked(timing(), "functions"), abi(), FLAGS)


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
