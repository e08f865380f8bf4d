"""Bounds the size of an expression on its syntax tree, before anything is computed.

sympy keeps exact numbers exact, and a short text can ask for a number that no memory holds.
"""

from __future__ import annotations

import ast
import math
from collections.abc import Callable, Collection
from dataclasses import dataclass, replace
from functools import partial

from ncgen.errors import ModelError
from ncgen.exchange.choices import PIECEWISE, compared
from ncgen.exchange.syntax import CONSTANTS, PRODUCTS, SUMS, chain, dotted, number_of, quoted
from ncgen.model.expressions import MAX_DEPTH, MOST_DIGITS, MOST_FACTORS
from ncgen.model.kinks import CHOICES
from ncgen.program.ir.functions import FUNCTIONS

MOST_LEVELS = 3 * MAX_DEPTH
"""Levels of a text: a level of sympy, such as 1/sqrt(-x), may be written with three."""

LARGEST_EXPONENT = 64

MAX_BITS = 2**16
"""Binary digits of the exact numbers that may come together in an expression."""

_INVERSE = frozenset({"asin", "acos", "atan", "atan2"})
INVERSES = {"exp": frozenset({"log"}), "log": frozenset({"exp"}), "sin": _INVERSE, "cos": _INVERSE, "tan": _INVERSE}
"""{function: those that it undoes}: what stands within both comes out again."""


@dataclass(frozen=True)
class Size:
    """What is known of a part of an expression before it is built.

    value: its number, or None where it has a name in it; digits: the most binary digits that its exact numbers can have
    growth: the most binary digits of the number that it may come down to once names cancel, which counts where it is an exponent;
        numbers within a function stay there
    functions: what is called in it, but for what other functions hide
    """

    value: float | None
    digits: int
    growth: int = 0
    functions: frozenset[str] = frozenset()


def _functions(sizes: list[Size]) -> frozenset[str]:
    return frozenset().union(*(size.functions for size in sizes))


def _largest(growth: int) -> int:
    """The largest number of so many binary digits, or one that is too large for anything."""
    return 2 ** min(growth, MAX_BITS.bit_length())


class Measure:
    """Bounds the size of an expression from the leaves upwards."""

    def __init__(self, text: str, curves: Collection[str] = ()) -> None:
        self.text, self.curves = text, curves

    def size(self, node: ast.expr, level: int = 1) -> Size:
        if level > MOST_LEVELS:
            raise ModelError(f"{quoted(self.text)} has more than {MOST_LEVELS} levels; write it with fewer parentheses, or in parts")
        size_of_node = self._size(node, level)
        if size_of_node.digits > (MAX_BITS if size_of_node.value is None else 2 * MOST_DIGITS):
            raise ModelError(f"{quoted(self.text)}: the exact numbers in it have too many digits; write numbers with a decimal point")
        if size_of_node.value is not None and not math.isfinite(size_of_node.value):
            raise self._not_finite(node)
        return size_of_node

    def _size(self, node: ast.expr, level: int) -> Size:
        if (number := number_of(node)) is not None:
            digits = number.bit_length() if isinstance(number, int) else 1
            return Size(self._number(node, partial(float, number)), digits, digits)
        if isinstance(node, ast.UnaryOp) and isinstance(node.op, (ast.USub, ast.UAdd)):
            operand = self.size(node.operand, level + 1)
            return replace(operand, value=-operand.value) if isinstance(node.op, ast.USub) and operand.value is not None else operand
        if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Pow):
            return self._power(node, self.size(node.left, level + 1), self.size(node.right, level + 1))
        if isinstance(node, ast.BinOp) and isinstance(node.op, SUMS + PRODUCTS):
            return self._chain(node, level)
        if isinstance(node, ast.Call) and (name := dotted(node.func)) in FUNCTIONS:
            return self._call(node, name, [self.size(a, level + 1) for a in node.args])
        if isinstance(node, ast.Call) and dotted(node.func) in CHOICES:
            inner = [self.size(a, level + 3) for a in node.args]  # each stands there three times: by itself and in two weights
            return Size(None, 3 * sum(s.digits for s in inner), 3 * sum(s.growth for s in inner), _functions(inner) | {"sign"})
        if isinstance(node, ast.Call) and dotted(node.func) == PIECEWISE:
            inner = [self.size(a, level + 3) for a in compared(node)]  # each stands there twice at most
            return Size(None, 3 * sum(s.digits for s in inner), 3 * sum(s.growth for s in inner), _functions(inner) | {"sign"})
        if isinstance(node, ast.Call) and dotted(node.func) in self.curves:
            return Size(None, 1 + sum(self.size(a, level + 1).digits for a in node.args), 1)  # of numbers alone it is a double
        return Size(CONSTANTS.get(dotted(node) or ""), 1)  # a name, or what is refused when it is read

    def _chain(self, node: ast.BinOp, level: int) -> Size:
        operators = SUMS if isinstance(node.op, SUMS) else PRODUCTS
        links = chain(node, operators)
        sizes = [self.size(operand, level + 1) for _, operand in links]
        if operators is PRODUCTS and sum(s.value is None for s in sizes) > MOST_FACTORS:
            raise ModelError(f"{quoted(self.text)}: a product of {len(sizes)} factors; {MOST_FACTORS} are allowed")
        value = sizes[0].value
        for (operator, _), size in zip(links[1:], sizes[1:], strict=True):
            value = None if value is None or size.value is None else self._number(node, partial(_combined, operator, value, size.value))
        digits, growth = sum(s.digits for s in sizes), sum(s.growth for s in sizes)
        return Size(value, digits, growth + len(sizes).bit_length() - 1 if operators is SUMS else growth, _functions(sizes))

    def _power(self, node: ast.expr, base: Size, exponent: Size) -> Size:
        """base**exponent. An exponent with names in it may come down to the number that its own numbers make."""
        if base.value == math.e and base.digits == 1:
            return self._function(node, "exp", [exponent])
        if exponent.value is None or "log" in exponent.functions:
            factor = _largest(exponent.growth)
        else:
            if abs(exponent.value) > LARGEST_EXPONENT:
                raise ModelError(f"{quoted(self.text)}: the exponent {exponent.value:.6g} is too large; {LARGEST_EXPONENT} is the limit")
            factor = max(1, math.ceil(abs(exponent.value)))
            if exponent.value != int(exponent.value) and base.digits > 2 * MOST_DIGITS:
                factor = MAX_BITS  # a root of an exact number looks for its factors
        value = None
        if base.value is not None and exponent.value is not None:
            value = self._number(node, partial(math.pow, base.value, exponent.value))
        return Size(value, base.digits * factor + exponent.digits, base.growth * factor, _functions([base, exponent]))

    def _call(self, node: ast.Call, name: str, arguments: list[Size]) -> Size:
        if len(arguments) != FUNCTIONS[name].arity:
            return Size(None, 1)  # refused when it is read
        return self._power(node, *arguments) if name == "pow" else self._function(node, name, arguments)

    def _function(self, node: ast.expr, name: str, arguments: list[Size]) -> Size:
        digits, growth, inside = sum(a.digits for a in arguments), sum(a.growth for a in arguments), _functions(arguments)
        if name == "exp" and "log" in inside:
            digits *= _largest(growth)  # exp(9*log(x)) is x**9
        if name == "sqrt" and digits > 2 * MOST_DIGITS:
            digits = MAX_BITS + 1
        if inside & INVERSES.get(name, frozenset()):
            growth = digits
        elif name not in ("sqrt", "abs"):  # what stands within stays there, at most for the function that undoes this one
            growth = digits.bit_length() if name == "log" else 1
            inside = inside if any(name in undone for undone in INVERSES.values()) else frozenset()
        value = None
        if all(a.value is not None for a in arguments):
            value = self._number(node, lambda: float(FUNCTIONS[name].python(*(a.value for a in arguments))))
        return Size(value, digits, growth, inside | {name})

    def _number(self, node: ast.expr, compute: Callable[[], float]) -> float:
        try:
            return compute()
        except ZeroDivisionError:
            raise ModelError(f"{quoted(self.text)} divides by zero") from None
        except (OverflowError, ValueError):  # beyond the doubles, and outside a function's domain
            raise self._not_finite(node) from None

    def _not_finite(self, node: ast.expr) -> ModelError:
        source = ast.get_source_segment(self.text.strip(), node) or self.text
        prefix = f"{quoted(self.text)}: " if source != self.text.strip() else ""
        return ModelError(f"{prefix}{quoted(source)} is not a finite number; correct it")


def _combined(operator: ast.operator | None, a: float, b: float) -> float:
    if isinstance(operator, SUMS):
        return a + b if isinstance(operator, ast.Add) else a - b
    return a * b if isinstance(operator, ast.Mult) else a / b
