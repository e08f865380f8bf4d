"""A model whose plain numbers are parameters: positions, masses, moments of inertia, gravity, springs and gears."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from ncgen.errors import ModelError
from ncgen.exchange.toml_reader import model_of
from ncgen.exchange.toml_writer import to_toml
from ncgen.model import Model
from ncgen.model.facts import Fact
from ncgen.model.names import numbered, word
from ncgen.model.values import Parameter, is_number

NUMBERS = {
    "point": {"position": "m"},
    "body": {"mass": "kg", "inertia": "kg m²"},
    "payload": {"mass": "kg"},
    "gravity": {"field": "m/s²"},
    "distance": {"length": "m"},
    "spring": {"stiffness": "N/m", "damping": "N s/m", "free_length": "m"},
    "torsion_spring": {"stiffness": "N m/rad", "damping": "N m s/rad", "free_angle": "rad"},
    "gear": {"radius_first": "m", "radius_second": "m"},
    "rack": {"radius": "m"},
    "rolling": {"radius": "m"},
    "screw": {"pitch": "m/rad"},
    "rotor": {"inertia": "kg m²"},
}
"""{fact: {argument: unit}} of numbers that a reader may turn."""

MAX_PARAMETERS = 60
"""Parameters that a model is given at most: beyond it positions stay as they are, then everything does."""


def turnable(model: Model) -> Model:
    """The same model, in which plain numbers are parameters whose defaults they are; those of its own come first.

    Positions become parameters in the plane only, where every constant of a body follows from its points. A parameter is named as in a
    model file: `B.position.x`, `crank.mass`, `gravity.y`. A model with Python functions is returned as it is.
    """
    if model.callbacks:
        return model
    for words in (NUMBERS, {name: numbers for name, numbers in NUMBERS.items() if name != "point"}):
        facts = list(_turned(model, words))
        if sum(fact.word == "parameter" for fact in facts) <= MAX_PARAMETERS:
            return _read_again(model, facts)
    return model


def _read_again(model: Model, facts: list[Fact]) -> Model:
    """The model of these facts; the model itself where no file can hold it, such as one with a Python function."""
    try:
        text = to_toml(model, facts)
    except ModelError:
        return model
    again = model_of(text, Path(f"{model.name}.toml"))
    again.drawing.folder = model.drawing.folder
    return again


def _turned(model: Model, words: dict[str, dict[str, str]]) -> Iterator[Fact]:
    """The facts of a model, its own parameters first, each other one after those of the parameters that it now needs."""
    taken = {*model.elements, *model.bodies, *model.numbers, *model.curves, *(c.name for c in model.components)}
    yield from (fact for fact in model.facts if fact.word == "parameter")
    for fact in model.facts:
        if fact.word == "parameter":
            continue
        arguments = dict(fact.arguments)
        for key, unit in words.get(fact.word, {}).items():
            made: list[Parameter] = []
            arguments[key] = _named(fact, key, unit, taken, made)
            yield from (Fact("parameter", {"name": p.name, "default": p.default, "unit": p.unit}) for p in made)
        yield Fact(fact.word, arguments)


def _named(fact: Fact, key: str, unit: str, taken: set[str], made: list[Parameter]) -> object:
    """An argument in which numbers are parameters, which are added to `made`."""
    value = fact.arguments.get(key)

    def parameter(number: float, axis: str = "") -> Parameter:
        name = numbered(_wish(fact, key, axis), taken.__contains__)
        taken.add(name)
        made.append(Parameter(name, float(number), unit))
        return made[-1]

    if key in ("position", "field"):
        if not isinstance(value, (list, tuple, np.ndarray)) or not all(is_number(number) for number in value):
            return value
        if key == "position" and len(value) != 2:
            return value
        return [parameter(number, axis) if key == "position" or number else number for number, axis in zip(value, "xyz", strict=False)]
    return parameter(float(value)) if is_number(value) and not isinstance(value, bool) else value


def _wish(fact: Fact, key: str, axis: str) -> str:
    """A name as in a model file, of what has a name, of the ends of what has none."""
    arguments = fact.arguments
    ends = "_".join(str(getattr(arguments[end], "name", arguments[end])) for end in ("start", "end", "first", "second") if end in arguments)
    if fact.word == "gravity":
        return f"gravity.{axis}"
    owner = (
        arguments.get("label")
        or arguments.get("name")
        or ends
        or getattr(arguments.get("coordinate") or arguments.get("angle"), "name", fact.word)
    )
    return ".".join(word(name, "parameter") for name in (*str(owner).split("."), key, axis) if name)
