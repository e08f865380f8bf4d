"""Questions about the syntax trees of expressions in model files, and what a text with a slip of the pen was probably meant to be."""

from __future__ import annotations

import ast
import math
import re
from collections.abc import Collection

from ncgen.errors import MAX_ECHO, shortened
from ncgen.program.ir.functions import FUNCTIONS

CONSTANTS = {"pi": math.pi, "e": math.e}
SUMS, PRODUCTS = (ast.Add, ast.Sub), (ast.Mult, ast.Div)


def quoted(text: str) -> str:
    """A user's text within a message."""
    return f"“{shortened(text, MAX_ECHO)}”"


def chain(node: ast.expr, operators: tuple[type[ast.operator], ...]) -> list[tuple[ast.operator | None, ast.expr]]:
    """a + b - c as [(None, a), (Add, b), (Sub, c)]: however long it is, it is one level."""
    links: list[tuple[ast.operator | None, ast.expr]] = []
    while isinstance(node, ast.BinOp) and isinstance(node.op, operators):
        links.append((node.op, node.right))
        node = node.left
    return [(None, node), *reversed(links)]


def dotted(node: ast.expr) -> str | None:
    """`a`, `a.b`, `a.b.c` as text, None for anything else."""
    parts = []
    while isinstance(node, ast.Attribute):
        parts.append(node.attr)
        node = node.value
    return ".".join([node.id, *reversed(parts)]) if isinstance(node, ast.Name) else None


def number_of(node: ast.expr) -> int | float | None:
    """The number that a node is; None for anything else."""
    if isinstance(node, ast.Constant) and isinstance(node.value, (int, float)) and not isinstance(node.value, bool):
        return node.value
    return None


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
