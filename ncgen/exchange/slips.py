"""Slips of the pen in expressions: what a text that Python does not read, or reads otherwise, was probably meant to be."""

from __future__ import annotations

import ast
import re
from collections.abc import Collection

from ncgen.program.ir.functions import FUNCTIONS

UNITS = frozenset("m mm cm km um kg g mg s ms us min h N kN mN Nm rad mrad deg rpm Hz kHz J kJ W kW Pa kPa MPa".split())
"""Words behind a number that are units unless the model has that name."""

_UNIT = re.compile(r"\s*[-+]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][-+]?\d+)?\s+([A-Za-z]+)")
_COMMA = re.compile(r"\s*([-+]?\d+),(\d+)\s*")
_APPLIED = re.compile(rf"\b({'|'.join(FUNCTIONS)})\s+(?:(?=\()|([\w.]+))")
_APART = re.compile(r"(?<=[\w.)])\s+(?=[A-Za-z_\d(])")
_AFTER_NUMBER = re.compile(r"(?<![\w.])((?:\d++(?:\.\d*+)?|\.\d++)(?:[eE][-+]?\d++)?+)(?=[A-Za-z_(])")


def has_unit(text: str, known: Collection[str]) -> bool:
    """Return whether a text is a number with a unit, such as `2 kg`, that is no name of the model."""
    match = _UNIT.match(text)
    return bool(match) and match[1] in UNITS and match[1] not in known


def repaired(text: str) -> str | None:
    """Return the expression that was probably meant by a text, such as `10*t` by `10 t`; None where nothing suggests itself."""
    if match := _COMMA.fullmatch(text):
        return f"{match[1]}.{match[2]}"
    meant = _APPLIED.sub(lambda call: f"{call[1]}({call[2]})" if call[2] else call[1], text.strip())
    meant = _AFTER_NUMBER.sub(r"\1*", _APART.sub("*", meant)).replace("^", "**")
    try:
        ast.parse(meant, mode="eval")
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        return None
    return meant if meant != text.strip() else None
