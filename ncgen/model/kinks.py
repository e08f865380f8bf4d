"""Laws with kinks and jumps: Min, Max, Heaviside and Piecewise in terms of sign, which every language and every derivative knows.

A choice is a weighted sum, (1 + sign(d))/2 of what holds where d > 0 and (1 − sign(d))/2 of the rest: exact on both sides, for one of the
weights is 1 and the other 0, and the mean of both where d is 0. What is not chosen is computed all the same, so it must be a number there.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import reduce
from typing import TYPE_CHECKING, cast

from ncgen.errors import ModelError, shown

if TYPE_CHECKING:
    import sympy


CHOICES = {"min": "Min", "max": "Max"}
"""{word of model files: class of sympy}, each of two expressions."""

MOST_PARTS = 3_000
"""Parts of an expression with choices, those that stand there several times counted as often: a choice says three times what it chooses."""


def without_kinks(expression: sympy.Expr, where: str) -> sympy.Expr:
    """The expression with sign and abs alone for what has kinks. Raises ModelError for a Piecewise without a last case, and for
    conditions that compare no two expressions."""
    import sympy

    kinked = (sympy.Min, sympy.Max, sympy.Heaviside, sympy.Piecewise)
    if not expression.has(*kinked):
        return expression
    replacements = {
        sympy.Min: lambda *args: reduce(lambda a, b: _chosen(b - a, a, b), _sorted(args)),
        sympy.Max: lambda *args: reduce(lambda a, b: _chosen(a - b, a, b), _sorted(args)),
        sympy.Heaviside: lambda x, *at_zero: (1 + sympy.sign(x)) / 2,
        sympy.Piecewise: lambda *cases: _piecewise(cases, where),
    }
    if (parts := _parts(expression, {})) > MOST_PARTS:
        problem = f"choices within choices make an expression of {parts} parts"
        raise ModelError(f"{where}: {problem}; {MOST_PARTS} are allowed, write it in parts")
    return cast("sympy.Expr", _replaced(expression, replacements))


def _parts(node: sympy.Basic, known: dict[sympy.Basic, int]) -> int:
    """How many parts an expression has, its choices expanded; counted before they are."""
    if node not in known:
        import sympy

        inner = [_parts(argument, known) for argument in node.args]
        if isinstance(node, (sympy.Min, sympy.Max)):
            known[node] = reduce(lambda one, other: 3 * (one + other), inner)
        elif isinstance(node, sympy.Piecewise):
            known[node] = 3 * sum(inner)  # a condition stands there twice, and what it chooses once
        else:
            known[node] = 1 + sum(inner)
    return known[node]


def _replaced(node: sympy.Basic, replacements: dict[type, Callable[..., sympy.Basic]]) -> sympy.Basic:
    """Inner ones first, every node once more with what its arguments became."""
    if not node.args:
        return node
    arguments = [_replaced(argument, replacements) for argument in node.args]
    make = replacements.get(type(node))
    return make(*arguments) if make else node.func(*arguments)


def _sorted(args: tuple[sympy.Expr, ...]) -> list[sympy.Expr]:
    from sympy.core.sorting import default_sort_key

    return sorted(args, key=default_sort_key)


def _chosen(difference: sympy.Expr, one: sympy.Expr, other: sympy.Expr) -> sympy.Expr:
    """One where the difference is positive, the other where it is negative."""
    import sympy

    side = sympy.sign(difference)
    return one * (1 + side) / 2 + other * (1 - side) / 2


def _piecewise(cases: tuple[sympy.Basic, ...], where: str) -> sympy.Expr:
    import sympy

    *before, (last, always) = [(cast("sympy.Expr", case.args[0]), case.args[1]) for case in cases]
    if always != sympy.true:
        raise ModelError(f"{where}: a Piecewise whose last case is not for all others; end it with (expression, True)")
    result = last
    for value, condition in reversed(before):
        if _is_comparison(condition):
            result = _chosen(_margin(condition), value, result)
        else:
            weight = _weight(condition, where)
            result = value * weight + result * (1 - weight)
    return result


def _is_comparison(condition: sympy.Basic) -> bool:
    import sympy

    return isinstance(condition, (sympy.StrictLessThan, sympy.LessThan, sympy.StrictGreaterThan, sympy.GreaterThan))


def _margin(comparison: sympy.Basic) -> sympy.Expr:
    """What is positive where a comparison holds."""
    return comparison.gts - comparison.lts  # pyright: ignore[reportAttributeAccessIssue]  sympy says Basic


def _weight(condition: sympy.Basic, where: str) -> sympy.Expr:
    """1 where a condition holds and 0 where it does not; between both, where two expressions are equal, a comparison counts half."""
    import sympy

    if _is_comparison(condition):
        return (1 + sympy.sign(_margin(condition))) / 2
    if isinstance(condition, sympy.Not):
        return 1 - _weight(condition.args[0], where)
    if isinstance(condition, sympy.And):
        return sympy.Mul(*(_weight(each, where) for each in _in_order(condition)))
    if isinstance(condition, sympy.Or):
        return 1 - sympy.Mul(*(1 - _weight(each, where) for each in _in_order(condition)))
    remedy = "compare two expressions by <, <=, > or >=, and join comparisons by &, | and ~"
    raise ModelError(f"{where}: {shown(condition)} is no condition of a Piecewise here; {remedy}")


def _in_order(condition: sympy.Basic) -> list[sympy.Basic]:
    from sympy.core.sorting import default_sort_key

    return sorted(condition.args, key=default_sort_key)
