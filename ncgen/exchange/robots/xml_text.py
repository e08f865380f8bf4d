"""XML of robots: elements with attributes, indented, numbers as the shortest text that reads back to the same bits."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np


def element(tag: str, inside: Iterable[str] = (), **attributes: str | float | np.ndarray | Iterable[float]) -> str:
    """An element with its children, elements or text; a last underscore of an attribute's name is left out."""
    from xml.sax.saxutils import quoteattr  # which imports all that speaks HTTP

    attributes_text = "".join(f" {name.rstrip('_')}={quoteattr(_text(value))}" for name, value in attributes.items())
    lines = [line for child in inside for line in child.splitlines()]
    return (
        f"<{tag}{attributes_text}/>"
        if not lines
        else "\n".join([f"<{tag}{attributes_text}>", *(f"  {line}" for line in lines), f"</{tag}>"])
    )


def document(root: str) -> str:
    """A whole file."""
    return f'<?xml version="1.0"?>\n{root}\n'


def _text(value: str | float | np.ndarray | Iterable[float]) -> str:
    if isinstance(value, str):
        return value
    return " ".join(number_text(float(x)) for x in np.atleast_1d(np.asarray(value, dtype=float)))


def number_text(x: float) -> str:
    """The shortest text that reads back to the same bits."""
    return repr(float(x) + 0.0).removesuffix(".0")  # −0 is 0
