"""Models by name and by file, and what is said about files that are none."""

from __future__ import annotations

import os

import pytest

import ncgen
from ncgen import Model
from ncgen.errors import ConvergenceError, ModelError
from ncgen.exchange.examples import example_module, example_names, lesson, load

GOOD = "from ncgen import Model\n\n\ndef build():\n    return Model('own')\n"

BAD = [
    ("x = = 1\n", "line 1: invalid syntax"),
    ("\n\n\nraise OSError('no disk')\n", "OSError: no disk"),
    ("def build():\n    x = 1\n    return x.shape\n", "line 3: AttributeError: 'int' object has no attribute 'shape'"),
    ("from ncgen import Model\n\ndef build():\n    return Model('two words')\n", "line 4: model name 'two words'"),
    ("build = 1\n", "it has no function build()"),
    ("", "it has no function build()"),
    ("def build():\n    return 'robot'\n", "build() returns str; return an ncgen.Model"),
    ("def build(size):\n    return size\n", "build() needs size"),
]


ENDS = [
    ("import sys\n\ndef build():\n    sys.exit(3)\n", "own.py, line 4: it ends Python by sys.exit(3)"),
    ("raise SystemExit\n", "own.py, line 1: it ends Python by sys.exit(None)"),
    ("def build(*, size):\n    return size\n", "build() needs size"),
    ("build = int\n", "own.py: ValueError"),
    ("x = '\0'\n", "own.py: "),
    ("def build():\n    raise ValueError('two\\nlines' + 900 * 'x')\n", "own.py, line 2: ValueError: two lines"),
    ("def build():\n    return build()\n", "own.py, line 2: RecursionError"),
    (
        "from ncgen import Model\n\ndef build():\n    m = Model('m')\n    m.simulation(duraton=3)\n    return m\n",
        "m.simulation: there is no argument 'duraton'; did you mean duration?",
    ),
]
"""Files that end otherwise than by returning a model that can be run."""


@pytest.fixture
def write(tmp_path):
    def file(text, name="own.py"):
        path = tmp_path / name
        path.write_text(text, encoding="utf-8")
        return path

    return file


@pytest.mark.parametrize("name", example_names())
def test_examples(name):
    """Every example says what it teaches and can be drawn and simulated as it says."""
    model = ncgen.load(name)
    assert isinstance(model, Model)
    assert model.name == name
    assert model.drawing.lines
    assert model.simulation_options["duration"] > 0
    assert len(lesson(name)) > 20


def test_both_robots_are_one():
    """The paper's tables and the same said call by call give the same sources, byte by byte."""
    tables, calls = (ncgen.generate(example_module("robot", file).build()) for file in ("model.py", "builder.py"))
    assert tables.files == calls.files


def test_a_file_of_ones_own(write, monkeypatch):
    path = write(GOOD)
    assert load(path).name == load(str(path)).name == "own"
    monkeypatch.chdir(path.parent)
    assert load("own.py").name == load("./own.py").name == "own"


def test_a_changed_file_is_read_again(write):
    assert load(write(GOOD)).name == "own"
    assert load(write(GOOD.replace("own", "new"))).name == "new"


def test_two_files_of_one_name(tmp_path):
    """Modules do not get mixed up."""
    for folder in ("one", "two"):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "model.py").write_text(GOOD.replace("own", folder))
    assert [load(tmp_path / folder / "model.py").name for folder in ("one", "two", "one")] == ["one", "two", "one"]


@pytest.mark.parametrize(("text", "message"), BAD, ids=[message for _, message in BAD])
def test_bad_files(write, text, message):
    """The file by its name, the line by its number, and the mistake in Python's own words."""
    with pytest.raises(ModelError) as refusal:
        load(write(text))
    assert message in str(refusal.value)
    assert "own.py" in str(refusal.value)
    assert "\n" not in str(refusal.value)


@pytest.mark.parametrize(("text", "message"), ENDS, ids=[message for _, message in ENDS])
def test_files_that_end_otherwise(write, text, message):
    with pytest.raises(ModelError) as refusal:
        load(write(text))
    assert message in str(refusal.value)
    assert len(str(refusal.value)) <= 300 and str(refusal.value).isprintable()


def test_the_kind_of_error_is_kept(write):
    """What the user's file lets through from ncgen keeps its exit code."""
    text = "from ncgen import ConvergenceError\n\ndef build():\n    raise ConvergenceError('too far')\n"
    with pytest.raises(ConvergenceError, match="own.py, line 4: too far"):
        load(write(text))


@pytest.mark.parametrize(
    "name",
    ["nosuch", "nosuch.py", "some/where.py", "", "robot/", "a\0.py", "x" * 5000, "x" * 5000 + ".py", "*"],
)
def test_what_there_is_not(name):
    with pytest.raises(ModelError, match=r"there is no such file or example; (the examples are |did you mean robot\?)") as refusal:
        load(name)
    assert "site-packages" not in str(refusal.value) and len(str(refusal.value)) <= 300


@pytest.mark.parametrize("name", ["..", ".", "/", "/dev/zero"])
def test_what_is_no_file(name):
    with pytest.raises(ModelError, match="a model file is an ordinary file, not a folder, a device or a pipe"):
        load(name)


def test_a_file_that_may_not_be_read(write):
    path = write(GOOD)
    path.chmod(0)
    if not os.access(path, os.R_OK):
        with pytest.raises(ModelError, match="own.py: PermissionError"):
            load(path)


def test_not_a_python_file(write):
    with pytest.raises(ModelError, match="notes.txt: not a model"):
        load(write("text", "notes.txt"))
