"""A model remembers what it was told, in order: that is what a model file holds.

`@fact` marks the methods of the builder that say something. Calls that such a method makes itself are not
recorded, so replaying the facts gives the same model.
"""

from __future__ import annotations

import functools
import inspect
from collections.abc import Iterator, KeysView, ValuesView
from dataclasses import dataclass


@dataclass(frozen=True)
class Fact:
    """One call: the method's name and its arguments by name; variable arguments stand under their own name as a tuple."""

    word: str
    arguments: dict[str, object]


def fact(method):
    """Record calls of a builder method that come from outside the builder."""
    signature = inspect.signature(method)

    @functools.wraps(method)
    def recorded(self, *args, **kwargs):
        args, kwargs = map(_settled, args), {key: _settled(value) for key, value in kwargs.items()}
        bound = signature.bind(self, *args, **kwargs)
        outermost = not self._telling
        self._telling = True
        try:
            result = method(*bound.args, **bound.kwargs)
        finally:
            self._telling = not outermost
        if outermost:
            self.facts.append(Fact(method.__name__, {k: v for k, v in bound.arguments.items() if k != "self"}))
        return result

    recorded.is_fact = True
    return recorded


def _settled(value):
    """What can be read only once (a generator, a view of a dictionary) as a tuple."""
    return tuple(value) if isinstance(value, (Iterator, KeysView, ValuesView)) else value
