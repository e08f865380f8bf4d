"""Where arrays and tables lie in the memory of a module: arrays that kernels write while they run, and the tables of their loops. Places
count from two addresses that the module imports."""

from __future__ import annotations

import struct
from collections.abc import Iterable

from ncgen.emit.wasm.binary import double

TABLES, ROOMS = b"\x23\x00", b"\x23\x01"
"""The instructions for the addresses from which places of tables and of arrays count."""


class Memory:
    """Arrays, and tables, each once."""

    def __init__(self, rooms: dict[str, int]) -> None:
        """rooms: {array: how many numbers it holds}"""
        self.places: dict[str, int] = {}
        self.size = 0
        """Of all arrays, in bytes."""
        for name, numbers in rooms.items():
            self.places[name] = self.size
            self.size += 8 * numbers
        self._tables: dict[bytes, int] = {}
        self._data = bytearray()

    @property
    def data(self) -> bytes:
        """The tables."""
        return bytes(self._data)

    def numbers(self, values: tuple[float, ...]) -> int:
        """The place of a table of doubles."""
        return self._placed(b"".join(map(double, values)))

    def distances(self, indices: tuple[int, ...]) -> int:
        """The place of a table of distances in bytes, of array elements from the beginning of their array."""
        return self.integers(8 * i for i in indices)

    def integers(self, values: Iterable[int]) -> int:
        """The place of a table of whole numbers."""
        values = list(values)
        return self._placed(struct.pack(f"<{len(values)}i", *values))

    def _placed(self, table: bytes) -> int:
        if table not in self._tables:
            self._data += b"\0" * (-len(self._data) % 8)
            self._tables[table] = len(self._data)
            self._data += table
        return self._tables[table]
