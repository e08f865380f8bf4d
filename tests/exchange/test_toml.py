"""Model files: read, refused with line numbers, and written without loss."""

from __future__ import annotations

import os
import re
import time
from pathlib import Path

import numpy as np
import pytest

import ncgen
from ncgen.exchange.examples import example_names
from ncgen.exchange.file_arguments import CONVERSIONS
from ncgen.exchange.toml_reader import line_of, read_toml
from ncgen.exchange.toml_writer import to_toml
from ncgen.exchange.words import kind_of, signature_of, words

HEAD = 'name = "bad"\n[[point]]\nname = "A"\nposition = [0, 0]\nfixed = true\n[[point]]\nname = "B"\nposition = [1, 0]\n'


def read(tmp_path, text):
    path = tmp_path / "model.toml"
    path.write_text(text, encoding="utf-8")
    return read_toml(path)


@pytest.mark.parametrize("name", example_names())
def test_examples_survive_the_file(name, tmp_path):
    """Written as a file and read again, every example generates the same bytes and writes the same file."""
    model = ncgen.load(name)
    text = to_toml(model)
    again, problems = read(tmp_path, text)
    assert not problems
    assert to_toml(again) == text
    assert ncgen.generate(again).files == ncgen.generate(model).files


def test_raw_rows_stay_raw(tmp_path):
    """`scale` is part of what a model says: without it rows are divided by their lengths."""
    m = ncgen.Model("raw", scale=False)
    m.distance(m.point("A", (0, 0), fixed=True), m.point("B", (2, 0)))
    again, problems = read(tmp_path, to_toml(m))
    assert not problems and not again.scale
    assert ncgen.compile(again, "numpy").jacobian([2.0, 0.0]).tolist() == [[4.0, 0.0]]


def test_documentation_example(tmp_path):
    """The file shown in docs/models.md is a model."""
    page = Path(__file__).parents[2] / "docs" / "models.md"
    model, problems = read(tmp_path, re.search(r"```toml\n(.*?)```", page.read_text(encoding="utf-8"), re.S)[1])
    assert not problems
    assert ncgen.generate(model).programs.phi_q.shape == (1, 2)


WRONG = {
    "not TOML": ('name = "x"\n[[point\n', 2, "not TOML"),
    "no name": ("[[point]]\n", 1, "no name"),
    "unknown table": (HEAD + "[[pont]]\n", 9, "did you mean point"),
    "unknown key": (HEAD + '[[spring]]\nstart = "A"\nend = "B"\nstifness = 3\n', 12, "did you mean stiffness"),
    "missing key": (HEAD + '[[distance]]\nstart = "A"\n', 9, "end is missing"),
    "unknown point": (HEAD + '[[distance]]\nstart = "A"\nend = "Q"\n', 11, "no point Q"),
    "unit": (HEAD + '[[body]]\nname = "b"\npoints = ["B"]\nmass = "2 kg"\n', 12, "has a unit"),
    "unknown name": (HEAD + '[[body]]\nname = "b"\npoints = ["B"]\nmass = "2*m"\n', 12, "m is no coordinate"),
    "code": (HEAD + '[[force]]\npoint = "B"\nvector = [0, "__import__(\'os\')", 0]\n', 11, "unknown"),
    "attribute": (HEAD + '[[force]]\npoint = "B"\nvector = [0, "().__class__", 0]\n', 11, "not allowed"),
    "huge power": (HEAD + '[[force]]\npoint = "B"\nvector = [0, "9**9**9", 0]\n', 11, "exponent"),
    "wrong type": (HEAD + '[[body]]\nname = "b"\npoints = "B"\nmass = [1]\n', 11, "not a list"),
    "not unit": (HEAD + '[[vector]]\nname = "u"\ndirection = [0, 0, 2]\n', 9, "not 1"),
    "NaN": (HEAD + '[[point]]\nname = "C"\nposition = [nan, 0]\n', 11, "not a finite number"),
    "unknown body": (HEAD + '[[spherical]]\na = "ground"\nb = "crank"\npoint = "A"\n', 11, "no body crank"),
}


@pytest.mark.parametrize("case", WRONG)
def test_mistakes_are_named_with_their_line(case, tmp_path):
    text, line, words = WRONG[case]
    _, problems = read(tmp_path, text)
    assert problems, "the mistake was not noticed"
    assert words in problems[0].message
    assert problems[0].line == line
    assert "\n" not in problems[0].message


def test_all_mistakes_at_once_without_echoes(tmp_path):
    """Three mistakes give three messages; what follows from a failed definition is not repeated."""
    text = (
        HEAD
        + '[[point]]\nname = "C"\nposition = [0]\n[[distance]]\nstart = "A"\nend = "C"\n'
        + '[[pont]]\n[[vector]]\nname = "u"\ndirection = [0, 0, 2]\n'
    )
    _, problems = read(tmp_path, text)
    assert [p.line for p in problems] == [9, 15, 16]


def test_load_gives_file_and_line(tmp_path):
    path = tmp_path / "wrong.toml"
    path.write_text(HEAD + "[[pont]]\n[[lien]]\n", encoding="utf-8")
    with pytest.raises(ncgen.ModelError, match=r"wrong.toml, line 9: .*1 more"):
        ncgen.load(path)


def test_expressions_mean_what_they_say(tmp_path):
    """A driver and a law as text give the same kernels as the sympy expressions."""
    import sympy

    text = HEAD + '[[parameter]]\nname = "w"\ndefault = 2.0\n[[constrain]]\nexpression = "B.x - w*sin(3*t)**2 + B.y/4"\n'
    text += '[[spring]]\nstart = "A"\nend = "B"\nlaw = "100*x**3 + 2*v"\n[[force]]\npoint = "B"\nvector = ["-rate(B.x)", "w*t", 0]\n'
    mine, problems = read(tmp_path, text)
    assert not problems
    m = ncgen.Model("bad")
    A, B = m.point("A", (0, 0), fixed=True), m.point("B", (1, 0))
    w = m.parameter("w", 2.0)
    m.constrain(B.x - w * sympy.sin(3 * m.time) ** 2 + B.y / 4)
    m.spring(A, B, law=lambda x, v: 100 * x**3 + 2 * v)
    m.force(B, (-B.x.rate, w * m.time, 0))
    assert ncgen.generate(mine).files == ncgen.generate(m).files


def test_python_functions_cannot_be_written():
    m = ncgen.Model("callback")
    m.point("A", (0, 0))
    m.callback(lambda t, q, qd, kernels: 0 * q)
    with pytest.raises(ncgen.ModelError, match="cannot be written"):
        to_toml(m)


# -- odd files ----------------------------------------------------------------------------------

ODD = {
    "400 digits": (HEAD + "[[parameter]]\nname = 'k'\ndefault = " + "7" * 400, 11, "a number of 400 digits is not a finite number"),
    "5000 digits": (HEAD + "[[parameter]]\nname = 'k'\ndefault = " + "7" * 5000, 11, "cannot be read"),
    "a heavy mass": (HEAD + "[[body]]\nname = 'b'\npoints = ['B']\nmass = 1e308", 12, "1e+308 is too large"),
    "deep lists": (HEAD + "[[point]]\nname = 'C'\nposition = " + "[" * 3000 + "]" * 3000, 1, "too deep"),
    "a deep expression": (HEAD + "[[potential]]\nexpression = '" + "(" * 3000 + "t" + ")" * 3000 + "'", 10, "too many parentheses"),
    "a long echo": (HEAD + "[[distance]]\nstart = 'A'\nend = '" + "Q" * 4000 + "'", 11, "define it first"),
    "a tower": (HEAD + "[[force]]\npoint = 'B'\nvector = [0, 'pow(9, 999999999)', 0]", 11, "exponent"),
    "a list for a text": (HEAD + "[[vector]]\nname = ['u']\ndirection = [0, 0, 1]", 10, "is not a text"),
    "a text for a list": (HEAD + "[[line]]\npoints = 'AB'", 10, '"AB" is not a list'),
    "a text for a vector": (HEAD + "[[force]]\npoint = 'B'\nvector = 'abc'", 11, "is not a list"),
    "a number for a name": (HEAD + "[[distance]]\nstart = 3\nend = 'B'", 10, "3 is not a text"),
    "a date": (HEAD + "[[parameter]]\nname = 'k'\ndefault = 1979-05-27", 11, "not a number"),
    "a point for an angle": (HEAD + "[[torque]]\ncoordinate = 'B'\nexpression = 1", 10, "point B is not a relative angle or distance"),
    "a point for a coordinate": (HEAD + "[[drive]]\ncoordinate = 'B'\nlaw = 't'", 10, "name one, such as B.x"),
    "a combination for a point": (HEAD + "[[length]]\nname = 's'\nstart = 'A - B'\nend = 'B'", 11, "no point A - B"),
    "a default of parameters": (HEAD + "[[parameter]]\nname = 'k'\ndefault = '2'", 11, '"2" is not a number'),
    "an internal argument": (HEAD + "[[constrain]]\nexpression = 'B.x'\nowner = 'b'", 11, "owner: unknown"),
    "scale": ('name = "x"\nscale = "no"', 2, 'scale: "no" is neither true nor false'),
    "form": ('name = "x"\nform = 3', 2, "form: 3 is not a text"),
    "a name": ("name = 3", 1, "name: 3 is not a text"),
    "gravity of one number": ('name = "x"\ngravity = -9.81', 2, "gravity: -9.81 given; write the field as a list"),
    "gravity of words": ('name = "x"\ngravity = ["a", 0, 0]', 2, "a is no coordinate"),
    "points in one line": ('name = "x"\npoint = [{ name = "A", position = [0, 0] }]', 2, "its own header line"),
    "a slip of a run": (HEAD + "[simulation]\nduration = 3\nduraton = 3", 11, "did you mean duration?"),
    "the kernels of a run": (HEAD + "[simulation]\nkernels = 3", 10, "kernels: unknown"),
    "a keyword": (HEAD + "[[point]]\nname = 'class'\nposition = [0, 1]", 9, "keyword"),
    "a couple of two": (HEAD + "[[body]]\nname = 'b'\npoints = ['B']\n[[couple]]\nbody = 'b'\nvector = [0, 1]", 12, "2 components"),
    "a header in a text": (
        HEAD + '[[body]]\nname = "b"\npoints = ["B"]\n[[force]]\npoint = "B"\nlabel = """\n[[point]]\n"""\nvector = [0]',
        12, "1 comp",
    ),
    "no UTF-8": (b'name = "x"\n# \xff', None, "line 2: byte 0xff is no UTF-8 text"),
}  # fmt: skip


@pytest.mark.parametrize("case", ODD)
def test_odd_files_are_refused_in_a_line(case, tmp_path):
    """The key's own line, at most 300 characters with the place, nothing that moves the cursor, in a moment."""
    text, line, words = ODD[case]
    path, began = tmp_path / "odd.toml", time.process_time()
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    if line is None:
        with pytest.raises(ncgen.ModelError, match=words):
            read_toml(path)
        return
    _, problems = read_toml(path)
    assert [problem.line for problem in problems] == [line]
    shown = problems[0].of(path)
    assert words in shown and len(shown) <= 300 and shown.isprintable()
    assert time.process_time() - began < 2


def test_many_unknown_keys_take_linear_time(tmp_path):
    """20,000 slips are 20,000 problems on 20,000 lines, in seconds."""
    began = time.process_time()
    _, problems = read(tmp_path, HEAD + "[[spring]]\nstart = 'A'\nend = 'B'\n" + "".join(f"stifness{k} = 1\n" for k in range(20_000)))
    assert [p.line for p in problems] == list(range(12, 20_012))
    assert "did you mean stiffness" in problems[0].message and "did you mean" not in problems[-1].message
    _, problems = read(tmp_path, 'name = "x"\n' + "".join(f"nmae{k} = 1\n" for k in range(20_000)))
    assert [p.line for p in problems] == list(range(2, 20_002))
    _, problems = read(tmp_path, HEAD + "[[pont]]\n" * 20_000)
    assert len(problems) == 20_000
    assert time.process_time() - began < 10


def test_long_expressions_are_read(tmp_path):
    """990 terms are one level."""
    terms = " + ".join(f"{k}*B.x**{k % 7}" for k in range(990))
    model, problems = read(tmp_path, HEAD + f"[[potential]]\nexpression = '{terms}'")
    assert not problems
    assert model.potentials[0].expression.as_poly().degree() == 6


def test_a_byte_order_mark_is_no_mistake(tmp_path):
    path = tmp_path / "marked.toml"
    path.write_bytes(b"\xef\xbb\xbf" + HEAD.encode())
    assert read_toml(path)[1] == []


@pytest.mark.parametrize("name", ["/dev/zero", "/dev/stdin", ".", "", "a\0b", "x" * 5000, "nosuch.toml"])
def test_what_is_no_file_is_not_read(name):
    with pytest.raises(ncgen.ModelError, match="an ordinary file|no such file") as refusal:
        read_toml(Path(name))
    assert len(str(refusal.value)) <= 300


def test_a_pipe_is_not_read(tmp_path):
    os.mkfifo(tmp_path / "pipe.toml")
    with pytest.raises(ncgen.ModelError, match="a device or a pipe"):
        read_toml(tmp_path / "pipe.toml")


def test_files_are_read_up_to_their_limit(tmp_path):
    path = tmp_path / "long.toml"
    with path.open("wb") as file:
        file.truncate(50_000_000_000)  # takes no place on the disk
    with pytest.raises(ncgen.ModelError, match="at most 4000000 bytes"):
        read_toml(path)


def test_names_in_either_form(tmp_path):
    """A point called µ (U+00B5) and one called μ (U+03BC) are one; so the second is refused, not confused with the first."""
    text = HEAD + '[[point]]\nname = "\u00b5"\nposition = [1, 1]\n[[distance]]\nstart = "\u03bc"\nend = "B"\n'
    model, problems = read(tmp_path, text)
    assert not problems
    assert "\u00b5" not in to_toml(model)
    _, problems = read(tmp_path, text + '[[point]]\nname = "\u03bc"\nposition = [2, 2]\n')
    assert [p.line for p in problems] == [15] and "already used" in problems[0].message


def test_lines_of_keys(tmp_path):
    """What is found out later about a key can be said with its line."""
    path = tmp_path / "model.toml"
    path.write_text(
        HEAD + '[[body]]\nname = "b"\n[simulation]\nduration = 3\n"points" = 5 # c\n[simulation.zd0]\n"B.x" = 1\n', encoding="utf-8"
    )
    assert [line_of(path, "simulation", key) for key in ("duration", "points", "zd0", "rtol")] == [12, 13, 14, 11]
    assert line_of(path, "gravity", "field") == 1


def test_every_argument_of_the_builder_is_known():
    """Whatever the builder takes has a kind that files can give."""
    kinds = {kind_of(parameter) for word in words() for parameter in signature_of(word).parameters.values()}
    assert kinds <= set(CONVERSIONS) and set(CONVERSIONS) - kinds == set()


def awkward():
    """A model of things that are not easily written down."""
    import sympy

    m = ncgen.Model("\U00010400dd", scale=False, form="cosine")
    A, B = m.point("A", np.zeros(3), fixed=np.True_), m.point("\u00b5", (np.float64(1), 1e-300, -0.0))
    u = m.vector("u", (0, 0, 1), fixed="")
    e = m.parameter("e", np.int64(2), unit='m²/"s"\\ \x7f\x00\n\u2028')
    psi = m.angle("psi", B - A, 2 * B - 2 * A + u * 0.5, u, lengths=(1, np.float32(0.1), sympy.Rational(1, 3)))
    m.body("b", [B], mass=e**2, com=None)
    m.force("\u00b5", (sympy.exp(1) * e, sympy.Rational(1, 3), sympy.Mul(2, B.x.symbol + 1, evaluate=False)), label="\U0001f4a5")
    m.potential(1 / sympy.sqrt(-1 / sympy.sqrt(-B.x.symbol)) + sympy.Abs(psi.symbol) ** 1.5)
    m.spring("A", B, law=lambda x, v: 3 * x + 0.1 * v)
    m.independent("\u00b5.x")
    m.simulation(zd0={"\u00b5.x": np.float64(1)}, max_step=np.inf, stop={"psi": (1, "rising")}, z=["\u00b5.x"])
    return m


def test_whatever_is_accepted_can_be_written(tmp_path):
    """Read back and written again it is the same file."""
    text = to_toml(awkward())
    again, problems = read(tmp_path, text)
    assert problems == []
    assert to_toml(again) == text
    assert again.parameters["e"].unit == awkward().parameters["e"].unit
    assert again.simulation_options["max_step"] == np.inf


def test_what_cannot_be_written_is_said():
    import sympy

    for tell, word in (
        (lambda m, B: m.potential(sympy.gamma(B.x.symbol)), "potential.expression"),
        (lambda m, B: m.potential(sympy.Symbol("hill")), "hill"),
        (lambda m, B: m.force(B, (0, 0, 1), "\ud800"), "force.label"),
        (lambda m, B: m.simulation(duraton=3), "duraton"),
        (lambda m, B: m.simulation(p=object()), "simulation.p"),
    ):
        m = ncgen.Model("m")
        tell(m, m.point("B", (1, 0)))
        with pytest.raises(ncgen.ModelError, match=word):
            to_toml(m)


def test_letters_are_no_lists():
    """Python would take the text for its letters."""
    m = ncgen.Model("m")
    m.point("A", (0, 0)), m.point("B", (1, 0))
    for given in ({"points": "AB"}, {"points": ["A"], "vectors": "AB"}, {"points": ["A", "B"], "mass": 1.0, "basis": "AB"}):
        with pytest.raises(ncgen.ModelError, match="body b, .*'AB' given; give a list"):
            m.body("b", **given)
