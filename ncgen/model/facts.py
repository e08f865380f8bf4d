"""A model remembers what it was told, in order: that is what a model file holds.

`@fact` marks the methods of the builder that say something. Calls that such a method makes itself are not
recorded, so replaying the facts gives the same model.
"""

from __future__ import annotations

import functools
import inspect
from collections.abc import Iterator, KeysView, ValuesView
from dataclasses import dataclass

from ncgen.errors import ModelError
from ncgen.model.arguments import read


@dataclass(frozen=True)
class Fact:
    """One call: the method's name and its arguments by name; variable arguments stand under their own name as a tuple."""

    word: str
    arguments: dict[str, object]


def fact(method):
    """Read the arguments of a builder method as its annotations say, and record calls that come from outside the builder."""
    signature = inspect.signature(method)

    @functools.wraps(method)
    def recorded(self, *args, **kwargs):
        args, kwargs = map(_settled, args), {key: _settled(value) for key, value in kwargs.items()}
        try:
            bound = signature.bind(self, *args, **kwargs)
        except TypeError as error:
            raise ModelError(f"{method.__name__}: {error}; it takes {', '.join(list(signature.parameters)[1:])}") from None
        read(self, method.__name__, bound)
        outermost = not self._telling
        before = _State(self, bound.arguments.values()) if outermost else None
        self._telling = True
        try:
            result = method(*bound.args, **bound.kwargs)
        except Exception:
            if outermost:
                before.restore()
            raise
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


class _State:
    """What a model held before a call: a call that is refused leaves no trace.

    Collections only grow, so their lengths say enough; bodies given to the call are copied.
    """

    def __init__(self, model, arguments):
        collections = [value for value in vars(model).values() if isinstance(value, (list, dict))]
        self._lengths = [(each, len(each)) for each in [*collections, *vars(model.drawing).values()]]
        self._bodies = [(body, body.copy()) for body in (*arguments, model.ground) if hasattr(body, "frame")]
        self._model, self._chosen = model, model.chosen_independent

    def restore(self) -> None:
        for each, length in self._lengths:
            while len(each) > length:
                each.popitem() if isinstance(each, dict) else each.pop()
        for body, kept in self._bodies:
            vars(body).update(vars(kept))
        self._model.chosen_independent = self._chosen
