"""Expressions in model files: parsed by a small grammar of our own, never evaluated as Python.

    2*L + 0.1        -k*(psi - psi0) - c*rate(psi)        sin(omega*t)        B.x**2        profile(psi)

Numbers, names, + - * / **, parentheses, the functions of ncgen.program.ir.functions, min and max of two, rate(…), loads as force(rod, A).x,
moment(rod, u).z and driver(psi), curves: splines and tables by their names, a derivative as profile(psi, 1), and
smooth_step(x, start, end), and choices (`ncgen.exchange.choices`). A text that is anything else is refused with the part that is not
understood.

The size of what a text says is measured on its syntax tree, before anything is computed: sympy keeps exact numbers
exact, and a short text can ask for a number that no memory holds.
"""

from __future__ import annotations

import ast
import math
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING

from ncgen.errors import SHOWN, ModelError, UnknownName, shortened
from ncgen.exchange.choices import PIECEWISE, compared, piecewise
from ncgen.exchange.slips import has_unit, repaired
from ncgen.model.curves import BUILT_IN, STEP, Curve, smooth_step
from ncgen.model.elements import rate_name
from ncgen.model.expressions import DEEPEST, MOST_DIGITS, MOST_FACTORS, check_expression
from ncgen.model.kinks import CHOICES, without_kinks
from ncgen.program.ir.functions import FUNCTIONS

if TYPE_CHECKING:
    from sympy import Expr

    from ncgen.model.elements import Combination, Spatial

LONGEST = 20_000
"""Characters of an expression."""

MOST_LEVELS = 3 * DEEPEST
"""Levels of a text: a level of sympy, such as 1/sqrt(-x), may be written with three."""

LARGEST_EXPONENT = 64

HEAVIEST = 2**16
"""Binary digits of the exact numbers that may come together in an expression."""

_INVERSE = frozenset({"asin", "acos", "atan", "atan2"})
UNDONE = {"exp": frozenset({"log"}), "log": frozenset({"exp"}), "sin": _INVERSE, "cos": _INVERSE, "tan": _INVERSE}
"""{function: those that it undoes}: what stands within both comes out again."""

RATE = "rate"

DRIVER = "driver"

LOADS = ("force", "moment")
"""Calls of two names, with an axis behind them; curves may have these names, too."""

CONSTANTS = {"pi": math.pi, "e": math.e}
_SUMS, _PRODUCTS = (ast.Add, ast.Sub), (ast.Mult, ast.Div)


def parse_expression(text: str, known: Collection[str], curves: Mapping[str, Curve] | None = None) -> Expr:
    """A sympy expression of the known names (coordinates, parameters, t) and of curves.

    Raises ModelError saying which part is not understood, which name is unknown, or which number is out of bounds.
    """
    tree, of_all = _tree(text, known), {**BUILT_IN, **(curves or {})}
    if taken := [name for name in of_all if name in (*FUNCTIONS, *CHOICES, RATE, DRIVER)]:
        raise ModelError(f"curve {taken[0]}: in the expressions of files that is the name of a function; choose another")
    _Measure(text, of_all).size(tree)
    found = _Reader(text, known, of_all).read(tree)
    check_expression(found, quoted(text))
    return found


def parse_direction(text: str, elements: Mapping[str, Spatial]) -> Spatial | Combination:
    """An element by its name, or a difference such as `r4 - r2`, `-u3`, as the builder takes it."""
    tree = _tree(text)
    if dotted(tree) is None:
        _Measure(text).size(tree)
    return _direction(tree, elements, text)


def quoted(text: str) -> str:
    """A user's text within a message."""
    return f"“{shortened(text, SHOWN)}”"


def _tree(text: str, known: Collection[str] = ()) -> ast.expr:
    if len(text) > LONGEST:
        raise ModelError(f"an expression of {len(text)} characters is too long; {LONGEST} are allowed")
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
            f"{quoted(text)} is not an expression; write {shortened(meant, SHOWN) if meant else 'for example 2*L + sin(t)'}"
        ) from None


def chain(node: ast.expr, operators: tuple[type[ast.operator], ...]) -> list[tuple[ast.operator | None, ast.expr]]:
    """a + b - c as [(None, a), (Add, b), (Sub, c)]: however long it is, it is one level."""
    links: list[tuple[ast.operator | None, ast.expr]] = []
    while isinstance(node, ast.BinOp) and isinstance(node.op, operators):
        links.append((node.op, node.right))
        node = node.left
    return [(None, node), *reversed(links)]


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
    return 2 ** min(growth, HEAVIEST.bit_length())


class _Measure:
    """Bounds the size of an expression from the leaves upwards."""

    def __init__(self, text: str, curves: Collection[str] = ()) -> None:
        self.text, self.curves = text, curves

    def size(self, node: ast.expr, level: int = 1) -> Size:
        if level > MOST_LEVELS:
            raise ModelError(f"{quoted(self.text)} has more than {MOST_LEVELS} levels; write it with fewer parentheses, or in parts")
        found = self._size(node, level)
        if found.digits > (HEAVIEST if found.value is None else 2 * MOST_DIGITS):
            raise ModelError(f"{quoted(self.text)}: the exact numbers in it have too many digits; write numbers with a decimal point")
        if found.value is not None and not math.isfinite(found.value):
            raise self._not_finite(node)
        return found

    def _size(self, node: ast.expr, level: int) -> Size:
        if (number := _number_of(node)) is not None:
            digits = number.bit_length() if isinstance(number, int) else 1
            return Size(self._number(node, partial(float, number)), digits, digits)
        if isinstance(node, ast.UnaryOp) and isinstance(node.op, (ast.USub, ast.UAdd)):
            found = self.size(node.operand, level + 1)
            return replace(found, value=-found.value) if isinstance(node.op, ast.USub) and found.value is not None else found
        if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Pow):
            return self._power(node, self.size(node.left, level + 1), self.size(node.right, level + 1))
        if isinstance(node, ast.BinOp) and isinstance(node.op, _SUMS + _PRODUCTS):
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
        operators = _SUMS if isinstance(node.op, _SUMS) else _PRODUCTS
        links = chain(node, operators)
        sizes = [self.size(part, level + 1) for _, part in links]
        if operators is _PRODUCTS and sum(s.value is None for s in sizes) > MOST_FACTORS:
            raise ModelError(f"{quoted(self.text)}: a product of {len(sizes)} factors; {MOST_FACTORS} are allowed")
        value = sizes[0].value
        for (operator, _), size in zip(links[1:], sizes[1:], strict=True):
            value = None if value is None or size.value is None else self._number(node, partial(_combined, operator, value, size.value))
        digits, growth = sum(s.digits for s in sizes), sum(s.growth for s in sizes)
        return Size(value, digits, growth + len(sizes).bit_length() - 1 if operators is _SUMS else growth, _functions(sizes))

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
                factor = HEAVIEST  # a root of an exact number looks for its factors
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
            digits = HEAVIEST + 1
        if inside & UNDONE.get(name, frozenset()):
            growth = digits
        elif name not in ("sqrt", "abs"):  # what stands within stays there, at most for the function that undoes this one
            growth = digits.bit_length() if name == "log" else 1
            inside = inside if any(name in undone for undone in UNDONE.values()) else frozenset()
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
        part = ast.get_source_segment(self.text.strip(), node) or self.text
        place = f"{quoted(self.text)}: " if part != self.text.strip() else ""
        return ModelError(f"{place}{quoted(part)} is not a finite number; correct it")


class _Reader:
    """Turns the syntax tree into sympy, node by node; what is not listed here is refused."""

    def __init__(self, text: str, known: Collection[str], curves: Mapping[str, Curve]) -> None:
        self.text = text
        self.known = known
        self.curves = curves

    def read(self, node: ast.expr) -> Expr:
        import sympy

        if (number := _number_of(node)) is not None:
            return sympy.Integer(number) if isinstance(number, int) else sympy.Float(number)
        if isinstance(node, ast.UnaryOp) and isinstance(node.op, (ast.USub, ast.UAdd)):
            return -self.read(node.operand) if isinstance(node.op, ast.USub) else self.read(node.operand)
        if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Pow):
            return self.read(node.left) ** self.read(node.right)
        if isinstance(node, ast.BinOp) and isinstance(node.op, _SUMS):
            return sympy.Add(*(-self.read(part) if isinstance(op, ast.Sub) else self.read(part) for op, part in chain(node, _SUMS)))
        if isinstance(node, ast.BinOp) and isinstance(node.op, _PRODUCTS):
            return self._product(node)
        if (load := _load_of(node)) is not None:
            return self._load(node, load)
        if isinstance(node, ast.Call) and not node.keywords:
            return self._call(node)
        name = dotted(node)
        if name is None:
            meant = repaired(self.text)
            advice = f"; write {shortened(meant, SHOWN)}" if meant else ""
            raise ModelError(f"{quoted(self.text)}: {quoted(_source(node, self.text))} is not allowed in an expression{advice}")
        return self._name(name)

    def _load(self, node: ast.expr, name: str) -> Expr:
        import sympy

        if name not in self.known:
            part = shortened(_source(node, self.text), SHOWN)
            said = "outputs have force(body, point).x, moment(body, vector).x and driver(coordinate), with axes x, y and z"
            raise UnknownName(f"{quoted(self.text)}: {part}: there is no such load here; {said}", "")
        return sympy.Symbol(name, real=True)

    def _product(self, node: ast.BinOp) -> Expr:
        (_, first), *rest = chain(node, _PRODUCTS)
        product = self.read(first)
        for operator, part in rest:
            factor = self.read(part)
            if isinstance(operator, ast.Div) and factor == 0:
                raise ModelError(f"{quoted(self.text)} divides by zero")
            product = product / factor if isinstance(operator, ast.Div) else product * factor
        return product

    def _call(self, node: ast.Call) -> Expr:
        import sympy

        function = dotted(node.func)
        if function is None and (meant := repaired(self.text)):
            raise ModelError(f"{quoted(self.text)} calls what is no function; write {shortened(meant, SHOWN)}")
        if function == RATE and len(node.args) == 1:
            inner = dotted(node.args[0])
            if isinstance(node.args[0], ast.Call) and dotted(node.args[0].func) == RATE:  # of a rate: an acceleration
                return sympy.Symbol(rate_name(str(self._call(node.args[0]))), real=True)
            if inner is None or inner not in self.known:
                part = shortened(_source(node, self.text), SHOWN)
                raise UnknownName(f"{quoted(self.text)}: {part}: there is no coordinate of that name", inner or "")
            return sympy.Symbol(rate_name(inner), real=True)
        if function in CHOICES and len(node.args) == 2:
            return without_kinks(getattr(sympy, CHOICES[function])(*map(self.read, node.args)), quoted(self.text))
        if function == PIECEWISE:
            return piecewise(node, self.read, quoted(self.text))
        if function is not None and function in self.curves:
            return self._curve(self.curves[function], node.args)
        if function not in FUNCTIONS or len(node.args) != FUNCTIONS[function].arity:
            part, known = shortened(_source(node.func, self.text), SHOWN), ", ".join((*FUNCTIONS, *CHOICES, PIECEWISE, *self.curves, RATE))
            raise ModelError(f"{quoted(self.text)}: {part} of {len(node.args)} is unknown; the functions are {known}")
        return getattr(sympy, FUNCTIONS[function].sympy)(*map(self.read, node.args))

    def _curve(self, curve: Curve, arguments: list[ast.expr]) -> Expr:
        """curve(x), its derivative curve(x, order), or smooth_step(x, start, end)."""
        order = _number_of(arguments[1]) if len(arguments) == 2 else 0
        if curve is STEP and len(arguments) == 3:
            return smooth_step(*map(self.read, arguments))
        if not 1 <= len(arguments) <= 2 or not isinstance(order, int):
            said = " or its start and end" if curve is STEP else ""
            raise ModelError(f"{quoted(self.text)}: {curve.name} takes one expression, and the order of its derivative{said}")
        return curve(self.read(arguments[0]), order)

    def _name(self, name: str) -> Expr:
        import sympy

        if name in self.known:
            return sympy.Symbol(name, real=True)
        if name in CONSTANTS:
            return sympy.pi if name == "pi" else sympy.E
        raise UnknownName(f"{quoted(self.text)}: {shortened(name, SHOWN)} is no coordinate, parameter or t; define it first", name)


def dotted(node: ast.expr) -> str | None:
    """`a`, `a.b`, `a.b.c` as text, None for anything else."""
    parts = []
    while isinstance(node, ast.Attribute):
        parts.append(node.attr)
        node = node.value
    return ".".join([node.id, *reversed(parts)]) if isinstance(node, ast.Name) else None


def _load_of(node: ast.expr) -> str | None:
    """The name of the load that a node is, such as `force(rod,A).x` or `driver(psi)`; None for anything else."""
    axis = f".{node.attr}" if isinstance(node, ast.Attribute) else ""
    call = node.value if isinstance(node, ast.Attribute) else node
    if not isinstance(call, ast.Call) or call.keywords or (kind := dotted(call.func)) not in (LOADS if axis else (DRIVER,)):
        return None
    return f"{kind}({','.join(dotted(argument) or '…' for argument in call.args)}){axis}"


def _number_of(node: ast.expr) -> int | float | None:
    """The number that a node is; None for anything else."""
    if isinstance(node, ast.Constant) and isinstance(node.value, (int, float)) and not isinstance(node.value, bool):
        return node.value
    return None


def _combined(operator: ast.operator | None, a: float, b: float) -> float:
    if isinstance(operator, _SUMS):
        return a + b if isinstance(operator, ast.Add) else a - b
    return a * b if isinstance(operator, ast.Mult) else a / b


def _source(node: ast.expr, text: str) -> str:
    """The part of a text that a node was read from."""
    return ast.get_source_segment(text.strip(), node) or text


def _direction(node: ast.expr, elements: Mapping[str, Spatial], text: str) -> Spatial | Combination:
    if isinstance(node, ast.BinOp) and isinstance(node.op, _SUMS):
        (_, first), *rest = chain(node, _SUMS)
        total = _direction(first, elements, text)
        for operator, part in rest:
            other = _direction(part, elements, text)
            total = total + other if isinstance(operator, ast.Add) else total - other
        return total
    if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Mult) and (weight := _weight(node.left)) is not None:
        return _direction(node.right, elements, text) * weight
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
        return -_direction(node.operand, elements, text)
    name = dotted(node)
    if name is None or name not in elements:
        shown = shortened(name or _source(node, text), SHOWN)
        place = "" if shown == text.strip() else f"{quoted(text)}: "
        raise UnknownName(f"{place}there is no point or vector {shown}; define it first", name or "")
    return elements[name]


def _weight(node: ast.expr) -> float | None:
    """A number with or without a sign; None for anything else."""
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
        number = _number_of(node.operand)
        return None if number is None else -float(number)
    number = _number_of(node)
    return None if number is None else float(number)
