"""A model remembers what it was told, in order: that is what a model file holds.

`@fact` marks the methods of the builder that say something. Calls that such a method makes itself are not
recorded, so replaying the facts gives the same model.
"""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable, Iterable, Iterator, KeysView, ValuesView
from dataclasses import dataclass
from typing import Any, Concatenate, ParamSpec, TypeVar

from ncgen.errors import ModelError
from ncgen.model.argument_readers import read, readings_of
from ncgen.model.bodies import Body
from ncgen.model.contents import Contents
from ncgen.model.curves import check_curves

M = TypeVar("M", bound=Contents)
P = ParamSpec("P")
R = TypeVar("R")


@dataclass(frozen=True)
class Fact:
    """One call: the method's name and its arguments by name; variable arguments stand under their own name as a tuple."""

    word: str
    arguments: dict[str, object]


def fact(method: Callable[Concatenate[M, P], R]) -> Callable[Concatenate[M, P], R]:
    """Read the arguments of a builder method as its annotations say, and record calls that come from outside the builder.

    To type checkers the method stays what it is: its annotations say what a user may pass, and what it finds is one of these.
    """
    signature = inspect.signature(method)
    readings = readings_of(signature)
    binding = _Binding(signature)

    @functools.wraps(method)
    def recorded(self: M, *args: P.args, **kwargs: P.kwargs) -> R:
        named = {key: _read_once(value) for key, value in kwargs.items()}
        try:
            arguments = binding.arguments((self, *map(_read_once, args)), named)
        except TypeError as error:
            raise ModelError(f"{method.__name__}: {error}; it takes {', '.join(list(signature.parameters)[1:])}") from None
        read(self, method.__name__, arguments, readings)
        check_curves(self, method.__name__, arguments)
        is_outermost = not self._is_recording
        before = _State(self, arguments.values()) if is_outermost and self.keeps_state else None
        self._is_recording = True
        try:
            result = binding.call(method, arguments)
        except Exception:
            if before is not None:
                before.restore()
            raise
        finally:
            self._is_recording = not is_outermost
        if is_outermost:
            self.facts.append(Fact(method.__name__, {k: v for k, v in arguments.items() if k != "self"}))
        return result

    vars(recorded)["is_fact"] = True
    return recorded


class _Binding:
    """The arguments of a method by their names, as of `inspect.Signature.bind`, in a fifth of its time for methods without * and **."""

    def __init__(self, signature: inspect.Signature) -> None:
        self._signature, self._names = signature, tuple(signature.parameters)
        kinds = {name: parameter.kind for name, parameter in signature.parameters.items()}
        self._positional = [name for name, kind in kinds.items() if kind is inspect.Parameter.POSITIONAL_OR_KEYWORD]
        self._is_plain = {*kinds.values()} <= {inspect.Parameter.POSITIONAL_OR_KEYWORD, inspect.Parameter.KEYWORD_ONLY}
        self._required = {name for name, parameter in signature.parameters.items() if parameter.default is parameter.empty}

    def arguments(self, args: tuple[object, ...], kwargs: dict[str, object]) -> dict[str, object]:
        """{name: what was given}, in the order of the signature. Raises TypeError for what the method does not take."""
        named = {**dict(zip(self._positional, args)), **kwargs}
        if self._is_plain and len(named) == len(args) + len(kwargs) and self._required <= named.keys():
            arguments = {name: named[name] for name in self._names if name in named}
            if len(arguments) == len(named):
                return arguments
        return self._signature.bind(*args, **kwargs).arguments

    def call(self, method: Callable[..., R], arguments: dict[str, object]) -> R:
        """What the method returns for arguments by their names."""
        if self._is_plain:
            return method(**arguments)
        bound = inspect.BoundArguments(self._signature, arguments)
        return method(*bound.args, **bound.kwargs)


def _read_once(value: Any) -> object:
    """What can be read only once (a generator, a view of a dictionary) as a tuple."""
    return tuple(value) if _is_read_once(value.__class__) else value


@functools.cache
def _is_read_once(kind: type) -> bool:
    """Found once for a class: most arguments are numbers and names."""
    return issubclass(kind, (Iterator, KeysView, ValuesView))


class _State:
    """What a model held before a call: a call that is refused leaves no trace.

    Collections only grow, so their lengths say enough; bodies given to the call are copied.
    """

    def __init__(self, model: Contents, arguments: Iterable[object]) -> None:
        held = (*vars(model).values(), *vars(model.drawing).values())
        self._lengths = [(each, len(each)) for each in held if isinstance(each, (list, dict))]
        self._bodies = [(body, body.copy()) for body in (*arguments, model.ground) if isinstance(body, Body)]
        self._model, self._chosen = model, model.chosen_independent

    def restore(self) -> None:
        for each, length in self._lengths:
            while len(each) > length:
                each.popitem() if isinstance(each, dict) else each.pop()
        for body, kept in self._bodies:
            vars(body).update(vars(kept))
        self._model.chosen_independent, self._model._box = self._chosen, None
