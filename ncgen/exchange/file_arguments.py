"""What stands in a model file as what the builder takes.

TOML has texts, numbers and lists: an expression in quotes is read here, and what is no text, number or list where one is needed
is refused in the words of a file. Everything else is the builder's own to say (`ncgen.model.argument_readers`).
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from ncgen import errors
from ncgen.errors import MAX_ECHO, ModelError, shortened
from ncgen.exchange.grammar import parse_direction, parse_expression
from ncgen.exchange.words import kind_of
from ncgen.model import Model
from ncgen.model.actions import LOCKINGS
from ncgen.model.argument_readers import READERS
from ncgen.model.bodies import WORDS_OF_INERTIA
from ncgen.model.elements import Spatial
from ncgen.model.names import LAW, TIME
from ncgen.model.outputs import observable_loads

if TYPE_CHECKING:
    from sympy import Expr

    from ncgen.model.elements import Combination


def convert(model: Model | None, parameter: inspect.Parameter, raw: object, where: str) -> object:
    """The argument that a value of a file stands for; a tuple for a variable one.

    model: None where the argument needs none
    Raises ModelError beginning with `where`: UnknownName where the value mentions what there is not.
    """
    if parameter.kind is not parameter.VAR_POSITIONAL:
        return _converted(model, kind_of(parameter), raw, where)
    with _refusals_at(where):
        items = _list(raw)
    return tuple(_converted(model, kind_of(parameter), item, where) for item in items)


def _converted(model: Model | None, kind: str, raw: object, where: str) -> object:
    with _refusals_at(where):
        converted = CONVERSIONS[kind](model, raw)
    return READERS[kind](model, converted, where) if model is not None and kind in READERS else converted


def _model_of(model: Model | None) -> Model:
    """The model whose names an expression mentions."""
    if model is None:
        raise ModelError("an expression cannot stand before the name of the model")
    return model


@contextmanager
def _refusals_at(where: str) -> Iterator[None]:
    """Whatever is refused is reported with its place."""
    try:
        yield
    except ModelError as error:
        error.args = (shortened(f"{where}: {error}"),)
        raise


def _text(model: Model | None, raw: object) -> str:
    """A text."""
    if not isinstance(raw, str):
        raise ModelError(f'{shown(raw)} is not a text; write it as "…"')
    return raw


def _name(model: Model | None, raw: object) -> str:
    """The name of an element or a body."""
    return _text(model, raw).strip()


def _names(model: Model | None, raw: object) -> list[str]:
    """A list of names of elements."""
    return [_name(model, item) for item in _list(raw)]


def _flag(model: Model | None, raw: object) -> bool:
    """true or false."""
    if not isinstance(raw, bool):
        raise ModelError(f"{shown(raw)} is neither true nor false")
    return raw


def _held(model: Model | None, raw: object) -> bool | str:
    """true or false, or the axes that are held, such as "xz"."""
    if not isinstance(raw, (bool, str)):
        raise ModelError(f'{shown(raw)} is neither true nor false, nor a text of axes such as "xz"')
    return raw


def _number(model: Model | None, raw: object) -> int | float:
    """A number."""
    if isinstance(raw, bool) or not isinstance(raw, (int, float)):
        raise ModelError(f"{shown(raw)} is not a number")
    return raw


def _value(model: Model | None, raw: object) -> int | float | Expr:
    """A number, or an expression of parameters."""
    model = _model_of(model)
    return _expression_of(raw, model.numbers, model)


def _numbers(model: Model | None, raw: object) -> list[int | float]:
    return [_number(model, item) for item in _list(raw)]


def _rows(model: Model | None, raw: object) -> list[list[int | float]]:
    """A list of lists of numbers."""
    return [_numbers(model, item) for item in _list(raw)]


def _values(model: Model | None, raw: object) -> list[int | float | Expr]:
    """A list of numbers and expressions of parameters."""
    return [_value(model, item) for item in _list(raw)]


def _tensor(model: Model | None, raw: object) -> object:
    """A number, three of them, three rows of three, or a word."""
    if isinstance(raw, str) and raw.strip() in WORDS_OF_INERTIA:
        return raw.strip()
    if not isinstance(raw, list):
        return _value(model, raw)
    return [_values(model, item) if isinstance(item, list) else _value(model, item) for item in raw]


def _expression(model: Model | None, raw: object) -> int | float | Expr:
    """A number, or an expression of everything that moves."""
    model = _model_of(model)
    return _expression_of(raw, {TIME, *model.numbers, *(c.name for c in model.components)} if isinstance(raw, str) else (), model)


def _driven(model: Model | None, raw: object) -> int | float | Expr:
    """The same with loads, which outputs may mention."""
    model = _model_of(model)
    known = {TIME, *model.numbers, *(c.name for c in model.components), *observable_loads(model)} if isinstance(raw, str) else ()
    return _expression_of(raw, known, model)


def _expressions(model: Model | None, raw: object) -> list[int | float | Expr]:
    """A list of numbers and expressions of everything that moves."""
    return [_expression(model, item) for item in _list(raw)]


def _moment(model: Model | None, raw: object) -> object:
    """Such a list, or one expression in the plane."""
    return _expressions(model, raw) if isinstance(raw, list) else _expression(model, raw)


def _law(model: Model | None, raw: object) -> int | float | Expr:
    """A number, or an expression of x, the length or angle, v, its rate, the time and parameters."""
    model = _model_of(model)
    return _expression_of(raw, {*LAW, TIME, *model.numbers}, model)


def _expression_of(raw: object, known: Collection[str], model: Model) -> int | float | Expr:
    if isinstance(raw, str):
        return parse_expression(raw, known, model.curves)
    if isinstance(raw, bool) or not isinstance(raw, (int, float)):
        raise ModelError(f"{shown(raw)} is not a number or an expression")
    return raw


def _doing(model: Model | None, raw: object) -> object:
    """The word "stop", a table of an impact or of values by name, or a list of these."""
    if isinstance(raw, list):
        return [_doing(model, item) for item in raw]
    if isinstance(raw, str):
        return raw.strip()
    if not isinstance(raw, dict):
        raise ModelError(f'{shown(raw)} is no action; write "stop", {{ impact = {{ restitution = 0.5 }} }} or {{ name = value }}')
    if set(raw) == {"impact"} and isinstance(raw["impact"], dict):
        return {"impact": {key: item if key in ("order", "rest") else _value(model, item) for key, item in raw["impact"].items()}}
    if len(raw) == 1 and set(raw) < set(LOCKINGS) and isinstance(next(iter(raw.values())), str):
        return raw
    return {key: _driven(model, item) for key, item in raw.items()}


def _direction(model: Model | None, raw: object) -> Spatial | Combination:
    """The name of a vector, or a segment such as "B - A"."""
    return parse_direction(_text(model, raw), {name: e for name, e in _model_of(model).elements.items() if isinstance(e, Spatial)})


def _curve(model: Model | None, raw: object) -> object:
    """The name of a spline or a table."""
    return _model_of(model).curves.get(name := _name(model, raw), name)


def _option(model: Model | None, raw: object) -> object:
    """What a run can be told, as `ncgen.simulate` takes it: everything but a date."""
    if isinstance(raw, dict):
        return {key: _option(model, item) for key, item in raw.items()}
    if isinstance(raw, list):
        return [_option(model, item) for item in raw]
    if not isinstance(raw, (bool, int, float, str)):
        raise ModelError(f"{shown(raw)} is a date; give a number or a text")
    return raw


def _list(raw: object) -> list:
    if not isinstance(raw, list):
        raise ModelError(f"{shown(raw)} is not a list; write it as […]")
    return raw


def shown(raw: object) -> str:
    """A value of a file within a message, as a file writes it."""
    if isinstance(raw, bool):
        return "true" if raw else "false"
    if isinstance(raw, (list, dict)):
        return "a list" if isinstance(raw, list) else "a table"
    if isinstance(raw, str):
        return f'"{shortened(raw, MAX_ECHO)}"'
    return errors.shown(raw) if isinstance(raw, (int, float)) else str(raw)


CONVERSIONS: dict[str, Callable[[Model | None, object], object]] = {
    "str": _text,
    "bool": _flag,
    "bool | str": _held,
    "Number": _number,
    "Numbers": _numbers,
    "Sequence[Numbers]": _rows,
    "Value": _value,
    "Values": _values,
    "Tensor": _tensor,
    "Expression": _expression,
    "Driven": _driven,
    "Doing": _doing,
    "Expressions": _expressions,
    "Moment": _moment,
    "Law": _law,
    "Direction": _direction,
    **dict.fromkeys(("Body", "Point", "Vector", "Spatial", "Relative", "Component | Relative"), _name),
    "Row": _text,
    **dict.fromkeys(("Sequence[Point]", "Sequence[Vector]", "Sequence[Spatial]"), _names),
    "Curve": _curve,
    "option": _option,
}
"""{annotation: conversion(model, what a file says)}."""
