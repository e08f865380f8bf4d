"""The numbers of a model that compiled code reads from a table, so that a model with other numbers needs no other code."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

from ncgen.model.traced_numbers import Traced


class NumberTable:
    """A table that grows as code is printed. name: in C; entries: what it has to be filled with."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.entries: list[float] = []
        self._positions: dict[tuple[str, ...], int] = {}

    def element(self, value: Traced) -> str:
        """A number as C reads it."""
        return f"{self.name}[{self._position([value])}]"

    def column(self, values: Iterable[float]) -> str:
        """Several numbers one after the other, as C points to the first of them."""
        return f"({self.name} + {self._position(list(values))})"

    def _position(self, values: list[float]) -> int:
        """Where numbers stand one after the other."""
        position = self._positions.setdefault(tuple(value.hex() for value in values), len(self.entries))
        if position == len(self.entries):
            self.entries += values
        return position


class FilledSources(NamedTuple):
    """Sources {file name: text} of a library, and what its table of numbers is filled with; None where it has no table.

    is_own: whether the sources were generated for these very numbers
    """

    files: dict[str, str]
    values: list[float] | None
    is_own: bool = True


def table_getter(prefix: str) -> str:
    """The function of a library that gives its table."""
    return f"{prefix}_number_table"
