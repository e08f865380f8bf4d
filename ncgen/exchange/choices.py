"""Choices in the expressions of model files: piecewise((value, condition), …, otherwise), and what a condition may be.

    piecewise((2*t, t < 1), (1, (t >= 1) & ~(B.x > 0.2)), 0)

Conditions are comparisons by <, <=, > and >=, joined by &, | and ~ between parentheses, or by and, or and not.
"""

from __future__ import annotations

import ast
from collections.abc import Callable
from typing import TYPE_CHECKING, TypeAlias

from ncgen.errors import ModelError
from ncgen.model.kinks import without_kinks

if TYPE_CHECKING:
    from sympy import Expr
    from sympy.logic.boolalg import Boolean

PIECEWISE = "piecewise"

COMPARISONS: dict[type[ast.cmpop], str] = {
    ast.Lt: "StrictLessThan",
    ast.LtE: "LessThan",
    ast.Gt: "StrictGreaterThan",
    ast.GtE: "GreaterThan",
}
"""{operator: class of sympy}."""

MOST_JOINED = 50
"""Levels of conditions within conditions."""

MOST_COMPARED = 64
"""Comparisons in a choice. Each becomes a factor, of which a product may have no more (`ncgen.model.expressions.MOST_FACTORS`), and sympy
takes time with the square of their number."""


def compared(call: ast.Call) -> list[ast.expr]:
    """The expressions in a choice: its values, and the sides of its comparisons."""
    expressions: list[ast.expr] = []
    waiting: list[ast.expr] = list(call.args)
    while waiting:
        each = waiting.pop()
        inner = each.elts if isinstance(each, ast.Tuple) else _parts(each)
        waiting += inner
        expressions += [] if inner else [each]
    return expressions


Read: TypeAlias = "Callable[[ast.expr], Expr]"
"""How an expression is read."""


def piecewise(call: ast.Call, read: Read, where: str) -> Expr:
    """A choice in terms of signs. Raises ModelError, beginning with `where`, for what is not one."""
    import sympy

    cases = [each.elts for each in call.args[:-1] if isinstance(each, ast.Tuple) and len(each.elts) == 2]
    if not cases or len(cases) < len(call.args) - 1 or isinstance(call.args[-1], ast.Tuple):
        raise ModelError(f"{where}: write a choice as {PIECEWISE}((value, condition), …, otherwise)")
    comparisons = sum(isinstance(node, ast.Compare) for node in ast.walk(call))
    if comparisons > MOST_COMPARED:
        raise ModelError(f"{where}: {comparisons} comparisons in a choice; {MOST_COMPARED} are allowed, take a table instead")
    pairs = [(read(value), _condition(condition, read, where)) for value, condition in cases]
    return without_kinks(sympy.Piecewise(*pairs, (read(call.args[-1]), True)), where)


def _condition(node: ast.expr, read: Read, where: str, level: int = 1) -> Boolean:
    """A comparison, or several that are joined."""
    import sympy

    if level > MOST_JOINED:
        raise ModelError(f"{where}: conditions stand more than {MOST_JOINED} deep in each other; write them with fewer parentheses")
    if isinstance(node, ast.Compare) and all(type(operator) in COMPARISONS for operator in node.ops):
        sides = [read(side) for side in (node.left, *node.comparators)]
        pairs = zip(sides, sides[1:])
        return sympy.And(*(getattr(sympy, COMPARISONS[type(o)])(*pair) for o, pair in zip(node.ops, pairs, strict=True)))
    inner = [] if isinstance(node, ast.Compare) else [_condition(each, read, where, level + 1) for each in _parts(node)]
    if not inner:
        raise ModelError(f"{where}: a condition compares expressions, such as (t > 1) & (t <= 2), each comparison between parentheses")
    if isinstance(node, ast.UnaryOp):
        return sympy.Not(*inner)
    both = isinstance(node.op, (ast.BitAnd, ast.And)) if isinstance(node, (ast.BinOp, ast.BoolOp)) else True
    return sympy.And(*inner) if both else sympy.Or(*inner)


def _parts(node: ast.expr) -> list[ast.expr]:
    """What a condition is made of; empty for an expression."""
    if isinstance(node, ast.Compare):
        return [node.left, *node.comparators]
    if isinstance(node, ast.BoolOp):
        return node.values
    if isinstance(node, ast.BinOp) and isinstance(node.op, (ast.BitAnd, ast.BitOr)):
        return [node.left, node.right]
    return [node.operand] if isinstance(node, ast.UnaryOp) and isinstance(node.op, (ast.Not, ast.Invert)) else []
