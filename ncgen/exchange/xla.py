"""Functions of arrays as operations of JAX: on the processor XLA calls them where its arguments lie, and they fill its own results.

What XLA calls is a few lines of C (`xla.c`), compiled with the header that jaxlib brings. Without that, or without a compiler, JAX
calls Python, and copies.
"""

from __future__ import annotations

import secrets
from collections.abc import Callable
from importlib import import_module
from math import prod
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np

from ncgen.errors import CompileError, NcgenError, shortened
from ncgen.exchange.motion_functions import ArrayFunction
from ncgen.toolchain.abi import InC, Interface, marked
from ncgen.toolchain.loader import load
from ncgen.toolchain.once import once

SOURCE = Path(__file__).with_name("xla.c")
HEADER = "xla/ffi/api/c_api.h"
TARGET = "ncgen_fill"

_functions: dict[int, ArrayFunction] = {}
"""Those that XLA calls. They stay: a program that calls one may be anywhere, and for as long as the process lasts. Numbers are random, so
that a program that was compiled in another process, and kept, finds none here in place of a wrong one."""


def operation(function: ArrayFunction) -> Callable[..., Any]:
    """A function of arrays of JAX, which jit and vmap take."""
    jax = import_module("jax")
    shapes = tuple(jax.ShapeDtypeStruct(shape, np.float64) for shape in function.result_shapes)

    def in_python(*arrays: Any) -> tuple[np.ndarray, ...]:
        return function(*map(np.asarray, arrays))

    def call(*arrays: Any) -> Any:
        if jax.default_backend() == "cpu" and _handler():
            return jax.ffi.ffi_call(TARGET, shapes, vmap_method="expand_dims")(*arrays, function=np.int64(_number(function)))
        return jax.pure_callback(in_python, shapes, *arrays, vmap_method="expand_dims")

    return call


@once
def _number(function: ArrayFunction) -> int:
    number = secrets.randbits(62)
    _functions[number] = function
    return number


@once
def _handler() -> tuple[InC, ...] | None:
    """What XLA calls, registered, and what must live as long; None where JAX has no such interface, or no compiler takes it."""
    try:
        of_jax = import_module("jax.ffi")
        header = Path(of_jax.include_dir(), HEADER).read_text(encoding="utf-8")
    except (ImportError, OSError):
        return None
    source = SOURCE.read_text(encoding="utf-8")
    files = {"c_api.h": header, SOURCE.name: source}
    try:
        ffi, library = load(files, marked(source) + "void *ncgen_xla_call(void *call);", None)
    except CompileError:
        return None
    library.ncgen_xla_filling = fill = _fill(ffi, library.NCGEN_XLA_LINE)
    address = int(ffi.cast("uintptr_t", ffi.addressof(library, "ncgen_xla_call")))
    of_jax.register_ffi_target(TARGET, of_jax.pycapsule(address), platform="cpu")
    return library, fill


def _fill(ffi: Interface, room: int) -> InC:
    """`ncgen_xla_fill`; room: bytes of a line."""

    def fill(number: int, count: int, arrays: InC, line: InC) -> int:
        if number not in _functions:
            raise NcgenError("this program was compiled in another process, whose motions are not here; let JAX trace it again")
        _functions[number].fill(*(_array(ffi, arrays[k]) for k in range(count)))
        return 0

    def write_message(kind: type[BaseException], raised: BaseException, traceback: TracebackType) -> None:
        text = str(raised) if isinstance(raised, NcgenError) else shortened(f"{kind.__name__}: {raised}")
        written = text.encode()[: room - 1] + b"\0"
        ffi.memmove(traceback.tb_frame.f_locals["line"], written, len(written))

    return ffi.callback("ncgen_xla_fill *", fill, error=1, onerror=write_message)


def _array(ffi: Interface, array: InC) -> np.ndarray:
    """An `ncgen_xla_array` as NumPy sees it."""
    shape = ffi.unpack(array.sizes, array.rank)
    return np.frombuffer(ffi.buffer(array.numbers, 8 * prod(shape)), dtype=float).reshape(shape)
