"""Numbers that a user writes: plain, named parameters, or expressions of parameters.

A *value* is a float, a `Parameter`, or a sympy expression of parameters. Plain numbers become
constants of the generated code; anything that mentions a parameter stays symbolic and is read from
`p` at run time.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from itertools import islice
from typing import TYPE_CHECKING, TypeAlias, TypeVar, overload

from ncgen.errors import ModelError, shown
from ncgen.model.expressions import check_expression, is_symbolic, symbols_in

if TYPE_CHECKING:
    from collections.abc import Sequence
    from fractions import Fraction

    import numpy as np
    import sympy
    from typing_extensions import TypeIs

MAX_NUMBER = 1e100
"""The largest number that can be given: products of three are still doubles. A length, mass or stiffness beyond it is a slip."""

Number: TypeAlias = "float | np.integer | np.floating | Fraction"
"""A plain real number; what a model keeps of it is a float, or an int."""

Value: TypeAlias = "Number | Parameter | sympy.Expr"
"""In signatures: a number, a parameter, or an expression of parameters."""

Numbers: TypeAlias = "Sequence[Number] | np.ndarray"
"""In signatures: several plain numbers."""

Values: TypeAlias = "Sequence[Value] | np.ndarray"
"""In signatures: several of them, such as the three of a position."""

Expression: TypeAlias = "Value | Symbolic"
"""In signatures: a number, or an expression of coordinates, rates, time and parameters."""

Driven: TypeAlias = "Value | Symbolic"
"""In signatures: the same, in which inputs may stand, too."""

Expressions: TypeAlias = "Sequence[Expression] | np.ndarray | sympy.MatrixBase"
"""In signatures: three of them, or two in the plane."""

Moment: TypeAlias = "Expression | Expressions"
"""In signatures: three of them, or one about the normal of the plane."""

Tensor: TypeAlias = "Value | Sequence[Value] | Sequence[Sequence[Value]] | np.ndarray | str"
"""In signatures: one value, three, 3×3, or a word for it."""

Scalar: TypeAlias = "float | sympy.Expr"
"""A value that a model holds, ready for arithmetic: a number, or an expression of parameters."""

T = TypeVar("T")


def symbol_of(name: str) -> sympy.Symbol:
    """The symbol of a real number; sympy is imported only then."""
    import sympy

    return sympy.Symbol(name, real=True)


class Symbolic:
    """Arithmetic on a named scalar gives a sympy expression."""

    name: str

    @property
    def symbol(self) -> sympy.Symbol:
        return symbol_of(self.name)

    def _sympy_(self) -> sympy.Symbol:
        """So that functions of sympy take it as it is: sympy.cos(parameter)."""
        return self.symbol

    def __add__(self, other: Expression) -> sympy.Expr:
        return self.symbol + as_sympy(other)

    def __radd__(self, other: Expression) -> sympy.Expr:
        return as_sympy(other) + self.symbol

    def __sub__(self, other: Expression) -> sympy.Expr:
        return self.symbol - as_sympy(other)

    def __rsub__(self, other: Expression) -> sympy.Expr:
        return as_sympy(other) - self.symbol

    def __mul__(self, other: Expression) -> sympy.Expr:
        return self.symbol * as_sympy(other)

    def __rmul__(self, other: Expression) -> sympy.Expr:
        return as_sympy(other) * self.symbol

    def __truediv__(self, other: Expression) -> sympy.Expr:
        return self.symbol / as_sympy(other)

    def __rtruediv__(self, other: Expression) -> sympy.Expr:
        return as_sympy(other) / self.symbol

    def __pow__(self, other: Expression) -> sympy.Expr:
        return self.symbol ** as_sympy(other)

    def __neg__(self) -> sympy.Expr:
        return -self.symbol


@overload
def as_sympy(value: Symbolic) -> sympy.Symbol: ...
@overload
def as_sympy(value: Symbolic | sympy.Expr) -> sympy.Expr: ...
@overload
def as_sympy(value: Expression) -> Scalar: ...
@overload
def as_sympy(value: T) -> T: ...
def as_sympy(value: object) -> object:
    """The sympy form of a number, a handle or an expression."""
    return value.symbol if isinstance(value, Symbolic) else value


@dataclass(frozen=True)
class Parameter(Symbolic):
    """A number with a name: symbolic in the kernels, given in `p` at run time.

    `default` is the value used when the caller gives no `p`; `unit` is only for people.
    """

    name: str
    default: float
    unit: str = ""

    def __repr__(self) -> str:
        return f"parameter {self.name}"


@dataclass(frozen=True)
class Input(Parameter):
    """A force, torque or signal that whoever drives the mechanism gives at every instant; `default` where nobody does."""

    def __repr__(self) -> str:
        return f"input {self.name}"


def is_number(value: object) -> TypeIs[Number]:
    """True for plain real numbers, NumPy's included; False for truth values, arrays, complex numbers, parameters and expressions."""
    if isinstance(value, float):
        return True
    if isinstance(value, (bool, Parameter)) or is_symbolic(value) or not hasattr(value, "__float__"):
        return False
    return getattr(value, "ndim", 0) == 0 and getattr(getattr(value, "dtype", None), "kind", "f") in "iuf"


@overload
def as_value(value: Number, where: str) -> float: ...
@overload
def as_value(value: object, where: str) -> float | Parameter | sympy.Expr: ...
def as_value(value: object, where: str) -> float | Parameter | sympy.Expr:
    """Check one number as the user wrote it; `where` names it in the message.

    Returns a float, a `Parameter` or a sympy expression. Raises ModelError for NaN, infinity, numbers
    beyond `MAX_NUMBER`, and things that are no numbers.
    """
    if not is_number(value):
        if isinstance(value, Parameter):
            return value
        if not is_symbolic(value):
            raise ModelError(f"{where}: {shown(value)} is not a number; give a number, a parameter or an expression of parameters")
        value = check_expression(value, where)
        if value.free_symbols:
            return value
    try:
        number = float(value)
    except OverflowError:
        raise ModelError(f"{where}: {shown(value)} is not a finite number; correct it") from None
    if not math.isfinite(number):
        raise ModelError(f"{where}: {number} is not a finite number; correct it")
    if abs(number) > MAX_NUMBER:
        raise ModelError(f"{where}: {number:g} is too large; the largest number is {MAX_NUMBER:g}, check the unit")
    return number


def as_number_if_constant(value: Scalar) -> Scalar:
    """A value that turned out to have nothing symbolic in it as a float; other values as they are."""
    return float(value) if is_symbolic(value) and not value.free_symbols else value


def total(values: Iterable[Scalar]) -> Scalar:
    """The sum of values; of numbers the same in every version of Python, since it is rounded once."""
    terms = list(values)
    return math.fsum(terms) if all(isinstance(x, (int, float)) for x in terms) else as_number_if_constant(sum(terms))


def evaluate(value: Value, parameters: dict[str, Parameter], where: str) -> float:
    """The number a value has at the parameters' defaults.

    Raises ModelError if an expression mentions something that is not a parameter of the model, or is not a real number there.
    """
    if isinstance(value, Parameter):
        return parameters.get(value.name, value).default
    if is_number(value):
        return float(value)
    symbols = symbols_in(value)
    unknown = sorted(s.name for s in symbols if s.name not in parameters)
    if unknown:
        raise ModelError(f"{where}: {unknown[0]} is not a parameter of this model; declare it with m.parameter")
    number = value.subs({s: parameters[s.name].default for s in symbols})
    try:
        result = float(number)
    except (TypeError, OverflowError):  # complex, or beyond the doubles
        result = math.nan
    if not math.isfinite(result):
        raise ModelError(f"{where}: {shown(value)} is {shown(number)} at the parameters' defaults, not a finite number; correct it")
    return result


PARAMETER_CHANGES = (0.0847, -0.0613, 0.0391, -0.0957, 0.0719)
"""By how much parameters are changed to see whether something holds for all of them: of their size, or of 1 where they are zero."""


def nearby(parameters: dict[str, Parameter]) -> list[dict[str, Parameter]]:
    """Two other sets of parameters: what holds for them and for the defaults is taken to hold always."""
    return [
        {
            name: replace(
                parameter,
                default=parameter.default + sign * PARAMETER_CHANGES[k % len(PARAMETER_CHANGES)] * (abs(parameter.default) or 1.0),
            )
            for k, (name, parameter) in enumerate(parameters.items())
        }
        for sign in (1.0, -1.0)
    ]


def vanishes(value: Value, parameters: dict[str, Parameter], bound: float) -> bool:
    """True if a value is not larger than `bound` at the parameters' defaults and at others near them."""
    if is_number(value):
        return bool(abs(value) <= bound)
    sizes = []
    for each in (parameters, *nearby(parameters)):
        try:
            sizes.append(abs(evaluate(value, each, "")))
        except ModelError:
            continue  # outside the domain of a function: says nothing
    return len(sizes) > 1 and max(sizes) <= bound


def mentioned(values: Iterable[object], parameters: dict[str, Parameter]) -> str:
    """The names of the parameters in some values, for messages."""
    names: set[str] = set()
    for value in values:
        if isinstance(value, Parameter):
            names.add(value.name)
        elif is_symbolic(value):
            names |= {s.name for s in symbols_in(value)}
    return ", ".join(name for name in parameters if name in names)


def text_of(expression: sympy.Basic) -> str:
    """An expression for a reader of code: as it is, or what it is made of where it is longer than anybody reads."""
    from sympy import preorder_traversal

    if next(islice(preorder_traversal(expression), READABLE, None), None) is None:
        return str(expression)
    return f"[{', '.join(sorted(s.name for s in symbols_in(expression)))}]"


READABLE = 40
"""Parts of an expression that a comment repeats."""
