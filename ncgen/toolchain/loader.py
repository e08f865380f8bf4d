"""From sources in C or NumPy to functions that Python calls: the one way in."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from ncgen.errors import NcgenError
from ncgen.toolchain.abi import InC
from ncgen.toolchain.cache import compiled
from ncgen.toolchain.compilers import FLAGS
from ncgen.toolchain.filled_libraries import FilledLibrary
from ncgen.toolchain.interfaces import Interface, interface


def executed(files: Mapping[str, str]) -> dict[str, Any]:
    """The names of a module of NumPy that was generated, {file name: text} of one file."""
    ((name, text),) = files.items()
    namespace: dict[str, Any] = {"__name__": name.removesuffix(".py")}
    exec(compile(text, name, "exec"), namespace)  # our own output, never the user's text
    return namespace


def load(
    files: dict[str, str],
    declarations: str,
    base: Interface | None,
    flags: tuple[str, ...] = FLAGS,
    table: str = "",
    values: Sequence[float] | None = None,
) -> tuple[Interface, InC]:
    """(interface, library) of sources {file name: text}: from the cache, or compiled.

    declarations: what is called, in C; base: the interface that knows the types in them, None where all are C's own; table, values: as of
    `opened`
    """
    return opened(compiled(files, flags).library, declarations, base, table, values)


def opened(
    library: Path, declarations: str, base: Interface | None, table: str = "", values: Sequence[float] | None = None
) -> tuple[Interface, InC]:
    """(interface, library) of a compiled library. Raises NcgenError where it cannot be loaded.

    table: the function that gives the library's table of numbers; values: what it is filled with, None where there is no table
    """
    if values is None:
        ffi = interface(declarations, base)
        return ffi, opened_by(ffi, library)
    ffi = interface(f"{declarations}\ndouble *{table}(void);", base)
    with _named(library):
        return ffi, FilledLibrary(ffi, library, table, values)


def opened_by(ffi: Interface, library: Path) -> InC:
    """A compiled library behind an interface that knows its functions. Raises NcgenError where it cannot be loaded."""
    with _named(library):
        return ffi.dlopen(str(library))


@contextmanager
def _named(library: Path) -> Iterator[None]:
    """Name a library that the system does not open."""
    try:
        yield
    except OSError as error:
        raise NcgenError(f"{library} cannot be loaded: {error}; run `ncgen cache --clear` and try again") from error
