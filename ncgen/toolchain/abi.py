"""What the C headers declare, as cffi sees it, for every number type that Python can pass on."""

from __future__ import annotations

from typing import Any, NamedTuple, TypeAlias

import numpy as np
from cffi import FFI

from ncgen.emit.runtime_files import runtime_text
from ncgen.toolchain.once import once

Interface: TypeAlias = Any
"""An FFI at work: the stubs of cffi know no members of what it makes, and take no array of NumPy for a buffer."""

InC: TypeAlias = Any
"""What lives in C: a library with its functions, a struct with its members, a number, a pointer."""


class Number(NamedTuple):
    """A number type of C: its name, the compiler's flags that choose it in ncgen.h, and NumPy's type."""

    name: str
    flags: tuple[str, ...]
    dtype: np.dtype

    @property
    def array(self) -> str:
        """The type of an array of them, for cffi."""
        return f"{self.name}[]"


NUMBERS = {
    "double": Number("double", (), np.dtype(np.float64)),
    "float": Number("float", ("-DNCGEN_SINGLE",), np.dtype(np.float32)),
    "long double": Number("long double", ("-DNCGEN_LONG_DOUBLE",), np.dtype(np.longdouble)),
}

DUAL = Number("double _Complex", ("-include", "ncgen_dual.h", "-fcx-limited-range"), np.dtype(np.complex128))
"""A double with its change along a direction (ncgen_dual.h)."""

STRUCTS = {
    "ncgen.h": ("ncgen_model", "ncgen_tangents", "ncgen_parameter_tangents"),
    "ncgen_runtime.h": (
        "ncgen_dynamics",
        "ncgen_elimination",
        "ncgen_event",
        "ncgen_formulas",
        "ncgen_motion",
        "ncgen_options",
        "ncgen_piecewise",
        "ncgen_signals",
        "ncgen_statistics",
        "ncgen_tape",
        "ncgen_tree",
    ),  # fmt: skip
    "ncgen_differentiated.h": ("ncgen_seeded_motion", "ncgen_taped"),
    "ncgen_driven.h": ("ncgen_driven", "ncgen_moment"),
    "ncgen_event_table.h": (),
    "ncgen_impulses.h": ("ncgen_impact",),
    "ncgen_chain.h": ("ncgen_chain",),
    "ncgen_active.h": ("ncgen_active",),
}


def declared(file: str, section: str = "cdef") -> str:
    """What a file of the C library declares between its marks "begin part" and "end part"."""
    return marked(runtime_text(file), section)


@once
def abi_version() -> int:
    """NCGEN_ABI_VERSION of ncgen.h."""
    return int(runtime_text("ncgen.h").split("#define NCGEN_ABI_VERSION ")[1].split()[0])


def marked(text: str, section: str = "cdef") -> str:
    """What stands in a text between the marks "begin part" and "end part"."""
    return text.split(f"/* begin {section} */")[1].split(f"/* end {section} */")[0]


@once
def abi(number: str = "double") -> FFI:
    """The types of ncgen.h."""
    ffi, scalar = FFI(), "double" if number == DUAL.name else number
    ffi.cdef(f"typedef {number} ncgen_real; typedef {scalar} ncgen_scalar;" + declared("ncgen.h"))
    return _completed(ffi, "ncgen.h")


@once
def runtime_abi(number: str = "double") -> FFI:
    """The types of ncgen.h and of the runtime's headers."""
    ffi = FFI()
    ffi.include(abi(number))
    headers = [file for file in STRUCTS if file != "ncgen.h"]
    for file in headers:
        ffi.cdef(declared(file))
    return _completed(ffi, *headers)


def _completed(ffi: FFI, *files: str) -> FFI:
    """Structs are completed here: otherwise they are completed by, and die with, the first library that uses them."""
    for name in (name for file in files for name in STRUCTS[file]):
        ffi.sizeof(name)
    return ffi
