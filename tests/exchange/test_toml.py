"""Model files: read, refused with line numbers, and written without loss."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import ncgen
from ncgen.exchange.examples import example_names
from ncgen.exchange.toml_reader import read_toml
from ncgen.exchange.toml_writer import to_toml

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
    "unknown point": (HEAD + '[[distance]]\nstart = "A"\nend = "Q"\n', 11, "no point or vector Q"),
    "unit": (HEAD + '[[body]]\nname = "b"\npoints = ["B"]\nmass = "2 kg"\n', 12, "has a unit"),
    "unknown name": (HEAD + '[[body]]\nname = "b"\npoints = ["B"]\nmass = "2*m"\n', 12, "m is no coordinate"),
    "code": (HEAD + '[[force]]\npoint = "B"\nvector = [0, "__import__(\'os\')", 0]\n', 11, "unknown"),
    "attribute": (HEAD + '[[force]]\npoint = "B"\nvector = [0, "().__class__", 0]\n', 11, "not allowed"),
    "huge power": (HEAD + '[[force]]\npoint = "B"\nvector = [0, "9**9**9", 0]\n', 11, "exponent"),
    "wrong type": (HEAD + '[[body]]\nname = "b"\npoints = "B"\nmass = [1]\n', 9, ""),
    "not unit": (HEAD + '[[vector]]\nname = "u"\ndirection = [0, 0, 2]\n', 9, "not 1"),
    "NaN": (HEAD + '[[point]]\nname = "C"\nposition = [nan, 0]\n', 9, "not a finite number"),
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
    text = HEAD + '[[point]]\nname = "C"\nposition = [0]\n[[distance]]\nstart = "A"\nend = "C"\n[[pont]]\n[[vector]]\nname = "u"\ndirection = [0, 0, 2]\n'
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
