"""Kernels called for rows of states one after the other, and plain arithmetic, both in C, so that the clock measures them alone."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from ncgen.emit.runtime_files import runtime_files
from ncgen.mechanism.arguments import numbers, pointer
from ncgen.report.clock import Run
from ncgen.toolchain.abi import abi, marked
from ncgen.toolchain.compilers import FLAGS
from ncgen.toolchain.loader import load

SCALAR = (*FLAGS, "-fno-tree-vectorize", "-fno-tree-slp-vectorize")
"""The arithmetic rate is that of single numbers, as in straight-line code."""

OPERATIONS = 24
"""Multiplications and additions in one turn of the loop of `ncgen_arithmetic`."""


@cache
def _loops() -> tuple[Any, Any]:
    text = Path(__file__).with_name("loops.c").read_text(encoding="utf-8")
    return load({"loops.c": text} | runtime_files("ncgen.h"), marked(text, "functions"), abi(), SCALAR)


def each(t: float, q: np.ndarray, v: np.ndarray, p: np.ndarray, function: object, moves: bool, out: np.ndarray) -> Run:
    """A function run(times) that calls a kernel, one of the velocity if it `moves`, for every row of q and v, and fills rows of out."""
    ffi, library = _loops()
    arrays = [np.ascontiguousarray(numbers(a, "rows")) for a in (q, v, p)]
    q_rows, v_rows, parameters = (pointer(ffi, a, count=count) for a, count in zip(arrays, (q.size, q.size, p.size), strict=True))
    results = pointer(ffi, out, count=len(q) * out.shape[1])
    either = (ffi.NULL, function) if moves else (function, ffi.NULL)

    def run(times: int) -> None:
        for _ in range(times):
            library.ncgen_each(len(q), t, q.shape[1], q_rows, v_rows, parameters, *either, out.shape[1], results)

    return run


def arithmetic() -> Run:
    """A function run(times): plain multiplications and additions, OPERATIONS of them each time."""
    _, library = _loops()
    return lambda times: library.ncgen_arithmetic(times, 0.5, 0.25)
