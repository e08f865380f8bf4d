"""Where arrays and tables lie in the memory of a module."""

from __future__ import annotations

import struct
from collections.abc import Iterable

from ncgen.emit.wasm.binary import double

FIRST = 16
"""The first address that is used."""


class Memory:
    """Arrays that kernels write while they run, then the tables of their loops, each once."""

    def __init__(self, rooms: dict[str, int], linked: bool = False) -> None:
        """rooms: {array: how many numbers it holds}; linked: places count from two imported addresses, one of tables and one of arrays"""
        self.linked = linked
        self.places: dict[str, int] = {}
        self.start = 0 if linked else FIRST
        for name, size in rooms.items():
            self.places[name] = self.start
            self.start += 8 * size
        self._tables: dict[bytes, int] = {}
        self._data = bytearray()

    @property
    def data(self) -> bytes:
        """The tables, which begin at the address `start`."""
        return bytes(self._data)

    @property
    def rooms(self) -> bytes:
        """The instruction for the address from which places of arrays count."""
        return b"\x23\x01" if self.linked else b"\x41\x00"

    @property
    def tables(self) -> bytes:
        """The instruction for the address from which places of tables count; none where they are addresses."""
        return b"\x23\x00" if self.linked else b""

    @property
    def heap(self) -> int:
        """The first address behind everything."""
        return self.start + len(self._data) + -len(self._data) % 8

    def numbers(self, values: tuple[float, ...]) -> int:
        """The address of a table of doubles."""
        return self._placed(b"".join(map(double, values)))

    def distances(self, indices: tuple[int, ...]) -> int:
        """The address of a table of distances in bytes, of array elements from the beginning of their array."""
        return self.integers(8 * i for i in indices)

    def integers(self, values: Iterable[int]) -> int:
        """The address of a table of whole numbers."""
        values = list(values)
        return self._placed(struct.pack(f"<{len(values)}i", *values))

    def _placed(self, table: bytes) -> int:
        if table not in self._tables:
            self._data += b"\0" * (-len(self._data) % 8)
            self._tables[table] = len(self._data) + (0 if self.linked else self.start)
            self._data += table
        return self._tables[table]
