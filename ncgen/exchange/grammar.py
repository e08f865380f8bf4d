"""Expressions in model files: parsed by a small grammar of our own, never evaluated as Python.

    2*L + 0.1        -k*(psi - psi0) - c*rate(psi)        sin(omega*t)        B.x**2

Numbers, names, + - * / **, parentheses, the functions of ncgen.program.functions, and rate(…). A text that
is anything else is refused with the part that is not understood.
"""

from __future__ import annotations

import ast
import re

from ncgen.errors import ModelError
from ncgen.model.elements import rate_name
from ncgen.program.functions import FUNCTIONS

LONGEST = 4000
CONSTANTS = {"pi": "pi", "e": "E"}
_OPERATORS = {ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/", ast.Pow: "**"}


def parse_expression(text: str, known: set[str]):
    """A sympy expression of the known names (coordinates, parameters, t).

    Raises ModelError saying which part is not understood or which name is unknown.
    """
    tree = _tree(text)
    return _Reader(text, known).read(tree.body)


def parse_direction(text: str, elements: dict):
    """An element by its name, or a difference such as `r4 - r2`, `-u3`, as the builder takes it."""
    if text.strip() in elements:
        return elements[text.strip()]
    return _direction(_tree(text).body, elements, text)


def _tree(text: str) -> ast.Expression:
    if len(text) > LONGEST:
        raise ModelError(f"an expression of {len(text)} characters is too long; {LONGEST} are allowed")
    unit = re.fullmatch(r"\s*[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?\s+[A-Za-z].*", text)
    if unit:
        raise ModelError(f"“{text}” has a unit; give the bare number in m, kg, s, N, rad")
    try:
        return ast.parse(text.strip(), mode="eval")
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        raise ModelError(f"“{text}” is not an expression; write for example 2*L + sin(t)") from None


class _Reader:
    """Turns the syntax tree into sympy, node by node; what is not listed here is refused."""

    def __init__(self, text: str, known: set[str]):
        self.text = text
        self.known = known

    def read(self, node):
        import sympy

        if isinstance(node, ast.Constant) and isinstance(node.value, (int, float)) and not isinstance(node.value, bool):
            return sympy.Integer(node.value) if isinstance(node.value, int) else sympy.Float(node.value)
        if isinstance(node, ast.UnaryOp) and isinstance(node.op, (ast.USub, ast.UAdd)):
            return -self.read(node.operand) if isinstance(node.op, ast.USub) else self.read(node.operand)
        if isinstance(node, ast.BinOp) and type(node.op) in _OPERATORS:
            return self._binary(node)
        if isinstance(node, ast.Call) and not node.keywords:
            return self._call(node)
        name = dotted(node)
        if name is None:
            raise ModelError(f"“{self.text}”: “{ast.unparse(node)}” is not allowed in an expression")
        return self._name(name)

    def _binary(self, node):
        left, right = self.read(node.left), self.read(node.right)
        kind = type(node.op)
        if kind is ast.Pow:
            if right.is_number and abs(right) > 64:
                raise ModelError(f"“{self.text}”: the exponent {right} is too large; 64 is the limit")
            return left**right
        if kind is ast.Div:
            if right == 0:
                raise ModelError(f"“{self.text}” divides by zero")
            return left / right
        return {ast.Add: left + right, ast.Sub: left - right, ast.Mult: left * right}[kind]

    def _call(self, node):
        import sympy

        function = dotted(node.func)
        if function == "rate" and len(node.args) == 1:
            inner = dotted(node.args[0])
            if inner not in self.known:
                raise ModelError(f"“{self.text}”: rate({inner}): there is no coordinate {inner}")
            return sympy.Symbol(rate_name(inner), real=True)
        if function not in FUNCTIONS or len(node.args) != FUNCTIONS[function].arity:
            raise ModelError(f"“{self.text}”: {function} of {len(node.args)} is unknown; the functions are {', '.join(FUNCTIONS)}, rate")
        return getattr(sympy, FUNCTIONS[function].sympy)(*map(self.read, node.args))

    def _name(self, name: str):
        import sympy

        if name in self.known:
            return sympy.Symbol(name, real=True)
        if name in CONSTANTS:
            return getattr(sympy, CONSTANTS[name])
        raise ModelError(f"“{self.text}”: {name} is no coordinate, parameter or t; define it first")


def dotted(node) -> str | None:
    """`a`, `a.b`, `a.b.c` as text, None for anything else."""
    if isinstance(node, ast.Name):
        return node.id
    if isinstance(node, ast.Attribute):
        head = dotted(node.value)
        return None if head is None else f"{head}.{node.attr}"
    return None


def _direction(node, elements: dict, text: str):
    if isinstance(node, ast.BinOp) and isinstance(node.op, (ast.Add, ast.Sub)):
        left, right = _direction(node.left, elements, text), _direction(node.right, elements, text)
        return left + right if isinstance(node.op, ast.Add) else left - right
    if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Mult) and isinstance(node.left, (ast.Constant, ast.UnaryOp)):
        return _direction(node.right, elements, text) * float(ast.literal_eval(node.left))
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
        return -_direction(node.operand, elements, text)
    name = dotted(node)
    if name not in elements:
        raise ModelError(f"“{text}”: there is no point or vector {name or ast.unparse(node)}; define it first")
    return elements[name]
