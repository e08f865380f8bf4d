"""Parameters that many methods share, described once: a decorator of classes completes the methods' docstrings."""

from __future__ import annotations

import re
from collections.abc import Callable
from inspect import cleandoc
from types import FunctionType
from typing import TypeVar

Class = TypeVar("Class", bound=type)

ENTRY = re.compile(r"^(\w+) : .*\n(?: +.*\n?)*", re.MULTILINE)


def shares(**meanings: str) -> Callable[[Class], Class]:
    """Describe parameters of a class's methods once.

    Parameters
    ----------
    **meanings : str
        Of a parameter its type and, on the next line, what it is. Methods that have another meaning for it describe it themselves.

    Returns
    -------
    callable
        A decorator of the class. A public method without a docstring gets that of the method that it overrides.
    """

    def decorate(kind: Class) -> Class:
        for name, method in vars(kind).items():
            if isinstance(method, FunctionType) and not name.startswith("_"):
                text = method.__doc__ or next(vars(base)[name].__doc__ for base in kind.__mro__[1:] if name in vars(base))
                method.__doc__ = _completed(cleandoc(text), method, meanings)
        return kind

    return decorate


def _completed(text: str, method: FunctionType, meanings: dict[str, str]) -> str:
    """A docstring in NumPy's style with entries for all parameters that have a meaning, in the order of the signature."""
    names = method.__code__.co_varnames[: method.__code__.co_argcount]
    optional = names[len(names) - len(method.__defaults__ or ()) :]
    before, after = re.split(r"(?=\n\nReturns\n|\n\nRaises\n)|\Z", text, maxsplit=1)
    head, _, section = before.partition("\n\nParameters\n----------\n")
    entries = {entry[1]: entry[0].rstrip("\n") for entry in ENTRY.finditer(section)}
    if not (missing := [name for name in names if name in meanings and name not in entries]):
        return text
    for name in missing:
        kind, _, meaning = meanings[name].partition("\n")
        entries[name] = f"{name} : {kind}{', optional' if name in optional else ''}\n    {meaning}"
    return "\n".join([f"{head}\n\nParameters\n----------", *(entries[name] for name in names if name in entries)]) + after
