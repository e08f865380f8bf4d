"""What tells a model from others: a digest of everything that its equations can depend on.

The same model has the same digest in every process and after any journey between processes: nothing depends on where things lie
in memory, or on which of them are shared.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from dataclasses import fields, is_dataclass

import numpy as np

from ncgen.model.bodies import Body
from ncgen.model.catalogue import RowType
from ncgen.model.elements import Constant, Element
from ncgen.model.model import Model

BESIDE = (
    "facts", "callbacks", "conditions", "drawing", "left_out", "assembled", "closing", "starts", "frames",
    "simulation_options", "_related", "_telling", "_box",
)  # fmt: skip
"""What a model also holds: how it was told, what is called from Python only, what p must satisfy, what is shown, what is done with it. All
else counts."""


def digest(model: Model) -> str | None:
    """The digest of a model, 64 hexadecimal digits; None if it holds something that has no name and no value."""
    told = {key: value for key, value in vars(model).items() if key not in BESIDE}
    try:
        return hashlib.sha256("\n".join(_words(told, set())).encode()).hexdigest()
    except TypeError:
        return None


def _words(value: object, known: set[int]) -> Iterator[str]:
    """A value in words that mean nothing else; known: elements and bodies that have been described, for which a name is enough."""
    if isinstance(value, (Element, Body)) and not isinstance(value, Constant) and id(value) in known:
        yield f"{type(value).__name__} {value.name!r}"
    elif value is None or isinstance(value, (bool, str)):
        yield repr(value)
    elif isinstance(value, (int, np.integer)):
        yield repr(int(value))
    elif isinstance(value, (float, np.floating)):
        yield float(value).hex()
    elif isinstance(value, RowType):
        yield value.key
    elif isinstance(value, np.ndarray):
        yield str(value.shape)
        yield from _words(value.ravel().tolist(), known)
    elif isinstance(value, (list, tuple, dict)):
        parts = value.items() if isinstance(value, dict) else value
        yield f"{len(value)} parts"
        for part in parts:
            yield from _words(part, known)
    elif is_dataclass(value):
        known.add(id(value))
        yield type(value).__name__
        for field in fields(value):
            yield from _words(getattr(value, field.name), known)
    elif hasattr(value, "free_symbols"):
        import sympy

        yield sympy.srepr(value)
    else:
        raise TypeError(f"{value!r} has no value that could be told")
