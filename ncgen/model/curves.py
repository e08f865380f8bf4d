"""Functions of one variable that are given by numbers: splines, tables, and the smooth step, for any expression.

    profile = m.spline("profile", (0, 0.1, 0.3), (0, 0.02, 0.03))
    m.drive(s, profile(m.time))
    profile(psi, 1)  # its derivative

Between knots they are polynomials, so derivatives are exact. Beyond the last knots they go on straight, with the slope that they have
there; a periodic one begins again.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from ncgen.errors import ModelError, counted, foreign, one_of, shown
from ncgen.model.argument_readers import expression
from ncgen.model.expressions import is_symbolic
from ncgen.model.lookups import curves_in, looked_up
from ncgen.model.pieces import ENDS, Pieces, are_finite, cubic, linear, slopes_of

if TYPE_CHECKING:
    import sympy

    from ncgen.model.contents import Contents
    from ncgen.model.values import Expression, Numbers

MOST_KNOTS = 10_000

PERIOD_TOLERANCE = 1e-12
"""How far the ends of what repeats itself may be apart, of the largest value."""


@dataclass(frozen=True)
class Curve:
    """A function of one variable by its name; `curve(x)` is its value at an expression, `curve(x, k)` its kth derivative there."""

    name: str
    pieces: Pieces

    def __repr__(self) -> str:
        return f"curve {self.name}"

    def __call__(self, x: Expression, order: int = 0) -> sympy.Expr:
        """Raises ModelError for what is no expression, and for an order that is no whole number from 0 to the degree."""
        if type(order) is not int or not 0 <= order <= self.pieces.degree:
            raise ModelError(f"{self.name}: {shown(order)} is no order of a derivative here; give 0 to {self.pieces.degree}")
        return looked_up(self, order, expression(x, self.name))


def spline(name: str, knots: Numbers, values: Numbers, end: str) -> Curve:
    """A cubic spline with continuous second derivatives. Raises ModelError for an unknown end, and for what no spline goes through."""
    where, periodic = f"spline {name}", end == "periodic"
    one_of(end, f"{where}: end", ENDS)
    x, y = _checked(where, knots, values, ENDS[end], periodic)
    return _made(where, name, cubic(x, y, slopes_of(x, y, end), x[-1] - x[0] if periodic else 0.0))


def table(name: str, knots: Numbers, values: Numbers, periodic: bool) -> Curve:
    """Straight lines from knot to knot. Raises ModelError like `spline`."""
    where = f"table {name}"
    x, y = _checked(where, knots, values, 2, periodic)
    return _made(where, name, linear(x, y, x[-1] - x[0] if periodic else 0.0))


STEP = Curve("smooth_step", Pieces((0.0, 1.0), ((0.0,) * 7, (0.0, 0.0, 0.0, 0.0, 10.0, -15.0, 6.0), (1.0, 1.0, *(0.0,) * 5))))
"""From 0 at 0 to 1 at 1, s³ (10 − 15 s + 6 s²): speed and acceleration vanish at both ends."""


def smooth_step(x: Expression, start: Expression = 0.0, end: Expression = 1.0) -> sympy.Expr:
    """Build a step from 0 where x is `start` to 1 where it is `end`, with two continuous derivatives; constant beyond.

    The polynomial s³ (10 − 15 s + 6 s²) of s = (x − start)/(end − start).

    Parameters
    ----------
    x : float or expression
        Number, or expression of coordinates, `m.time` and parameters.
    start : float or expression
        Value of x at which the step begins.
    end : float or expression
        Value of x at which the step ends; less than `start` for a step from 1 to 0.

    Returns
    -------
    sympy.Expr
        The step.

    Raises
    ------
    ModelError
        If start and end are the same.
    """
    import sympy

    at, first, last = (sympy.sympify(each if type(each) is int else expression(each, STEP.name)) for each in (x, start, end))
    if (last - first).is_zero:
        raise ModelError(f"{STEP.name}: it starts and ends at {shown(first)}; give two places that are apart")
    return STEP((at - first) / (last - first))


BUILT_IN = {STEP.name: STEP}
"""Curves that every model has."""


def check_curves(model: Contents, word: str, arguments: Mapping[str, object]) -> None:
    """Refuse expressions with curves of another model among the arguments of a builder method."""
    for key, argument in arguments.items():
        for each in argument if isinstance(argument, (list, tuple)) else (argument,):
            for curve in curves_in(each) if is_symbolic(each) else ():
                if {**model.curves, **BUILT_IN}.get(curve.name) != curve:
                    raise foreign(f"{word}, {key}", repr(curve))


def _checked(where: str, knots: Numbers, values: Numbers, least: int, periodic: bool) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Knots and values, unless they do not go together; of what repeats itself the last value is the first."""
    x, y = tuple(map(float, knots)), tuple(map(float, values))
    if len(x) != len(y):
        raise ModelError(f"{where}: {counted(len(x), 'knot')} and {counted(len(y), 'value')} given; give a value for every knot")
    if not least <= len(x) <= MOST_KNOTS:
        raise ModelError(f"{where}: {counted(len(x), 'knot')} given; give {least} to {MOST_KNOTS}")
    for a, b in zip(x, x[1:]):
        if not a < b:
            raise ModelError(f"{where}: the knot {b:.12g} follows {a:.12g}; give knots that increase")
    if not periodic:
        return x, y
    if abs(y[-1] - y[0]) > PERIOD_TOLERANCE * max(map(abs, y)):
        raise ModelError(f"{where}: it begins with {y[0]:.12g} and ends with {y[-1]:.12g}; what repeats itself ends as it begins")
    return x, (*y[:-1], y[0])


def _made(where: str, name: str, pieces: Pieces) -> Curve:
    if not are_finite(pieces):
        raise ModelError(f"{where}: knots are so close, or values so large, that its slopes are not finite; correct them")
    return Curve(name, pieces)
