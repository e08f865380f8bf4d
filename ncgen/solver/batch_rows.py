"""The rule that tells a batch of states from one state, for all functions that take both.

A batch has rows: an array of two dimensions in q0, zd0, qd0 or p, one row a state; or by name an array of one dimension, one value a state.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from typing import Any

import numpy as np

from ncgen.errors import ModelError

STATE_ARGUMENTS = ("q0", "zd0", "qd0", "p")
"""Arguments that may have rows."""


WITH_ROWS = "with rows of states"
"""In messages: in which kind of call."""


def has_rows(arguments: Mapping[str, Any], names: Collection[str] = STATE_ARGUMENTS) -> bool:
    """Return whether arguments describe a batch: whether one of these names has rows."""
    for name, value in arguments.items():
        if value is not None and name in names and _row_count(value) is not None:
            return True
    return False


def states_of(mechanism: str, arguments: Mapping[str, Any]) -> list[Any]:
    """Return the arguments of every state of a batch, and a single one for arguments without rows.

    Raises ModelError where two arguments have different numbers of rows.
    """
    counts = {name: rows for name in STATE_ARGUMENTS if (rows := _row_count(arguments.get(name))) is not None}
    size = common_size(mechanism, counts) if counts else 1
    return [{name: _row(value, i) if name in counts else value for name, value in arguments.items()} for i in range(size)]


def common_size(mechanism: str, counts: Mapping[str, int]) -> int:
    """Return the number of states of a batch from {argument: number of its rows}. Raises ModelError unless all have as many."""
    if len({*counts.values()}) > 1:
        listed = ", ".join(f"{name} has {rows}" for name, rows in counts.items())
        raise ModelError(f"{mechanism}: {listed} rows; a batch has one number of them")
    if not any(counts.values()):
        raise ModelError(f"{mechanism}: a batch of no states; give at least one row")
    return next(iter(counts.values()))


def refuse_batch_options(function: str, **options: object) -> None:
    """Raise ModelError for an option of a batch that is given where there is one state."""
    for name, value in options.items():
        if value is not None and not (name == "threads" and isinstance(value, int) and value == 1):
            raise ModelError(f"{function}: {name} is for a batch, and no argument has rows; leave it out, or give rows of states")


def _row_count(value: object) -> int | None:
    """Return the number of rows of an argument; None if it is of one state, or for all."""
    return None if value is None else next(_counts(value), None)


def _counts(value: object) -> Iterator[int]:
    named = isinstance(value, Mapping)
    for entry in list(value.values()) if named else [value]:
        if isinstance(entry, (int, float)):
            continue
        try:
            shape = np.shape(entry)  # type: ignore[arg-type]
        except ValueError:  # rows of different lengths, which the check of the argument refuses
            continue
        if len(shape) >= 1 if named else len(shape) == 2:
            yield shape[0]


def _row(value: Any, i: int) -> Any:
    if isinstance(value, Mapping):
        return {name: entry[i] if np.ndim(entry) else entry for name, entry in value.items()}
    return value[i]
