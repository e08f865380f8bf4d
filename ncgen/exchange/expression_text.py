"""An expression as the text of a model file: sympy's notation, with every digit of every number."""

from __future__ import annotations

from collections.abc import Mapping

from sympy import Expr, Mul, Rational
from sympy.printing.precedence import PRECEDENCE
from sympy.printing.str import StrPrinter

from ncgen.exchange.grammar import parse_expression
from ncgen.model.curves import Curve

ROUNDS = 5
"""How often an expression is read and written until its text stays; twice is enough for what sympy made itself."""


def expression_text(value: object, known: set[str], curves: Mapping[str, Curve]) -> str | None:
    """The text that is written like this again after it was read; None where there is none.

    known: names of coordinates, parameters and inputs; curves: splines and tables by their names
    Raises ModelError for what a model file cannot say.
    """
    text = _Exact().doprint(value)
    for _ in range(ROUNDS):
        again = _Exact().doprint(parse_expression(text, known, curves))
        if again == text:
            return text
        text = again
    return None


class _Exact(StrPrinter):
    """sympy's own notation, with numbers that read back to the same bits, and our names of functions."""

    def _print_Mul(self, expr: Mul) -> str:
        """A product whose factors meet one by one when it is read, but never a number and a sum alone.

        sympy multiplies such two out: x/7/(x²/49 + 1), which it would print as x/(7 (x²/49 + 1)), would be read as x/(x²/7 + 7).
        """
        number = Mul(*(f for f in expr.args if f.is_Number))
        over, under = (number.p, number.q) if isinstance(number, Rational) else (number, 1)
        sign, over = ("-", self._print(-over)) if over < 0 else ("", self._print(over))
        factors = [f for f in expr.as_ordered_factors() if not f.is_Number]
        below = [f for f in factors if f.is_Pow and f.exp.is_Rational and f.exp < 0]
        sums = [self._factor(f) for f in factors if f.is_Add]
        plain = [self._factor(f) for f in factors if not f.is_Add and f not in below]
        divided = [self._print(under)] * (under != 1) + [self._factor(f.base**-f.exp) for f in below]
        if sums and not plain and (number == 1 or not below):  # the number goes last
            last = [f"(-{over})"] if sign else [over] * (over != "1")
            return "/".join(["*".join(sums + last), *divided])
        first = [over] * (over != "1" or not plain)
        return sign + "*".join(["/".join(["*".join(first + plain), *divided]), *sums])

    def _factor(self, expr: Expr) -> str:
        return self.parenthesize(expr, PRECEDENCE["Mul"], strict=False)

    def _print_Float(self, expr: Expr) -> str:
        return repr(float(expr))

    def _print_Abs(self, expr: Expr) -> str:
        return f"abs({self._print(expr.args[0])})"

    # sympy has no annotations: what its own method gives is taken for the only text that may be given.
    def _print_Exp1(self, expr: Expr) -> str:  # pyright: ignore[reportIncompatibleMethodOverride]
        return "exp(1)"  # a parameter may be called e
