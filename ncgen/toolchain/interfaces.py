"""What passes arguments to functions in C, by cffi: declarations are parsed once, and from then on known to the cache.

The parser takes 60 ms to load and to read the headers, a tenth of a short run. The cache holds what it makes of declarations, which is
data: cffi's own description of types, as in the modules that it writes for programs that are installed.
"""

from __future__ import annotations

import ast
import hashlib
import sys
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

import _cffi_backend

from ncgen.files import contents
from ncgen.toolchain.cache_location import MAX_FILE_BYTES, keep, kept
from ncgen.toolchain.once import once

if TYPE_CHECKING:
    from cffi import FFI

Interface: TypeAlias = Any
"""An FFI at work: the stubs of cffi know no members of what it makes, and take no array of NumPy for a buffer."""

KIND = "interfaces"
NAME = "declarations"
"""Of the modules that cffi writes."""

Texts: TypeAlias = tuple[str, ...]
"""Declarations in C, each of which knows the types of those before it."""

_bases: dict[Interface, Texts] = {}
"""{interface: its declarations} of those on which others are built; they live as long as the process."""


def base_interface(declarations: str, base: Interface | None = None) -> Interface:
    """As `interface`, of types for other interfaces."""
    made = interface(declarations, base)
    _bases[made] = _texts(declarations, base)
    return made


def interface(declarations: str, base: Interface | None = None) -> Interface:
    """Return an interface that knows some types and functions.

    declarations: in C; base: of `base_interface`, which knows types in them
    """
    texts = _texts(declarations, base)
    key = hashlib.sha256("\n".join((_cffi_backend.__version__, sys.platform, *texts)).encode()).hexdigest()[:40]
    description = kept(KIND, key)
    if description is None:
        description = _described(texts)
        keep(KIND, key, description)
    fields: dict[str, Any] = {name: _restored(value) for name, value in description.items()}
    if base is not None:
        fields["_includes"] = (base,)
    return _cffi_backend.FFI(key, **fields)


def _texts(declarations: str, base: Interface | None) -> Texts:
    return (*(() if base is None else _bases[base]), declarations)


def _described(texts: Texts) -> dict[str, Any]:
    """The arguments of an FFI in a module that cffi writes, as JSON can say them: a byte is the character of its number."""
    from cffi.recompiler import make_py_source

    with tempfile.TemporaryDirectory(prefix="ncgen-") as folder:
        path = Path(folder) / "interface.py"
        make_py_source(_parsed(texts), NAME, str(path))
        module = ast.parse(contents(path, MAX_FILE_BYTES))
    calls = [node for node in ast.walk(module) if isinstance(node, ast.Call)]
    return {word.arg: _plain(ast.literal_eval(word.value)) for word in calls[0].keywords if word.arg and word.arg != "_includes"}


def _parsed(texts: Texts) -> FFI:
    """The declarations in the order in which they know each other."""
    from cffi import FFI

    ffi = FFI()
    if texts[:-1]:
        ffi.include(_parsed_base(texts[:-1]))
    ffi.cdef(texts[-1])
    ffi.set_source(NAME, None)
    return ffi


_parsed_base = once(_parsed)


def _plain(value: Any) -> Any:
    if isinstance(value, bytes):
        return value.decode("latin-1")
    return [_plain(member) for member in value] if isinstance(value, tuple) else value


def _restored(value: Any) -> Any:
    if isinstance(value, str):
        return value.encode("latin-1")
    return tuple(_restored(member) for member in value) if isinstance(value, list) else value
