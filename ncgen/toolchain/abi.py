"""What the C headers declare, as cffi sees it, for every number type that Python can pass on."""

from __future__ import annotations

from typing import Any, NamedTuple, TypeAlias

import numpy as np

from ncgen.emit.runtime_files import runtime_text
from ncgen.toolchain.interfaces import Interface, base_interface
from ncgen.toolchain.once import once

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

HEADERS = (
    "ncgen_runtime.h",
    "ncgen_differentiated.h",
    "ncgen_driven.h",
    "ncgen_event_table.h",
    "ncgen_impulses.h",
    "ncgen_chain.h",
    "ncgen_active.h",
    "ncgen_sliding.h",
)
"""Headers of the runtime with types for Python, each after those that it needs."""


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
def abi(number: str = "double") -> Interface:
    """The types of ncgen.h."""
    scalar = "double" if number == DUAL.name else number
    return base_interface(f"typedef {number} ncgen_real; typedef {scalar} ncgen_scalar;" + declared("ncgen.h"))


@once
def runtime_abi(number: str = "double") -> Interface:
    """The types of ncgen.h and of the runtime's headers."""
    return base_interface("".join(map(declared, HEADERS)), abi(number))
