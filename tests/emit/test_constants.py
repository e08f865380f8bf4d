"""A constant is the same 64 bits in the model, in C and in Python."""

from __future__ import annotations

import random
import struct
from fractions import Fraction

import pytest
import sympy
from c_code import compile_object, run_consumer
from hypothesis import given
from hypothesis import strategies as st

import ncgen
from ncgen import Model
from ncgen.emit.c.c_spelling import number
from ncgen.emit.environment import c_literal
from ncgen.model.values import MAX_NUMBER
from ncgen.program.ir.evaluate import evaluate

EDGES = [
    5e-324, -5e-324, 2.2250738585072011e-308, 2.2250738585072014e-308, 1e100, -1e100,
    1.0000000000000002, 0.9999999999999999, 0.1, 1 / 3, -2 / 3, 1e22, 1e23, 9007199254740993.0, 123456789012345680.0, 1e16, 1e-5,
]  # fmt: skip
COUNT = 201


def doubles(count: int) -> list[float]:
    """Doubles with random bits, of every size that the builder takes, none of them zero, infinite or nan."""
    draw = random.Random(20070904)
    found = list(EDGES)
    while len(found) < count:
        value = struct.unpack("d", draw.randbytes(8))[0]
        if 0.0 < abs(value) <= 1e100:
            found.append(value)
    return found


def bits(values) -> list[str]:
    return [float(v).hex() for v in values]


@pytest.fixture(scope="module")
def constants():
    return doubles(COUNT)


@pytest.fixture(scope="module")
def sources(constants):
    """Every constant twice: in a row of its own, x + c at x = 0, and in the table of forces."""
    model = Model("constants")
    for k in range(0, COUNT, 3):
        point = model.point(f"P{k}", (0, 0, 0))
        model.force(point, [sympy.Float(c) for c in constants[k : k + 3]])
    x = model.elements["P0"].x
    for c in constants:
        model.constrain(x + sympy.Float(c))
    return ncgen.generate(model)


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_shortest_text_reads_back(value):
    """The literal of a double is its shortest text, and reads back to the same bits."""
    text = number(value).replace("R(", "(")
    assert float(eval(text)).hex() == value.hex()
    assert len(text) <= len(f"-({abs(value)!r})")


def test_constants_in_c(sources, constants, tmp_path):
    """Compiled once, all constants come out of C bit by bit, from code and from tables."""
    said = run_consumer(compile_object(sources, tmp_path, "-O1"), "-DMOVE=0")
    assert bits(said["phi"]) == bits(constants)
    assert bits(said["force"]) == bits(constants)


def test_constants_in_numpy(sources, constants):
    """The NumPy module holds the same bits."""
    kernels = ncgen.compile(sources, backend="numpy")
    assert bits(kernels.phi(kernels.q0)) == bits(constants)
    assert bits(kernels.force(kernels.q0, 0 * kernels.q0)) == bits(constants)


def test_constants_in_python(sources, constants):
    """So does the program itself, run directly."""
    n = len(sources.programs.equations.free)
    position = {"t": 0.0, "q": [0.0] * n, "qd": [0.0] * n, "p": []}
    for kernel in ("phi", "force"):
        assert bits(evaluate(sources.programs.programs[kernel], position)) == bits(constants)


def test_initial_position_and_defaults(tmp_path):
    """Initial coordinates and default parameters keep their bits, too."""
    values = [value for value in doubles(60) if abs(value) <= MAX_NUMBER][:30]
    model = Model("start")
    for k in range(0, 27, 3):
        model.point(f"P{k}", values[k : k + 3])
    for k in range(27, 30):
        model.parameter(f"p{k}", values[k])
    model.constrain(sympy.Add(model.elements["P0"].x.symbol, *(p.symbol for p in model.parameters.values())))
    sources = ncgen.generate(model)
    kernels = ncgen.compile(sources, backend="numpy")
    assert bits([*kernels.q0, *kernels.p0]) == bits(values)
    namespace: dict = {}
    exec(sources.numpy["start.py"], namespace)
    assert bits([*namespace["INITIAL_POSITION"], *namespace["DEFAULT_PARAMETERS"]]) == bits(values)
    said = run_consumer(compile_object(sources, tmp_path))
    assert bits([*said["q0"], *said["p0"]]) == bits(values)


@pytest.mark.parametrize(
    ("number", "text"),
    [(Fraction(3, 8), "Q(3, 8)"), (-2, "-R(2.0)"), (Fraction(-1, 3), "-Q(1, 3)"), (2**53 - 1, "R(9007199254740991.0)"),
     (2**53, "R(90071992547409920e-1)"), (2**53 + 1, "R(90071992547409930e-1)"), (Fraction(-1, 2**54), f"-R({5**54}e-54)")],
)  # fmt: skip
def test_exact_numbers_in_headers(number, text):
    """A whole number that a double cannot hold is written with all its digits."""
    assert c_literal(number) == text
