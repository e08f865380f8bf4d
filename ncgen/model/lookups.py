"""A curve at an expression, as sympy sees it: `Lookup(x, table)`, whose derivative is a lookup of the next order.

Classes of sympy are made when the first is needed, since models of plain numbers are described without it.
"""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from ncgen.model.pieces import Pieces

if TYPE_CHECKING:
    import sympy

    from ncgen.model.curves import Curve


def looked_up(curve: Curve, order: int, x: object) -> sympy.Expr:
    """The derivative of that order of a curve at an expression: a number at a number, and where it is the same everywhere."""
    import sympy

    at = sympy.sympify(x)
    pieces = curve.pieces
    for _ in range(order):
        pieces = pieces.derivative()
    if pieces.constant is not None:
        return sympy.Float(pieces.constant)
    if at.is_Number and at.is_finite:
        return sympy.Float(pieces.at(float(cast(Any, at))))
    lookup, table = _classes()
    return lookup(at, table(curve, order, pieces))


def pieces_in(expression: sympy.Basic) -> Pieces | None:
    """What a lookup looks into; None for any other expression."""
    return getattr(expression, "pieces", None) if expression.is_Function else None


def curves_in(expression: sympy.Basic) -> set[Curve]:
    """The curves that an expression mentions."""
    import sympy

    lookups: list[Any] = [each for each in expression.atoms(sympy.Function) if pieces_in(each)]
    return {each.table.curve for each in lookups}


def _value(x: Any, table: tuple[Any, Any, float]) -> Any:
    """What a lookup is at a number or an array in functions that sympy.lambdify makes; table: knots, rows and period of its pieces."""
    result = Pieces(*table).at(np.asarray(x, dtype=float))
    return result if result.ndim else float(result)


@cache
def _classes() -> tuple[Any, Any]:
    """Lookup, and the table that is its second argument. Any: sympy has no annotations."""
    import sympy

    atom, function = (cast(Any, base) for base in (sympy.AtomicExpr, sympy.Function))

    class Table(atom):
        """A curve that is differentiated so many times."""

        def __new__(cls, curve: Curve, order: int, pieces: Pieces) -> Any:
            made = super().__new__(cls)
            made.curve, made.order, made.pieces = curve, order, pieces
            return made

        def _hashable_content(self) -> tuple[object, ...]:
            return self.curve.name, self.order, self.pieces

        def _sympystr(self, printer: object) -> str:
            return f"{self.curve.name}, {self.order}"

        def _sympyrepr(self, printer: object) -> str:
            return repr((self.curve.name, self.order, self.pieces.knots, self.pieces.rows, self.pieces.period))

        def _code(self, printer: object) -> str:
            """As an argument of `_value` in the code of sympy.lambdify, whatever it is written for."""
            return repr((self.pieces.knots, self.pieces.rows, self.pieces.period))

        _pythoncode = _numpycode = _scipycode = _mpmathcode = _lambdacode = _code

    class Lookup(function):
        nargs = 2
        _imp_ = staticmethod(_value)

        def __reduce_ex__(self, protocol: object) -> tuple[object, ...]:
            return looked_up, (self.table.curve, self.table.order, self.args[0])

        @property
        def table(self) -> Any:
            return self.args[1]

        @property
        def pieces(self) -> Pieces:
            return self.table.pieces

        @classmethod
        def eval(cls, x: Any, table: Any) -> sympy.Expr | None:
            return looked_up(table.curve, table.order, x) if x.is_Number and x.is_finite else None

        def fdiff(self, argindex: int = 1) -> sympy.Expr:
            return looked_up(self.table.curve, self.table.order + 1, self.args[0])

        def _eval_evalf(self, prec: int) -> sympy.Expr | None:
            return self.eval(self.args[0].evalf(), self.table)

        def _eval_is_extended_real(self) -> bool | None:
            return self.args[0].is_extended_real

        def _sympystr(self, printer: Any) -> str:
            order = f", {self.table.order}" if self.table.order else ""
            return f"{self.table.curve.name}({printer.doprint(self.args[0])}{order})"

    return Lookup, Table
