"""The vocabulary of model files: the builder's methods and their arguments.

A table [[word]] in a file is one call of the builder method of that name; its keys are the method's arguments.
So there is no second list of words: methods marked as facts are the vocabulary, and annotations say what an argument may be.
"""

from __future__ import annotations

import difflib
import inspect
from collections.abc import Collection
from functools import cache

from ncgen.model import Model
from ncgen.model.gears import Gears
from ncgen.model.joints import Joints
from ncgen.model.names import LONGEST_NAME

NOT_IN_FILES = ("callback",)
"""Python functions cannot be said in a file."""

INTERNAL = ("Owner", "Owner | None")
"""Annotations of arguments that only the builder itself gives."""

SYNONYMS = {
    "joint": tuple(name for name, member in (vars(Joints) | vars(Gears)).items() if getattr(member, "is_fact", False)),
    "constraint": ("distance", "angle", "constrain"),
    **dict.fromkeys(("hinge", "pin"), ("revolute",)),
    "ball": ("spherical",),
    "slider": ("slider", "prismatic"),
    **dict.fromkeys(("weld", "fixed", "lock"), ("rigid",)),
    **dict.fromkeys(("link", "rod", "mass"), ("body",)),
    **dict.fromkeys(("damper", "dashpot"), ("spring",)),
    **dict.fromkeys(("motor", "actuator", "driver"), ("drive", "torque", "force")),
}
"""Words of other programs and of textbooks, and those for the same here."""


@cache
def words() -> tuple[str, ...]:
    """What a table can be called."""
    methods = inspect.getmembers(Model, lambda member: getattr(member, "is_fact", False))
    return tuple(name for name, _ in methods if name not in NOT_IN_FILES)


@cache
def signature_of(word: str) -> inspect.Signature:
    """The arguments that a file can give to a builder method."""
    return _run_options() if word == "simulation" else _for_files(inspect.signature(getattr(Model, word)))


@cache
def head() -> inspect.Signature:
    """What stands at the top of a file: the arguments of a model."""
    return _for_files(inspect.signature(Model.__init__))


def _run_options() -> inspect.Signature:
    """What [simulation] can say."""
    from ncgen.solver.runs.simulation_options import OPTIONS

    return inspect.Signature(
        [inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=None, annotation="option") for name in OPTIONS]
    )


def suggestion(word: str, known: Collection[str]) -> str:
    """The known word that looks like a mistyped one or means the same elsewhere, or all of them."""
    if meant := [each for each in SYNONYMS.get(word.lower(), ()) if each in known]:
        return f"did you mean {'one of ' if len(meant) > 1 else ''}{', '.join(meant)}?"
    near = difflib.get_close_matches(word, known, n=1) if len(word) <= LONGEST_NAME else []
    return f"did you mean {near[0]}?" if near else f"known are {', '.join(known)}"


def kind_of(parameter: inspect.Parameter) -> str:
    """What an argument is, by its annotation."""
    return parameter.annotation.removesuffix(" | None")


def is_required(parameter: inspect.Parameter) -> bool:
    return parameter.default is parameter.empty and parameter.kind not in (parameter.VAR_POSITIONAL, parameter.VAR_KEYWORD)


def _for_files(signature: inspect.Signature) -> inspect.Signature:
    parameters = [p for p in signature.parameters.values() if p.name != "self" and p.annotation not in INTERNAL]
    return signature.replace(parameters=parameters)
