"""The elementary functions a program may call: one table for every printer, evaluator and derivative.

Columns: the NumPy name, the sympy class name, the function on Python floats, and the derivative by each argument as operations g
of a graph: (graph, y = f(x), x) -> node. In C it is a macro of ncgen_math.h that is called like the key.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple, TypeAlias

if TYPE_CHECKING:
    from ncgen.program.ir.graph import Graph

Slope: TypeAlias = Callable[..., int]
"""(graph, node of y = f(x), nodes of x) -> node of the derivative of f by one argument."""


class Function(NamedTuple):
    numpy: str
    sympy: str
    python: Callable[..., float]
    derivatives: tuple[Slope, ...]

    @property
    def arity(self) -> int:
        """How many arguments it takes."""
        return len(self.derivatives)


def _one_over(g: Graph, node: int) -> int:
    return g.div(g.const(1.0), node)


def _one_plus(g: Graph, node: int) -> int:
    return g.add(g.const(1.0), node)


def _one_minus(g: Graph, node: int) -> int:
    return g.sub(g.const(1.0), node)


def _other_leg(g: Graph, x: int) -> int:
    """√(1 − x²)"""
    return g.call("sqrt", _one_minus(g, g.mul(x, x)))


def _radius(g: Graph, y: int, x: int) -> int:
    return g.add(g.mul(y, y), g.mul(x, x))


FUNCTIONS = {
    "sqrt": Function("sqrt", "sqrt", math.sqrt, (lambda g, y, x: g.div(g.const(0.5), y),)),
    "sin": Function("sin", "sin", math.sin, (lambda g, y, x: g.call("cos", x),)),
    "cos": Function("cos", "cos", math.cos, (lambda g, y, x: g.neg(g.call("sin", x)),)),
    "tan": Function("tan", "tan", math.tan, (lambda g, y, x: _one_plus(g, g.mul(y, y)),)),
    "asin": Function("arcsin", "asin", math.asin, (lambda g, y, x: _one_over(g, _other_leg(g, x)),)),
    "acos": Function("arccos", "acos", math.acos, (lambda g, y, x: g.neg(_one_over(g, _other_leg(g, x))),)),
    "atan": Function("arctan", "atan", math.atan, (lambda g, y, x: _one_over(g, _one_plus(g, g.mul(x, x))),)),
    "atan2": Function(
        "arctan2", "atan2", math.atan2,
        (lambda g, y, a, b: g.div(b, _radius(g, a, b)), lambda g, y, a, b: g.neg(g.div(a, _radius(g, a, b)))),
    ),
    "sinh": Function("sinh", "sinh", math.sinh, (lambda g, y, x: g.call("cosh", x),)),
    "cosh": Function("cosh", "cosh", math.cosh, (lambda g, y, x: g.call("sinh", x),)),
    "tanh": Function("tanh", "tanh", math.tanh, (lambda g, y, x: _one_minus(g, g.mul(y, y)),)),
    "exp": Function("exp", "exp", math.exp, (lambda g, y, x: y,)),
    "log": Function("log", "log", math.log, (lambda g, y, x: _one_over(g, x),)),
    "abs": Function("abs", "Abs", lambda x: abs(x), (lambda g, y, x: g.call("sign", x),)),
    "sign": Function("sign", "sign", lambda x: (x > 0) - (x < 0), (lambda g, y, x: g.const(0.0),)),
    "pow": Function(
        "power", "Pow", math.pow,
        (
            lambda g, y, a, b: g.mul(b, g.call("pow", a, g.sub(b, g.const(1.0)))),
            lambda g, y, a, b: g.mul(y, g.call("log", a)),
        ),
    ),
}  # fmt: skip
