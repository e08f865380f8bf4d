"""Questions about the syntax trees of expressions in model files."""

from __future__ import annotations

import ast
import math

from ncgen.errors import MAX_ECHO, shortened

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
