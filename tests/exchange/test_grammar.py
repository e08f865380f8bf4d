"""Expressions of model files: what they mean, and that nothing written in one can fill the memory."""

from __future__ import annotations

import math
import time

import pytest
import sympy

from ncgen import Model, ModelError
from ncgen.exchange.grammar import parse_expression

KNOWN = {"x", "y", "psi", "t", "B.x"}
x, y, t = sympy.symbols("x y t", real=True)

MEANINGS = {
    "2*x + 0.5": 2 * x + sympy.Float(0.5),
    "x - y - 1": x - y - 1,
    "x/3/y": x / 3 / y,
    "-(x + y)*2": -2 * x - 2 * y,
    "2*(x + y)*x": (2 * x + 2 * y) * x,
    "2**3**2": sympy.Integer(512),
    "pow(x, 1/3)": x ** sympy.Rational(1, 3),
    "e**x + pi": sympy.exp(x) + sympy.pi,
    "atan2(x, y) + abs(x)": sympy.atan2(x, y) + sympy.Abs(x),
    "rate(psi)*B.x": sympy.Symbol("rate(psi)", real=True) * sympy.Symbol("B.x", real=True),
    "exp(3*log(1 + x**2))": (1 + x**2) ** 3,
    "(x + 1)**64": (x + 1) ** 64,
    "exp(-5000*t)": sympy.exp(-5000 * t),
    " + ".join(["x"] * 990): 990 * x,
    " + ".join(f"{k}*x**{k % 60}" for k in range(990)): sympy.Add(*(k * x ** (k % 60) for k in range(990))),
    "+".join(f"x/{k}" for k in range(1, 300)): sum(sympy.Rational(1, k) for k in range(1, 300)) * x,
    "-" * 20 + "x": x,
    "sin(" * 45 + "x" + ")" * 45: None,
    "(1 + y**2)**sin((1 + 4*x**2)**(3/2))": (1 + y**2) ** sympy.sin((1 + 4 * x**2) ** sympy.Rational(3, 2)),
    "exp(-log(2 + cos(5/2))**2)": sympy.exp(-(sympy.log(2 + sympy.cos(sympy.Rational(5, 2))) ** 2)),
    "(1 + x**2)**sin(log(1000*y))": (1 + x**2) ** sympy.sin(sympy.log(1000 * y)),
}

BOMBS = {
    "pow(9, 999999999)": "exponent",
    "9**9**9": "exponent",
    "((9**64)**64)**64": "not a finite number",
    "((9*x)**64)**64*((9*x)**64)**64*((9*x)**64)**64*((9*x)**64)**64*((9*x)**64)**64*((9*x)**64)**64": "too many digits",
    "exp(exp(exp(exp(9))))": "“exp\\(exp\\(9\\)\\)” is not a finite number",
    "exp(999999999*log(9*x))": "too many digits",
    "(9**(387420489*x))**(387420489/x)": "too many digits",
    "x**(999999999*log(9)/log(x))": "too many digits",
    "((1 + 1/10**60)**64)**64": "too many digits",
    "9**(x*387420489/x)": "too many digits",
    "9**(x/(x/387420489))": "too many digits",
    "9**(sin(asin(387420489*x))/x)": "too many digits",
    "9**(tan(atan2(387420489*y, y))/x)": "too many digits",
    "9**(log(exp(387420489*y))/y)": "too many digits",
    "9**(sqrt(387420489**2*x**2)/abs(x))": "too many digits",
    "e**(387420489*log(9*x))": "too many digits",
    "sqrt(" + "+".join(f"x/{k}" for k in range(1, 900)) + ")": "too many digits",
    "9" * 400: "not a finite number",
    "9" * 5000 + "*x": "not an expression",
    "1e999": "not a finite number",
    "1e300*1e300": "not a finite number",
    "(" * 3000 + "x" + ")" * 3000: "too many parentheses",
    "-" * 3000 + "x": "too long or has too many parentheses|levels",
    "sin(" * 160 + "x" + ")" * 160: "more than 150 levels",
    "*".join(f"sin({k}*x)" for k in range(1, 300)): "299 factors",
    "x*" * 7000 + "x": "factors|too long or has",
    "x" * 30000: "30000 characters",
    "1/(2 - 2)": "divides by zero",
    "x/(y - y)": "divides by zero",
    "log(0)": "“log\\(0\\)” is not a finite number",
    "sqrt(-1)": "“sqrt\\(-1\\)” is not a finite number",
    "x + asin(2)": "“asin\\(2\\)” is not a finite number",
    "().__class__": "not allowed",
    "lambda: x": "not allowed",
    "__import__('os')": "unknown; the functions are",
}


@pytest.mark.parametrize("text", MEANINGS, ids=lambda text: text[:30])
def test_meanings(text):
    found = parse_expression(text, KNOWN)
    assert MEANINGS[text] is None or found == MEANINGS[text]


@pytest.mark.parametrize("text", BOMBS, ids=lambda text: text[:30])
def test_refused_before_anything_is_computed(text):
    """One line, in a time that the size of the text explains."""
    began = time.process_time()
    with pytest.raises(ModelError, match=BOMBS[text]) as refusal:
        parse_expression(text, KNOWN)
    assert time.process_time() - began < 2
    assert len(str(refusal.value)) <= 300 and str(refusal.value).isprintable()


HANDED = {
    "a tower": lambda: sympy.exp(sympy.exp(sympy.exp(sympy.exp(9)))),
    "a power that waits": lambda: sympy.Pow(9, 999999999, evaluate=False),
    "a long integer": lambda: 10**400 * x,
    "a long fraction": lambda: x * sympy.Rational(10**5000 + 1, 10**5000),
    "infinity": lambda: x + sympy.oo,
    "a complex number": lambda: sympy.sqrt(-2) * x,
    "a deep one": lambda: deep(60),
    "a long product": lambda: sympy.Mul(*(sympy.sin(k * x) for k in range(1, 100))),
    "a product that is too large": lambda: sympy.Float(1e300) * sympy.Float(1e300) * x,
    "a text": lambda: "__import__('os').getpid()*x",
    "a comparison": lambda: x > 0,
    "a matrix": lambda: sympy.Matrix([x]),
    "a list": lambda: [1],
    "an integer of 400 digits": lambda: 10**400,
    "not a number": lambda: math.nan,
    "nothing": lambda: None,
}


def deep(levels):
    e = x
    for _ in range(levels):
        e = sympy.sin(e)
    return e


@pytest.mark.parametrize("what", HANDED)
def test_the_same_bounds_in_python(what):
    """Every method that takes an expression refuses it on the line where it is given, by its label."""
    m = Model("m")
    B, psi = m.point("B", (1, 0)), m.parameter("k", 1.0)
    s = m.length("s", m.point("A", (0, 0), fixed=True), B)
    value = HANDED[what]()
    for give in (
        lambda: m.force(B, (value, 0, 0), "mine"),
        lambda: m.torque(s, value, "mine"),
        lambda: m.potential(value, "mine"),
        lambda: m.constrain(value, "mine"),
        lambda: m.constrain_velocity(value, "mine"),
    ):
        with pytest.raises(ModelError, match="^mine") as refusal:
            give()
        assert len(str(refusal.value)) <= 300
    with pytest.raises(ModelError, match="^drive s, law: "):
        m.drive(s, value)
    if what != "nothing":
        with pytest.raises(ModelError, match="spring"):
            m.spring("A", B, law=lambda x, v: value)
    assert m.forces == m.potentials == m.springs == [] and psi.default == 1.0


@pytest.mark.slow
def test_deep_expressions_that_are_accepted_can_be_generated():
    import ncgen

    m = Model("m")
    B = m.point("B", (0.5, 0.3))
    m.body("b", [B], mass=1.0)
    m.constrain(deep(45).subs(x, B.x.symbol * B.y.symbol) - 0.1)
    assert ncgen.generate(m).files
