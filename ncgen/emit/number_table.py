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
        self._places: dict[str | tuple[str, ...], int] = {}

    def element(self, value: Traced) -> str:
        """A number as C reads it."""
        place = self._places.setdefault(value.hex(), len(self.entries))
        if place == len(self.entries):
            self.entries.append(value)
        return f"{self.name}[{place}]"

    def column(self, values: Iterable[float]) -> str:
        """Several numbers one after the other, as C points to the first of them."""
        column = list(values)
        place = self._places.setdefault(tuple(value.hex() for value in column), len(self.entries))
        if place == len(self.entries):
            self.entries += column
        return f"({self.name} + {place})"


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
