"""The vocabulary of model files: the builder's methods, and how the text of each argument is read.

A table [[word]] in a file is one call of the builder method of that name; its keys are the method's arguments.
So there is no second list of words: methods marked as facts are the vocabulary.
"""

from __future__ import annotations

import inspect

from ncgen.model import Model

KINDS = {
    # elements, segments and reversed vectors
    **dict.fromkeys(("start", "end", "axis", "point", "vector", "segment", "normal", "centre", "axle", "across", "u", "v"), "direction"),
    **dict.fromkeys(("points", "vectors", "basis", "elements"), "directions"),
    **dict.fromkeys(("a", "b", "body", "owner", "disc"), "body"),
    **dict.fromkeys(("first", "second", "coordinate"), "coordinate"),
    **dict.fromkeys(("coordinates",), "names"),
    **dict.fromkeys(("expression", "law"), "expression"),
    **dict.fromkeys(("name", "label", "unit", "form", "fixed"), "text"),
    **dict.fromkeys(("rigid", "constant_mass"), "text"),
}
"""What an argument of this name is; anything else is a number, a list of numbers, or an expression of parameters."""

EXCEPTIONS = {
    ("force", "vector"): "expressions",
    ("couple", "vector"): "expressions",
    ("rack", "slide"): "coordinate",
    ("rack", "angle"): "coordinate",
    ("torsion_spring", "angle"): "coordinate",
    ("torsion_spring", "law"): "law",
    ("spring", "law"): "law",
    ("rolling", "normal"): "value",
    ("vector", "direction"): "value",
}

NOT_IN_FILES = ("callback",)
"""Python functions cannot be said in a file."""


def words() -> dict[str, inspect.Signature]:
    """{word: signature of its builder method}."""
    methods = inspect.getmembers(Model, lambda member: getattr(member, "is_fact", False))
    return {name: inspect.signature(method) for name, method in methods if name not in NOT_IN_FILES}


def kind_of(word: str, argument: str) -> str:
    return EXCEPTIONS.get((word, argument)) or KINDS.get(argument, "value")
