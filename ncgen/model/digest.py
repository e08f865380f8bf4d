"""What tells a model from others: a digest of everything that its equations can depend on.

The same model has the same digest in every process and after any journey between processes: nothing depends on where things lie
in memory, or on which of them are shared.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from dataclasses import fields, is_dataclass
from functools import cache
from typing import Any

import numpy as np

from ncgen.model.bodies import Body
from ncgen.model.catalogue import RowType
from ncgen.model.elements import Constant, Element
from ncgen.model.model import Model

OF_EVENTS = ("events", "frictions", "contacts", "ratchets", "locks", "beginnings")
"""What a model holds of what happens on the way of its motions."""

NOT_IN_EQUATIONS = (
    *OF_EVENTS, "facts", "callbacks", "conditions", "drawing", "left_out", "assembled", "closing", "starts", "frames",
    "simulation_options", "keeps_state", "_related", "_is_recording", "_box",
)  # fmt: skip
"""What a model also holds: how it was told, what is called from Python only, what happens on the way, what p must satisfy, what is shown,
what is done with it. All else counts."""


def digest(model: Model) -> str | None:
    """The digest of a model, 64 hexadecimal digits; None if it holds something that has no name and no value."""
    return _digest({key: value for key, value in vars(model).items() if key not in NOT_IN_EQUATIONS})


def digest_of_events(model: Model) -> str | None:
    """The same of what happens on the way of its motions, which equations do not depend on."""
    return _digest({name: getattr(model, name) for name in OF_EVENTS})


def _digest(contents: dict[str, object]) -> str | None:
    words: list[str] = []
    try:
        _words(contents, set(), words)
    except TypeError:
        return None
    return hashlib.sha256("\n".join(words).encode()).hexdigest()


def _words(value: Any, known: set[int], words: list[str]) -> None:
    """Add a value in words that mean nothing else; what most values are is asked first.

    known: elements and bodies that have been described, for which a name is enough
    """
    kind = value.__class__
    if kind is float:
        words.append(value.hex())
    elif kind is str or kind is int or kind is bool or value is None:
        words.append(repr(value))
    elif kind is tuple or kind is list or kind is dict:
        _parts(value, known, words)
    elif (names := _fields_of_objects(kind)) is not None:
        if id(value) in known and _has_name(kind):
            words.append(f"{kind.__name__} {value.name!r}")
            return
        known.add(id(value))
        words.append(kind.__name__)
        for name in names:
            _words(getattr(value, name), known, words)
    else:
        _rare(value, known, words)


def _parts(value: Any, known: set[int], words: list[str]) -> None:
    """Add a collection."""
    words.append(f"{len(value)} parts")
    items: Iterable[Any] = value.items() if isinstance(value, dict) else value
    for item in items:
        _words(item, known, words)


def _rare(value: Any, known: set[int], words: list[str]) -> None:
    """Add what is neither of these. Raises TypeError for what has no name and no value."""
    if isinstance(value, (bool, str)):
        words.append(repr(value))
    elif isinstance(value, (int, np.integer)):
        words.append(repr(int(value)))
    elif isinstance(value, (float, np.floating)):
        words.append(float(value).hex())
    elif isinstance(value, RowType):
        words.append(value.key)
    elif isinstance(value, np.ndarray):
        words.append(str(value.shape))
        _words(value.ravel().tolist(), known, words)
    elif isinstance(value, (list, tuple, dict)):
        _parts(value, known, words)
    elif hasattr(value, "free_symbols"):
        import sympy

        words.append(sympy.srepr(value))
    else:
        raise TypeError(f"{value!r} has no value that could be told")


@cache
def _fields_of_objects(kind: type) -> tuple[str, ...] | None:
    """The names of what objects of a class consist of; None for other values, and for types of rows."""
    return names_of_fields(kind) if is_dataclass(kind) and not issubclass(kind, RowType) else None


@cache
def _has_name(kind: type) -> bool:
    """Whether a name is enough for an object of a class that has been described."""
    return issubclass(kind, (Element, Body)) and not issubclass(kind, Constant)


@cache
def names_of_fields(kind: type) -> tuple[str, ...]:
    """The names of what objects of a class consist of, found once."""
    return tuple(field.name for field in fields(kind))
