"""Expressions that were written into a file are the same when they are read, and so is the code that is made of them."""

from __future__ import annotations

from pathlib import Path

import pytest
import sympy
from sympy import Rational as R

import ncgen
from ncgen import Model, ModelError
from ncgen.exchange.expression_text import _Exact
from ncgen.exchange.grammar import parse_expression
from ncgen.exchange.toml_reader import model_of, read_toml
from ncgen.exchange.toml_writer import to_toml

x, y = sympy.symbols("x y", real=True)

EXPRESSIONS = [
    sympy.asin(R(22, 7) * x / (1 + (R(22, 7) * x) ** 2)),
    R(22, 7) * x * (x + 1) / (484 * x**2 / 49 + 1),
    sympy.Mul(-1, x + 1, y + 1),
    sympy.Mul(R(-3, 7), x + 1, y + 1),
    sympy.Mul(R(-3, 7), x + 1, y + 1, 1 / (x - y)),
    sympy.Mul(3, x + 1, 1 / (y + 1)),
    sympy.Mul(0.3, x + 1, 1 / (y + 1)),
    -(x + 1) / y,
    y - sympy.Mul(2, x + 1, y + 2),
    2 * x * (x + y) * (x - y) ** -2,
    1.0 * x / 3,
    R(1, 3) / x / sympy.sqrt(y**2 + 1) ** 3,
    sympy.sqrt(2) / 2 * x,
    x ** R(-2, 3) * y**x,
    R(10, 9) ** sympy.sin(x),
    sympy.pi * sympy.E * x / 7,
    sympy.exp(-x / 2) * sympy.Abs(x) ** 1.5,
    -sympy.pi,
]


@pytest.mark.parametrize("expression", EXPRESSIONS, ids=str)
def test_read_as_it_was_written(expression):
    assert parse_expression(_Exact().doprint(expression), {"x", "y"}) == expression


def pendulum():
    m = Model("pendulum")
    A, B = m.point("A", (0, 0), fixed=True), m.point("B", (1, 0))
    u, w = m.vector("u", (1, 0, 0), fixed=True), m.vector("w", (0, 0, 1), fixed=True)
    m.body("bob", [A, B], mass=1.0, inertia="point")
    return m, B, m.angle("psi", u, B - A, w)


SAID = {
    "pi": lambda m, B, psi: m.torque(psi, sympy.pi),
    "e": lambda m, B, psi: m.torque(psi, sympy.E * psi.symbol),
    "e beside parameters of that name": lambda m, B, psi: m.torque(psi, m.parameter("e", 2.0) * m.parameter("E", 3.0) * sympy.E),
    "a number of sympy": lambda m, B, psi: m.force(B, (0.5 * sympy.sin(3), 0, sympy.Rational(1, 3))),
    "a driver": lambda m, B, psi: m.drive(psi, sympy.Float(0.1)),
    "a law": lambda m, B, psi: m.torsion_spring(psi, law=lambda x, v: sympy.pi * x + sympy.E),
    "a law that is a number": lambda m, B, psi: m.torsion_spring(psi, law=lambda x, v: sympy.pi),
    "a parameter that vanishes": lambda m, B, psi: m.gravity((0, m.parameter("g", 9.81).symbol * 0, 0)),
    "a parameter that vanishes from a damper": lambda m, B, psi: m.torsion_spring(psi, 1.0, m.parameter("c", 1.0) * 0),
    "a position": lambda m, B, psi: m.point("C", (sympy.pi, sympy.sqrt(2), m.parameter("L", 2.0) * sympy.pi)),
    "a quotient": lambda m, B, psi: m.potential(EXPRESSIONS[0].subs(x, psi.symbol)),
}


@pytest.mark.parametrize("case", SAID)
def test_the_same_code(case, tmp_path):
    """Written, read and written again: the same file, and the same sources."""
    m, B, psi = pendulum()
    SAID[case](m, B, psi)
    text = to_toml(m)
    (tmp_path / "model.toml").write_text(text, encoding="utf-8")
    again, problems = read_toml(tmp_path / "model.toml")
    assert problems == [] and to_toml(again) == text
    assert ncgen.generate(again).files == ncgen.generate(m).files


def test_loads_are_written_by_their_names():
    """A joint load, a moment and a driver force: the same text again, and the same numbers."""
    m, B, psi = pendulum()
    A, rod = m.elements["A"], m.bodies["bob"]
    m.output("pin", 2 * rod.force(A).x - rod.wrench(A)[0].y / 3, "N")
    m.drive(psi, 3.0 * m.time)
    m.output("power", psi.driver * psi.rate)
    text = to_toml(m)
    assert "force(bob,A).x" in text and 'expression = "driver(psi)*rate(psi)"' in text
    assert to_toml(model_of(text, Path("again.toml"))) == text
    again = model_of(text.replace("force(bob,A).x", "force( bob , A ).x"), Path("spaced.toml"))
    runs = [ncgen.simulate(ncgen.compile(each, "numpy"), 0.2, points=3) for each in (m, again)]
    for label in ("pin", "power"):
        assert runs[0][label].tolist() == runs[1][label].tolist()


@pytest.mark.parametrize(
    "text, said",
    [
        ("force(bob, C).x", r"force\(bob, C\)\.x: there is no such load here; outputs have force\(body, point\)\.x"),
        ("force(bob, A).w", r"force\(bob, A\)\.w: there is no such load here"),
        ("moment(bob, A).x", r"moment\(bob, A\)\.x: there is no such load here"),
        ("driver(phi)", r"driver\(phi\): there is no such load here"),
        ("force(bob).x", r"force\(bob\)\.x: there is no such load here"),
        ("driver(2*psi)", r"driver\(2\*psi\): there is no such load here"),
        ("force(bob, A)", "force of 2 is unknown"),
        ("abs(psi).x", r"“abs\(psi\)\.x” is not allowed in an expression"),
    ],
)
def test_loads_that_there_are_not(text, said):
    m, _, _ = pendulum()
    file = to_toml(m) + f'\n[[output]]\nlabel = "load"\nexpression = "{text}"\n'
    with pytest.raises(ModelError, match=said):
        model_of(file, Path("wrong.toml"))


def test_loads_stand_in_outputs_alone():
    m, _, _ = pendulum()
    file = to_toml(m) + '\n[[constrain]]\nexpression = "B.x - force(bob, A).x"\n'
    with pytest.raises(ModelError, match="there is no such load here"):
        model_of(file, Path("wrong.toml"))


def test_a_table_may_be_called_force():
    """Loads have two names and an axis, so that a curve may keep its name."""
    m, _, psi = pendulum()
    force = m.table("force", [0.0, 1.0], [0.0, 2.0])
    m.output("both", force(psi.symbol) + m.bodies["bob"].force("A").y)
    assert to_toml(model_of(to_toml(m), Path("again.toml"))) == to_toml(m)
