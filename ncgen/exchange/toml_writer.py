"""A model as a TOML file: the facts it was told, one table each, with every digit of every number."""

from __future__ import annotations

import inspect
import re
from collections import Counter
from collections.abc import Sequence
from typing import SupportsFloat

import numpy as np

from ncgen.errors import ModelError, shown
from ncgen.exchange.words import NOT_IN_FILES, kind_of, signature_of
from ncgen.model import Model
from ncgen.model.actions import STOP, Action, Call, Change, Impact, Locking, Stop
from ncgen.model.argument_readers import row
from ncgen.model.bodies import WORDS_OF_INERTIA, Body
from ncgen.model.curves import Curve
from ncgen.model.elements import Combination, Component, Element
from ncgen.model.facts import Fact
from ncgen.model.kinks import without_kinks
from ncgen.model.names import LAW, TIME, normal
from ncgen.model.outputs import observable_loads
from ncgen.model.rows import Row
from ncgen.model.values import Parameter, is_number

SINGLE_TABLES = ("gravity", "simulation")
"""Facts that a model has one of: a single table says so."""


def to_toml(model: Model, facts: Sequence[Fact] | None = None) -> str:
    """The text of a model file that `load` turns into the same model.

    facts: others than the model's own, in which more numbers may be parameters

    Raises ModelError for what a file cannot say, such as a Python function.
    """
    head = [f"name = {_quoted(model.name, 'name')}"]
    if not model.scale:
        head.append("scale = false")
    if model.form != "smooth":
        head.append(f"form = {_quoted(model.form, 'form')}")
    facts_told = model.facts if facts is None else facts
    counts = Counter(fact.word for fact in facts_told)
    writer = _Writer(model)
    tables = [writer.table(fact.word, fact.arguments, fact.word in SINGLE_TABLES and counts[fact.word] == 1) for fact in facts_told]
    return "\n".join(head) + "\n\n" + "\n".join(tables)


class _Writer:
    """Turns facts into tables; what it writes, the reader accepts."""

    def __init__(self, model: Model) -> None:
        self.model, self.curves = model, model.curves
        self.known = {TIME, *LAW, *model.numbers, *observable_loads(model)} | {c.name for c in model.components}

    def table(self, word: str, arguments: dict, once: bool) -> str:
        if word in NOT_IN_FILES:
            raise ModelError(f"{word}: a Python function cannot be written into a model file; use an expression")
        if word == "simulation":
            from ncgen.solver.runs.simulation_options import check_options

            arguments = arguments.get("options", {})
            check_options(arguments)
            arguments = {key: arguments[key] for key in signature_of(word).parameters if key in arguments}
        parameters = signature_of(word).parameters
        lines = [f"[{word}]" if once else f"[[{word}]]"]
        for key, value in arguments.items():
            if value is not None:
                lines.append(f"{key} = {self.argument(value, parameters.get(key), f'{word}.{key}')}")
        return "\n".join(lines) + "\n"

    def argument(self, value: object, parameter: inspect.Parameter | None, where: str) -> str:
        if parameter is None:
            raise _refused(value, where)
        if kind_of(parameter) == "str":
            return _quoted(value, where)
        if kind_of(parameter) == "Tensor" and isinstance(value, Parameter) and value.name in WORDS_OF_INERTIA:
            return _quoted(f"({value.name})", where)
        return self.text(value, where)

    def text(self, value: object, where: str) -> str:
        """A number, name, expression, or list or table of these."""
        if isinstance(value, (bool, np.bool_)):
            return "true" if value else "false"
        if isinstance(value, str):
            return _quoted(normal(value), where)
        if isinstance(value, (Element, Body, Parameter, Component, Curve)):
            return _quoted(value.name, where)
        if isinstance(value, Row):
            return _quoted(row(self.model, value.label, where).label, where)
        if isinstance(value, (Impact, Change, Stop, Call, Locking)):
            return self.text(_action_in_file(value, where), where)
        if isinstance(value, Combination):
            return _quoted(_combination(value), where)
        if isinstance(value, dict):
            return "{ " + ", ".join(f"{_quoted(normal(k), where)} = {self.text(v, where)}" for k, v in value.items()) + " }"
        if isinstance(value, (list, tuple)) or (isinstance(value, np.ndarray) and value.ndim):
            return "[" + ", ".join(self.text(v, where) for v in value) + "]"
        if hasattr(value, "free_symbols"):
            return _quoted(self.expression(value, where), where)
        if isinstance(value, SupportsFloat) and is_number(value):
            return repr(int(value)) if isinstance(value, (int, np.integer)) else repr(float(value))
        raise _refused(value, where)

    def expression(self, value: object, where: str) -> str:
        from sympy import Expr

        from ncgen.exchange.expression_text import expression_text  # needs sympy, which a model without expressions does without

        try:
            text = expression_text(without_kinks(value, where) if isinstance(value, Expr) else value, self.known, self.curves)
        except ModelError as error:
            raise ModelError(f"{where}: it cannot be written into a model file: {error}") from None
        if text is None:
            raise _refused(value, where)
        return text


def _action_in_file(action: Action, where: str) -> object:
    """An action as a file says it."""
    if isinstance(action, Call):
        raise ModelError(f"{where}: a Python function cannot be written into a model file; give values by name")
    if isinstance(action, Stop):
        return STOP
    if isinstance(action, Locking):
        return {"lock" if action.closes else "free": action.lock}
    if isinstance(action, Change):
        return dict(action.values)
    return {
        "impact": {"restitution": action.restitution}
        | ({"order": action.order} if action.order else {})
        | ({"rest": action.rest} if action.rest != "hold" else {})
    }


def _refused(value: object, where: str) -> ModelError:
    return ModelError(f"{where}: {shown(value)} cannot be written into a model file")


def _quoted(text: object, where: str) -> str:
    """A text between quotes as TOML writes it: what is no character of a line is escaped."""
    if not isinstance(text, str) or re.search("[\ud800-\udfff]", text):
        raise _refused(text, where)
    text = text.replace("\\", "\\\\").replace('"', '\\"')
    return '"' + re.sub("[\x00-\x1f\x7f-\x9f\u2028\u2029]", lambda c: f"\\u{ord(c[0]):04x}", text) + '"'


def _combination(value: Combination) -> str:
    parts = []
    for weight, element in value.terms:
        if not (isinstance(weight, SupportsFloat) and is_number(weight)):
            raise ModelError(f"{value}: a combination with parameters cannot be written into a model file")
        number = float(weight)
        size = "" if abs(number) == 1.0 else f"{abs(number)!r}*"
        parts.append(f"{'-' if number < 0 else '+'} {size}{element.name}")
    return " ".join(parts).removeprefix("+ ").replace("- ", "-", 1 if parts[0].startswith("-") else 0)
