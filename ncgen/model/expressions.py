"""What an expression may hold: finite numbers of a size that can be worked with, and no more depth than sympy can follow.

Everything here looks at an expression without changing it. Numbers of an expression are doubles in the end, so whatever is
no double at any place within it is refused there, before a tower of powers becomes a number that fills the memory.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, cast

from ncgen.errors import ModelError, shown

if TYPE_CHECKING:
    import sympy
    from typing_extensions import TypeIs

MAX_DEPTH = 50
"""Levels of functions and operations within each other; sympy follows them by recursion."""

MOST_DIGITS = 1023
"""Binary digits of an exact number, above or below the fraction's line: those of a double's range."""

MOST_FACTORS = 64
"""Factors of a product: the second derivative has as many terms as this has pairs."""


def is_symbolic(value: object) -> TypeIs[sympy.Basic]:
    """True for what sympy made; sympy is not imported to find out."""
    return hasattr(type(value), "free_symbols")


def symbols_in(expression: sympy.Basic) -> set[sympy.Symbol]:
    """The symbols in an expression."""
    return cast("set[sympy.Symbol]", expression.free_symbols)  # sympy says Basic of every symbol


def check_expression(expression: object, where: str) -> sympy.Expr:
    """The expression, unless it is not one of sympy's, too deep, or holds what is no finite real number; `where` names it.

    Every different part is looked at once, arguments first.
    """
    import sympy

    if not isinstance(expression, sympy.Expr):
        raise ModelError(f"{where}: {shown(expression)} is not an expression; give one of coordinates, rates, time and parameters")
    depth: dict[sympy.Basic, int] = {}
    values: dict[sympy.Basic, float] = {}
    stack: list[tuple[sympy.Basic, bool]] = [(expression, False)]
    while stack:
        node, ready = stack.pop()
        if node in depth:
            continue
        if not ready:
            stack.append((node, True))
            stack.extend((argument, False) for argument in node.args)
            continue
        depth[node] = 1 + max((depth[a] for a in node.args), default=0)
        if depth[node] > MAX_DEPTH:
            raise ModelError(f"{where}: an expression of more than {MAX_DEPTH} levels; write it with fewer parentheses, or in parts")
        if node.is_Mul and len(node.args) > MOST_FACTORS:
            raise ModelError(f"{where}: a product of {len(node.args)} factors; {MOST_FACTORS} are allowed")
        if isinstance(node, sympy.Expr) and node.is_number and all(a in values for a in node.args):
            values[node] = _value(node, [values[a] for a in node.args], where)
    return expression


def _value(node: sympy.Expr, arguments: list[float], where: str) -> float:
    """The double that a number, or a function of numbers, stands for."""
    import sympy

    if isinstance(node, sympy.Rational) and max(node.p.bit_length(), node.q.bit_length()) > MOST_DIGITS:
        raise ModelError(
            f"{where}: an exact number of {len(bin(max(abs(node.p), node.q))) - 2} binary digits; {MOST_DIGITS} are allowed, correct it"
        )
    try:
        computed = node.func(*map(sympy.Float, arguments)) if arguments else node
        value = float(computed)
    except (TypeError, OverflowError):  # what is not real, and what is beyond the doubles
        value = math.nan
    if not math.isfinite(value):
        raise ModelError(f"{where}: {shown(node)} is not a finite number; correct it")
    return value
