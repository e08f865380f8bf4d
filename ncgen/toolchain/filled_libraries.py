"""Libraries with a table of numbers: those of different numbers in one process are different files, since a file is opened once only.

The first numbers go into the library of the cache itself, others into copies of it, which are used again when nobody holds them any more.
A copy stays until the process ends: systems tell files by their inode, which the next file might get.
"""

from __future__ import annotations

import shutil
import tempfile
import threading
import weakref
from array import array
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cache
from itertools import count
from multiprocessing import util
from pathlib import Path
from typing import Any

from ncgen.toolchain.abi import InC
from ncgen.toolchain.interfaces import Interface


class FilledLibrary:
    """A library whose functions read numbers of its own; it is closed with the last of those that hold this object."""

    def __init__(self, ffi: Interface, library: Path, table: str, values: Sequence[float]) -> None:
        """table: the function that gives the table of numbers; values: what it is filled with. Raises OSError where it cannot be opened."""
        data = array("d", values).tobytes()
        with _lock:
            copies = _copies.setdefault(library, _Copies(library))
            path = copies.take(data)
            try:
                self._functions = ffi.dlopen(str(path))
            except OSError:
                copies.give_back(path)
                raise
            ffi.buffer(getattr(self._functions, table)(), len(data))[:] = data
        weakref.finalize(self, _close, ffi, self._functions, copies, path).atexit = False

    def __getattr__(self, name: str) -> Any:
        return getattr(self._functions, name)


def _close(ffi: Interface, functions: InC, copies: _Copies, path: Path) -> None:
    with _lock:
        ffi.dlclose(functions)
        copies.give_back(path)


@dataclass
class _Copies:
    """A library and copies of it. data: {file: its numbers} of all files; holders: {file: how many have it open}."""

    library: Path
    data: dict[Path, bytes] = field(default_factory=dict)
    holders: dict[Path, int] = field(default_factory=dict)

    def take(self, data: bytes) -> Path:
        """A file for these numbers: one that has them, one that nobody holds, or a new one."""
        path = next((path for path, number in self.holders.items() if number and self.data[path] == data), None)
        path = path or next((path for path, number in self.holders.items() if not number), None) or self._new()
        self.data[path] = data
        self.holders[path] = self.holders.get(path, 0) + 1
        return path

    def give_back(self, path: Path) -> None:
        self.holders[path] -= 1

    def _new(self) -> Path:
        if not self.holders:
            return self.library
        return Path(shutil.copy(self.library, _folder() / f"{next(_numbers)}{self.library.suffix}"))


_copies: dict[Path, _Copies] = {}
"""{library of the cache: it and its copies}."""

_numbers = count(1)
"""Of the copies of this process."""

_lock = threading.RLock()
"""Also within itself: an object that is collected while another one is made closes its library."""


@cache
def _folder() -> Path:
    """Where the copies of this process are; it goes when this process does."""
    folder = Path(tempfile.mkdtemp(prefix="ncgen-"))
    util.Finalize(None, shutil.rmtree, args=(folder, True), exitpriority=0)
    return folder
