"""Expressions in model files: parsed by a small grammar of our own, never evaluated as Python.

    2*L + 0.1        -k*(psi - psi0) - c*rate(psi)        sin(omega*t)        B.x**2        profile(psi)

Numbers, names, + - * / **, parentheses, the functions of ncgen.program.ir.functions, min and max of two, rate(…), loads as force(rod, A).x,
moment(rod, u).z and driver(psi), curves: splines and tables by their names, a derivative as profile(psi, 1), and
smooth_step(x, start, end), and choices (`ncgen.exchange.choices`). A text that is anything else is refused with the part that is not
understood.

The size of an expression is bounded before anything is computed (`ncgen.exchange.expression_size`).
"""

from __future__ import annotations

import ast
from collections.abc import Collection, Mapping
from typing import TYPE_CHECKING

from ncgen.errors import MAX_ECHO, ModelError, UnknownName, shortened
from ncgen.exchange.choices import PIECEWISE, piecewise
from ncgen.exchange.expression_size import Measure
from ncgen.exchange.syntax import CONSTANTS, PRODUCTS, SUMS, chain, dotted, has_unit, number_of, quoted, repaired
from ncgen.model.curves import BUILT_IN, STEP, Curve, smooth_step
from ncgen.model.elements import rate_name
from ncgen.model.expressions import check_expression
from ncgen.model.kinks import CHOICES, without_kinks
from ncgen.program.ir.functions import FUNCTIONS

if TYPE_CHECKING:
    from sympy import Expr

    from ncgen.model.elements import Combination, Spatial

MAX_CHARACTERS = 20_000
"""Characters of an expression."""

RATE = "rate"

DRIVER = "driver"

LOADS = ("force", "moment")
"""Calls of two names, with an axis behind them; curves may have these names, too."""


def parse_expression(text: str, known: Collection[str], curves: Mapping[str, Curve] | None = None) -> Expr:
    """A sympy expression of the known names (coordinates, parameters, t) and of curves.

    Raises ModelError saying which part is not understood, which name is unknown, or which number is out of bounds.
    """
    tree, of_all = _tree(text, known), {**BUILT_IN, **(curves or {})}
    if taken := [name for name in of_all if name in (*FUNCTIONS, *CHOICES, RATE, DRIVER)]:
        raise ModelError(f"curve {taken[0]}: in the expressions of files that is the name of a function; choose another")
    Measure(text, of_all).size(tree)
    remedy = _Reader(text, known, of_all).read(tree)
    check_expression(remedy, quoted(text))
    return remedy


def parse_direction(text: str, elements: Mapping[str, Spatial]) -> Spatial | Combination:
    """An element by its name, or a difference such as `r4 - r2`, `-u3`, as the builder takes it."""
    tree = _tree(text)
    if dotted(tree) is None:
        Measure(text).size(tree)
    return _direction(tree, elements, text)


def _tree(text: str, known: Collection[str] = ()) -> ast.expr:
    if len(text) > MAX_CHARACTERS:
        raise ModelError(f"an expression of {len(text)} characters is too long; {MAX_CHARACTERS} are allowed")
    if has_unit(text, known):
        raise ModelError(f"{quoted(text)} has a unit; give the bare number in m, kg, s, N, rad")
    try:
        return ast.parse(text.strip(), mode="eval").body
    except (RecursionError, MemoryError):
        raise ModelError(f"{quoted(text)} is too long or has too many parentheses; write it in parts") from None
    except (SyntaxError, ValueError) as error:
        if "too many nested" in str(error):
            raise ModelError(f"{quoted(text)} has too many parentheses within each other; write it in parts") from None
        meant = repaired(text)
        raise ModelError(
            f"{quoted(text)} is not an expression; write {shortened(meant, MAX_ECHO) if meant else 'for example 2*L + sin(t)'}"
        ) from None


class _Reader:
    """Turns the syntax tree into sympy, node by node; what is not listed here is refused."""

    def __init__(self, text: str, known: Collection[str], curves: Mapping[str, Curve]) -> None:
        self.text = text
        self.known = known
        self.curves = curves

    def read(self, node: ast.expr) -> Expr:
        import sympy

        if (number := number_of(node)) is not None:
            return sympy.Integer(number) if isinstance(number, int) else sympy.Float(number)
        if isinstance(node, ast.UnaryOp) and isinstance(node.op, (ast.USub, ast.UAdd)):
            return -self.read(node.operand) if isinstance(node.op, ast.USub) else self.read(node.operand)
        if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Pow):
            return self.read(node.left) ** self.read(node.right)
        if isinstance(node, ast.BinOp) and isinstance(node.op, SUMS):
            return sympy.Add(*(-self.read(operand) if isinstance(op, ast.Sub) else self.read(operand) for op, operand in chain(node, SUMS)))
        if isinstance(node, ast.BinOp) and isinstance(node.op, PRODUCTS):
            return self._product(node)
        if (load := _load_of(node)) is not None:
            return self._load(node, load)
        if isinstance(node, ast.Call) and not node.keywords:
            return self._call(node)
        name = dotted(node)
        if name is None:
            meant = repaired(self.text)
            advice = f"; write {shortened(meant, MAX_ECHO)}" if meant else ""
            raise ModelError(f"{quoted(self.text)}: {quoted(_source(node, self.text))} is not allowed in an expression{advice}")
        return self._name(name)

    def _load(self, node: ast.expr, name: str) -> Expr:
        import sympy

        if name not in self.known:
            source = shortened(_source(node, self.text), MAX_ECHO)
            words = "outputs have force(body, point).x, moment(body, vector).x and driver(coordinate), with axes x, y and z"
            raise UnknownName(f"{quoted(self.text)}: {source}: there is no such load here; {words}", "")
        return sympy.Symbol(name, real=True)

    def _product(self, node: ast.BinOp) -> Expr:
        (_, first), *rest = chain(node, PRODUCTS)
        product = self.read(first)
        for operator, operand in rest:
            factor = self.read(operand)
            if isinstance(operator, ast.Div) and factor == 0:
                raise ModelError(f"{quoted(self.text)} divides by zero")
            product = product / factor if isinstance(operator, ast.Div) else product * factor
        return product

    def _call(self, node: ast.Call) -> Expr:
        import sympy

        function = dotted(node.func)
        if function is None and (meant := repaired(self.text)):
            raise ModelError(f"{quoted(self.text)} calls what is no function; write {shortened(meant, MAX_ECHO)}")
        if function == RATE and len(node.args) == 1:
            inner = dotted(node.args[0])
            if isinstance(node.args[0], ast.Call) and dotted(node.args[0].func) == RATE:  # of a rate: an acceleration
                return sympy.Symbol(rate_name(str(self._call(node.args[0]))), real=True)
            if inner is None or inner not in self.known:
                source = shortened(_source(node, self.text), MAX_ECHO)
                raise UnknownName(f"{quoted(self.text)}: {source}: there is no coordinate of that name", inner or "")
            return sympy.Symbol(rate_name(inner), real=True)
        if function in CHOICES and len(node.args) == 2:
            return without_kinks(getattr(sympy, CHOICES[function])(*map(self.read, node.args)), quoted(self.text))
        if function == PIECEWISE:
            return piecewise(node, self.read, quoted(self.text))
        if function is not None and function in self.curves:
            return self._curve(self.curves[function], node.args)
        if function not in FUNCTIONS or len(node.args) != FUNCTIONS[function].arity:
            source, known = (
                shortened(_source(node.func, self.text), MAX_ECHO),
                ", ".join((*FUNCTIONS, *CHOICES, PIECEWISE, *self.curves, RATE)),
            )
            raise ModelError(f"{quoted(self.text)}: {source} of {len(node.args)} is unknown; the functions are {known}")
        return getattr(sympy, FUNCTIONS[function].sympy)(*map(self.read, node.args))

    def _curve(self, curve: Curve, arguments: list[ast.expr]) -> Expr:
        """curve(x), its derivative curve(x, order), or smooth_step(x, start, end)."""
        order = number_of(arguments[1]) if len(arguments) == 2 else 0
        if curve is STEP and len(arguments) == 3:
            return smooth_step(*map(self.read, arguments))
        if not 1 <= len(arguments) <= 2 or not isinstance(order, int):
            hint = " or its start and end" if curve is STEP else ""
            raise ModelError(f"{quoted(self.text)}: {curve.name} takes one expression, and the order of its derivative{hint}")
        return curve(self.read(arguments[0]), order)

    def _name(self, name: str) -> Expr:
        import sympy

        if name in self.known:
            return sympy.Symbol(name, real=True)
        if name in CONSTANTS:
            return sympy.pi if name == "pi" else sympy.E
        raise UnknownName(f"{quoted(self.text)}: {shortened(name, MAX_ECHO)} is no coordinate, parameter or t; define it first", name)


def _load_of(node: ast.expr) -> str | None:
    """The name of the load that a node is, such as `force(rod,A).x` or `driver(psi)`; None for anything else."""
    axis = f".{node.attr}" if isinstance(node, ast.Attribute) else ""
    call = node.value if isinstance(node, ast.Attribute) else node
    if not isinstance(call, ast.Call) or call.keywords or (kind := dotted(call.func)) not in (LOADS if axis else (DRIVER,)):
        return None
    return f"{kind}({','.join(dotted(argument) or '…' for argument in call.args)}){axis}"


def _source(node: ast.expr, text: str) -> str:
    """The part of a text that a node was read from."""
    return ast.get_source_segment(text.strip(), node) or text


def _direction(node: ast.expr, elements: Mapping[str, Spatial], text: str) -> Spatial | Combination:
    if isinstance(node, ast.BinOp) and isinstance(node.op, SUMS):
        (_, first), *rest = chain(node, SUMS)
        total = _direction(first, elements, text)
        for operator, operand in rest:
            other = _direction(operand, elements, text)
            total = total + other if isinstance(operator, ast.Add) else total - other
        return total
    if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Mult) and (weight := _weight(node.left)) is not None:
        return _direction(node.right, elements, text) * weight
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
        return -_direction(node.operand, elements, text)
    name = dotted(node)
    if name is None or name not in elements:
        shown = shortened(name or _source(node, text), MAX_ECHO)
        prefix = "" if shown == text.strip() else f"{quoted(text)}: "
        raise UnknownName(f"{prefix}there is no point or vector {shown}; define it first", name or "")
    return elements[name]


def _weight(node: ast.expr) -> float | None:
    """A number with or without a sign; None for anything else."""
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
        number = number_of(node.operand)
        return None if number is None else -float(number)
    number = number_of(node)
    return None if number is None else float(number)
