"""Numbers that a user writes: plain, named parameters, or expressions of parameters.

A *value* is a float, a `Parameter`, or a sympy expression of parameters. Plain numbers become
constants of the generated code; anything that mentions a parameter stays symbolic and is read from
`p` at run time.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from ncgen.errors import ModelError


class Symbolic:
    """Arithmetic on a named scalar gives a sympy expression; sympy is imported only then."""

    name: str

    @property
    def symbol(self):
        import sympy

        return sympy.Symbol(self.name, real=True)

    def __add__(self, other):
        return self.symbol + as_sympy(other)

    def __radd__(self, other):
        return as_sympy(other) + self.symbol

    def __sub__(self, other):
        return self.symbol - as_sympy(other)

    def __rsub__(self, other):
        return as_sympy(other) - self.symbol

    def __mul__(self, other):
        return self.symbol * as_sympy(other)

    def __rmul__(self, other):
        return as_sympy(other) * self.symbol

    def __truediv__(self, other):
        return self.symbol / as_sympy(other)

    def __rtruediv__(self, other):
        return as_sympy(other) / self.symbol

    def __pow__(self, other):
        return self.symbol ** as_sympy(other)

    def __neg__(self):
        return -self.symbol


def as_sympy(value):
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


def is_number(value) -> bool:
    """True for plain numbers (bool excluded), False for parameters and expressions."""
    return not isinstance(value, (bool, Parameter)) and not hasattr(value, "free_symbols") and hasattr(value, "__float__")


def as_value(value, what: str):
    """Check one number as the user wrote it; `what` names it in the message.

    Returns a float, a `Parameter` or a sympy expression. Raises ModelError for NaN, infinity and
    things that are no numbers.
    """
    if isinstance(value, Parameter):
        return value
    if hasattr(value, "free_symbols"):
        if value.free_symbols:
            return value
        value = float(value)
    if not is_number(value):
        raise ModelError(f"{what}: {value!r} is not a number; give a number, a parameter or an expression of parameters")
    number = float(value)
    if not math.isfinite(number):
        raise ModelError(f"{what}: {number} is not a finite number; correct it")
    return number


def evaluate(value, parameters: dict[str, Parameter], what: str) -> float:
    """The number a value has at the parameters' defaults.

    Raises ModelError if an expression mentions something that is not a parameter of the model.
    """
    if isinstance(value, Parameter):
        return parameters.get(value.name, value).default
    if is_number(value):
        return float(value)
    unknown = sorted(s.name for s in value.free_symbols if s.name not in parameters)
    if unknown:
        raise ModelError(f"{what}: {unknown[0]} is not a parameter of this model; declare it with m.parameter")
    return float(value.subs({s: parameters[s.name].default for s in value.free_symbols}))
