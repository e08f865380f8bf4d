"""sympy expressions become operations that mean the same."""

from __future__ import annotations

import pytest
import sympy
from hypothesis import given
from hypothesis import strategies as st
from programs import program_of, run, straight

from ncgen.errors import ModelError
from ncgen.program.ir.functions import FUNCTIONS
from ncgen.program.ir.graph import Graph
from ncgen.program.ir.lower import lower_value, lowered
from ncgen.symbolic.templates import Template, TemplateOutput

x, y, z = SYMBOLS = sympy.symbols("x y z", real=True)
Q = (0.37, -1.62, 2.25, 0.0)
R = sympy.Rational


def lower(expression):
    """The block that computes an expression of x, y and z from q."""
    graph = Graph()
    return straight(graph, lower_value(graph, expression, {s.name: graph.load("q", i) for i, s in enumerate(SYMBOLS)}))


def exact(expression, q=Q) -> float:
    """sympy's own value: 30 digits, rounded once."""
    return float(expression.subs({s: sympy.Float(v, 40) for s, v in zip(SYMBOLS, q)}).evalf(30))


EXPRESSIONS = {
    "sqrt": sympy.sqrt(z),
    "sin": sympy.sin(x + y),
    "cos": sympy.cos(3 * x),
    "tan": sympy.tan(x),
    "asin": sympy.asin(x),
    "acos": sympy.acos(x),
    "atan": sympy.atan(y),
    "atan2": sympy.atan2(x, y),
    "sinh": sympy.sinh(x),
    "cosh": sympy.cosh(y),
    "tanh": sympy.tanh(y),
    "exp": sympy.exp(-y),
    "log": sympy.log(z),
    "abs": sympy.Abs(y) * x,
    "sign": sympy.sign(y) * x,
    "pow": z**x,
}

SHAPES = {
    "square": x**2,
    "seventh power": y**7,
    "reciprocal": 1 / x,
    "negative power": y**-3,
    "product of powers": x**2 * y**-3 * z,
    "several below": x / (y * z),
    "reciprocal root": 1 / sympy.sqrt(z),
    "root above and below": sympy.sqrt(z) * x / sympy.sqrt(x + z),
    "three halves": z ** R(3, 2),
    "minus three halves": z ** R(-3, 2),
    "minus three halves in a product": x * z ** R(-3, 2),
    "a power of two": 2**x,
    "exponential below": x / sympy.exp(y),
    "Euler's number": sympy.E * x,
    "a number's own value": sympy.Integer(5),
    "half": R(1, 2) * x,
    "a rational": R(-22, 7) * x * y,
    "rationals in a sum": R(1, 3) * x + R(1, 6) * y,
    "pi": sympy.pi * x,
    "golden ratio": sympy.GoldenRatio * x,
    "root of a number": sympy.sqrt(2) * x,
    "float": sympy.Float(0.1) * x + sympy.Float(1e-9),
    "leading minus": -x + y,
    "minus of a sum": -(x + y),
    "all negative": -x - y - z,
    "minus of a product": -x * y + z,
    "difference of products": x * y - y * z,
    "factored sum": R(2, 3) * (x - y) * z,
    "sum below": 1 / (x - y),
    "square of a sum": (x - y + z) ** 2,
    "nested": sympy.sin(sympy.sqrt(x**2 + y**2)) / (1 + sympy.cos(x) ** 2),
}


@pytest.mark.parametrize("name", FUNCTIONS)
def test_every_function(name):
    """Each elementary function is called, and agrees with sympy's evaluation."""
    block = lower(EXPRESSIONS[name])
    assert name in [op.code for op in block.ops]
    assert run(program_of(block), Q)[0] == pytest.approx(exact(EXPRESSIONS[name]), rel=1e-14)


@pytest.mark.parametrize("name", SHAPES)
def test_every_shape_of_expression(name):
    """Powers, quotients, rationals and signs, against sympy's evaluation at three places."""
    program = program_of(lower(SHAPES[name]))
    for q in (Q, (0.9, 0.3, 7.5, 0.0), (1.25, -0.001, 1e-3, 0.0)):
        assert run(program, q)[0] == pytest.approx(exact(SHAPES[name], q), rel=1e-13)


def test_square_roots_and_integer_powers_need_no_pow():
    """pow is slow and less exact: it is called for other exponents only."""
    for expression in (sympy.sqrt(x), 1 / sympy.sqrt(x), x**5, x**-5):
        assert "pow" not in [op.code for op in lower(expression).ops]
    assert "pow" in [op.code for op in lower(z ** R(3, 2)).ops]


def test_quotients_are_divided_once():
    """Whatever stands below is multiplied up first: one division a product."""
    for expression, codes in ((x / y, ["div"]), (x / (y * z), ["mul", "div"]), (x**2 / y**2, ["mul", "mul", "div"])):
        assert [op.code for op in lower(expression).ops if op.args] == codes


def test_common_subexpressions_are_computed_once():
    """sin(x) in three places is one call."""
    codes = [op.code for op in lower(sympy.sin(x) * y + z / sympy.sin(x) - sympy.cos(sympy.sin(x))).ops]
    assert codes.count("sin") == 1


def test_data_are_divided_by_at_generation():
    """A template's constants may stand below: their reciprocal is a number, and no division is left."""
    template = Template(
        key="test", equation="", scalars=("x",), data=("L",), outputs={TemplateOutput("phi"): x / sympy.Symbol("L", real=True) ** 2}
    )
    graph = Graph()
    values = {"x": graph.load("q", 0), "L": graph.const(4.0)}
    node = lowered(template).replay(graph, values.get, [TemplateOutput("phi")])[TemplateOutput("phi")]
    block = straight(graph, node)
    assert [op.code for op in block.ops if op.args] == ["mul"]
    assert run(program_of(block), Q)[0] == Q[0] / 16


@given(st.lists(st.integers(-9, 9).map(sympy.Integer) | st.fractions(-9, 9, max_denominator=12).map(R), min_size=6, max_size=6))
def test_random_polynomials(c):
    """Coefficients of any sign, whole or rational, against sympy."""
    polynomial = c[0] + c[1] * x + c[2] * y + c[3] * x * y + c[4] * x**2 - c[5] * z
    size = sum(abs(float(k)) * 3 for k in c)
    assert run(program_of(lower(polynomial)), Q)[0] == pytest.approx(exact(polynomial), abs=1e-15 * (size + 1))


@pytest.mark.parametrize("expression", [sympy.Max(x, y), sympy.I * x, sympy.gamma(x), sympy.Piecewise((x, y > 0), (z, True))])
def test_unknown_functions_are_named(expression):
    """What cannot be generated is refused in one line that lists what can."""
    with pytest.raises(ModelError, match="cannot be generated") as caught:
        lower(expression)
    assert all(name in str(caught.value) for name in FUNCTIONS) and "\n" not in str(caught.value)


@pytest.mark.parametrize("number", [sympy.oo, -sympy.oo, sympy.nan, sympy.oo * x])
def test_numbers_that_are_none_are_refused(number):
    """Infinity and nan in an expression are the user's mistake, told as such."""
    with pytest.raises(ModelError) as caught:
        lower(number)
    assert "\n" not in str(caught.value)


def test_poles_are_refused():
    """So is sympy's complex infinity, which 1/0 becomes."""
    with pytest.raises(ModelError, match="zoo"):
        lower(1 / (x - x))


def test_long_rational_sums_keep_their_value():
    """Coefficients whose common denominator is beyond the doubles do not turn the sum into zero."""
    series = sympy.Add(*(x**k / sympy.Integer(k) for k in range(1, 800)))
    assert run(program_of(lower(series)), Q)[0] == pytest.approx(-float(sympy.log(1 - Q[0])), rel=1e-12)


def test_long_sums_can_be_used():
    """A sum of eight hundred terms goes from template to program."""
    terms = sympy.Add(*(x**k for k in range(800)))
    template = Template(key="long", equation="", scalars=("x",), data=(), outputs={TemplateOutput("phi"): terms})
    graph = Graph()
    node = lowered(template).replay(graph, lambda name: graph.load("q", 0), [TemplateOutput("phi")])[TemplateOutput("phi")]
    assert len(straight(graph, node).ops) >= 800
