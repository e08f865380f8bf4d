"""What tells a model from others: a digest of everything that its equations can depend on.

The same model has the same digest in every process and after any journey between processes: nothing depends on where things lie
in memory, or on which of them are shared.
"""

from __future__ import annotations

import hashlib
from dataclasses import fields, is_dataclass
from functools import cache

import numpy as np

from ncgen.model.bodies import Body
from ncgen.model.catalogue import RowType
from ncgen.model.elements import Constant, Element
from ncgen.model.model import Model

OF_EVENTS = ("events", "frictions", "contacts", "ratchets", "locks", "beginnings")
"""What a model holds of what happens on the way of its motions."""

NOT_IN_EQUATIONS = (
    *OF_EVENTS, "facts", "callbacks", "conditions", "drawing", "left_out", "assembled", "closing", "starts", "frames",
    "simulation_options", "_related", "_is_recording", "_box",
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


def _words(value: object, known: set[int], words: list[str]) -> None:
    """Add a value in words that mean nothing else.

    known: elements and bodies that have been described, for which a name is enough
    """
    if type(value) is float:
        words.append(value.hex())
    elif type(value) is str or value is None or isinstance(value, (bool, str)):
        words.append(repr(value))
    elif isinstance(value, (Element, Body)) and not isinstance(value, Constant) and id(value) in known:
        words.append(f"{type(value).__name__} {value.name!r}")
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
        parts = value.items() if isinstance(value, dict) else value
        words.append(f"{len(value)} parts")
        for item in parts:
            _words(item, known, words)
    elif is_dataclass(value):
        known.add(id(value))
        words.append(type(value).__name__)
        for name in names_of_fields(type(value)):
            _words(getattr(value, name), known, words)
    elif hasattr(value, "free_symbols"):
        import sympy

        words.append(sympy.srepr(value))
    else:
        raise TypeError(f"{value!r} has no value that could be told")


@cache
def names_of_fields(kind: type) -> tuple[str, ...]:
    """The names of what objects of a class consist of, found once."""
    return tuple(field.name for field in fields(kind))
