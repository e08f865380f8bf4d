"""The elementary functions a program may call: one table for every printer and evaluator.

Columns: how many arguments, the name of the C macro (see ncgen.h), the NumPy name, the sympy class name,
and the function on Python floats.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple


class Function(NamedTuple):
    arity: int
    c: str
    numpy: str
    sympy: str
    python: Callable


FUNCTIONS = {
    "sqrt": Function(1, "NCGEN_SQRT", "sqrt", "sqrt", math.sqrt),
    "sin": Function(1, "NCGEN_SIN", "sin", "sin", math.sin),
    "cos": Function(1, "NCGEN_COS", "cos", "cos", math.cos),
    "tan": Function(1, "NCGEN_TAN", "tan", "tan", math.tan),
    "asin": Function(1, "NCGEN_ASIN", "arcsin", "asin", math.asin),
    "acos": Function(1, "NCGEN_ACOS", "arccos", "acos", math.acos),
    "atan": Function(1, "NCGEN_ATAN", "arctan", "atan", math.atan),
    "atan2": Function(2, "NCGEN_ATAN2", "arctan2", "atan2", math.atan2),
    "sinh": Function(1, "NCGEN_SINH", "sinh", "sinh", math.sinh),
    "cosh": Function(1, "NCGEN_COSH", "cosh", "cosh", math.cosh),
    "tanh": Function(1, "NCGEN_TANH", "tanh", "tanh", math.tanh),
    "exp": Function(1, "NCGEN_EXP", "exp", "exp", math.exp),
    "log": Function(1, "NCGEN_LOG", "log", "log", math.log),
    "abs": Function(1, "NCGEN_ABS", "abs", "Abs", abs),
    "sign": Function(1, "NCGEN_SIGN", "sign", "sign", lambda x: (x > 0) - (x < 0)),
    "pow": Function(2, "NCGEN_POW", "power", "Pow", math.pow),
}
