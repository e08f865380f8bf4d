"""A model as a TOML file: the facts it was told, one table each, with every digit of every number."""

from __future__ import annotations

import json
from collections import Counter

import numpy as np
from sympy.printing.str import StrPrinter

from ncgen.errors import ModelError
from ncgen.exchange.words import NOT_IN_FILES, words
from ncgen.model import Model
from ncgen.model.bodies import Body
from ncgen.model.elements import Combination, Component, Element
from ncgen.model.values import Parameter, is_number


ONCE = ("gravity", "simulation")
"""Facts that a model has one of: a single table says so."""


def to_toml(model: Model) -> str:
    """The text of a model file that `load` turns into the same model.

    Raises ModelError for what a file cannot say, such as a Python function.
    """
    head = [f"name = {json.dumps(model.name)}"]
    if not model.scale:
        head.append("scale = false")
    if model.form != "smooth":
        head.append(f"form = {json.dumps(model.form)}")
    counts = Counter(fact.word for fact in model.facts)
    tables = [_table(fact.word, fact.arguments, fact.word in ONCE and counts[fact.word] == 1) for fact in model.facts]
    return "\n".join(head) + "\n\n" + "\n".join(tables)


def _table(word: str, arguments: dict, once: bool) -> str:
    if word in NOT_IN_FILES:
        raise ModelError(f"{word}: a Python function cannot be written into a model file; use an expression")
    signature = words()[word]
    lines = [f"[{word}]" if once else f"[[{word}]]"]
    for key, value in arguments.items():
        if signature.parameters[key].kind is signature.parameters[key].VAR_KEYWORD:
            lines += [f"{k} = {_text(v, f'{word}.{k}')}" for k, v in value.items() if v is not None]
        elif value is not None:
            lines.append(f"{key} = {_text(value, f'{word}.{key}')}")
    return "\n".join(lines) + "\n"


def _text(value, where: str) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False)
    if isinstance(value, (Element, Body, Parameter, Component)):
        return json.dumps(value.name)
    if isinstance(value, Combination):
        return json.dumps(_combination(value))
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{json.dumps(k)} = {_text(v, where)}" for k, v in value.items()) + " }"
    if isinstance(value, (list, tuple, np.ndarray)):
        return "[" + ", ".join(_text(v, where) for v in value) + "]"
    if hasattr(value, "free_symbols") and value.free_symbols:
        return json.dumps(_Exact().doprint(value))
    if is_number(value):
        return repr(int(value)) if isinstance(value, (int, np.integer)) else repr(float(value))
    if callable(value):
        import sympy

        return json.dumps(_Exact().doprint(sympy.sympify(value(*sympy.symbols("x v", real=True)))))
    raise ModelError(f"{where}: {value!r} cannot be written into a model file")


def _combination(value: Combination) -> str:
    parts = []
    for weight, element in value.terms:
        if not is_number(weight):
            raise ModelError(f"{value}: a combination with parameters cannot be written into a model file")
        size = "" if abs(weight) == 1.0 else f"{abs(weight)!r}*"
        parts.append(f"{'-' if weight < 0 else '+'} {size}{element.name}")
    return " ".join(parts).removeprefix("+ ").replace("- ", "-", 1 if parts[0].startswith("-") else 0)


class _Exact(StrPrinter):
    """sympy's own notation, with numbers that read back to the same bits, and our names of functions."""

    def _print_Float(self, expr):
        return repr(float(expr))

    def _print_Abs(self, expr):
        return f"abs({self._print(expr.args[0])})"
